//! Figures that describe one sample.

use crate::special::normal_tail;
use crate::{Alternative, Error, Outcome, Variant, finite};

/// Figures of one sample, among them those of Tukey's box plot.
#[derive(Clone, Debug, PartialEq)]
pub struct Description {
    /// Number of finite observations.
    pub n: usize,
    /// Number of observations left out because they are not finite.
    pub excluded: usize,
    /// Arithmetic mean.
    pub mean: f64,
    /// Sample standard deviation, with divisor n - 1. None for one observation.
    pub deviation: Option<f64>,
    /// Median.
    pub median: f64,
    /// Lower and upper quartile, interpolated at position (n - 1) q (definition 7 of Hyndman and Fan 1996).
    pub quartiles: [f64; 2],
    /// Smallest and largest observation within 1.5 interquartile ranges of the box (Tukey 1977).
    /// A quartile, if the box reaches further than that observation.
    pub whiskers: [f64; 2],
    /// Observations outside the whiskers, in ascending order.
    pub outliers: Vec<f64>,
}

/// Describes a sample of at least one finite observation.
pub fn describe(x: &[f64]) -> Result<Description, Error> {
    let (mut x, excluded) = finite(x);
    let n = x.len();
    if n == 0 {
        return Err(Error::TooFew { n, least: 1 });
    }
    x.sort_by(f64::total_cmp);
    let quantile = |q: f64| {
        let position = (n - 1) as f64 * q;
        let (low, high) = (x[position.floor() as usize], x[position.ceil() as usize]);
        low + (high - low) * position.fract()
    };
    let [q1, median, q3] = [0.25, 0.5, 0.75].map(quantile);
    let reach = 1.5 * (q3 - q1);
    let low = x.iter().copied().find(|&v| v >= q1 - reach).unwrap_or(q1).min(q1);
    let high = x.iter().rev().copied().find(|&v| v <= q3 + reach).unwrap_or(q3).max(q3);
    let mean = x.iter().sum::<f64>() / n as f64;
    let squares: f64 = x.iter().map(|v| (v - mean).powi(2)).sum();
    if ![reach, q1, median, q3, squares].iter().all(|v| v.is_finite()) {
        return Err(Error::Overflow);
    }
    x.retain(|v| !(low..=high).contains(v));
    Ok(Description {
        n,
        excluded,
        mean,
        deviation: (n > 1).then(|| (squares / (n - 1) as f64).sqrt()),
        median,
        quartiles: [q1, q3],
        whiskers: [low, high],
        outliers: x,
    })
}

/// D'Agostino's test of the null hypothesis that a normal population gave the sample (D'Agostino 1970).
///
/// It needs at least eight finite observations that are not all equal. [`Alternative::Greater`] means a
/// longer right tail. A skewness of exactly 0 gives Z = 0 and, two-sided, p = 1.
/// SciPy takes another value there.
pub fn skewness_test(x: &[f64], alternative: Alternative) -> Result<Outcome, Error> {
    let (x, excluded) = finite(x);
    if x.len() < 8 {
        return Err(Error::TooFew { n: x.len(), least: 8 });
    }
    let n = x.len() as f64;
    let mean = x.iter().sum::<f64>() / n;
    let moment = |k| x.iter().map(|v| (v - mean).powi(k)).sum::<f64>() / n;
    let (second, third) = (moment(2), moment(3));
    let scale = second.powf(1.5);
    if !(scale.is_finite() && third.is_finite()) {
        return Err(Error::Overflow);
    }
    // Rounding of the mean alone gives equal values such a spread.
    if scale == 0.0 || second <= (f64::EPSILON * mean).powi(2) {
        return Err(Error::NoVariation);
    }
    let y = third / scale * ((n + 1.0) * (n + 3.0) / (6.0 * (n - 2.0))).sqrt();
    let kurtosis = 3.0 * (n * n + 27.0 * n - 70.0) * (n + 1.0) * (n + 3.0)
        / ((n - 2.0) * (n + 5.0) * (n + 7.0) * (n + 9.0));
    let w = (2.0 * (kurtosis - 1.0)).sqrt() - 1.0;
    let z = (y * ((w - 1.0) / 2.0).sqrt()).asinh() / (0.5 * w.ln()).sqrt();
    let p = alternative.p(normal_tail(-z), normal_tail(z));
    Ok(Outcome { n: x.len(), excluded, statistic: z, p, variant: Variant::Skewness(alternative) })
}
