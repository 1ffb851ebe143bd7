//! Signals whose figures are known.

use std::f64::consts::TAU;

/// A white, nearly Gaussian noise of a root mean square, the same for the same seed.
pub(crate) fn noise(seed: u64, count: usize, rms: f64) -> Vec<f64> {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let mut uniform = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    };
    // A sum of twelve uniform numbers has a variance of 1.
    (0..count).map(|_| rms * (0..12).map(|_| uniform()).sum::<f64>()).collect()
}

pub(super) fn sine(amplitude: f64, hz: f64, rate_hz: f64, seconds: f64) -> Vec<f64> {
    let samples = (rate_hz * seconds).round() as usize;
    (0..samples).map(|n| amplitude * (TAU * hz * n as f64 / rate_hz + 0.7).sin()).collect()
}

pub(super) fn louder(signal: &[f64], db: f64) -> Vec<f64> {
    let gain = 10f64.powf(db / 20.0);
    signal.iter().map(|x| gain * x).collect()
}
