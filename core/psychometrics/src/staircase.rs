//! The up/down method.

use asperity_numbers::Elementary;
use serde::{Deserialize, Serialize};

use crate::{Log, require, root};

/// Sizes of the steps: the first until the first reversal, the second until the second, the last for good.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Steps {
    /// Differences of levels, each above 0. Fits levels in dB or on another logarithmic axis.
    Add {
        /// Sizes.
        by: Vec<f64>,
    },
    /// Ratios of levels, each above 1. Fits levels on a linear axis above 0.
    Multiply {
        /// Sizes.
        by: Vec<f64>,
    },
}

/// Settings of a [`Staircase`].
///
/// Start with large steps. End with steps of at most a quarter of the distance between the levels where F is
/// 25 % and 75 %. Average reversals at that size alone. With a Weibull slope of 3.5, the mean of a thousand
/// simulated runs of 100 trials is then within 5 % of the target.
///
/// Larger last steps put the estimate too low where the guess rate is 1/2, since guesses take the level down.
/// With 2 down and 1 up it is low by 0 to 2 % with 0.15 of that distance. It is low by 2 to 4 % with a
/// quarter, by 5 to 8 % with half, by 7 to 12 % with three quarters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StaircaseSettings {
    /// First level, within `floor` to `ceiling`.
    pub start: f64,
    /// Lowest level.
    pub floor: f64,
    /// Highest level.
    pub ceiling: f64,
    /// Sizes of the steps.
    pub steps: Steps,
    /// Correct answers in a row after which the level goes down, 1 to 1000.
    pub down: u32,
    /// Wrong answers in a row after which the level goes up, 1 to 1000.
    #[serde(default = "one")]
    pub up: u32,
    /// Size of a step up over one down, 0.01 to 100 (Kaernbach 1991). Ratios of levels are raised to it.
    #[serde(default = "even")]
    pub up_over_down: f64,
    /// Trials after which the staircase ends, 1 or more.
    pub trials: u32,
    /// Reversals after which the staircase ends; None: only `trials` ends it.
    #[serde(default)]
    pub reversals: Option<u32>,
    /// Reversals that are averaged: the last ones. An even number has as many peaks as valleys.
    #[serde(default = "ten")]
    pub average: u32,
}

fn one() -> u32 {
    1
}

fn even() -> f64 {
    1.0
}

fn ten() -> u32 {
    10
}

/// Estimate of a [`Staircase`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// Mean level of the averaged reversals; the geometric mean for [`Steps::Multiply`].
    pub level: f64,
    /// Standard deviation of these levels. For [`Steps::Multiply`] it is that of their logarithms, as a
    /// distance above the level.
    pub sd: f64,
    /// Number of averaged reversals.
    pub reversals: u32,
    /// Probability of a correct answer that the rule aims at.
    pub target: f64,
}

/// A transformed or weighted up/down staircase (Levitt 1971; Kaernbach 1991).
///
/// The level goes down after `down` correct answers in a row, and up after `up` wrong ones. Either count
/// starts again after a move, and after an answer of the other kind. A reversal is a level at which the
/// direction changes. The step that leaves it already has the new size. A move that the floor or the ceiling
/// stops counts as a move.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Log<StaircaseSettings>", into = "Log<StaircaseSettings>")]
pub struct Staircase {
    settings: StaircaseSettings,
    answers: Vec<bool>,
    level: f64,
    /// Length of the run of equal answers since the last move.
    run: u32,
    /// Direction of the last move.
    rises: Option<bool>,
    reversals: Vec<f64>,
}

