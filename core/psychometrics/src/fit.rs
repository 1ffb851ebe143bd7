//! The method of constant stimuli.

use asperity_numbers::Elementary;
use serde::{Deserialize, Serialize};

use crate::{Axis, Function, Shape, require, root};

const IMPOSSIBLE: &str =
    "a correct answer to a level of 0 is a guess: use a `guess` above 0, for instance 0.5";
const NO_SLOPE: &str = "the answers fix no slope: use more levels with both correct and wrong answers, and \
                        with more correct answers at higher levels";

/// Answers at one level.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Row {
    /// Level of the stimulus.
    pub level: f64,
    /// Number of correct answers, or of "more" answers of a comparison.
    pub correct: u32,
    /// Number of all answers, 1 or more.
    pub total: u32,
}

/// Settings of a [`fit()`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FitSettings {
    /// Shape of the psychometric function.
    pub shape: Shape,
    /// Unit of levels.
    pub axis: Axis,
    /// Guess rate, 0 or more and less than 1: 1/n with n alternatives, 0 for a comparison.
    pub guess: f64,
    /// Least lapse rate, 0 or more.
    #[serde(default)]
    pub lapse: f64,
    /// Greatest lapse rate; None: the lapse rate is `lapse`, and is not fitted.
    #[serde(default)]
    pub lapse_up_to: Option<f64>,
    /// Probability that an interval holds the true value, 0.5 to 0.999.
    #[serde(default = "usual")]
    pub confidence: f64,
}

fn usual() -> f64 {
    0.95
}

impl Default for FitSettings {
    /// A cumulative Gaussian function of a comparison: neither guesses nor lapses.
    fn default() -> Self {
        let (shape, axis) = (Shape::Gaussian, Axis::Linear);
        Self { shape, axis, guess: 0.0, lapse: 0.0, lapse_up_to: None, confidence: usual() }
    }
}

/// A confidence interval. None at an end: the data set no bound there.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    /// Lower end.
    pub low: Option<f64>,
    /// Upper end.
    pub high: Option<f64>,
}

/// A fitted psychometric function.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fit {
    /// The most likely function.
    pub function: Function,
    /// Confidence interval of the threshold, by profile likelihood.
    pub threshold: Interval,
    /// Confidence interval of the slope, by profile likelihood.
    pub slope: Interval,
    /// Natural logarithm of the likelihood of the answers in their order, 0 or less.
    pub log_likelihood: f64,
    /// Twice the logarithm of the likelihood ratio to a function through all rates (Wichmann and Hill 2001).
    pub deviance: f64,
    /// Degrees of freedom: levels less fitted parameters.
    pub degrees: u32,
    /// Probability of a greater deviance if the function is true, from the chi-square distribution; None
    /// without degrees of freedom. With few answers a level it is rough.
    pub p_value: Option<f64>,
}

/// Rows and settings of a fit. Parameters are the coordinate of the threshold, the natural logarithm of the
/// slope, and the lapse rate.
struct Problem {
    settings: FitSettings,
    /// Coordinate, correct and wrong answers.
    rows: Vec<[f64; 3]>,
    /// Middle and range of the coordinates.
    middle: f64,
    range: f64,
    low: [f64; 3],
    high: [f64; 3],
}

/// A point of the search.
#[derive(Clone, Copy)]
struct Point {
    at: [f64; 3],
    log_likelihood: f64,
}

/// Fits a psychometric function to counts of the method of constant stimuli, by maximum likelihood.
///
/// Rows with equal levels are added. The likelihood is that of Wichmann and Hill (2001). The search starts at
/// the best point of a grid, and climbs by damped Fisher scoring. A confidence interval ends where twice the
/// drop of the profile's log-likelihood reaches the chi-square quantile (Venzon and Moolgavkar 1988).
///
/// An error names the setting or row that does not fit, or says why the answers fix no function.
pub fn fit(rows: &[Row], settings: &FitSettings) -> Result<Fit, String> {
    let problem = Problem::new(rows, settings)?;
    let best = problem.search(problem.start(), [true; 3]);
    let FitSettings { shape, axis, guess, lapse_up_to, .. } = *settings;
    let exp = Elementary::exp_e;
    let level = |coordinate| shape.level(axis, coordinate);
    let [threshold, slope, lapse] = [level(best.at[0]), exp(best.at[1]), best.at[2]];
    let function = Function { shape, axis, threshold, slope, guess, lapse };
    if !best.log_likelihood.is_finite() {
        return Err(IMPOSSIBLE.to_owned());
    }
    let edges = [problem.low[1], problem.high[1]].map(|slope| problem.profile(best, 1, slope));
    if edges.iter().any(|edge| *edge > best.log_likelihood - 1e-6) || function.check().is_err() {
        return Err(NO_SLOPE.to_owned());
    }
    let degrees = problem.rows.len().saturating_sub(2 + usize::from(lapse_up_to.is_some()));
    let term = |count: f64, of: f64| if count > 0.0 { count * (count / of).log_e() } else { 0.0 };
    let saturated: f64 = problem.rows.iter().map(|[_, k, m]| term(*k, k + m) + term(*m, k + m)).sum();
    let deviance = (2.0 * (saturated - best.log_likelihood)).max(0.0);
    Ok(Fit {
        function,
        threshold: problem.interval(best, 0, level),
        slope: problem.interval(best, 1, exp),
        log_likelihood: best.log_likelihood,
        deviance,
        degrees: degrees as u32,
        p_value: (degrees > 0).then(|| chi_square_above(deviance, degrees)),
    })
}

