//! QUEST+.

use asperity_numbers::Elementary;
use serde::{Deserialize, Serialize};

use crate::{Axis, Function, Log, Shape, require};

/// Most entries of a likelihood table: 64 MiB.
const MOST: usize = 1 << 23;

/// Values of a parameter or of the level.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[serde(rename_all = "snake_case")]
pub enum Grid {
    /// Any finite values, one or more.
    Values {
        /// The values.
        of: Vec<f64>,
    },
    /// Values at equal distances.
    Linear {
        /// First value.
        from: f64,
        /// Last value, above the first.
        to: f64,
        /// Number of values, 2 to 10,000.
        count: u32,
    },
    /// Values at equal ratios.
    Logarithmic {
        /// First value, above 0.
        from: f64,
        /// Last value, above the first.
        to: f64,
        /// Number of values, 2 to 10,000.
        count: u32,
    },
}

/// Settings of a [`Quest`]. Every combination of the parameters' values is equally likely at first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct QuestSettings {
    /// Shape of the psychometric function.
    #[serde(default = "weibull")]
    pub shape: Shape,
    /// Unit of levels.
    #[serde(default = "linear")]
    pub axis: Axis,
    /// Levels that may be presented.
    pub levels: Grid,
    /// Thresholds that are possible.
    pub threshold: Grid,
    /// Slopes that are possible.
    pub slope: Grid,
    /// Guess rates that are possible, usually one: 1/2 by default, one of two.
    #[serde(default = "half")]
    pub guess: Grid,
    /// Lapse rates that are possible: 0.02 by default.
    #[serde(default = "slips")]
    pub lapse: Grid,
    /// Trials after which the method ends, 1 or more.
    pub trials: u32,
    /// Standard deviation of the threshold below which the method ends; None: only `trials` ends it.
    #[serde(default)]
    pub threshold_sd: Option<f64>,
}

fn weibull() -> Shape {
    Shape::Weibull
}

fn linear() -> Axis {
    Axis::Linear
}

fn half() -> Grid {
    Grid::Values { of: vec![0.5] }
}

fn slips() -> Grid {
    Grid::Values { of: vec![0.02] }
}

/// Posterior distribution of one parameter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Marginal {
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub sd: f64,
    /// Value in the most likely combination of all parameters; the first of several.
    pub mode: f64,
}

/// Posterior distribution of all parameters.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Posterior {
    /// Threshold, in the unit of levels.
    pub threshold: Marginal,
    /// Slope.
    pub slope: Marginal,
    /// Guess rate.
    pub guess: Marginal,
    /// Lapse rate.
    pub lapse: Marginal,
    /// Psychometric function with the means.
    pub function: Function,
    /// Entropy over all combinations \[nats\].
    pub entropy: f64,
}

/// The QUEST+ method (Watson 2017): presents the level with the least expected entropy of the posterior.
///
/// With posterior w, probability p of a correct answer and mean p' of p over w, the expected entropy is
/// H(w) - h(p') + mean of h(p) over w. h is the entropy of one answer. Tables of p and h are made once, so a
/// trial costs two products a level and combination. Of equal levels the first is presented.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Log<QuestSettings>", into = "Log<QuestSettings>")]
pub struct Quest {
    settings: QuestSettings,
    answers: Vec<bool>,
    levels: Vec<f64>,
    /// Threshold, slope, guess and lapse of each combination.
    cells: Vec<[f64; 4]>,
    /// Probability of a correct answer for each level and combination.
    correct: Vec<f64>,
    /// Entropy of an answer for each level and combination.
    entropy: Vec<f64>,
    posterior: Vec<f64>,
    /// Index of the next level.
    next: usize,
}