impl StaircaseSettings {
    /// An error names the first field that does not fit, and a value that does.
    pub fn check(&self) -> Result<(), String> {
        let Self { start, floor, ceiling, ref steps, up_over_down, .. } = *self;
        let (sizes, least) = match steps {
            Steps::Add { by: sizes } => (sizes, 0.0),
            Steps::Multiply { by: sizes } => (sizes, 1.0),
        };
        let fit = |s: &f64| *s > least && s.is_finite();
        require(!sizes.is_empty(), "steps", "empty", "for instance add(by: [8, 4, 2])")?;
        let bad = sizes.iter().find(|s| !fit(s)).copied().unwrap_or(least + 1.0);
        require(
            fit(&bad),
            "steps",
            bad,
            &format!("finite numbers above {least}, for instance {}", least + 1.0),
        )?;
        require(floor.is_finite(), "floor", floor, "a finite number")?;
        let positive = floor > 0.0 || matches!(steps, Steps::Add { .. });
        require(positive, "floor", floor, "a number above 0 with ratios, for instance 0.001")?;
        require(ceiling > floor && ceiling.is_finite(), "ceiling", ceiling, &format!("more than {floor}"))?;
        let between = format!("a number from {floor} to {ceiling}");
        require((floor..=ceiling).contains(&start), "start", start, &between)?;
        for (field, n) in [("down", self.down), ("up", self.up)] {
            require((1..=1000).contains(&n), field, n, "1 to 1000, for instance 1")?;
        }
        let ratio = (0.01..=100.0).contains(&up_over_down);
        require(ratio, "up_over_down", up_over_down, "a number from 0.01 to 100, for instance 1")?;
        require(self.average > 0, "average", self.average, "1 or more, for instance 10")?;
        let least = self.least_trials();
        let fitting = format!("{least} or more: `average` reversals take as many");
        require(u64::from(self.trials) >= least, "trials", self.trials, &fitting)?;
        let least = self.average;
        let reversals = self.reversals.unwrap_or(least);
        require(
            reversals >= least,
            "reversals",
            reversals,
            &format!("`average` or more, for instance {least}"),
        )
    }

    /// Fewest trials with as many reversals as are averaged: after the first move, each is a reversal.
    fn least_trials(&self) -> u64 {
        let [average, down, up] = [self.average, self.down, self.up].map(u64::from);
        average / 2 * (down + up) + average % 2 * (down + up) + (1 - average % 2) * down.min(up)
    }

    /// Probability of a correct answer at which moves balance: that of a step down is r / (1 + r).
    ///
    /// r is `up_over_down`, p the probability of a correct answer, q = 1 - p. The probability of n correct
    /// answers in a row before m wrong ones is p^(n-1) (1 - q^m) / (p^(n-1) + q^(m-1) - p^(n-1) q^(m-1))
    /// (Feller 1968, chapter VIII). With m = 1 it is p^n: 2 down and 1 up aim at 70.7 %, 3 down at 79.4 %.
    pub fn target(&self) -> f64 {
        let (n, m) = (f64::from(self.down), f64::from(self.up));
        let share = self.up_over_down / (1.0 + self.up_over_down);
        root(0.0, 1.0, |p| {
            let (right, wrong) = (p.power(n - 1.0), (1.0 - p).power(m - 1.0));
            right * (1.0 - wrong * (1.0 - p)) / (right + wrong - right * wrong) - share
        })
    }
}

impl Staircase {
    /// Starts a staircase. An error names a setting that does not fit, and a value that does.
    pub fn new(settings: StaircaseSettings) -> Result<Self, String> {
        settings.check()?;
        let level = settings.start;
        Ok(Self { settings, answers: Vec::new(), level, run: 0, rises: None, reversals: Vec::new() })
    }

    /// Level of the next trial; None after the last.
    pub fn next_level(&self) -> Option<f64> {
        let enough = self.settings.reversals.is_some_and(|n| self.reversals.len() >= n as usize);
        (self.answers.len() < self.settings.trials as usize && !enough).then_some(self.level)
    }

    /// Takes the answer of a trial at [`next_level`](Self::next_level). Ignored after the last trial.
    pub fn answer(&mut self, correct: bool) {
        if self.next_level().is_none() {
            return;
        }
        self.run = if self.answers.last() == Some(&correct) { self.run + 1 } else { 1 };
        self.answers.push(correct);
        if self.run >= if correct { self.settings.down } else { self.settings.up } {
            self.run = 0;
            self.step(!correct);
        }
    }

    fn step(&mut self, rises: bool) {
        if self.rises.replace(rises).is_some_and(|before| before != rises) {
            self.reversals.push(self.level);
        }
        let StaircaseSettings { floor, ceiling, ref steps, up_over_down, .. } = self.settings;
        let (Steps::Add { by: sizes } | Steps::Multiply { by: sizes }) = steps;
        let size = sizes.get(self.reversals.len()).or(sizes.last()).copied().unwrap_or_default();
        let by = if rises { up_over_down } else { -1.0 };
        let level = match steps {
            Steps::Add { .. } => self.level + size * by,
            Steps::Multiply { .. } => self.level * size.power(by),
        };
        self.level = level.clamp(floor, ceiling);
    }

