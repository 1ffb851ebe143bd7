//! The vector by which a network knows a material.

use super::Law;

/// Length of the vector.
pub const EMBEDDING_LEN: usize = 256;

/// Speeds [mm/s] and forces [N] at which the spectrum is read.
const CONDITIONS: [(f64, f64); 4] = [(25.0, 1.0), (80.0, 1.0), (80.0, 3.0), (240.0, 1.0)];
/// Frequencies read at each, spaced by equal ratios from 10 to 1000 Hz.
const FREQUENCIES: usize = EMBEDDING_LEN / CONDITIONS.len();

/// The vector of a law: log-spectra at four reference conditions, (25 mm/s, 1 N), (80, 1), (80, 3) and (240, 1), one
/// after the other, each at 64 frequencies `f_j = 10 * 100^(j / 63)` Hz, as
/// `2 + log10(S(f_j) + 1e-6)` with `S` in (m/s^2)^2/Hz: -4 for silence, 0 at 0.01, 2 at 1.
///
/// Entries 64..128 and 128..192 differ by the force exponent alone.
pub fn embed(law: &Law) -> [f32; EMBEDDING_LEN] {
    std::array::from_fn(|i| {
        let (speed, force) = CONDITIONS[i / FREQUENCIES];
        let hz = 10.0 * 100f64.powf((i % FREQUENCIES) as f64 / (FREQUENCIES - 1) as f64);
        (2.0 + (law.psd(speed, force, hz) + 1e-6).log10()) as f32
    })
}
