//! Magnitudes of frames of a signal.

use std::f64::consts::TAU;
use std::sync::Arc;

use asperity_world::material::{BIN_HZ, BINS, WINDOW_S};
use realfft::num_complex::Complex64;
use realfft::{RealFftPlanner, RealToComplex};

/// Takes the magnitudes of frames at some rate.
pub struct Spectrometer {
    window: Vec<f64>,
    /// Of the frame's length padded to where bins are 10 Hz apart.
    plan: Arc<dyn RealToComplex<f64>>,
    room: Vec<f64>,
    bins: Vec<Complex64>,
}

impl Spectrometer {
    /// For signals at a rate of a whole multiple of 10 Hz, at least 20.
    pub fn new(rate_hz: f64) -> Self {
        let length = ((rate_hz * WINDOW_S).round() as usize).max(2);
        debug_assert!((length as f64 * BIN_HZ - rate_hz).abs() < 1e-6);
        let plan = RealFftPlanner::new().plan_fft_forward(length);
        let window = (0..length).map(|n| 0.5 - 0.5 * (TAU * n as f64 / length as f64).cos()).collect();
        Self { window, room: plan.make_input_vec(), bins: plan.make_output_vec(), plan }
    }

    /// Samples of a frame.
    pub fn length(&self) -> usize {
        self.window.len()
    }

    /// Amplitudes `2 |sum w x| / sum w` at 10, 20, .. 1000 Hz, `w` Hann's window, of a signal on several axes, as one: the root of their summed squares,
    /// which is what is left of each axis' energy when they are made one signal (Landin, Romano, McMahan, Kuchenbecker 2010, "Dimensional reduction of
    /// high-frequency accelerations for haptic rendering"). What lies beyond half the rate is 0. Axes of another
    /// [length](Self::length) count as far as they go.
    pub fn magnitudes(&mut self, axes: &[&[f64]]) -> [f32; BINS] {
        let mut powers = [0.0; BINS];
        let scale = 2.0 / self.window.iter().sum::<f64>();
        for axis in axes {
            self.room.fill(0.0);
            for ((room, w), x) in self.room.iter_mut().zip(&self.window).zip(*axis) {
                *room = w * x;
            }
            // Lengths are the plan's own.
            if self.plan.process(&mut self.room, &mut self.bins).is_err() {
                continue;
            }
            for (power, bin) in powers.iter_mut().zip(self.bins.iter().skip(1)) {
                *power += bin.norm_sqr() * scale * scale;
            }
        }
        powers.map(|p| p.sqrt() as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sine_has_its_amplitude_in_its_bin_and_half_of_it_beside() {
        for rate in [1000.0, 2500.0, 10_000.0] {
            let mut spectrometer = Spectrometer::new(rate);
            let wave = |amplitude: f64, hz: f64| -> Vec<f64> {
                (0..spectrometer.length())
                    .map(|n| amplitude * (TAU * hz * n as f64 / rate + 0.7).sin())
                    .collect()
            };
            let (x, y) = (wave(3.0, 120.0), wave(4.0, 120.0));
            let magnitudes = spectrometer.magnitudes(&[&x, &y]);
            assert!((magnitudes[11] - 5.0).abs() < 1e-5, "{}", magnitudes[11]);
            assert!((magnitudes[10] - 2.5).abs() < 1e-5 && (magnitudes[12] - 2.5).abs() < 1e-5);
            assert!(magnitudes[20] < 1e-5 && magnitudes[99] < 1e-5);
        }
    }
}
