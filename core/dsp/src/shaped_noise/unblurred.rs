//! Power density whose frames have given magnitudes.

use crate::Float;

/// Power of the Hann window 0.5, 1 and 1.5 bins from its middle, relative to its middle. With all of
/// them on both sides they sum to 3.
const BESIDE: [f32; 3] = [0.720_506_2, 0.25, 0.028_820_2];
/// Iterations.
const STEPS: usize = 2;
/// Magnitudes below this part of the largest count as 0: their squares would be denormal.
const LEAST: f32 = 1e-15;
/// Padding at both ends.
const END: usize = 2;

/// Finds the power density of noise, on a grid twice as fine as the bins, whose frames have the given
/// magnitudes, relative to the largest.
///
/// The Hann window spreads a frequency over three bins and more, and a filter that followed magnitudes
/// directly would spread it again: below a steep slope it would be louder. So the density starts from the
/// magnitudes and is multiplied by the wanted power over the present one, as seen through the window (as in
/// W. H. Richardson, J. Opt. Soc. Am. 62, 55, 1972, with the quotient at the same frequency).
#[derive(Debug)]
pub(super) struct Unblurred {
    /// Density at bins, and half a bin above each; both padded.
    at: Vec<f32>,
    above: Vec<f32>,
    wanted: Vec<f32>,
    /// Wanted power over present power.
    quotients: Vec<f32>,
}

impl Unblurred {
    pub(super) fn new(bins: usize) -> Self {
        let room = || vec![0.0; bins + 2 * END];
        Self { at: room(), above: room(), wanted: vec![0.0; bins], quotients: vec![0.0; bins] }
    }

    /// Computes the density in units of `scale`; a flat spectrum gives the square of its magnitudes.
    /// Beyond the bins it is 0.
    pub(super) fn find<T: Float>(&mut self, magnitudes: &[T], scale: f64, density: &mut [f64]) {
        density.fill(0.0);
        let bins = self.wanted.len();
        let most = magnitudes.iter().fold(0.0, |most: f64, m| most.max(m.f64()));
        if most <= 0.0 {
            return;
        }
        let unit = most.recip().min(f64::MAX);
        let relative = |m: &T| Some(f32::of(m.f64() * unit)).filter(|m| *m > LEAST).unwrap_or(0.0);
        for (wanted, m) in self.wanted.iter_mut().zip(magnitudes) {
            *wanted = relative(m) * relative(m);
        }
        // Interpolates linearly in decibels.
        for (above, pair) in self.above[END..END + bins].iter_mut().zip(magnitudes.windows(2)) {
            *above = relative(&pair[0]) * relative(&pair[1]);
        }
        self.at[END..END + bins].copy_from_slice(&self.wanted);
        // Bin 0 is often 0, and there is none beyond the last: next to them the mean of powers is used.
        if let [first, second, ..] = self.wanted[..] {
            self.above[END] = 0.5 * (first + second);
        }
        self.above[END + bins - 1] = 0.5 * self.wanted[bins - 1];
        for _ in 0..STEPS {
            self.step();
        }
        let scale = most * most * scale;
        let found = self.at[END..END + bins].iter().zip(&self.above[END..]);
        for (pair, (at, above)) in density.chunks_mut(2).zip(found) {
            pair.iter_mut().zip([at, above]).for_each(|(to, power)| *to = f64::from(*power) * scale);
        }
    }

