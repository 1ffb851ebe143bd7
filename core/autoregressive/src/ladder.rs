//! A filter as a ladder of rotations (A. H. Gray, J. D. Markel, "A normalized digital filter structure", IEEE Trans. ASSP 23(3), 1975).
//!
//! With the reflection coefficients `k_1 .. k_p` of `A`, `c_m = sqrt(1 - k_m^2)`, and the noise at the top, `f_p`, each stage is a rotation,
//!
//! ```text
//! f_m-1[n] = c_m f_m[n] - k_m b_m-1[n-1]
//! b_m[n]   = k_m f_m[n] + c_m b_m-1[n-1],    b_0 = f_0
//! ```
//!
//! and the signal is a sum of all `b_m`, whose weights follow from `B`. With fixed coefficients it is that of the recursion, sample by sample.
//!
//! Rotations keep lengths, whichever they are and however often they change: white noise of deviation 1 at the top leaves every `b_m` with
//! deviation 1 at most, and none of them with another in common. So the noise gets the deviation that the signal is to have, and the weights a sum of
//! squares of 1; then no signal is ever louder than the loudest of the filters that it went through. The recursion over the signal's own past has no such
//! bound: between filters each of which is stable it can grow without end.

use super::{Filter, MAX_ORDER};

/// Reflection coefficients are held below this, where rounding would put one at 1.
const MOST_REFLECTED: f64 = 1.0 - 1e-14;

/// The rotations of a filter and the weights of what they answer.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ladder {
    order: usize,
    /// `k_m` and `c_m`, m from 1.
    stages: [[f64; 2]; MAX_ORDER],
    /// Weights of `b_0 .. b_p`; their squares sum to 1.
    weights: [f64; MAX_ORDER + 1],
    /// Standard deviation of the signal in m/s^2.
    level: f64,
}

impl Ladder {
    /// A ladder that lets nothing through.
    pub(super) const SILENT: Self =
        Self { order: 0, stages: [[0.0, 1.0]; MAX_ORDER], weights: [0.0; MAX_ORDER + 1], level: 0.0 };

    /// Becomes that of a filter, whose `A` is stable. Nothing is allocated.
    pub(super) fn set(&mut self, filter: &Filter) {
        let order = filter.ar().len().max(filter.ma().len());
        let mut a = [0.0; MAX_ORDER + 1];
        let mut b = [0.0; MAX_ORDER + 1];
        (a[0], b[0]) = (1.0, 1.0);
        a[1..].iter_mut().zip(filter.ar()).for_each(|(to, x)| *to = *x);
        b[1..].iter_mut().zip(filter.ma()).for_each(|(to, x)| *to = *x);
        // From the top: `b_m` is `A_m` backwards over `A`, times the `c` of all stages above; its weight takes away the last coefficient that is left of `B`.
        let (mut above, mut squares) = (1.0, 0.0);
        for m in (1..=order).rev() {
            let k = a[m].clamp(-MOST_REFLECTED, MOST_REFLECTED);
            let last = b[m];
            for j in 0..=m {
                b[j] -= last * a[m - j];
            }
            self.weights[m] = last / above;
            squares += self.weights[m] * self.weights[m];
            let rest = 1.0 - k * k;
            for j in 0..=m / 2 {
                let (x, y) = (a[j], a[m - j]);
                (a[j], a[m - j]) = ((x - k * y) / rest, (y - k * x) / rest);
            }
            self.stages[m - 1] = [k, rest.sqrt()];
            above *= rest.sqrt();
        }
        self.weights[0] = b[0] / above;
        let norm = (squares + self.weights[0] * self.weights[0]).sqrt();
        self.weights[..=order].iter_mut().for_each(|w| *w /= norm);
        self.order = order;
        self.level = filter.deviation * filter.gain * norm;
    }

    /// Standard deviation of the signal in m/s^2, once it has settled.
    pub(super) fn level(&self) -> f64 {
        self.level
    }

