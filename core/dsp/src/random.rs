//! Random numbers by index: skipping some does not change later ones.

use asperity_numbers::Elementary as _;
use asperity_numbers::random::{STEP, mix};

use asperity_numbers::unit_circle;

/// A uniform number in [0, 1) for a seed and two indices, by the finaliser of SplitMix64 (Steele, Lea,
/// Flood 2014), which passes BigCrush on successive counters.
#[inline]
pub fn uniform(seed: u64, row: u64, column: u64) -> f64 {
    uniform_at(row_seed(seed, row), column)
}

/// A uniform number in [0, 1) for a seed and one index.
#[inline]
pub(crate) fn uniform_at(seed: u64, index: u64) -> f64 {
    (step(seed, index) >> 11) as f64 / (1u64 << 53) as f64
}

/// A normal number of unit variance for a seed and an index (G. Box, M. Muller, 1958).
#[inline]
pub(crate) fn normal(seed: u64, index: u64) -> f64 {
    let (radius, turns) = (uniform(seed, index, 0), uniform(seed, index, 1));
    (-2.0 * (1.0 - radius).log_e()).sqrt() * unit_circle(turns).0
}

/// Seed of one row of numbers.
#[inline]
fn row_seed(seed: u64, row: u64) -> u64 {
    step(step(seed, 0), row)
}

/// The 64-bit number of a seed at an index.
#[inline]
fn step(seed: u64, index: u64) -> u64 {
    mix(seed.wrapping_add(index.wrapping_mul(STEP)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_numbers_have_normal_moments() {
        let n = 100_000;
        let moment = |power: i32| (0..n).map(|i| normal(5, i).powi(power)).sum::<f64>() / n as f64;
        // Four standard deviations.
        assert!(moment(1).abs() < 0.013 && (moment(2) - 1.0).abs() < 0.018, "{} {}", moment(1), moment(2));
        assert!(moment(3).abs() < 0.05 && (moment(4) - 3.0).abs() < 0.13, "{} {}", moment(3), moment(4));
    }

    #[test]
    fn numbers_are_uniform_and_uncorrelated() {
        let n = 300u64;
        let count = (n * n) as f64;
        let centred = |seed, i, k| uniform(seed, i, k) - 0.5;
        let (mut mean, mut square, mut rows, mut columns, mut seeds) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for i in 0..n {
            for k in 0..n {
                let x = centred(3, i, k);
                mean += x / count;
                square += 12.0 * x * x / count;
                rows += 12.0 * x * centred(3, i + 1, k) / count;
                columns += 12.0 * x * centred(3, i, k + 1) / count;
                seeds += 12.0 * x * centred(4, i, k) / count;
            }
        }
        // Four standard deviations of such means are 0.004 and 0.013.
        assert!(mean.abs() < 0.004 && (square - 1.0f64).abs() < 0.013, "{mean} {square}");
        assert!([rows, columns, seeds].iter().all(|c| f64::abs(*c) < 0.014), "{rows} {columns} {seeds}");
    }
}