    /// Settings.
    pub fn settings(&self) -> &StaircaseSettings {
        &self.settings
    }

    /// Answers so far.
    pub fn answers(&self) -> &[bool] {
        &self.answers
    }

    /// Levels of the reversals so far.
    pub fn reversals(&self) -> &[f64] {
        &self.reversals
    }

    /// Mean of the last `average` reversals; None until there are as many.
    pub fn estimate(&self) -> Option<Estimate> {
        let n = self.settings.average;
        let last = &self.reversals[self.reversals.len().checked_sub(n as usize)?..];
        let ratios = matches!(self.settings.steps, Steps::Multiply { .. });
        let levels = last.iter().map(|l| if ratios { l.log_e() } else { *l });
        let mean = levels.clone().sum::<f64>() / f64::from(n);
        let sd = (levels.map(|l| (l - mean) * (l - mean)).sum::<f64>() / f64::from(n)).sqrt();
        let (level, sd) = if ratios { (mean.exp_e(), mean.exp_e() * sd.exp_less_1()) } else { (mean, sd) };
        Some(Estimate { level, sd, reversals: n, target: self.settings.target() })
    }
}

impl From<Staircase> for Log<StaircaseSettings> {
    fn from(Staircase { settings, answers, .. }: Staircase) -> Self {
        Self { settings, answers }
    }
}

impl TryFrom<Log<StaircaseSettings>> for Staircase {
    type Error = String;

    /// Replays a log.
    fn try_from(log: Log<StaircaseSettings>) -> Result<Self, String> {
        let mut staircase = Self::new(log.settings)?;
        log.answers.into_iter().for_each(|correct| staircase.answer(correct));
        Ok(staircase)
    }
}

#[cfg(test)]
mod tests {
    use asperity_numbers::random::uniform;

    use super::*;

    fn settings(down: u32, up: u32, up_over_down: f64) -> StaircaseSettings {
        let steps = Steps::Add { by: vec![4.0, 2.0] };
        let (floor, ceiling) = (0.0, 40.0);
        StaircaseSettings {
            start: 20.0,
            floor,
            ceiling,
            steps,
            down,
            up,
            up_over_down,
            trials: 18,
            reversals: Some(5),
            average: 4,
        }
    }

    /// Worked by hand: C is a correct answer, W a wrong one.
    #[test]
    fn two_down_one_up_follows_levitt_by_hand() {
        let mut staircase = Staircase::new(settings(2, 1, 1.0)).unwrap();
        let answers = "CC CC CW CC W CW CC CC W";
        let by_hand = [20, 20, 16, 16, 12, 12, 14, 14, 12, 14, 14, 16, 16, 14, 14, 12];
        for (answer, level) in answers.chars().filter(|c| *c != ' ').zip(by_hand) {
            assert_eq!(staircase.next_level(), Some(f64::from(level)));
            staircase.answer(answer == 'C');
        }
        assert_eq!(staircase.next_level(), None);
        assert_eq!(staircase.reversals(), [12.0, 14.0, 12.0, 16.0, 12.0]);
        let estimate = staircase.estimate().unwrap();
        assert_eq!((estimate.level, estimate.reversals), (13.5, 4));
        let before = staircase.clone();
        staircase.answer(true);
        assert_eq!(staircase, before);
    }

    #[test]
    fn ratios_and_weighted_steps_stay_within_bounds() {
        let steps = Steps::Multiply { by: vec![2.0] };
        let mut staircase =
            Staircase::new(StaircaseSettings { steps, floor: 4.0, start: 10.0, ..settings(1, 1, 2.0) })
                .unwrap();
        let mut levels = Vec::new();
        for correct in [true, true, false, false, true] {
            staircase.answer(correct);
            levels.extend(staircase.next_level());
        }
        assert_eq!(levels, [5.0, 4.0, 16.0, 40.0, 20.0]);
        assert_eq!(staircase.reversals(), [4.0, 40.0]);
    }

