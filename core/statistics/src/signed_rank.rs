//! Wilcoxon's signed-rank test.

use std::fmt;

use crate::ranks::midranks;
use crate::special::normal_tail;
use crate::{Alternative, Error, Outcome, Variant, finite};

/// Largest sample of the exact methods: their tables grow with its square.
const MOST: usize = 500;

/// Treatment of zero differences.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Zeros {
    /// Drops zeros before ranking (Wilcoxon 1945). SciPy: `wilcox`.
    Drop,
    /// Ranks zeros too, then drops their ranks (Pratt 1959; Cureton 1967). SciPy: `pratt`.
    Pratt,
    /// Ranks zeros too and gives half of their ranks to each side. SciPy: `zsplit`.
    Split,
}

impl fmt::Display for Zeros {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Self::Drop => "zeros dropped",
            Self::Pratt => "zeros by Pratt",
            Self::Split => "zeros split",
        })
    }
}

/// Method for the p-value of the signed-rank test.
///
/// In [`Zeros::Pratt`] and [`Zeros::Split`], [`Self::Exact`] takes n with the zeros, as SciPy does.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Method {
    /// Chooses as SciPy 1.17.1 does. Above 50 differences: [`Self::Normal`]. Else, without ties or zeros:
    /// [`Self::Exact`]. Else, up to 13 differences: [`Self::ExactWithTies`]. Else [`Self::Normal`].
    Auto {
        /// Continuity correction, if the choice is [`Self::Normal`].
        corrected: bool,
    },
    /// Null distribution of untied ranks, for at most 500 differences. With ties it is an approximation:
    /// a fractional rank sum is rounded so that p grows.
    Exact,
    /// Null distribution of the midranks of the sample, for at most 500 differences.
    /// It is exact with ties and zeros, and equals the enumeration of all signs.
    ExactWithTies,
    /// Normal approximation with the variance for ties.
    Normal {
        /// Moves the rank sum by 0.5 towards its mean.
        corrected: bool,
    },
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Self::Auto { .. } => "automatic",
            Self::Exact => "exact for untied ranks",
            Self::ExactWithTies => "exact with ties",
            Self::Normal { corrected: true } => "normal approximation with continuity correction",
            Self::Normal { corrected: false } => "normal approximation",
        })
    }
}

/// Differences x - y of pairs. Both slices have the same length.
///
/// A pair that holds a number that is not finite gives a NaN, which [`wilcoxon`] leaves out.
pub fn differences(x: &[f64], y: &[f64]) -> Result<Vec<f64>, Error> {
    if x.len() != y.len() {
        return Err(Error::Lengths(x.len(), y.len()));
    }
    let difference = |(a, b): (&f64, &f64)| if a.is_finite() && b.is_finite() { a - b } else { f64::NAN };
    Ok(x.iter().zip(y).map(difference).collect())
}

