//! A filter as a ladder of rotations (A. H. Gray, J. D. Markel, "A normalized digital filter
//! structure", IEEE Trans. ASSP 23(3), 1975).
//!
//! Let `k_1 .. k_p` be the reflection coefficients of `A`, `c_m = sqrt(1 - k_m^2)`, and `f_p` the noise
//! at the top. Each stage is a rotation,
//!
//! ```text
//! f_m-1[n] = c_m f_m[n] - k_m b_m-1[n-1]
//! b_m[n]   = k_m f_m[n] + c_m b_m-1[n-1],    b_0 = f_0
//! ```
//!
//! The signal is a sum of all `b_m` with weights that follow from `B`. With fixed coefficients it
//! equals the recursion, sample by sample.
//!
//! Rotations keep lengths, however often they change. White noise of deviation 1 at the top gives every
//! `b_m` a deviation of at most 1, and all `b_m` are uncorrelated. The noise gets the deviation of the
//! signal, and the squares of the weights sum to 1. So the signal is never louder than the loudest of
//! the filters that it went through. A recursion over the signal's own past has no such bound: switched
//! between stable filters it can grow without end.

use super::{Filter, MAX_ORDER};

/// Reflection coefficients stay below this. Rounding could put one at 1.
const MOST_REFLECTED: f64 = 1.0 - 1e-14;

/// A filter's rotations and the weights of their outputs.
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
    /// A silent ladder.
    pub(super) const SILENT: Self =
        Self { order: 0, stages: [[0.0, 1.0]; MAX_ORDER], weights: [0.0; MAX_ORDER + 1], level: 0.0 };

    /// Takes over a filter with a stable `A`. Nothing is allocated.
    pub(super) fn set(&mut self, filter: &Filter) {
        let order = filter.ar().len().max(filter.ma().len());
        let mut a = [0.0; MAX_ORDER + 1];
        let mut b = [0.0; MAX_ORDER + 1];
        (a[0], b[0]) = (1.0, 1.0);
        a[1..].iter_mut().zip(filter.ar()).for_each(|(to, x)| *to = *x);
        b[1..].iter_mut().zip(filter.ma()).for_each(|(to, x)| *to = *x);
        // From the top: `b_m` is `A_m` backwards over `A`, times the `c` of all stages above. Its
        // weight removes the last remaining coefficient of `B`.
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

    /// The next sample, from noise of deviation 1 and the last states `b_0 .. b_p-1`.
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
    use super::super::testing::stable;
    use super::*;
    use asperity_numbers::Random;

    #[test]
    fn ladder_equals_the_recursion() {
        let mut random = Random::new(3);
        for (p, q) in
            [(0, 0), (1, 0), (2, 0), (0, 1), (0, 4), (3, 2), (2, 3), (2, 7), (8, 8), (16, 4), (40, 3)]
        {
            let (ar, ma) = (stable(&mut random, p, 0.1), stable(&mut random, q, 0.1));
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
            let off = ladder.level() / filter.variance().sqrt() - 1.0;
            assert!(off.abs() < 1e-6, "{p} {q}: the level is {off} off that of the closed form");
        }
    }

    /// Exact covariance of the states after rotations of independent noise. While the level stays, it
    /// is the level's square on the diagonal and 0 elsewhere.
    #[test]
    fn states_stay_independent_while_filters_change() {
        const ORDER: usize = 6;
        let mut random = Random::new(9);
        let mut ladder = Ladder::SILENT;
        // One row for each sample of noise: its part in each state.
        let mut rows: Vec<[f64; MAX_ORDER]> = Vec::new();
        for n in 0..600 {
            ladder.set(&Filter::new(&stable(&mut random, ORDER, 0.1), &stable(&mut random, 3, 0.1), 1.0));
            ladder.level = 2.0;
            rows.push([0.0; MAX_ORDER]);
            let square: f64 = rows
                .iter_mut()
                .enumerate()
                .map(|(i, r)| ladder.step(f64::from(u8::from(i == n)), r).powi(2))
                .sum();
            // The states start empty. The missing part dies away as a signal would.
            assert!(square <= 4.0 + 1e-9, "{square}");
            if n > 500 {
                assert!((square - 4.0).abs() < 1e-6, "sample {n}: {square}");
            }
        }
    }
}
