//! Line spectral frequencies of a monic polynomial (Itakura 1975; Soong and Juang 1984, "Line spectrum
//! pair (LSP) and speech data compression").
//!
//! A polynomial `A` of order p is half the sum of `P = A + z^-(p+1) A(1/z)` and `Q = A - z^-(p+1) A(1/z)`.
//! All roots of `A` lie within the unit circle exactly when those of `P` and `Q` lie on it and alternate.
//! Their p angles between 0 and pi, rising, `P` first, are the line spectral frequencies in radians a
//! sample. Any p rising numbers between 0 and pi belong to a stable polynomial, so mixtures of stable
//! polynomials are stable.

use asperity_numbers::Elementary;
use std::f64::consts::PI;

use super::{MAX_ORDER, is_stable};

/// The line spectral frequencies of `1 + a_1 z^-1 + ..` in radians a sample, rising. None if the polynomial
/// is not stable, its order is above [`MAX_ORDER`], or frequencies coincide.
pub fn from_polynomial(a: &[f64]) -> Option<Vec<f64>> {
    let p = a.len();
    if p > MAX_ORDER || !is_stable(a) {
        return None;
    }
    let at = |k: usize| if k == 0 { 1.0 } else { a.get(k - 1).copied().unwrap_or(0.0) };
    let mut sum: Vec<f64> = (0..=p + 1).map(|k| at(k) + at(p + 1 - k)).collect();
    let mut difference: Vec<f64> = (0..=p + 1).map(|k| at(k) - at(p + 1 - k)).collect();
    // Every such polynomial has roots at z = 1 and z = -1. They are divided out.
    if p.is_multiple_of(2) {
        divide(&mut sum, 1, -1.0);
        divide(&mut difference, 1, 1.0);
    } else {
        divide(&mut difference, 2, 1.0);
    }
    let (mut sums, mut differences) = (angles(&sum), angles(&difference));
    sums.sort_unstable_by(f64::total_cmp);
    differences.sort_unstable_by(f64::total_cmp);
    let frequencies: Vec<f64> =
        (0..p).map(|i| if i % 2 == 0 { sums[i / 2] } else { differences[i / 2] }).collect();
    are_valid(&frequencies).then_some(frequencies)
}

/// Whether these rise and lie between 0 and pi, both excluded.
pub fn are_valid(frequencies: &[f64]) -> bool {
    let within = frequencies.iter().all(|w| *w > 0.0 && *w < PI);
    within && frequencies.windows(2).all(|pair| pair[0] < pair[1])
}

/// Writes the coefficients `a_1 .. a_p` of the polynomial with these frequencies, as many as `a` holds.
/// At most [`MAX_ORDER`] frequencies count. Nothing is allocated.
pub fn to_polynomial(frequencies: &[f64], a: &mut [f64]) {
    let frequencies = &frequencies[..frequencies.len().min(MAX_ORDER)];
    let mut halves = [[0.0; MAX_ORDER + 2]; 2];
    let mut degrees = [0_usize; 2];
    for half in &mut halves {
        half[0] = 1.0;
    }
    for (first, (half, degree)) in halves.iter_mut().zip(&mut degrees).enumerate() {
        let count = (frequencies.len() + 1 - first) / 2;
        for i in spread(count) {
            let Some(w) = frequencies.get(2 * i + first) else { continue };
            let middle = -2.0 * w.cosine();
            *degree += 2;
            for k in (0..=*degree).rev() {
                let one = if k >= 1 { middle * half[k - 1] } else { 0.0 };
                let two = if k >= 2 { half[k - 2] } else { 0.0 };
                half[k] += one + two;
            }
        }
    }
    let [sum, difference] = &mut halves;
    if frequencies.len().is_multiple_of(2) {
        multiply(sum, 1, 1.0);
        multiply(difference, 1, -1.0);
    } else {
        multiply(difference, 2, -1.0);
    }
    for (k, a) in a.iter_mut().take(frequencies.len()).enumerate() {
        *a = 0.5 * (sum[k + 1] + difference[k + 1]);
    }
}

/// Numbers below `count` in bit-reversed order. In rising order the product of the roots would lose all
/// digits.
fn spread(count: usize) -> impl Iterator<Item = usize> {
    let bits = count.next_power_of_two().trailing_zeros();
    let reversed = move |i: usize| i.reverse_bits().checked_shr(usize::BITS - bits).unwrap_or(0);
    (0..count.next_power_of_two()).map(reversed).filter(move |i| *i < count)
}

/// Multiplies by `1 + c z^-step`.
fn multiply(polynomial: &mut [f64], step: usize, c: f64) {
    for k in (step..polynomial.len()).rev() {
        polynomial[k] += c * polynomial[k - step];
    }
}

/// Divides by `1 - c z^-step`, a factor of the polynomial.
fn divide(polynomial: &mut Vec<f64>, step: usize, c: f64) {
    for k in step..polynomial.len() {
        polynomial[k] += c * polynomial[k - step];
    }
    polynomial.truncate(polynomial.len() - step);
}

/// Angles of the roots of a symmetric polynomial of degree 2m with all roots on the unit circle. There
/// it is `e^-imw` times a Chebyshev series in `cos w`.
fn angles(symmetric: &[f64]) -> Vec<f64> {
    let m = symmetric.len() / 2;
    let series: Vec<f64> =
        (0..=m).map(|j| if j == 0 { symmetric[m] } else { 2.0 * symmetric[m - j] }).collect();
    roots(series).into_iter().map(Elementary::arc_cosine).collect()
}

