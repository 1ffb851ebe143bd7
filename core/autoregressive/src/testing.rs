//! Polynomials and spectra for tests.

use asperity_numbers::Random;
use std::f64::consts::{PI, TAU};

use super::Filter;
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

/// `c_1 ..` of a polynomial with pairs of roots, by frequencies and bandwidths in Hz.
pub(super) fn poles(pairs: &[[f64; 2]], rate_hz: f64) -> Vec<f64> {
    let mut all = vec![1.0];
    for [hz, bandwidth_hz] in pairs {
        let radius = (-PI * bandwidth_hz / rate_hz).exp();
        multiply(&mut all, [-2.0 * radius * (TAU * hz / rate_hz).cos(), radius * radius]);
    }
    all.split_off(1)
}

/// Multiplies a polynomial by `1 + a z^-1 + b z^-2`.
pub(super) fn multiply(polynomial: &mut Vec<f64>, [a, b]: [f64; 2]) {
    polynomial.extend([0.0; 2]);
    for i in (1..polynomial.len()).rev() {
        polynomial[i] += a * polynomial[i - 1] + if i > 1 { b * polynomial[i - 2] } else { 0.0 };
    }
}

/// Power of a filter's signal in thirds of an octave from 25 to 400 Hz, in closed form.
pub(super) fn bands(filter: &Filter, rate_hz: f64) -> Vec<f64> {
    let band = |number: i32| {
        let edge = |by: f64| 10f64.powf(f64::from(number) / 10.0 + by);
        let (low, high) = (edge(-0.05), edge(0.05));
        let at = |i: i32| low + (high - low) * (f64::from(i) + 0.5) / 200.0;
        let mean = (0..200).map(|i| filter.power(TAU * at(i) / rate_hz)).sum::<f64>() / 200.0;
        // One-sided: twice the density times the width.
        2.0 * mean / rate_hz * (high - low)
    };
    (14..=26).map(band).collect()
}

/// Largest difference in dB of two lists of powers, of those that hold more than a part of all.
pub(super) fn off_db(found: &[f64], want: &[f64], part: f64) -> f64 {
    let whole: f64 = want.iter().sum();
    let held = found.iter().zip(want).filter(|(_, want)| **want > part * whole);
    held.map(|(found, want)| (10.0 * (found / want).log10()).abs()).fold(0.0, f64::max)
}
