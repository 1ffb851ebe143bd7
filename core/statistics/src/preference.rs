//! The Bradley-Terry model of paired comparisons.

use std::fmt;

use crate::special::{chi_square_tail, two_sided_quantile};
use crate::{Error, Interval, Outcome, Variant};

/// Largest number of items, and of wins in a cell.
const MOST: usize = 200;
const MOST_WINS: f64 = 1e9;

/// Estimator of abilities.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Estimator {
    /// Maximum likelihood.
    MaximumLikelihood,
    /// Maximum likelihood after half a win is added for both items of every pair.
    ///
    /// It is finite for all designs and pulls the abilities together. Its intervals hold only approximately.
    /// For two items it is the estimate of Haldane (1956) and Firth (1993).
    Penalised,
}

impl fmt::Display for Estimator {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Self::MaximumLikelihood => "maximum likelihood",
            Self::Penalised => "penalised with half a win for each item of a pair",
        })
    }
}

/// Fitted model: item i wins against item j with probability 1 / (1 + exp(ability j - ability i)).
#[derive(Clone, Debug, PartialEq)]
pub struct BradleyTerry {
    /// Abilities on the log scale. Their sum is 0.
    pub abilities: Vec<f64>,
    /// Covariance of the abilities: pseudo-inverse of the observed information, items x items.
    pub covariance: Vec<Vec<f64>>,
    /// Test that all abilities are equal. n counts comparisons, half wins rounded.
    /// It includes the half wins of [`Estimator::Penalised`] in the statistic, but not in n.
    pub equality: Outcome,
    /// Estimator of the abilities.
    pub estimator: Estimator,
}

impl BradleyTerry {
    /// Standard error of an item's ability against the mean of all. None if there is no such item.
    pub fn error(&self, item: usize) -> Option<f64> {
        self.covariance.get(item).map(|row| row[item].max(0.0).sqrt())
    }

    /// Wald interval of an item's ability against the mean of all. `confidence` lies between 0 and 1.
    pub fn ability(&self, item: usize, confidence: f64) -> Result<Interval, Error> {
        let error = self.error(item).ok_or(NO_ITEM)?;
        wald(self.abilities[item], error, confidence)
    }

    /// Wald interval of ability `a` minus ability `b`. `confidence` lies between 0 and 1.
    pub fn difference(&self, a: usize, b: usize, confidence: f64) -> Result<Interval, Error> {
        if a.max(b) >= self.abilities.len() {
            return Err(NO_ITEM);
        }
        let c = &self.covariance;
        let variance: f64 = c[a][a] + c[b][b] - 2.0 * c[a][b];
        wald(self.abilities[a] - self.abilities[b], variance.max(0.0).sqrt(), confidence)
    }
}

const NO_ITEM: Error = Error::Argument("there is no such item");

fn wald(estimate: f64, error: f64, confidence: f64) -> Result<Interval, Error> {
    let half = two_sided_quantile(confidence)? * error;
    Ok(Interval { estimate, low: estimate - half, high: estimate + half })
}

/// Fits the Bradley-Terry model (Bradley and Terry 1952) by Newton's method.
///
/// `wins` is square with 2 to 200 items: cell (i, j) holds how often i won against j, 0 to 1e9. The diagonal
/// is ignored. Count a tie as half a win for both items. Maximum likelihood is finite if and only if a chain
/// of wins leads from each item to each other (Ford 1957). Else the error names the items.
pub fn bradley_terry<R: AsRef<[f64]>>(wins: &[R], estimator: Estimator) -> Result<BradleyTerry, Error> {
    let items = wins.len();
    if items < 2 {
        return Err(Error::TooFew { n: items, least: 2 });
    }
    if items > MOST {
        return Err(Error::TooMany { n: items, most: MOST });
    }
    let extra = if estimator == Estimator::Penalised { 0.5 } else { 0.0 };
    let mut comparisons = 0.0;
    let mut counts = vec![vec![0.0; items]; items];
    for (i, row) in wins.iter().map(AsRef::as_ref).enumerate() {
        if row.len() != items {
            return Err(Error::Lengths(items, row.len()));
        }
        for j in (0..items).filter(|&j| j != i) {
            if !(0.0..=MOST_WINS).contains(&row[j]) {
                return Err(Error::Argument("wins must be 0 to 1e9"));
            }
            comparisons += row[j];
            counts[i][j] = row[j] + extra;
        }
    }
    let wins = counts;
    if estimator == Estimator::MaximumLikelihood {
        check_design(&wins)?;
    }

    let mut abilities = vec![0.0; items];
    let even = likelihood(&wins, &abilities);
    let mut best = even;
    for _ in 0..200 {
        let (slope, covariance) = derivatives(&wins, &abilities).ok_or(Error::NoConvergence)?;
        let step: Vec<f64> = covariance.iter().map(|row| dot(row, &slope)).collect();
        let length = step.iter().fold(0.0, |m: f64, s| m.max(s.abs()));
        if length < 1e-12 {
            let statistic = (2.0 * (best - even)).max(0.0);
            let freedom = (items - 1) as f64;
            let equality = Outcome {
                n: comparisons.round() as usize,
                excluded: 0,
                statistic,
                p: chi_square_tail(statistic, freedom),
                variant: Variant::EqualAbilities { freedom, estimator },
            };
            return Ok(BradleyTerry { abilities, covariance, equality, estimator });
        }
        // The likelihood is concave, so a short enough step raises it. Rounding may hide a tiny rise.
        let mut scale = 1.0;
        loop {
            let next: Vec<f64> = abilities.iter().zip(&step).map(|(a, s)| a + scale * s).collect();
            let reached = likelihood(&wins, &next);
            if reached >= best || (length < 1e-4 && scale == 1.0) {
                (abilities, best) = (next, reached);
                break;
            }
            scale /= 2.0;
            if scale < 1e-9 {
                return Err(Error::NoConvergence);
            }
        }
    }
    Err(Error::NoConvergence)
}