impl Problem {
    fn new(rows: &[Row], settings: &FitSettings) -> Result<Self, String> {
        let FitSettings { shape, axis, guess, lapse, lapse_up_to, confidence } = *settings;
        let lapse_most = lapse_up_to.unwrap_or(lapse);
        Function { shape, axis, threshold: 1.0, slope: 1.0, guess, lapse }.check()?;
        let above = lapse_up_to.is_none_or(|most| most > lapse) && guess + lapse_most < 1.0;
        require(above, "lapse_up_to", lapse_most, &format!("None, or more than {lapse}, for instance 0.06"))?;
        require((0.5..=0.999).contains(&confidence), "confidence", confidence, "0.5 to 0.999, as 0.95")?;
        let mut merged: Vec<[f64; 3]> = Vec::new();
        let mut sorted = rows.to_vec();
        sorted.sort_by(|a, b| a.level.total_cmp(&b.level));
        for Row { level, correct, total } in sorted {
            require(level.abs() <= 1e100, "level", level, "a number from -1e100 to 1e100")?;
            require(total > 0, "total", total, "1 or more, or leave the row out")?;
            require(correct <= total, "correct", correct, &format!("0 to {total}, the row's `total`"))?;
            let at = shape.coordinate(axis, level);
            let counts = [f64::from(correct), f64::from(total - correct)];
            match merged.last_mut() {
                Some(last) if last[0] == at => {
                    (last[1], last[2]) = (last[1] + counts[0], last[2] + counts[1])
                }
                _ => merged.push([at, counts[0], counts[1]]),
            }
        }
        let finite: Vec<f64> = merged.iter().map(|r| r[0]).filter(|u| u.is_finite()).collect();
        let (Some(first), Some(last), 2..) = (finite.first(), finite.last(), finite.len()) else {
            return Err("`rows` have fewer than two levels: use at least two, better five or more".to_owned());
        };
        let range = last - first;
        let gap = finite.windows(2).map(|w| w[1] - w[0]).fold(range, f64::min);
        Ok(Self {
            settings: *settings,
            middle: first + range / 2.0,
            range,
            low: [first - 1e3 * range, (0.01 / range).log_e(), lapse],
            high: [last + 1e3 * range, (100.0 / gap).log_e(), lapse_most],
            rows: merged,
        })
    }

    /// Likelihood with its first derivatives and Fisher's information.
    fn evaluate(&self, at: [f64; 3]) -> (f64, [f64; 3], [[f64; 3]; 3]) {
        let [threshold, log_slope, lapse] = at;
        let (slope, span) = (log_slope.exp_e(), 1.0 - self.settings.guess - lapse);
        let (mut sum, mut score, mut information) = (0.0, [0.0; 3], [[0.0; 3]; 3]);
        // A floor keeps quotients finite where a probability is too small for a number.
        let over = |a: f64, b: f64| if a > 0.0 { a / b.max(1e-200) } else { 0.0 };
        let term = |count: f64, p: f64| if count > 0.0 { count * p.log_e() } else { 0.0 };
        for &[u, correct, wrong] in &self.rows {
            let z = slope * (u - threshold);
            let [f, rest] = self.settings.shape.distribution(z);
            let (p, q) = (self.settings.guess + span * f, lapse + span * rest);
            sum += term(correct, p) + term(wrong, q);
            let density = span * self.settings.shape.density(z);
            let by = [-slope * density, if density > 0.0 { z * density } else { 0.0 }, -f];
            let residual = over(correct, p) - over(wrong, q);
            for i in 0..3 {
                score[i] += residual * by[i];
                for j in 0..3 {
                    information[i][j] += over(correct + wrong, p * q) * by[i] * by[j];
                }
            }
        }
        (sum, score, information)
    }

