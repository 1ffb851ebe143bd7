//! Magnitudes of frames of a signal.

use std::f64::consts::TAU;

use asperity_dsp::frame::{BINS, WINDOW_S};
use num_complex::Complex64;

/// Computes magnitudes of frames at one rate.
pub struct Spectrometer {
    window: Vec<f64>,
    transform: Transform,
}

/// Computation of the sums at 10, 20, .. Hz.
enum Transform {
    /// For frames with a whole number of samples.
    Fast(asperity_fft::Transform<f64>),
    /// For others: e^(-i w t) at the samples, for each bin below half the rate.
    Direct(Vec<Vec<Complex64>>),
}

impl Spectrometer {
    /// For signals at a rate of at least 20 Hz.
    pub fn new(rate_hz: f64) -> Self {
        let samples = (rate_hz * WINDOW_S).max(2.0);
        let whole = samples.round();
        let (length, transform) = if (samples - whole).abs() < 1e-6 {
            (whole as usize, Transform::Fast(asperity_fft::Transform::new(whole as usize)))
        } else {
            let length = samples.ceil() as usize;
            let below = ((0.5 * samples) as usize).min(BINS);
            let turn = |bin: usize, n: usize| Complex64::cis(-TAU * bin as f64 * n as f64 / samples);
            let bin = |bin| (0..length).map(|n| turn(bin, n)).collect();
            (length, Transform::Direct((1..=below).map(bin).collect()))
        };
        let window = (0..length).map(|n| 0.5 - 0.5 * (TAU * n as f64 / samples).cos()).collect();
        Self { window, transform }
    }

    /// Samples in a frame.
    pub fn length(&self) -> usize {
        self.window.len()
    }

    /// Amplitudes `2 |sum w x| / sum w` at 10, 20, .. 1000 Hz with Hann's window `w`. Several axes count as
    /// one signal: the root of their summed squares, which keeps each axis' energy (Landin, Romano, McMahan,
    /// Kuchenbecker 2010, "Dimensional reduction of high-frequency accelerations for haptic rendering"). Bins
    /// above half the rate are 0. Axes of another [length](Self::length) count as far as they go.
    pub fn magnitudes(&mut self, axes: &[&[f64]]) -> [f32; BINS] {
        let mut powers = [0.0; BINS];
        let scale = 2.0 / self.window.iter().sum::<f64>();
        for axis in axes {
            let seen = self.window.iter().zip(*axis).map(|(w, x)| w * x);
            match &mut self.transform {
                Transform::Fast(fft) => {
                    fft.time.fill(0.0);
                    fft.time.iter_mut().zip(seen).for_each(|(to, x)| *to = x);
                    fft.forward();
                    let found = fft.bins.iter().skip(1);
                    powers.iter_mut().zip(found).for_each(|(p, bin)| *p += bin.norm_sqr() * scale * scale);
                }
                Transform::Direct(kernels) => {
                    let seen: Vec<f64> = seen.collect();
                    for (power, kernel) in powers.iter_mut().zip(kernels) {
                        let sum: Complex64 = kernel.iter().zip(&seen).map(|(k, x)| k * x).sum();
                        *power += sum.norm_sqr() * scale * scale;
                    }
                }
            }
        }
        powers.map(|p| p.sqrt() as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sine_has_its_amplitude_in_its_bin_and_half_beside() {
        for rate in [1000.0, 1024.0, 2500.0, 4096.5, 10_000.0] {
            let mut spectrometer = Spectrometer::new(rate);
            let wave = |amplitude: f64, hz: f64| -> Vec<f64> {
                (0..spectrometer.length())
                    .map(|n| amplitude * (TAU * hz * n as f64 / rate + 0.7).sin())
                    .collect()
            };
            let (x, y) = (wave(3.0, 120.0), wave(4.0, 120.0));
            let magnitudes = spectrometer.magnitudes(&[&x, &y]);
            // A frame that does not end with a sample lacks a little.
            let near = if rate % 10.0 == 0.0 { 1e-5 } else { 5e-3 };
            assert!((magnitudes[11] - 5.0).abs() < near, "{}", magnitudes[11]);
            assert!((magnitudes[10] - 2.5).abs() < near && (magnitudes[12] - 2.5).abs() < near);
            assert!(magnitudes[20] < near && magnitudes[99] < near, "{rate}");
            assert_eq!(magnitudes[99] == 0.0, rate < 2000.0, "{rate}");
        }
    }
}
