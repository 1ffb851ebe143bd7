//! The Hann window.

use crate::Float;
use asperity_numbers::Elementary as _;

/// The periodic Hann window of `len` samples, `0.5 - 0.5 cos(2 pi i / len)`. Its sum is `len / 2`, and that
/// of its squares `3 len / 8` (for `len >= 3`).
pub fn hann<T: Float>(len: usize) -> Vec<T> {
    let step = std::f64::consts::PI / len.max(1) as f64;
    // sin^2 of the half angle does not cancel near the ends, where 0.5 - 0.5 cos does.
    (0..len).map(|i| T::of((i as f64 * step).sine().powi(2))).collect()
}

/// Transform of the Hann window along frequency, relative to `nu = 0`, for a window centred on time 0:
/// `sin(pi nu) / (pi nu (1 - nu^2))` with `nu` in bins. The main lobe is `|nu| < 2`.
pub fn hann_lobe(nu: f64) -> f64 {
    let nu = nu.abs();
    if nu < 1e-6 {
        return 1.0;
    }
    if (nu - 1.0).abs() < 1e-6 {
        return 0.5;
    }
    (std::f64::consts::PI * nu).sine() / (std::f64::consts::PI * nu * (1.0 - nu * nu))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hann_matches_its_formula_and_sums() {
        let w = hann::<f64>(250);
        for (i, v) in w.iter().enumerate() {
            assert!((v - (0.5 - 0.5 * (std::f64::consts::TAU * i as f64 / 250.0).cos())).abs() < 1e-15);
        }
        assert!((w.iter().sum::<f64>() - 125.0).abs() < 1e-12);
        assert!((w.iter().map(|v| v * v).sum::<f64>() - 93.75).abs() < 1e-12);
    }

    #[test]
    fn hann_lobe_matches_the_transform_of_the_window() {
        let n = 4800;
        let w = hann::<f64>(n);
        for nu in [0.0, 0.3, 1.0, 1.5, 2.0, 2.4, 3.7] {
            let sum: f64 = w
                .iter()
                .enumerate()
                .map(|(i, v)| v * (std::f64::consts::TAU * nu * (i as f64 / n as f64 - 0.5)).cos())
                .sum();
            assert!((sum / (n as f64 / 2.0) - hann_lobe(nu)).abs() < 1e-6, "{nu}");
        }
    }
}