    fn point(&self, at: [f64; 3]) -> Point {
        Point { at, log_likelihood: self.evaluate(at).0 }
    }

    /// Best point of a grid.
    fn start(&self) -> Point {
        let [low, high] = [self.low, self.high];
        let mut best = Point { at: low, log_likelihood: f64::NEG_INFINITY };
        for t in -20..=20 {
            for s in 0..10 {
                for lapse in [low[2], (low[2] + high[2]) / 2.0] {
                    let threshold = self.middle + self.range * f64::from(t) * 0.075;
                    let point = self.point([threshold, (f64::from(1 << s) / self.range).log_e(), lapse]);
                    if point.log_likelihood > best.log_likelihood {
                        best = point;
                    }
                }
            }
        }
        best
    }

    /// Climbs to the most likely point within the bounds, along the free parameters, by Fisher scoring with
    /// damping (Marquardt 1963).
    fn search(&self, start: Point, free: [bool; 3]) -> Point {
        let mut point = start;
        let mut damping = 1e-3;
        for _ in 0..500 {
            let (_, score, information) = self.evaluate(point.at);
            // A parameter at a bound rests there while the likelihood rises beyond it.
            let moves: [bool; 3] = std::array::from_fn(|i| {
                let edge = if score[i] > 0.0 { self.high[i] } else { self.low[i] };
                free[i] && point.at[i] != edge
            });
            let Some(step) = solve(information, score, moves, damping) else { return point };
            let at = std::array::from_fn(|i| (point.at[i] + step[i]).clamp(self.low[i], self.high[i]));
            let next = self.point(at);
            // Close to the top the likelihood no longer shows a rise.
            let slack = 1e-13 * point.log_likelihood.abs();
            if next.log_likelihood >= point.log_likelihood - slack {
                let far = (0..3).any(|i| (at[i] - point.at[i]).abs() > 1e-11 * (1.0 + at[i].abs()));
                (point, damping) = (next, damping * 0.1);
                if !far {
                    break;
                }
            } else {
                damping = (damping * 10.0).max(1e-6);
            }
        }
        point
    }

    /// Logarithm of the greatest likelihood with one parameter fixed.
    ///
    /// The threshold of another slope starts where some level keeps its rate.
    fn profile(&self, best: Point, parameter: usize, value: f64) -> f64 {
        let mut at = best.at;
        at[parameter] = value;
        let ratio = (best.at[1] - at[1]).exp_e();
        let kept = self.rows.iter().map(|[u, ..]| u - (u - at[0]) * ratio).filter(|t| t.is_finite());
        let starts = kept.map(|t| self.point([t.clamp(self.low[0], self.high[0]), at[1], at[2]]));
        let better = |a: Point, b: Point| if b.log_likelihood > a.log_likelihood { b } else { a };
        let start = starts.fold(self.point(at), better);
        self.search(start, std::array::from_fn(|i| i != parameter)).log_likelihood
    }

    /// Confidence interval of a parameter: `of` is its value in the unit of the function.
    fn interval(&self, best: Point, parameter: usize, of: impl Fn(f64) -> f64) -> Interval {
        let z = Shape::Gaussian.quantile(0.5 + self.settings.confidence / 2.0);
        let excess = |value: f64| 2.0 * (best.log_likelihood - self.profile(best, parameter, value)) - z * z;
        let end = |bound: f64| {
            let near = best.at[parameter];
            let part = |share: f64| near + (bound - near) * share;
            let outside =
                (0..=20).map(|i| f64::from(1 << i) / f64::from(1 << 20)).find(|s| excess(part(*s)) > 0.0)?;
            Some(of(part(root(0.0, outside, |share| excess(part(share))))))
        };
        Interval { low: end(self.low[parameter]), high: end(self.high[parameter]) }
    }
}

