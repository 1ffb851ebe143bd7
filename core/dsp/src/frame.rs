//! The magnitude frame of the texture models (Heravi et al. 2024).
//!
//! A frame is a Hann window of [`WINDOW_S`]. Its magnitudes are amplitudes, `A_k = 2 |sum w x| / sum w`
//! in m/s^2, at [`BIN_HZ`], 2 `BIN_HZ`, .. [`BINS`] `BIN_HZ`. For a stationary Gaussian signal they are
//! Rayleigh distributed: `E[A_k] = sqrt(pi / 4) sqrt(E[A_k^2])`.

/// Bins of a frame.
pub const BINS: usize = 100;
/// Distance between bins [Hz].
pub const BIN_HZ: f64 = 10.0;
/// Length of the Hann window [s].
pub const WINDOW_S: f64 = 0.1;