/// Checks Ford's condition by the transitive closure of "i won against j".
fn check_design(wins: &[Vec<f64>]) -> Result<(), Error> {
    let items = wins.len();
    let closure = |edge: &dyn Fn(usize, usize) -> bool| {
        let mut reach: Vec<Vec<bool>> =
            (0..items).map(|i| (0..items).map(|j| i == j || edge(i, j)).collect()).collect();
        for via in 0..items {
            for i in 0..items {
                for j in 0..items {
                    reach[i][j] |= reach[i][via] && reach[via][j];
                }
            }
        }
        reach
    };
    let select = |keep: &dyn Fn(usize) -> bool| (0..items).filter(|&i| keep(i)).collect::<Vec<_>>();

    let linked = closure(&|i, j| wins[i][j] + wins[j][i] > 0.0);
    let items_apart = select(&|i| !linked[0][i]);
    if !items_apart.is_empty() {
        return Err(Error::Disconnected { items: items_apart });
    }
    let beats = closure(&|i, j| wins[i][j] > 0.0);
    if beats.iter().flatten().all(|&b| b) {
        return Ok(());
    }
    Err(Error::Unbounded {
        unbeaten: select(&|i| (0..items).all(|j| !beats[j][i] || beats[i][j])),
        winless: select(&|i| (0..items).all(|j| !beats[i][j] || beats[j][i])),
    })
}

/// Log likelihood.
fn likelihood(wins: &[Vec<f64>], abilities: &[f64]) -> f64 {
    let log_logistic = |d: f64| d.min(0.0) - (-d.abs()).exp().ln_1p();
    let cell = |i: usize, j: usize| wins[i][j] * log_logistic(abilities[i] - abilities[j]);
    (0..wins.len()).map(|i| (0..wins.len()).map(|j| cell(i, j)).sum::<f64>()).sum()
}

/// Gradient of the log likelihood, and pseudo-inverse of the observed information.
fn derivatives(wins: &[Vec<f64>], abilities: &[f64]) -> Option<(Vec<f64>, Vec<Vec<f64>>)> {
    let items = wins.len();
    let mut slope = vec![0.0; items];
    let mut information = vec![vec![0.0; items]; items];
    for i in 0..items {
        for j in (0..items).filter(|&j| j != i) {
            // Both probabilities keep their digits near 0, so no 1 - p.
            let d = abilities[i] - abilities[j];
            let (win, loss) = (1.0 / (1.0 + (-d).exp()), 1.0 / (1.0 + d.exp()));
            let weight = (wins[i][j] + wins[j][i]) * win * loss;
            slope[i] += wins[i][j] * loss - wins[j][i] * win;
            information[i][i] += weight;
            information[i][j] -= weight;
        }
    }
    // The information L is a graph's Laplacian: its null space is the constant vectors. So the pseudo-inverse
    // is (L + c J)^-1 - J / (c items^2), with J all ones. This c puts the added eigenvalue at the mean.
    let trace: f64 = (0..items).map(|i| information[i][i]).sum();
    let c = trace / (items * items) as f64;
    information.iter_mut().flatten().for_each(|v| *v += c);
    let mut covariance = inverse(information)?;
    covariance.iter_mut().flatten().for_each(|v| *v -= 1.0 / trace);
    Some((slope, covariance))
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// Inverse of a positive definite matrix by Gauss-Jordan elimination, in place. None if it is singular.
fn inverse(mut m: Vec<Vec<f64>>) -> Option<Vec<Vec<f64>>> {
    for k in 0..m.len() {
        let pivot = std::mem::replace(&mut m[k][k], 1.0);
        if !(pivot > 0.0 && (1.0 / pivot).is_finite()) {
            return None;
        }
        m[k].iter_mut().for_each(|v| *v /= pivot);
        let row = m[k].clone();
        for other in (0..m.len()).filter(|&i| i != k) {
            let factor = std::mem::replace(&mut m[other][k], 0.0);
            m[other].iter_mut().zip(&row).for_each(|(v, r)| *v -= factor * r);
        }
    }
    m.iter().flatten().all(|v| v.is_finite()).then_some(m)
}
