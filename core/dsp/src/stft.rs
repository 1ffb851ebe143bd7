//! From samples to spectra.

use crate::window::hann;
use crate::{Complex, Float};
use asperity_fft::Transform;

/// Hann-windowed forward transform of single frames.
#[derive(Debug)]
pub struct Stft<T> {
    window: Vec<T>,
    transform: Transform<T>,
}

impl<T: Float> Stft<T> {
    /// Plans a transform of `fft_len` samples (at least 1).
    pub fn new(fft_len: usize) -> Self {
        let len = fft_len.max(1);
        let scale = 4.0 / len as f64;
        let window = hann::<f64>(len).into_iter().map(|w| T::of(w * scale)).collect();
        Self { window, transform: Transform::new(len) }
    }

    /// Amplitudes `2 sum(w x e^-i..) / sum(w)` of one frame, in the samples' unit, for all `fft_len / 2 + 1`
    /// bins, with phases counted from the first sample. Missing samples are 0.
    pub fn process(&mut self, samples: &[T]) -> &[Complex<T>] {
        self.transform.time.fill(T::zero());
        for ((to, &x), &w) in self.transform.time.iter_mut().zip(samples).zip(&self.window) {
            *to = x * w;
        }
        self.transform.forward();
        &self.transform.bins
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unit_sine_on_a_bin_reads_1_at_any_length() {
        for len in [50usize, 250, 4410, 4800] {
            let x: Vec<f64> =
                (0..len).map(|i| (0.3 + std::f64::consts::TAU * 7.0 * i as f64 / len as f64).cos()).collect();
            let mut stft = Stft::new(len);
            let s = stft.process(&x);
            assert_eq!(s.len(), len / 2 + 1);
            assert!((s[7] - Complex::from_polar(1.0, 0.3)).norm() < 1e-12);
            assert!((s[6] + Complex::from_polar(0.5, 0.3)).norm() < 1e-12);
            assert!(s[12].norm() < 1e-12);
        }
    }
}
