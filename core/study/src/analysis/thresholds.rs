//! Thresholds of a varied parameter.

use asperity_psychometrics::{
    Axis, Fit, FitSettings, Function, Posterior, Quest, Row as Count, Shape, Staircase, fit,
};
use serde::Serialize;

use super::{Summary, cells, levels_of, people, rows, summary};
use crate::file::{Experiment, Part};
use crate::method::Method;
use crate::question::Question;
use crate::table::{Row, Table};

/// Thresholds by condition and participant.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Thresholds {
    /// Name of the method.
    pub method: &'static str,
    /// The varied stimulus and its setting.
    pub varied: [String; 2],
    /// Probability of a hit at the threshold; `None` for a comparison, which has no hits.
    pub target: Option<f64>,
    /// Whether the task has a right answer. A comparison has a point of subjective equality instead.
    pub has_right_answer: bool,
    /// Whether levels belong on a logarithmic axis.
    pub is_logarithmic: bool,
    /// Conditions: levels of factors with a kind of trial.
    pub conditions: Vec<Condition>,
}

/// Thresholds of a condition.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Condition {
    /// Level of each factor of the part.
    pub levels: Vec<String>,
    /// Kind of trial.
    pub kind: String,
    /// Over the answers of all participants, by the method of constant stimuli.
    pub pooled: Option<Threshold>,
    /// One of each participant.
    pub people: Vec<Threshold>,
    /// The participants' thresholds.
    pub summary: Option<Summary>,
}

/// A threshold with its evidence.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Threshold {
    /// Code of the participant; empty over all.
    pub participant: String,
    /// Level and hit of each trial, in the order of time.
    pub trials: Vec<(f64, bool)>,
    /// Indices of the trials at which a staircase turned.
    pub reversals: Vec<usize>,
    /// The threshold.
    pub threshold: Option<f64>,
    /// Standard deviation: of a staircase's reversals, or of the posterior.
    pub sd: Option<f64>,
    /// Posterior of QUEST+.
    pub posterior: Option<Posterior>,
    /// Counts of each level, by the method of constant stimuli.
    pub counts: Vec<Count>,
    /// Their fitted function.
    pub fit: Option<Fit>,
    /// Reason for no threshold.
    pub why: Option<String>,
}

/// Thresholds of a part that varies a parameter, from the answers to its judging question.
pub(super) fn thresholds(
    experiment: &Experiment,
    table: &Table,
    part: &Part,
    question: &Question,
) -> Thresholds {
    let all: Vec<usize> = part.over.iter().map(|(factor, _)| *factor).collect();
    let method = part.vary.as_ref().map(|vary| &vary.method);
    let mut it = Thresholds {
        method: "",
        varied: part.vary.as_ref().map_or_else(Default::default, |vary| {
            [experiment.stimuli[vary.stimulus].name.clone(), vary.set.clone()]
        }),
        target: None,
        has_right_answer: true,
        is_logarithmic: false,
        conditions: Vec::new(),
    };
    // Tables of QUEST+ are made once.
    let mut fresh = None;
    (it.method, it.is_logarithmic) = match method {
        None => return it,
        Some(Method::Staircase(settings)) => {
            it.target = Some(settings.target());
            let ratios = matches!(settings.steps, asperity_psychometrics::Steps::Multiply { .. });
            ("staircase", ratios)
        }
        Some(Method::Quest(settings)) => {
            fresh = Quest::new(settings.clone()).ok();
            let prior = fresh.as_ref().map(|quest| quest.posterior().function);
            it.target = prior.map(|function| function.probability(function.threshold));
            it.has_right_answer = prior.is_none_or(|function| function.guess > 0.0);
            ("QUEST+", (settings.shape, settings.axis) == (Shape::Weibull, Axis::Linear))
        }
        Some(Method::Constant { fit, .. }) => {
            it.has_right_answer = fit.guess > 0.0;
            let FitSettings { shape, axis, guess, lapse, .. } = *fit;
            // The same at any threshold and slope.
            let any = Function { shape, axis, threshold: 1.0, slope: 1.0, guess, lapse };
            it.target = Some(any.probability(any.threshold));
            ("constant stimuli", (fit.shape, fit.axis) == (Shape::Weibull, Axis::Linear))
        }
    };
    let one = |participant: &str, own: &[&Row]| {
        let trials = own.iter().filter_map(|row| Some((row.level?, row.hit?))).collect();
        let mut it = Threshold { participant: participant.into(), trials, ..Threshold::default() };
        it.estimate(method, fresh.as_ref());
        it
    };
    for cell in cells(experiment, part, &all) {
        for kind in 0..part.show.len() {
            let label = part.label(kind, &experiment.stimuli);
            let own: Vec<&Row> = rows(table, &part.name, &question.name)
                .filter(|row| row.kind == label && levels_of(experiment, &all, row).as_ref() == Some(&cell))
                .collect();
            let of =
                |code: &str| own.iter().copied().filter(|row| row.participant == code).collect::<Vec<_>>();
            let people: Vec<Threshold> = people(table).into_iter().map(|code| one(code, &of(code))).collect();
            let constant = matches!(method, Some(Method::Constant { .. }));
            let found: Vec<f64> = people.iter().filter_map(|p| p.threshold).collect();
            it.conditions.push(Condition {
                levels: cell.clone(),
                kind: label,
                pooled: constant.then(|| one("", &own)),
                summary: summary(&found),
                people,
            });
        }
    }
    it
}

impl Threshold {
    fn estimate(&mut self, method: Option<&Method>, fresh: Option<&Quest>) {
        if self.trials.is_empty() {
            self.why = Some("no answers".into());
            return;
        }
        match method {
            Some(Method::Staircase(settings)) => {
                let Ok(mut staircase) = Staircase::new(settings.clone()) else { return };
                for (i, (_, hit)) in self.trials.iter().enumerate() {
                    let before = staircase.reversals().len();
                    staircase.answer(*hit);
                    if staircase.reversals().len() > before {
                        self.reversals.push(i);
                    }
                }
                match staircase.estimate() {
                    Some(found) => (self.threshold, self.sd) = (Some(found.level), Some(found.sd)),
                    None => {
                        let (have, need) = (staircase.reversals().len(), settings.average);
                        self.why = Some(format!("{have} reversals, and {need} are averaged"));
                    }
                }
            }
            Some(Method::Quest(_)) => {
                let Some(mut quest) = fresh.cloned() else { return };
                self.trials.iter().for_each(|(_, hit)| quest.answer(*hit));
                let posterior = quest.posterior();
                (self.threshold, self.sd) = (Some(posterior.threshold.mean), Some(posterior.threshold.sd));
                self.posterior = Some(posterior);
            }
            Some(Method::Constant { fit: settings, .. }) => {
                let mut sorted = self.trials.clone();
                sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
                for same in sorted.chunk_by(|a, b| a.0 == b.0) {
                    let correct = same.iter().filter(|(_, hit)| *hit).count() as u32;
                    self.counts.push(Count { level: same[0].0, correct, total: same.len() as u32 });
                }
                match fit(&self.counts, settings) {
                    Ok(found) => {
                        self.threshold = Some(found.function.threshold);
                        self.fit = Some(found);
                    }
                    Err(why) => self.why = Some(why),
                }
            }
            None => (),
        }
    }
}