/// Roots of a Chebyshev series whose roots are all real and within -1 to 1. Exactly one lies between
/// two neighbouring roots of the derivative, or between one of them and an end.
fn roots(series: Vec<f64>) -> Vec<f64> {
    let mut all = vec![series];
    while let Some(last) = all.last().filter(|s| s.len() > 2) {
        let lower = derivative(last);
        all.push(lower);
    }
    let mut found = Vec::new();
    for series in all.iter().rev() {
        let mut ends = vec![-1.0];
        ends.append(&mut found);
        ends.push(1.0);
        found = ends.windows(2).take(series.len() - 1).map(|e| root_between(series, e[0], e[1])).collect();
    }
    found
}

fn root_between(series: &[f64], mut low: f64, mut high: f64) -> f64 {
    let rises = value(series, low) < value(series, high);
    // Halves until the middle is one of the ends.
    loop {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            return middle;
        }
        if (value(series, middle) < 0.0) == rises {
            low = middle;
        } else {
            high = middle;
        }
    }
}

/// Clenshaw's recurrence.
fn value(series: &[f64], x: f64) -> f64 {
    let (mut last, mut before) = (0.0, 0.0);
    for c in series.iter().skip(1).rev() {
        (last, before) = (2.0 * x * last - before + c, last);
    }
    x * last - before + series[0]
}

/// The derivative of a Chebyshev series of degree 1 or more, scaled to keep its size.
fn derivative(series: &[f64]) -> Vec<f64> {
    let n = series.len() - 1;
    let mut lower = vec![0.0; n + 2];
    for k in (1..=n).rev() {
        lower[k - 1] = lower[k + 1] + 2.0 * k as f64 * series[k];
    }
    lower[0] *= 0.5;
    lower.truncate(n);
    let largest = lower.iter().fold(f64::MIN_POSITIVE, |m, c| c.abs().max(m));
    lower.iter_mut().for_each(|c| *c /= largest);
    lower
}

#[cfg(test)]
mod tests {
    use super::super::testing::frequencies;
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn low_orders_have_textbook_frequencies() {
        let near = |a: &[f64], want: &[f64]| {
            let found = from_polynomial(a).unwrap();
            assert!(found.iter().zip(want).all(|(x, y)| (x - y).abs() < 1e-12), "{found:?} {want:?}");
            assert_eq!(found.len(), want.len());
        };
        assert_eq!(from_polynomial(&[]), Some(vec![]));
        // P = 1 + 2 a z^-1 + z^-2
        near(&[-0.9], &[0.9f64.acos()]);
        near(&[0.0], &[PI / 2.0]);
        // P / (1 + z^-1) = 1 + (a1 + a2 - 1) z^-1 + z^-2, Q / (1 - z^-1) = 1 + (a1 - a2 + 1) z^-1 + z^-2
        let (a1, a2) = (-1.2, 0.81);
        near(&[a1, a2], &[(-(a1 + a2 - 1.0) / 2.0f64).acos(), (-(a1 - a2 + 1.0) / 2.0f64).acos()]);
        // A = 1: the angles of 1 + z^-(p+1) and 1 - z^-(p+1)
        near(&[0.0; 5], &[1.0, 2.0, 3.0, 4.0, 5.0].map(|k| k * PI / 6.0));
    }

    #[test]
    fn unstable_polynomial_has_no_frequencies() {
        assert_eq!(from_polynomial(&[-1.0]), None);
        assert_eq!(from_polynomial(&[-2.1, 1.2]), None);
        assert_eq!(from_polynomial(&[f64::NAN]), None);
        assert_eq!(from_polynomial(&[0.0; MAX_ORDER + 1]), None);
        assert!(
            !are_valid(&[0.5, 0.5]) && !are_valid(&[0.0]) && !are_valid(&[PI]) && !are_valid(&[f64::NAN])
        );
    }

    /// A stable polynomial from reflection coefficients, by stepping up.
    fn from_reflections(reflections: &[f64]) -> Vec<f64> {
        let mut a: Vec<f64> = Vec::new();
        for &k in reflections {
            let up: Vec<f64> = a.iter().zip(a.iter().rev()).map(|(x, y)| x + k * y).collect();
            a = up;
            a.push(k);
        }
        a
    }

    /// Frequencies whose steps differ by a factor of up to 2. Multiplied in rising order, those of
    /// order 64 come back wrong by 0.04, and most of the polynomials are not stable.
    #[test]
    fn high_orders_keep_their_digits() {
        let mut random = asperity_numbers::Random::new(1);
        for order in [16, 33, 48, 63, MAX_ORDER] {
            for _ in 0..100 {
                let lines = frequencies(&mut random, order, 0.5);
                let mut a = vec![0.0; order];
                to_polynomial(&lines, &mut a);
                let back = from_polynomial(&a).unwrap();
                let off = back.iter().zip(&lines).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
                assert!(off < 1e-8, "order {order}: {off}");
            }
        }
        for count in 0..40 {
            let mut all: Vec<usize> = spread(count).collect();
            all.sort_unstable();
            assert!(all.into_iter().eq(0..count));
        }
    }

    proptest! {
        #[test]
        fn stable_polynomial_comes_back(reflections in proptest::collection::vec(-0.95..0.95f64, 1..32)) {
            let a = from_reflections(&reflections);
            let frequencies = from_polynomial(&a).unwrap();
            let mut back = vec![0.0; a.len()];
            to_polynomial(&frequencies, &mut back);
            let size = a.iter().fold(1.0, |m: f64, x| m.max(x.abs()));
            for (x, y) in a.iter().zip(&back) {
                prop_assert!((x - y).abs() < 1e-7 * size, "{x} {y}");
            }
        }
    }
}
