//! Effect sizes of paired comparisons.

use crate::ranks::midranks;
use crate::signed_rank::differences;
use crate::{Error, finite};

/// Size of an effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effect {
    /// Size of the effect.
    pub size: f64,
    /// Number of pairs that entered.
    pub n: usize,
    /// Number of pairs left out.
    pub excluded: usize,
}

/// Common language effect size: the probability that a value of `x` exceeds one of `y`, 0 to 1.
///
/// It compares all n x n pairs of values, not only those of one person. A tie counts one half
/// (McGraw and Wong 1992; Vargha and Delaney 2000). Pingouin reports it for `wilcoxon`. For the alternative
/// "less" Pingouin reports 1 - size. Pairs with a number that is not finite are left out.
pub fn common_language_effect(x: &[f64], y: &[f64]) -> Result<Effect, Error> {
    if x.len() != y.len() {
        return Err(Error::Lengths(x.len(), y.len()));
    }
    let pairs = x.iter().zip(y).filter(|(a, b)| a.is_finite() && b.is_finite());
    let (x_kept, y_kept): (Vec<f64>, Vec<f64>) = pairs.unzip();
    let n = x_kept.len();
    if n == 0 {
        return Err(Error::TooFew { n, least: 1 });
    }
    let score = |a: &f64| y_kept.iter().map(|b| if a > b { 2 } else { usize::from(a == b) }).sum::<usize>();
    let scores: usize = x_kept.iter().map(score).sum();
    Ok(Effect { size: scores as f64 / (2.0 * (n * n) as f64), n, excluded: x.len() - n })
}

/// Matched-pairs rank-biserial correlation, -1 to 1 (Kerby 2014).
///
/// It is the difference of the rank sums of positive and negative differences x - y, over their sum.
/// Zero differences are left out.
pub fn rank_biserial(x: &[f64], y: &[f64]) -> Result<Effect, Error> {
    let (mut d, _) = finite(&differences(x, y)?);
    d.retain(|&v| v != 0.0);
    let n = d.len();
    if n == 0 {
        return Err(Error::TooFew { n, least: 1 });
    }
    let ranks = midranks(&d.iter().map(|v| v.abs()).collect::<Vec<_>>());
    let signed: f64 = d.iter().zip(&ranks).map(|(v, r)| r * v.signum()).sum();
    Ok(Effect { size: signed / ranks.iter().sum::<f64>(), n, excluded: x.len() - n })
}