    fn step(&mut self) {
        let bins = self.wanted.len();
        // The density is even about 0 Hz.
        (self.at[1], self.above[1], self.above[0]) = (self.at[3], self.above[2], self.above[3]);
        let at = self.at.windows(3).skip(1).map(|at| at[1] + BESIDE[1] * (at[0] + at[2]));
        let above = self.above.windows(4);
        let above = above.map(|a| BESIDE[0] * (a[1] + a[2]) + BESIDE[2] * (a[0] + a[3]));
        for ((quotient, wanted), (at, above)) in
            self.quotients.iter_mut().zip(&self.wanted).zip(at.zip(above))
        {
            // A bin without power gives no information.
            let there = at + above;
            *quotient = if *wanted > 0.0 && there > 0.0 { 3.0 * wanted / there } else { 1.0 };
        }
        for (at, quotient) in self.at[END..].iter_mut().zip(&self.quotients) {
            *at *= quotient;
        }
        for (above, pair) in self.above[END..].iter_mut().zip(self.quotients.windows(2)) {
            *above *= (pair[0] * pair[1]).sqrt();
        }
        self.above[END + bins - 1] *= self.quotients[bins - 1];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Squared magnitudes that frames of a density have: of frequencies twice as fine as bins, beyond which
    /// there is nothing.
    fn seen(density: &[f64], bins: usize) -> Vec<f64> {
        let of = |j: i64| density.get(j.unsigned_abs() as usize).copied().unwrap_or(0.0);
        // |sinc(x) / (1 - x^2)|^2 of x bins.
        let window = |x: f64| {
            let sinc =
                if x == 0.0 { 1.0 } else { (std::f64::consts::PI * x).sin() / (std::f64::consts::PI * x) };
            if (x.abs() - 1.0).abs() < 1e-9 { 0.25 } else { (sinc / (1.0 - x * x)).powi(2) }
        };
        let bin = |k: i64| (-12..=12).map(|d| of(2 * k + d) * window(0.5 * d as f64)).sum::<f64>() / 3.0;
        (0..bins as i64).map(bin).collect()
    }

    fn found(squares: &[f64]) -> Vec<f64> {
        let mut density = vec![0.0; 2 * squares.len() + 20];
        let magnitudes: Vec<f64> = squares.iter().map(|s| s.sqrt()).collect();
        Unblurred::new(squares.len()).find(&magnitudes, 1.0, &mut density);
        density
    }

    #[test]
    fn flat_density_is_found_flat() {
        let density = found(&[2.0; 50]);
        assert!(density[..90].iter().all(|d| (d - 2.0).abs() < 1e-3), "{density:?}");
        assert!(density[100..].iter().all(|d| *d == 0.0));
    }

    #[test]
    fn slope_of_10_db_a_bin_is_not_made_flatter() {
        // Steep from bin 4 on: what leaks out of the window is more than what is there.
        let truth: Vec<f64> =
            (0..100).map(|j| 10f64.powf(-0.5 * (f64::from(j) - 8.0).max(0.0)).max(1e-5)).collect();
        let squares = seen(&truth, 45);
        let density = found(&squares);
        let error = |found: &dyn Fn(usize) -> f64| {
            (5..9).map(|k| 2.5 * (found(k) / truth[2 * k]).log10()).sum::<f64>()
        };
        let [plain, better] = [error(&|k| squares[k]), error(&|k| density[2 * k])];
        assert!(plain > 2.0 && better.abs() < 0.4 * plain, "{plain} dB, {better} dB");
        // And what is seen of it is what was asked for.
        let [plain, better] = [&seen(&interleaved(&squares), 45), &seen(&density, 45)]
            .map(|seen| (2..10).map(|k| (10.0 * (seen[k] / squares[k]).log10()).abs()).fold(0.0, f64::max));
        assert!(better < 0.25 * plain, "{better} dB, {plain} dB");
    }

    fn interleaved(squares: &[f64]) -> Vec<f64> {
        squares.windows(2).flat_map(|pair| [pair[0], 0.5 * (pair[0] + pair[1])]).collect()
    }

    #[test]
    fn single_bin_has_the_power_of_a_sine() {
        let mut squares = [0.0; 30];
        squares[12] = 4.0;
        // An amplitude of 2 has a power of 2: half bins are a sixth of it.
        let power = found(&squares).iter().sum::<f64>() / 6.0;
        assert!((power - 2.0).abs() < 1e-6, "{power}");
    }

    #[test]
    fn silence_gives_0_and_few_bins_stay_finite() {
        assert!(found(&[0.0; 9]).iter().all(|d| *d == 0.0));
        for bins in 1..5 {
            assert!(found(&vec![1e300; bins]).iter().all(|d| d.is_finite()));
        }
    }
}