impl Grid {
    /// An error names the field that does not fit, and a value that does.
    fn values(&self, field: &str) -> Result<Vec<f64>, String> {
        let (from, to, count) = match self {
            Self::Values { of: values } => {
                let bad = values.iter().find(|v| !v.is_finite());
                require(bad.is_none(), field, bad.unwrap_or(&0.0), "finite numbers")?;
                require(!values.is_empty(), field, "empty", "for instance values(of: [0.02])")?;
                return Ok(values.clone());
            }
            Self::Linear { from, to, count } | Self::Logarithmic { from, to, count } => (*from, *to, *count),
        };
        let ratios = matches!(self, Self::Logarithmic { .. });
        let good = from.is_finite() && (from > 0.0 || !ratios);
        let fitting = if ratios { "a number above 0, for instance 1" } else { "a finite number" };
        require(good, &format!("{field}.from"), from, fitting)?;
        let good = to > from && (to - from).is_finite();
        require(good, &format!("{field}.to"), to, &format!("a finite number above {from}"))?;
        let good = (2..=10_000).contains(&count);
        require(good, &format!("{field}.count"), count, "2 to 10000, for instance 40")?;
        let (from, to) = if ratios { (from.log_e(), to.log_e()) } else { (from, to) };
        let step = (to - from) / f64::from(count - 1);
        let even = (0..count).map(|i| from + step * f64::from(i));
        Ok(if ratios { even.map(Elementary::exp_e).collect() } else { even.collect() })
    }
}

impl QuestSettings {
    /// Levels that may be presented. An error names what does not fit.
    pub fn levels(&self) -> Result<Vec<f64>, String> {
        self.levels.values("levels")
    }

    /// Thresholds that are possible. An error names what does not fit.
    pub fn thresholds(&self) -> Result<Vec<f64>, String> {
        self.threshold.values("threshold")
    }

    fn function(&self, [threshold, slope, guess, lapse]: [f64; 4]) -> Function {
        Function { shape: self.shape, axis: self.axis, threshold, slope, guess, lapse }
    }
}

impl Quest {
    /// Starts the method. An error names a setting that does not fit, and a value that does.
    pub fn new(settings: QuestSettings) -> Result<Self, String> {
        let QuestSettings { trials, threshold_sd, .. } = settings;
        require(trials > 0, "trials", trials, "1 or more, for instance 100")?;
        let sd = threshold_sd.unwrap_or(1.0);
        require(sd > 0.0, "threshold_sd", sd, "a number above 0, or None")?;
        let levels = settings.levels.values("levels")?;
        let thresholds = settings.threshold.values("threshold")?;
        let slopes = settings.slope.values("slope")?;
        let guesses = settings.guess.values("guess")?;
        let lapses = settings.lapse.values("lapse")?;
        let sizes = [&thresholds, &slopes, &guesses, &lapses].map(Vec::len);
        let n = sizes.iter().fold(1_usize, |n, size| n.saturating_mul(*size));
        let entries = n.saturating_mul(levels.len());
        let many = format!("{} values for each of {n} combinations of the other grids", levels.len());
        require(entries <= MOST, "levels", many, &format!("grids whose sizes multiply to {MOST} or less"))?;
        let mut cells = Vec::with_capacity(n);
        for &t in &thresholds {
            for &s in &slopes {
                for &g in &guesses {
                    cells.extend(lapses.iter().map(|&l| [t, s, g, l]));
                }
            }
        }
        cells.iter().try_for_each(|cell| settings.function(*cell).check())?;
        let mut all: Vec<[f64; 2]> = Vec::with_capacity(entries);
        for level in &levels {
            all.extend(cells.iter().map(|cell| settings.function(*cell).probabilities(*level)));
        }
        let mut quest = Self {
            correct: all.iter().map(|p| p[0]).collect(),
            entropy: all.iter().map(|p| p.iter().map(|p| surprise(*p)).sum()).collect(),
            posterior: vec![1.0 / cells.len() as f64; cells.len()],
            settings,
            answers: Vec::new(),
            levels,
            cells,
            next: 0,
        };
        quest.next = quest.best();
        Ok(quest)
    }

