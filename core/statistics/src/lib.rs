//! Statistical tests for perception studies, as pure functions over slices.
//!
//! No function panics, and no result holds a NaN. Observations that are not finite are left out, and each
//! result counts them. Bad arguments and degenerate data give an [`Error`].
//!
//! The tests compare all results with SciPy 1.17.1, Pingouin 0.7.0, statsmodels 0.15.0 and Matplotlib 3.11.2.
//! `tests/reference.py` makes the reference tables.

mod correction;
mod descriptive;
mod effect;
mod friedman;
mod preference;
mod proportion;
mod ranks;
mod signed_rank;
mod special;

pub use correction::{Adjusted, Correction, adjust};
pub use descriptive::{Description, describe, mean_interval, median_interval, skewness_test};
pub use effect::{Effect, common_language_effect, rank_biserial};
pub use friedman::{Friedman, friedman};
pub use preference::{BradleyTerry, Estimator, bradley_terry};
pub use proportion::{binomial_test, wilson_interval};
pub use signed_rank::{Method, Zeros, differences, wilcoxon};

use std::fmt;

/// Direction of the alternative hypothesis.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Alternative {
    /// The parameter differs from its null value.
    TwoSided,
    /// The parameter is larger than its null value.
    Greater,
    /// The parameter is smaller than its null value.
    Less,
}

impl Alternative {
    /// p-value from the probabilities of a statistic at most, and at least, as large as the observed one.
    fn p(self, at_most: f64, at_least: f64) -> f64 {
        match self {
            Self::TwoSided => (2.0 * at_most.min(at_least)).min(1.0),
            Self::Greater => at_least.min(1.0),
            Self::Less => at_most.min(1.0),
        }
    }
}

impl fmt::Display for Alternative {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Self::TwoSided => "two-sided",
            Self::Greater => "one-sided (greater)",
            Self::Less => "one-sided (less)",
        })
    }
}

/// Outcome of one test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    /// Number of observations that entered the test.
    pub n: usize,
    /// Number of observations left out: not finite, or zero differences under [`Zeros::Drop`].
    pub excluded: usize,
    /// Test statistic, as [`Variant`] defines it. Only [`Variant::FriedmanF`] can be infinite.
    pub statistic: f64,
    /// p-value, 0 to 1.
    pub p: f64,
    /// Test that was made.
    pub variant: Variant,
}

/// Name and variant of a test. [`Display`](fmt::Display) gives the text for a report.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Variant {
    /// Exact binomial test. The statistic is the proportion of successes.
    Binomial(Alternative),
    /// Wilcoxon signed-rank test. The statistic is the rank sum of the positive differences.
    /// If two-sided, it is the smaller of the two rank sums.
    SignedRank {
        /// Direction of the alternative.
        alternative: Alternative,
        /// Treatment of zero differences.
        zeros: Zeros,
        /// Method that gave p. It is never [`Method::Auto`].
        method: Method,
    },
    /// Friedman test by the chi-square approximation. The statistic is chi-square, corrected for ties.
    FriedmanChiSquare {
        /// Degrees of freedom: conditions - 1.
        freedom: f64,
    },
    /// Friedman test by the F approximation. The statistic is F. It is infinite if all rows rank alike.
    FriedmanF {
        /// Degrees of freedom of numerator and denominator.
        freedom: [f64; 2],
    },
    /// D'Agostino's skewness test. The statistic is Z.
    Skewness(Alternative),
    /// Likelihood-ratio test of equal abilities. The statistic is twice the log likelihood ratio.
    EqualAbilities {
        /// Degrees of freedom: items - 1.
        freedom: f64,
        /// Estimator of the abilities.
        estimator: Estimator,
    },
}

impl fmt::Display for Variant {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Binomial(side) => write!(f, "exact binomial, {side}"),
            Self::SignedRank { alternative, zeros, method } => {
                write!(f, "Wilcoxon signed-rank, {alternative}, {method}, {zeros}")
            }
            Self::FriedmanChiSquare { freedom } => write!(f, "Friedman, chi-square({freedom})"),
            Self::FriedmanF { freedom: [a, b] } => write!(f, "Friedman, F({a:.3}, {b:.3})"),
            Self::Skewness(side) => write!(f, "D'Agostino skewness, {side}"),
            Self::EqualAbilities { freedom, estimator } => {
                write!(f, "Bradley-Terry likelihood ratio, chi-square({freedom}), {estimator}")
            }
        }
    }
}

/// Estimate with its confidence interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Point estimate.
    pub estimate: f64,
    /// Lower limit.
    pub low: f64,
    /// Upper limit.
    pub high: f64,
}

/// Reason why there is no result.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// The data are too few.
    #[error("{n} observations are too few: at least {least} are needed")]
    TooFew {
        /// Number of usable observations, conditions or items.
        n: usize,
        /// Smallest number that works.
        least: usize,
    },
    /// The data are too many for this method.
    #[error("{n} observations are too many: at most {most} are supported")]
    TooMany {
        /// Number of observations or items.
        n: usize,
        /// Largest number that works.
        most: usize,
    },
    /// Two inputs, or two rows, differ in length.
    #[error("lengths differ: {0} and {1}")]
    Lengths(usize, usize),
    /// All values, all differences or all ranks are equal.
    #[error("the data do not vary")]
    NoVariation,
    /// An argument is out of its range.
    #[error("{0}")]
    Argument(&'static str),
    /// A result is too large for a floating-point number.
    #[error("a result overflows")]
    Overflow,
    /// Two groups of items were never compared with each other.
    #[error("items {items:?} were never compared with the other items")]
    Disconnected {
        /// Indices of the items that no chain of comparisons links to item 0.
        items: Vec<usize>,
    },
    /// No finite estimate exists: some items never lost to the others, or never won against them.
    #[error("no finite estimate: items {unbeaten:?} never lost to the others, {winless:?} never won")]
    Unbounded {
        /// Indices of the items in groups that never lost to an item outside.
        unbeaten: Vec<usize>,
        /// Indices of the items in groups that never won against an item outside.
        winless: Vec<usize>,
    },
    /// The iteration did not converge.
    #[error("the estimate did not converge")]
    NoConvergence,
}

/// Finite numbers of a slice, and how many others there are.
fn finite(x: &[f64]) -> (Vec<f64>, usize) {
    let kept: Vec<f64> = x.iter().copied().filter(|v| v.is_finite()).collect();
    let excluded = x.len() - kept.len();
    (kept, excluded)
}
