//! Minimum-phase response for given magnitudes.

use super::LANES;
use crate::{Complex, Float};
use asperity_fft::Transform;

/// Smallest squared magnitude relative to the largest: -70 dB.
const FLOOR: f64 = 1e-7;

/// Computes responses on a grid twice as fine as the bins of a transform.
///
/// The logarithm's imaginary part is the Hilbert transform of its real part: the cepstrum, folded to
/// positive times (A. V. Oppenheim and R. W. Schafer, "Discrete-Time Signal Processing", section on
/// minimum-phase sequences by the real cepstrum). Magnitudes on the grid are exact.
#[derive(Debug)]
pub(super) struct Designer<T> {
    /// Its bins are the grid: first the logarithm of the response, then the response.
    transform: Transform<T>,
    len: usize,
    /// Sum of squares of the impulse response.
    energy: f64,
}

impl<T: Float> Designer<T> {
    /// For transforms of `fft_len` samples: a grid of `fft_len + 1` frequencies, from 0 to Nyquist's.
    pub(super) fn new(fft_len: usize) -> Self {
        let len = 2 * fft_len;
        Self { transform: Transform::new(len), len, energy: 0.0 }
    }

    /// The response at each frequency of the grid, after [`design`](Self::design).
    pub(super) fn response(&self) -> &[Complex<T>] {
        &self.transform.bins
    }

    /// Computes the response from squared magnitudes at each frequency of the grid. Returns false if
    /// all are 0.
    pub(super) fn design(&mut self, squares: &[f64]) -> bool {
        let most = in_lanes(squares, |most, square| if square > most { square } else { most }, f64::max);
        let ends = squares.first().unwrap_or(&0.0) + squares.last().unwrap_or(&0.0);
        let sum = in_lanes(squares, |sum, square| sum + square, |a, b| a + b);
        self.energy = (2.0 * sum - ends) / self.len as f64;
        if most <= 0.0 {
            self.transform.bins.fill(Complex::default());
            return false;
        }
        let unit = most.recip().min(f64::MAX);
        for (to, square) in self.transform.bins.iter_mut().zip(squares) {
            // Relative to the largest, so that they are normal numbers in single precision.
            let log = T::of((square * unit).max(FLOOR)).natural_log();
            *to = Complex::new(log * T::of(0.5), T::zero());
        }
        self.transform.inverse();
        // Folds negative times onto positive ones.
        let half = self.len / 2;
        let (once, twice) = (T::of(1.0 / self.len as f64), T::of(2.0 / self.len as f64));
        let cepstrum = &mut self.transform.time;
        cepstrum[0] *= once;
        cepstrum[1..half].iter_mut().for_each(|c| *c *= twice);
        cepstrum[half] *= once;
        cepstrum[half + 1..].fill(T::zero());
        self.transform.forward();
        let level = T::of(most.sqrt());
        for (to, square) in self.transform.bins.iter_mut().zip(squares) {
            // The real part is the given logarithm.
            let radius = level * T::of((square * unit).max(FLOOR)).root();
            let (cos, sin) = to.im.cos_sin();
            *to = Complex::new(radius * cos, radius * sin);
        }
        true
    }

    /// Writes the first samples of the impulse response, newest last: `taps[len - 1 - i]` weighs the
    /// input i samples ago. They have the energy of the whole response, so a line narrower than the
    /// taps allow becomes wider at the same level.
    pub(super) fn taps(&mut self, taps: &mut [T]) {
        self.transform.inverse();
        let norm = T::of(1.0 / self.len as f64);
        taps.iter_mut().rev().zip(&self.transform.time).for_each(|(tap, x)| *tap = *x * norm);
        // Fades the cut end.
        let end = taps.len().div_ceil(4);
        for (i, tap) in taps[..end].iter_mut().enumerate() {
            *tap *= T::of((i + 1) as f64 / end as f64);
        }
        let energy = in_lanes(taps, |sum, tap| sum + tap.f64() * tap.f64(), |a, b| a + b);
        if energy > 0.0 && energy.is_finite() {
            let louder = T::of((self.energy / energy).sqrt().min(10.0));
            taps.iter_mut().for_each(|tap| *tap *= louder);
        }
    }
}

/// Folds values from 0 on, in lanes.
fn in_lanes<T: Copy>(values: &[T], with: impl Fn(f64, T) -> f64, both: impl Fn(f64, f64) -> f64) -> f64 {
    let mut lanes = [0.0; LANES];
    let chunks = values.chunks_exact(LANES);
    let rest = chunks.remainder().iter().fold(0.0, |all, value| with(all, *value));
    for chunk in chunks {
        lanes.iter_mut().zip(chunk).for_each(|(lane, value)| *lane = with(*lane, *value));
    }
    lanes.into_iter().fold(rest, both)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn response_of_a_one_pole_filter_is_its_impulse_response() {
        // |1 / (1 - a e^-jw)|^2, which is of minimum phase: a^n.
        let (n, a) = (125, 0.7);
        let mut designer = Designer::<f64>::new(n);
        let squares: Vec<f64> = (0..=n)
            .map(|j| {
                let w = std::f64::consts::PI * j as f64 / n as f64;
                1.0 / (1.0 - 2.0 * a * w.cos() + a * a)
            })
            .collect();
        assert!(designer.design(&squares));
        let mut taps = vec![0.0; n];
        designer.taps(&mut taps);
        for i in 0..20 {
            assert!((taps[n - 1 - i] - a.powi(i as i32)).abs() < 1e-9, "{i}: {}", taps[n - 1 - i]);
        }
    }

    #[test]
    fn silence_has_no_response() {
        let mut designer = Designer::<f32>::new(10);
        assert!(!designer.design(&[0.0; 11]));
        let mut taps = [1.0; 10];
        designer.taps(&mut taps);
        assert_eq!(taps, [0.0; 10]);
    }
}