    /// Index of the level with the least expected entropy.
    fn best(&self) -> usize {
        let n = self.cells.len();
        let tables = self.correct.chunks_exact(n).zip(self.entropy.chunks_exact(n));
        let gains = tables.map(|(correct, entropy)| {
            let p = dot(&self.posterior, correct);
            surprise(p) + surprise(1.0 - p) - dot(&self.posterior, entropy)
        });
        let best = |best: (usize, f64), (i, gain): (usize, f64)| if gain > best.1 { (i, gain) } else { best };
        gains.enumerate().fold((0, f64::NEG_INFINITY), best).0
    }

    /// Level of the next trial; None after the last.
    pub fn next_level(&self) -> Option<f64> {
        let more = self.answers.len() < self.settings.trials as usize;
        let sure = more && self.settings.threshold_sd.is_some_and(|sd| self.marginal(0, 0).sd < sd);
        (more && !sure).then(|| self.levels.get(self.next).copied()).flatten()
    }

    /// Probability of a correct answer in the next trial, over all combinations; None after the last.
    pub fn chance(&self) -> Option<f64> {
        self.next_level().map(|_| dot(&self.posterior, self.likelihood()))
    }

    /// Takes the answer of a trial at [`next_level`](Self::next_level). Ignored after the last trial.
    ///
    /// An answer that no combination allows leaves the posterior as it is.
    pub fn answer(&mut self, correct: bool) {
        if self.next_level().is_none() {
            return;
        }
        self.answers.push(correct);
        let likelihood = self.likelihood().iter().map(|p| if correct { *p } else { 1.0 - p });
        let mut posterior: Vec<f64> = self.posterior.iter().zip(likelihood).map(|(w, l)| w * l).collect();
        let sum: f64 = posterior.iter().sum();
        if sum > 0.0 {
            posterior.iter_mut().for_each(|w| *w /= sum);
            self.posterior = posterior;
        }
        self.next = self.best();
    }

    /// Probabilities of a correct answer at the next level.
    fn likelihood(&self) -> &[f64] {
        let n = self.cells.len();
        &self.correct[self.next * n..][..n]
    }

    /// Settings.
    pub fn settings(&self) -> &QuestSettings {
        &self.settings
    }

    /// Answers so far.
    pub fn answers(&self) -> &[bool] {
        &self.answers
    }

    /// Posterior distribution of a parameter, given the most likely combination.
    fn marginal(&self, parameter: usize, mode: usize) -> Marginal {
        let all = || self.posterior.iter().zip(&self.cells).map(|(w, cell)| (w, cell[parameter]));
        let mean: f64 = all().map(|(w, v)| w * v).sum();
        let variance: f64 = all().map(|(w, v)| w * (v - mean) * (v - mean)).sum();
        Marginal { mean, sd: variance.sqrt(), mode: self.cells[mode][parameter] }
    }

    /// Posterior distribution after the answers so far.
    pub fn posterior(&self) -> Posterior {
        let w = &self.posterior;
        let mode = (0..w.len()).fold(0, |best, i| if w[i] > w[best] { i } else { best });
        let [threshold, slope, guess, lapse] = [0, 1, 2, 3].map(|i| self.marginal(i, mode));
        let means = [threshold, slope, guess, lapse].map(|marginal| marginal.mean);
        let function = self.settings.function(means);
        let entropy = w.iter().map(|w| surprise(*w)).sum();
        Posterior { threshold, slope, guess, lapse, function, entropy }
    }
}

/// A probability's part of an entropy \[nats\].
fn surprise(p: f64) -> f64 {
    if p > 0.0 { -p * p.log_e() } else { 0.0 }
}

/// Sum of products, in four sums that the CPU can form at once.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a, b) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest: f64 = a.remainder().iter().zip(b.remainder()).map(|(a, b)| a * b).sum();
    let mut sums = [0.0; 4];
    for (a, b) in a.zip(b) {
        (0..4).for_each(|i| sums[i] += a[i] * b[i]);
    }
    rest + sums.iter().sum::<f64>()
}