/// Signed-rank test that differences are symmetric about 0 (Wilcoxon 1945).
///
/// It needs at least one difference that is finite and not 0. [`Alternative::Greater`] means that the
/// differences tend to be positive. The methods agree with SciPy 1.17.1, also where that is a convention:
/// a two-sided correction of a deviation below 0.5 overshoots the mean.
pub fn wilcoxon(
    differences: &[f64],
    alternative: Alternative,
    zeros: Zeros,
    method: Method,
) -> Result<Outcome, Error> {
    let (mut d, _) = finite(differences);
    let all = d.len();
    if all == 0 {
        return Err(Error::TooFew { n: 0, least: 1 });
    }
    let zero_count = d.iter().filter(|&&v| v == 0.0).count();
    if zero_count == all {
        return Err(Error::NoVariation);
    }
    if zeros == Zeros::Drop {
        d.retain(|&v| v != 0.0);
    }
    let n = d.len();
    let ranks = midranks(&d.iter().map(|v| v.abs()).collect::<Vec<_>>());
    let sum_where = |keep: fn(f64) -> bool| -> f64 {
        d.iter().zip(&ranks).filter(|(v, _)| keep(**v)).map(|(_, r)| r).sum()
    };
    let positive = sum_where(|v| v > 0.0);
    let split = if zeros == Zeros::Split { sum_where(|v| v == 0.0) / 2.0 } else { 0.0 };
    let plus = positive + split;
    let minus = sum_where(|v| v < 0.0) + split;

    // Untied ranks are all different. Sorted, they are 1 to n.
    let mut sorted = ranks.clone();
    sorted.sort_by(f64::total_cmp);
    let tied = sorted.windows(2).any(|w| w[0] == w[1]);
    let method = match method {
        Method::Auto { corrected } if all > 50 => Method::Normal { corrected },
        Method::Auto { .. } if !tied && zero_count == 0 => Method::Exact,
        Method::Auto { .. } if all <= 13 => Method::ExactWithTies,
        Method::Auto { corrected } => Method::Normal { corrected },
        method => method,
    };
    if matches!(method, Method::Exact | Method::ExactWithTies) && n > MOST {
        return Err(Error::TooMany { n, most: MOST });
    }

    let p = match method {
        Method::Exact => {
            let mass = sum_masses(1..=n);
            alternative
                .p(mass[..=plus.ceil() as usize].iter().sum(), mass[plus.floor() as usize..].iter().sum())
        }
        Method::ExactWithTies => {
            let moving = d.iter().zip(&ranks).filter(|(v, _)| **v != 0.0);
            let mass = sum_masses(moving.map(|(_, r)| (2.0 * r) as usize));
            let observed = (2.0 * positive) as usize;
            alternative.p(mass[..=observed].iter().sum(), mass[observed..].iter().sum())
        }
        Method::Auto { corrected } | Method::Normal { corrected } => {
            let moving = d.iter().zip(&ranks).filter(|(v, _)| zeros == Zeros::Split || **v != 0.0);
            let variance = moving.map(|(_, r)| r * r).sum::<f64>() / 4.0;
            let deviation = plus - (plus + minus) / 2.0;
            let shift = if corrected { 0.5 } else { 0.0 };
            let z = |deviation: f64| deviation / variance.sqrt();
            match alternative {
                Alternative::Less => normal_tail(-z(deviation + shift)),
                Alternative::Greater => normal_tail(z(deviation - shift)),
                Alternative::TwoSided if deviation == 0.0 => 1.0,
                Alternative::TwoSided => 2.0 * normal_tail(z(deviation.abs() - shift).abs()),
            }
        }
    };
    Ok(Outcome {
        n,
        excluded: differences.len() - n,
        statistic: if alternative == Alternative::TwoSided { plus.min(minus) } else { plus },
        p,
        variant: Variant::SignedRank { alternative, zeros, method },
    })
}

/// Probabilities of the sums 0, 1, 2, ... of weights that each enter with probability one half.
fn sum_masses(weights: impl Iterator<Item = usize>) -> Vec<f64> {
    weights.fold(vec![1.0], |mass, weight| {
        let mut next = vec![0.0; mass.len() + weight];
        for (sum, p) in mass.iter().enumerate() {
            next[sum] += p / 2.0;
            next[sum + weight] += p / 2.0;
        }
        next
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use asperity_numbers::Random;

    #[test]
    fn exact_with_ties_equals_enumeration() {
        let mut random = Random::new(5);
        for round in 0..200 {
            let n = 1 + round % 12;
            let d: Vec<f64> = (0..n).map(|_| random.below(9) as f64 - 4.0).collect();
            if d.iter().all(|&v| v == 0.0) {
                continue;
            }
            for zeros in [Zeros::Drop, Zeros::Pratt, Zeros::Split] {
                let p = |d: &[f64]| wilcoxon(d, Alternative::Greater, zeros, Method::ExactWithTies).unwrap();
                let observed = p(&d);
                let signs = 0..1u32 << n;
                let flip = |signs: u32| -> Vec<f64> {
                    d.iter().enumerate().map(|(i, v)| if signs >> i & 1 == 1 { -v } else { *v }).collect()
                };
                let reached = signs.clone().filter(|&s| p(&flip(s)).statistic >= observed.statistic).count();
                assert!((observed.p - reached as f64 / signs.len() as f64).abs() < 1e-14, "{d:?} {zeros}");
            }
        }
    }
}
