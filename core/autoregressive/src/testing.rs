//! Random polynomials for tests.

use asperity_numbers::Random;
use std::f64::consts::PI;

use super::line_spectrum::to_polynomial;

/// Random line spectral frequencies. Their steps are `least` to 1 parts of each other.
pub(super) fn frequencies(random: &mut Random, order: usize, least: f64) -> Vec<f64> {
    let steps: Vec<f64> = (0..=order).map(|_| random.range(least, 1.0)).collect();
    let whole: f64 = steps.iter().sum();
    let mut sum = 0.0;
    let mut next = |step: &f64| {
        sum += step / whole * PI;
        sum
    };
    steps[..order].iter().map(&mut next).collect()
}

/// A random polynomial with all roots within the unit circle.
pub(super) fn stable(random: &mut Random, order: usize, least: f64) -> Vec<f64> {
    let mut a = vec![0.0; order];
    to_polynomial(&frequencies(random, order, least), &mut a);
    a
}