    #[test]
    fn targets_match_levitt_and_kaernbach() {
        for (down, up, ratio, target) in [
            (1, 1, 1.0, 0.5),
            (2, 1, 1.0, 0.5_f64.powf(1.0 / 2.0)),
            (3, 1, 1.0, 0.5_f64.powf(1.0 / 3.0)),
            (4, 1, 1.0, 0.5_f64.powf(1.0 / 4.0)),
            (1, 2, 1.0, 1.0 - 0.5_f64.sqrt()),
            (2, 2, 1.0, 0.5),
            (1, 1, 3.0, 0.75),
        ] {
            let ours = settings(down, up, ratio).target();
            assert!((ours - target).abs() < 1e-14, "{down} {up} {ratio}: {ours} instead of {target}");
        }
    }

    /// Moves are simulated at the target's constant probability, and balance.
    #[test]
    fn moves_at_the_target_balance() {
        for (down, up, ratio) in [(3, 2, 1.0), (2, 3, 1.0), (2, 2, 3.0), (4, 1, 0.5)] {
            let rule = settings(down, up, ratio);
            let target = rule.target();
            let (mut balance, mut moves, mut last, mut run) = (0.0, 0.0, true, 0);
            for i in 0..200_000 {
                let correct = uniform(5, i) < target;
                run = if correct == last { run + 1 } else { 1 };
                last = correct;
                if run == if correct { down } else { up } {
                    run = 0;
                    moves += 1.0;
                    balance += if correct { -1.0 } else { ratio };
                }
            }
            assert!((balance / moves).abs() < 0.02, "{down} {up} {ratio}: {}", balance / moves);
        }
    }

    #[test]
    fn staircase_resumes_from_its_log() {
        let mut staircase = Staircase::new(settings(2, 1, 1.0)).unwrap();
        for correct in [true, true, false, true, true] {
            staircase.answer(correct);
            let text = serde_json::to_string(&staircase).unwrap();
            assert_eq!(serde_json::from_str::<Staircase>(&text).unwrap(), staircase);
        }
    }

    /// Every answer turns it, by hand: up, down down, up, ...; and no shorter row does.
    #[test]
    fn fewest_trials_reach_the_reversals_and_no_fewer_do() {
        for (down, up, average) in [(1, 1, 1), (2, 1, 4), (2, 1, 5), (3, 2, 6), (1, 3, 3)] {
            let rule =
                |trials| StaircaseSettings { trials, average, reversals: None, ..settings(down, up, 1.0) };
            let least = rule(1).least_trials() as u32;
            assert!(rule(least).check().is_ok() && rule(least - 1).check().is_err());
            let reaches = |trials: u32, rises: bool| {
                let mut staircase = Staircase::new(rule(least)).unwrap();
                let mut turn = rises;
                for _ in 0..trials {
                    let before = (staircase.reversals().len(), staircase.rises);
                    staircase.answer(!turn);
                    if (staircase.reversals().len(), staircase.rises) != before {
                        turn = !turn;
                    }
                }
                staircase.estimate().is_some()
            };
            assert!(reaches(least, true) || reaches(least, false), "{down} {up} {average}");
            assert!(!reaches(least - 1, true) && !reaches(least - 1, false), "{down} {up} {average}");
        }
    }

    #[test]
    fn settings_are_read_from_ron_and_checked() {
        let read = |text: &str| ron::from_str::<StaircaseSettings>(text).map_err(|e| e.to_string());
        let good = "(start: -8, floor: -60, ceiling: 0, steps: add(by: [4, 2, 1]), down: 2, trials: 100)";
        let read_good = read(good).unwrap();
        assert_eq!((read_good.up, read_good.average, read_good.check()), (1, 10, Ok(())));
        assert!(read(&good.replace("down", "dwon")).unwrap_err().contains("dwon"));
        for (from, to, error) in [
            ("start: -8", "start: 8", "`start` is 8: use a number from -60 to 0"),
            ("4, 2, 1", "4, -2, 1", "`steps` is -2: use finite numbers above 0, for instance 1"),
            ("4, 2, 1", "", "`steps` is empty: use for instance add(by: [8, 4, 2])"),
            ("add", "multiply", "`steps` is 1: use finite numbers above 1, for instance 2"),
            ("ceiling: 0", "ceiling: NaN", "`ceiling` is NaN: use more than -60"),
            ("down: 2", "down: 0", "`down` is 0: use 1 to 1000, for instance 1"),
            ("trials: 100", "trials: 15", "`trials` is 15: use 16 or more: `average` reversals take as many"),
        ] {
            assert_eq!(Staircase::new(read(&good.replace(from, to)).unwrap()).unwrap_err(), error);
        }
    }
}
