//! Proportions: the exact binomial test and Wilson's interval.

use crate::special::two_sided_quantile;
use crate::{Alternative, Error, Interval, Outcome, Variant};

/// Largest number of trials: the test tabulates the whole distribution.
const MOST: usize = 1_000_000;

/// Exact test that the probability of success is `p0`, for `successes` in `n` trials, 1 to 1,000,000.
///
/// The two-sided p sums the probabilities of all outcomes that are not more likely than the observed one.
/// A relative slack of 1e-7 absorbs rounding, as in SciPy and R. `p0` is 0 to 1.
pub fn binomial_test(
    successes: usize,
    n: usize,
    p0: f64,
    alternative: Alternative,
) -> Result<Outcome, Error> {
    check(successes, n)?;
    if !(0.0..=1.0).contains(&p0) {
        return Err(Error::Argument("p0 must be 0 to 1"));
    }
    if n > MOST {
        return Err(Error::TooMany { n, most: MOST });
    }
    let mass = binomial_masses(n, p0);
    let p: f64 = match alternative {
        Alternative::Less => mass[..=successes].iter().sum(),
        Alternative::Greater => mass[successes..].iter().sum(),
        Alternative::TwoSided => mass.iter().filter(|&&m| m <= mass[successes] * (1.0 + 1e-7)).sum(),
    };
    let statistic = successes as f64 / n as f64;
    Ok(Outcome { n, excluded: 0, statistic, p: p.min(1.0), variant: Variant::Binomial(alternative) })
}

/// Probabilities of 0 to `n` successes: ratios to the mode, then divided by their sum.
pub(crate) fn binomial_masses(n: usize, p: f64) -> Vec<f64> {
    let mode = (((n + 1) as f64 * p) as usize).min(n);
    let mut mass = vec![1.0; n + 1];
    for k in mode + 1..=n {
        mass[k] = mass[k - 1] * ((n + 1 - k) as f64 / k as f64) * (p / (1.0 - p));
    }
    for k in (0..mode).rev() {
        mass[k] = mass[k + 1] * ((k + 1) as f64 / (n - k) as f64) * ((1.0 - p) / p);
    }
    let sum: f64 = mass.iter().sum();
    mass.iter().map(|m| m / sum).collect()
}

/// Wilson's score interval of a proportion, without continuity correction (Wilson 1927; Newcombe 1998).
///
/// `confidence` lies between 0 and 1; `n` is at least 1.
pub fn wilson_interval(successes: usize, n: usize, confidence: f64) -> Result<Interval, Error> {
    check(successes, n)?;
    let z = two_sided_quantile(confidence)?;
    let (k, m, z2) = (successes as f64, n as f64, z * z);
    let center = (k + z2 / 2.0) / (m + z2);
    let half = z / (m + z2) * (k * (m - k) / m + z2 / 4.0).sqrt();
    // Rounding must not move a limit off 0 or 1.
    let low = if successes == 0 { 0.0 } else { center - half };
    let high = if successes == n { 1.0 } else { center + half };
    Ok(Interval { estimate: k / m, low, high })
}

/// Checks that `n` is at least 1 and not less than `successes`.
fn check(successes: usize, n: usize) -> Result<(), Error> {
    match n {
        0 => Err(Error::TooFew { n, least: 1 }),
        _ if successes > n => Err(Error::Argument("successes must not exceed trials")),
        _ => Ok(()),
    }
}