/// Step of damped Fisher scoring along some parameters; None if the information is singular.
fn solve(mut a: [[f64; 3]; 3], mut b: [f64; 3], moves: [bool; 3], damping: f64) -> Option<[f64; 3]> {
    for i in 0..3 {
        a[i][i] *= 1.0 + damping;
        if !moves[i] {
            (0..3).for_each(|j| (a[i][j], a[j][i]) = (0.0, 0.0));
            (a[i][i], b[i]) = (1.0, 0.0);
        }
    }
    for i in 0..3 {
        if !(a[i][i].is_finite() && a[i][i] > 0.0) {
            return None;
        }
        for j in i + 1..3 {
            let factor = a[j][i] / a[i][i];
            (i..3).for_each(|k| a[j][k] -= factor * a[i][k]);
            b[j] -= factor * b[i];
        }
    }
    for i in (0..3).rev() {
        b[i] = (b[i] - (i + 1..3).map(|k| a[i][k] * b[k]).sum::<f64>()) / a[i][i];
    }
    b.iter().all(|b| b.is_finite()).then_some(b)
}

/// Probability that a chi-square variable exceeds `x`, with 1 or more degrees of freedom (Abramowitz and
/// Stegun 1964, 26.4.4 and 26.4.5).
fn chi_square_above(x: f64, degrees: usize) -> f64 {
    let half = x / 2.0;
    if half <= 0.0 {
        return 1.0;
    }
    let (first, start) = if degrees.is_multiple_of(2) { (0.0, 0.0) } else { (libm::erfc(half.sqrt()), 0.5) };
    let term = |i: usize| {
        let a = start + i as f64;
        (a * half.log_e() - half - libm::lgamma(a + 1.0)).exp_e()
    };
    (first + (0..degrees / 2).map(term).sum::<f64>()).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SETTINGS: FitSettings = FitSettings {
        shape: Shape::Logistic,
        axis: Axis::Linear,
        guess: 0.0,
        lapse: 0.0,
        lapse_up_to: None,
        confidence: 0.95,
    };

    fn rows(counts: &[(f64, u32, u32)]) -> Vec<Row> {
        counts.iter().map(|&(level, correct, total)| Row { level, correct, total }).collect()
    }

    #[test]
    fn answers_without_slope_are_refused() {
        let none: [&[(f64, u32, u32)]; 6] = [
            &[(1.0, 0, 9), (2.0, 0, 9), (3.0, 9, 9), (4.0, 9, 9)],
            &[(1.0, 0, 9), (2.0, 4, 9), (3.0, 9, 9)],
            &[(1.0, 9, 9), (2.0, 9, 9)],
            &[(1.0, 0, 9), (2.0, 0, 9)],
            &[(1.0, 9, 9), (2.0, 5, 9), (3.0, 0, 9)],
            &[(1.0, 5, 9), (2.0, 5, 9), (3.0, 5, 9)],
        ];
        for shape in [Shape::Weibull, Shape::Logistic, Shape::Gaussian] {
            for guess in [0.0, 0.5] {
                for data in none {
                    let fitted = fit(&rows(data), &FitSettings { shape, guess, ..SETTINGS });
                    assert!(fitted.is_err_and(|e| e.contains("no slope")), "{shape:?} {guess} {data:?}");
                }
            }
        }
    }

    #[test]
    fn bad_row_or_setting_is_named() {
        let good = rows(&[(1.0, 2, 9), (2.0, 7, 9)]);
        let error = |rows: &[Row], settings| fit(rows, &settings).unwrap_err();
        assert!(error(&rows(&[(1.0, 10, 9)]), SETTINGS).starts_with("`correct` is 10: use 0 to 9"));
        assert!(error(&rows(&[(1.0, 0, 0)]), SETTINGS).starts_with("`total`"));
        assert!(error(&rows(&[(f64::NAN, 0, 1)]), SETTINGS).starts_with("`level`"));
        assert!(error(&[], SETTINGS).starts_with("`rows`"));
        assert!(error(&good, FitSettings { guess: 2.0, ..SETTINGS }).starts_with("`guess`"));
        assert!(
            error(&good, FitSettings { lapse_up_to: Some(0.0), ..SETTINGS }).starts_with("`lapse_up_to`")
        );
        assert!(error(&good, FitSettings { confidence: 1.0, ..SETTINGS }).starts_with("`confidence`"));
        assert!(fit(&good, &SETTINGS).is_ok());
    }

    #[test]
    fn rows_at_one_level_add_up() {
        let apart = rows(&[(2.0, 4, 5), (1.0, 1, 4), (2.0, 3, 4), (1.0, 1, 5), (3.0, 8, 9)]);
        let together = rows(&[(1.0, 2, 9), (2.0, 7, 9), (3.0, 8, 9)]);
        assert_eq!(fit(&apart, &SETTINGS), fit(&together, &SETTINGS));
    }
}
