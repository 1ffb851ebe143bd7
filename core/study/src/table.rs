//! Answers in long form: one row an answer.

use std::collections::BTreeMap;

use asperity_diagnostics::Diagnostic;

use crate::log::Event;
use crate::progress::{Progress, Step, hit};
use crate::{Answer, Experiment};

/// The events of one participant.
#[derive(Clone, Debug, PartialEq)]
pub struct Session {
    /// Code of the participant.
    pub participant: String,
    /// Number of the participant, from 1.
    pub number: u32,
    /// Events, in the order of time.
    pub events: Vec<Event>,
}

/// An answer with everything that it depends on.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Code of the participant.
    pub participant: String,
    /// Name of the part; empty in the survey.
    pub part: String,
    /// Number of the trial in the plan, from 0.
    pub trial: usize,
    /// Number of the trial in the order of time, from 0.
    pub shown: usize,
    /// Level of each factor, by its name.
    pub levels: Vec<(String, String)>,
    /// Label of the kind of trial, such as `NN-Real`.
    pub kind: String,
    /// Names of the stimuli from left to right.
    pub places: Vec<String>,
    /// Level of the varied parameter.
    pub level: Option<f64>,
    /// Name of the question.
    pub question: String,
    /// Stimulus that a slider is about.
    pub about: Option<String>,
    /// The answer; of sliders, one as [`Answer::Numbers`] of one entry.
    pub answer: Answer,
    /// Whether it names the varied stimulus, or a difference.
    pub hit: Option<bool>,
    /// Time of the trial in s.
    pub seconds: f64,
}

/// All answers, and the trials that do not count.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// One row an answer, by participant and time.
    pub rows: Vec<Row>,
    /// Participants, each with the number of trials still to answer.
    pub participants: Vec<(String, usize)>,
    /// Participant, trial and reason of each showing that does not count.
    pub excluded: Vec<(String, usize, String)>,
}

impl Table {
    /// The answers in the logs of some participants.
    ///
    /// # Errors
    /// A log that does not fit the experiment's plan, with its participant.
    pub fn new(experiment: &Experiment, sessions: &[Session]) -> Result<Self, Diagnostic> {
        let mut it = Self::default();
        for session in sessions {
            it.add(experiment, session).map_err(|mut e| {
                e.message = format!("participant {}: {}", session.participant, e.message);
                e
            })?;
        }
        Ok(it)
    }

    fn add(&mut self, experiment: &Experiment, session: &Session) -> Result<(), Diagnostic> {
        let who = &session.participant;
        let mut progress = Progress::new(experiment, session.number);
        let mut shown = 0;
        for event in &session.events {
            let row = |question: &str, about: Option<String>, answer: Answer| Row {
                participant: who.clone(),
                part: String::new(),
                trial: 0,
                shown,
                levels: Vec::new(),
                kind: String::new(),
                places: Vec::new(),
                level: None,
                question: question.to_owned(),
                about,
                answer,
                hit: None,
                seconds: 0.0,
            };
            match event {
                Event::Answered { trial: number, answers, seconds } => {
                    let Step { level, .. } = progress.check(*number)?;
                    let trial = &progress.trials()[*number];
                    let part = &experiment.parts[trial.part];
                    let name = |stimulus: &usize| experiment.stimuli[*stimulus].name.clone();
                    let of = |(factor, level): &(usize, usize)| {
                        let factor = &experiment.factors[*factor];
                        (factor.name.clone(), factor.levels[*level].clone())
                    };
                    let hit = hit(experiment, part, answers);
                    let judging = part.judging().map(|q| q.name.as_str());
                    let places: Vec<String> = trial.places.iter().map(name).collect();
                    let full = |question: &str, about: Option<String>, answer: Answer| Row {
                        part: part.name.clone(),
                        trial: *number,
                        levels: trial.cell.iter().map(of).collect(),
                        kind: part.label(trial.kind, &experiment.stimuli),
                        places: places.clone(),
                        level,
                        hit: hit.filter(|_| judging == Some(question)),
                        seconds: *seconds,
                        ..row(question, about, answer)
                    };
                    for (question, answer) in answers {
                        match answer {
                            Answer::Numbers(all) => self.rows.extend(all.iter().map(|(about, x)| {
                                let one = Answer::Numbers(vec![(about.clone(), *x)]);
                                full(question, Some(about.clone()), one)
                            })),
                            one => self.rows.push(full(question, None, one.clone())),
                        }
                    }
                    progress.answer(answers);
                    shown += 1;
                }
                Event::Marked { trial, why, .. } => {
                    progress.check(*trial)?;
                    self.excluded.push((who.clone(), *trial, why.clone()));
                    progress.mark();
                    shown += 1;
                }
                Event::Survey { answers } => {
                    let rows = answers.iter().map(|(question, answer)| row(question, None, answer.clone()));
                    self.rows.extend(rows);
                }
                _ => (),
            }
        }
        // Ended tracks are left out.
        progress.step();
        self.participants.push((who.clone(), progress.left()));
        Ok(())
    }

    /// Mean answer of each participant to a scale: by participant, then by the values that `by` names, such
    /// as level and kind. Rows for which `by` gives nothing are left out.
    pub fn means<K: Ord>(
        &self,
        part: &str,
        question: &str,
        by: impl Fn(&Row) -> Option<K>,
    ) -> BTreeMap<String, BTreeMap<K, f64>> {
        let mut sums: BTreeMap<String, BTreeMap<K, (f64, u32)>> = BTreeMap::new();
        for row in self.rows.iter().filter(|row| row.part == part && row.question == question) {
            if let (Some(x), Some(key)) = (row.answer.number(), by(row)) {
                let of = sums.entry(row.participant.clone()).or_default().entry(key).or_default();
                *of = (of.0 + x, of.1 + 1);
            }
        }
        let mean = |(key, (sum, n)): (K, (f64, u32))| (key, sum / f64::from(n));
        sums.into_iter().map(|(who, of)| (who, of.into_iter().map(mean).collect())).collect()
    }
}

impl Row {
    /// Level of a factor.
    pub fn level_of(&self, factor: &str) -> Option<&str> {
        self.levels.iter().find(|(name, _)| name == factor).map(|(_, level)| level.as_str())
    }
}

impl Answer {
    /// The number of a scale or of one slider.
    pub fn number(&self) -> Option<f64> {
        match self {
            Self::Number(n) => Some(*n as f64),
            Self::Numbers(one) => one.first().map(|(_, x)| *x),
            _ => None,
        }
    }
}
