//! Materials: the library file that names them with their vectors, and what a frame of their magnitudes is.
//!
//! A frame is a Hann window of [`WINDOW_S`] and its magnitudes are amplitudes, `A_k = 2 |sum w x| / sum w`
//! in m/s^2, at [`BIN_HZ`], 2 `BIN_HZ`, .. [`BINS`] `BIN_HZ`. Of a stationary Gaussian signal they are
//! Rayleigh distributed: `E[A_k] = sqrt(pi / 4) sqrt(E[A_k^2])`.

mod library;
mod random;

/// Bins of a magnitude frame: `BIN_HZ`, 2 `BIN_HZ`, .. `BINS` `BIN_HZ`.
pub const BINS: usize = 100;
/// Distance of bins in Hz.
pub const BIN_HZ: f64 = 10.0;
/// Length of the Hann window in s.
pub const WINDOW_S: f64 = 0.1;

pub use library::{
    Assignment, BLENDED, Events, Harmonic, Library, LibraryMaterial, MAX_HARMONICS, MAX_WAVES, Neighbour,
    Pattern, VECTOR_LEN, Wave,
};
pub use random::Random;
