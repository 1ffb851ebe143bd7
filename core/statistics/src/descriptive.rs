//! Figures that describe one sample.

use crate::proportion::binomial_masses;
use crate::special::{normal_tail, student_quantile};
use crate::{Alternative, Error, Interval, Outcome, Variant, finite};

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

/// Mean of at least two finite observations, with the interval of Student's t.
pub fn mean_interval(x: &[f64], confidence: f64) -> Result<Interval, Error> {
    let Description { n, mean, deviation, .. } = describe(x)?;
    let deviation = deviation.ok_or(Error::TooFew { n, least: 2 })?;
    let half = student_quantile(confidence, (n - 1) as f64)? * deviation / (n as f64).sqrt();
    Ok(Interval { estimate: mean, low: mean - half, high: mean + half })
}

/// Median with the interval between two observations that lie equally far from the ends (Conover 1999).
///
/// It holds the median of any continuous population with at least the given confidence. Few observations
/// cannot: for 95 %, at least six are needed.
pub fn median_interval(x: &[f64], confidence: f64) -> Result<Interval, Error> {
    if !(confidence > 0.0 && confidence < 1.0) {
        return Err(Error::Argument("confidence must lie between 0 and 1"));
    }
    let median = describe(x)?.median;
    let (mut x, _) = finite(x);
    x.sort_by(f64::total_cmp);
    let n = x.len();
    // The number of observations below the population's median has a binomial distribution.
    let mut below = 0.0;
    let rare = |mass: &f64| {
        below += mass;
        below <= (1.0 - confidence) / 2.0
    };
    match binomial_masses(n, 0.5).iter().copied().take_while(rare).count() {
        0 => Err(Error::TooFew { n, least: (1.0 - (1.0 - confidence).log2()).ceil() as usize }),
        cut => Ok(Interval { estimate: median, low: x[cut - 1], high: x[n - cut] }),
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of scipy.stats 1.17.1: `t.interval` with `sem`, and `quantile_test`'s interval.
    #[test]
    fn intervals_of_mean_and_median_match_scipy() {
        let x = [83.0, 91.0, 77.0, 62.0, 95.0, 88.0, 70.0, 99.0, 81.0, 54.0];
        let near = |got: Interval, wanted: [f64; 3]| {
            let apart = [got.low, got.estimate, got.high].into_iter().zip(wanted).map(|(a, b)| (a - b).abs());
            assert!(apart.fold(0.0, f64::max) < 1e-9, "{got:?} {wanted:?}");
        };
        near(mean_interval(&x, 0.95).unwrap(), [69.63349356759069, 80.0, 90.36650643240931]);
        near(median_interval(&x, 0.95).unwrap(), [62.0, 82.0, 95.0]);
        let many: Vec<f64> = (0..5000).map(f64::from).collect();
        let wide = median_interval(&many, 0.95).unwrap();
        assert!(wide.low > 2400.0 && wide.high < 2600.0, "{wide:?}");
    }

    #[test]
    fn five_observations_give_no_median_interval() {
        let x = [1.0, 2.0, 3.0, 4.0, 5.0];
        assert_eq!(median_interval(&x, 0.95), Err(Error::TooFew { n: 5, least: 6 }));
        let all = median_interval(&[&x[..], &[6.0]].concat(), 0.95).unwrap();
        assert_eq!([all.low, all.estimate, all.high], [1.0, 3.5, 6.0]);
        assert_eq!(mean_interval(&x[..1], 0.95), Err(Error::TooFew { n: 1, least: 2 }));
    }
}