    /// The next sample from noise of deviation 1 and the states `b_0 .. b_p-1` of the sample before.
    #[inline]
    pub(super) fn step(&self, noise: f64, states: &mut [f64; MAX_ORDER]) -> f64 {
        let mut forward = self.level * noise;
        let mut sum = 0.0;
        for m in (0..self.order).rev() {
            let ([k, c], state) = (self.stages[m], states[m]);
            let back = k * forward + c * state;
            forward = c * forward - k * state;
            sum += self.weights[m + 1] * back;
            if let Some(next) = states[..self.order].get_mut(m + 1) {
                *next = back;
            }
        }
        states[0] = forward;
        sum + self.weights[0] * forward
    }
}

#[cfg(test)]
mod tests {
    use super::super::line_spectrum::to_polynomial;
    use super::*;
    use asperity_numbers::Random;

    /// Coefficients of which all roots lie within the unit circle.
    fn polynomial(random: &mut Random, order: usize) -> Vec<f64> {
        let steps: Vec<f64> = (0..=order).map(|_| random.range(0.1, 1.0)).collect();
        let whole: f64 = steps.iter().sum();
        let mut sum = 0.0;
        let mut next = |step: &f64| {
            sum += step / whole * std::f64::consts::PI;
            sum
        };
        let lines: Vec<f64> = steps[..order].iter().map(&mut next).collect();
        let mut a = vec![0.0; order];
        to_polynomial(&lines, &mut a);
        a
    }

    #[test]
    fn a_ladder_answers_what_the_recursion_does() {
        let mut random = Random::new(3);
        for (p, q) in
            [(0, 0), (1, 0), (2, 0), (0, 1), (0, 4), (3, 2), (2, 3), (2, 7), (8, 8), (16, 4), (40, 3)]
        {
            let (ar, ma) = (polynomial(&mut random, p), polynomial(&mut random, q));
            let mut filter = Filter::new(&ar, &ma, 0.7);
            filter.gain = 1.3;
            let mut ladder = Ladder::SILENT;
            ladder.set(&filter);
            let (mut states, mut e, mut x) = ([0.0; MAX_ORDER], Vec::new(), Vec::<f64>::new());
            for n in 0..2000 {
                e.push(random.normal());
                let past = |c: &[f64], of: &[f64]| -> f64 {
                    c.iter().zip(of[..n].iter().rev()).map(|(c, x)| c * x).sum()
                };
                let want = 0.7 * 1.3 * (e[n] + past(&ma, &e)) - past(&ar, &x);
                let found = ladder.step(e[n], &mut states);
                assert!(
                    (found - want).abs() < 1e-6 * ladder.level(),
                    "{p} {q}, sample {n}: {found}, not {want}"
                );
                x.push(want);
            }
            let mut square = [0.0];
            filter.autocovariance(&mut square);
            let off = ladder.level() / square[0].sqrt() - 1.0;
            assert!(off.abs() < 1e-6, "{p} {q}: the level is {off} off that of the closed form");
        }
    }

    /// The covariance of the states after any rotations of independent noise, exactly: as long as the level stays, it is the level's square on the
    /// diagonal and 0 elsewhere.
    #[test]
    fn states_stay_independent_and_as_loud_whatever_filters_follow_each_other() {
        const ORDER: usize = 6;
        let mut random = Random::new(9);
        let mut ladder = Ladder::SILENT;
        // Row by row what is left in each state of the noise of every sample so far.
        let mut rows: Vec<[f64; MAX_ORDER]> = Vec::new();
        for n in 0..600 {
            ladder.set(&Filter::new(&polynomial(&mut random, ORDER), &polynomial(&mut random, 3), 1.0));
            ladder.level = 2.0;
            rows.push([0.0; MAX_ORDER]);
            let square: f64 = rows
                .iter_mut()
                .enumerate()
                .map(|(i, r)| ladder.step(f64::from(u8::from(i == n)), r).powi(2))
                .sum();
            // At the start there is nothing in the states yet, and what is not there dies away as a signal would.
            assert!(square <= 4.0 + 1e-9, "{square}");
            if n > 500 {
                assert!((square - 4.0).abs() < 1e-6, "sample {n}: {square}");
            }
        }
    }
}