impl From<Quest> for Log<QuestSettings> {
    fn from(Quest { settings, answers, .. }: Quest) -> Self {
        Self { settings, answers }
    }
}

impl TryFrom<Log<QuestSettings>> for Quest {
    type Error = String;

    /// Replays a log.
    fn try_from(log: Log<QuestSettings>) -> Result<Self, String> {
        let mut quest = Self::new(log.settings)?;
        log.answers.into_iter().for_each(|correct| quest.answer(correct));
        Ok(quest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = "(
        shape: weibull,
        axis: linear,
        levels: logarithmic(from: 0.1, to: 10, count: 9),
        threshold: linear(from: 1, to: 5, count: 5),
        slope: values(of: [1, 3]),
        guess: values(of: [0.5]),
        lapse: values(of: [0, 0.04]),
        trials: 20,
    )";

    fn settings(text: &str) -> QuestSettings {
        ron::from_str(text).unwrap()
    }

    #[test]
    fn quest_resumes_from_its_log() {
        let mut quest = Quest::new(settings(GOOD)).unwrap();
        for i in 0..6 {
            quest.answer(i % 3 != 1);
            let text = serde_json::to_string(&quest).unwrap();
            assert_eq!(serde_json::from_str::<Quest>(&text).unwrap(), quest);
        }
        assert!(ron::from_str::<QuestSettings>(&GOOD.replace("slope", "slop")).is_err());
    }

    #[test]
    fn quest_ends_when_the_threshold_is_sure() {
        let mut quest = Quest::new(QuestSettings { threshold_sd: Some(1.2), ..settings(GOOD) }).unwrap();
        while let Some(level) = quest.next_level() {
            quest.answer(level > 3.0);
        }
        assert!(quest.answers().len() < 20 && quest.posterior().threshold.sd < 1.2);
        let before = quest.clone();
        quest.answer(true);
        assert_eq!(quest, before);
    }

    #[test]
    fn impossible_answer_leaves_the_posterior() {
        let only = |value: f64| Grid::Values { of: vec![value] };
        let [levels, guess, lapse] = [only(0.0), only(0.0), only(0.0)];
        let mut quest = Quest::new(QuestSettings { levels, guess, lapse, ..settings(GOOD) }).unwrap();
        let before = quest.posterior();
        assert_eq!(quest.chance(), Some(0.0));
        quest.answer(true);
        assert_eq!((quest.posterior(), quest.answers()), (before, &[true][..]));
    }

    #[test]
    fn quest_with_bad_setting_names_it() {
        for (from, to, error) in [
            ("count: 9", "count: 1", "`levels.count` is 1: use 2 to 10000, for instance 40"),
            ("from: 0.1", "from: 0", "`levels.from` is 0: use a number above 0, for instance 1"),
            ("to: 5", "to: 1", "`threshold.to` is 1: use a finite number above 1"),
            ("[1, 3]", "[]", "`slope` is empty: use for instance values(of: [0.02])"),
            ("[1, 3]", "[1, -3]", "`slope` is -3: use a number above 0, for instance 3.5"),
            ("[0, 0.04]", "[0.5]", "`lapse` is 0.5: use 0 or more and less than 1 - `guess`, as 0.02"),
            ("trials: 20", "trials: 0", "`trials` is 0: use 1 or more, for instance 100"),
        ] {
            assert_eq!(Quest::new(settings(&GOOD.replace(from, to))).unwrap_err(), error);
        }
        let huge = GOOD
            .replace("count: 9", "count: 99")
            .replace("count: 5", "count: 10000")
            .replace("0.5", "0.1, 0.2, 0.3, 0.4, 0.5")
            .replace("1, 3", "1, 2, 3, 4, 5");
        assert!(
            Quest::new(settings(&huge))
                .unwrap_err()
                .starts_with("`levels` is 99 values for each of 500000 comb")
        );
    }
}
