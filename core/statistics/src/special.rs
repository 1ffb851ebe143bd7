//! Tails and quantiles of distributions, from the special functions of `statrs`.
//!
//! Each is within 1e-11 of SciPy, relative, down to p = 1e-100. F is so up to 10,000 rows, and within 1e-9 up
//! to a million.

use std::f64::consts::SQRT_2;

use statrs::distribution::{ContinuousCDF as _, StudentsT};
use statrs::function::{beta, erf, gamma};

use crate::Error;

/// P(Z >= z) of the standard normal distribution.
pub(crate) fn normal_tail(z: f64) -> f64 {
    0.5 * libm::erfc(z / SQRT_2)
}

/// Standard normal quantile z with P(|Z| <= z) = `confidence`, which must lie between 0 and 1.
pub(crate) fn two_sided_quantile(confidence: f64) -> Result<f64, Error> {
    if confidence > 0.0 && confidence < 1.0 {
        Ok(SQRT_2 * erf::erf_inv(confidence))
    } else {
        Err(Error::Argument("confidence must lie between 0 and 1"))
    }
}

/// Quantile t of Student's distribution with P(|T| <= t) = `confidence`, which must lie between 0 and 1.
pub(crate) fn student_quantile(confidence: f64, freedom: f64) -> Result<f64, Error> {
    let distribution =
        StudentsT::new(0.0, 1.0, freedom).map_err(|_| Error::Argument("freedom must be positive"))?;
    if confidence > 0.0 && confidence < 1.0 {
        Ok(distribution.inverse_cdf(0.5 + 0.5 * confidence))
    } else {
        Err(Error::Argument("confidence must lie between 0 and 1"))
    }
}

/// P(X >= x) of the chi-square distribution, for x >= 0.
pub(crate) fn chi_square_tail(x: f64, freedom: f64) -> f64 {
    // Zero and infinity are the arguments that `statrs` refuses.
    gamma::checked_gamma_ur(freedom / 2.0, x / 2.0).unwrap_or(if x > 0.0 { 0.0 } else { 1.0 })
}

/// P(X >= x) of Fisher's F distribution, for x >= 0.
pub(crate) fn f_tail(x: f64, [a, b]: [f64; 2]) -> f64 {
    beta::checked_beta_reg(b / 2.0, a / 2.0, b / (b + a * x)).unwrap_or(if x > 0.0 { 0.0 } else { 1.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of scipy.stats 1.17.1: chi2.sf, f.sf, norm.isf, t.ppf.
    #[test]
    fn far_tails_match_scipy() {
        let f = |x, n: f64| f_tail(x, [3.0 - 2.0 / n, (n - 1.0) * (3.0 - 2.0 / n)]);
        let quantile = |confidence| two_sided_quantile(confidence).unwrap();
        let student = |confidence, freedom| student_quantile(confidence, freedom).unwrap();
        for (got, expected) in [
            (chi_square_tail(1e-3, 2.0), 0.9995001249791693),
            (chi_square_tail(3.0, 3.0), 0.3916251762710877),
            (chi_square_tail(700.0, 4.0), 3.4852862290889247e-150),
            (f(0.5, 1e3), 0.682174678845867),
            (f(30.0, 1e3), 4.295321212232729e-19),
            (f(0.5, 1e6), 0.6822702346299047),
            (f(30.0, 1e6), 2.1920736104788755e-19),
            (quantile(0.5), 0.6744897501960817),
            (quantile(0.99), 2.575829303548901),
            (quantile(1.0 - 1e-12), 7.130509892879273),
            (student(0.95, 1.0), 12.706204736174694),
            (student(0.95, 9.0), 2.262157162798205),
            (student(0.99, 1000.0), 2.580754698065951),
        ] {
            assert!((got / expected - 1.0).abs() < 1e-9, "{got} {expected}");
        }
        assert_eq!([chi_square_tail(0.0, 2.0), chi_square_tail(f64::INFINITY, 2.0)], [1.0, 0.0]);
        assert_eq!([f(0.0, 9.0), f(f64::INFINITY, 9.0)], [1.0, 0.0]);
    }
}
