//! A participant's way through the trials.

use std::collections::{BTreeMap, VecDeque};

use asperity_diagnostics::Diagnostic;
use asperity_psychometrics::{Quest, Staircase};

use crate::Answer;
use crate::file::{Experiment, Part};
use crate::log::Event;
use crate::method::Method;
use crate::plan::Trial;

/// An adaptive method with its answers.
#[derive(Clone, Debug)]
pub enum Track {
    /// Up and down with the answers.
    Staircase(Staircase),
    /// The most informative level.
    Quest(Box<Quest>),
}

impl Track {
    fn new(method: &Method) -> Option<Self> {
        // The settings were checked when the file was read.
        match method {
            Method::Staircase(settings) => Staircase::new(settings.clone()).ok().map(Self::Staircase),
            Method::Quest(settings) => Quest::new(settings.clone()).ok().map(|q| Self::Quest(Box::new(q))),
            Method::Constant { .. } => None,
        }
    }

    fn next_level(&self) -> Option<f64> {
        match self {
            Self::Staircase(it) => it.next_level(),
            Self::Quest(it) => it.next_level(),
        }
    }

    fn answer(&mut self, hit: bool) {
        match self {
            Self::Staircase(it) => it.answer(hit),
            Self::Quest(it) => it.answer(hit),
        }
    }
}

/// Where a participant stands: a function of the plan and of the events so far.
#[derive(Clone, Debug)]
pub struct Progress<'e> {
    experiment: &'e Experiment,
    trials: Vec<Trial>,
    /// Trials to show, in order. Marked ones come again at the end of their part.
    ahead: VecDeque<usize>,
    attempts: Vec<u32>,
    tracks: BTreeMap<(usize, usize), Track>,
}

/// A trial to show.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// Number of the trial in the plan.
    pub number: usize,
    /// Times that it was shown before.
    pub attempt: u32,
    /// Level of its varied parameter.
    pub level: Option<f64>,
}

impl<'e> Progress<'e> {
    /// A participant before the first trial; `participant` counts from 1.
    pub fn new(experiment: &'e Experiment, participant: u32) -> Self {
        let trials = experiment.trials(participant);
        let mut tracks = BTreeMap::new();
        for trial in &trials {
            let method = experiment.parts[trial.part].vary.as_ref().map(|vary| &vary.method);
            if let (Some(track), Some(method)) = (trial.track, method) {
                let at = (trial.part, track);
                if let (false, Some(new)) = (tracks.contains_key(&at), Track::new(method)) {
                    tracks.insert(at, new);
                }
            }
        }
        let attempts = vec![0; trials.len()];
        Self { experiment, ahead: (0..trials.len()).collect(), trials, attempts, tracks }
    }

    /// A participant after the events of a log.
    ///
    /// # Errors
    /// An event that does not fit the plan: the study or its seed changed.
    pub fn after(experiment: &'e Experiment, participant: u32, events: &[Event]) -> Result<Self, Diagnostic> {
        let mut it = Self::new(experiment, participant);
        for event in events {
            match event {
                Event::Answered { trial, answers, .. } => {
                    it.check(*trial)?;
                    it.answer(answers);
                }
                Event::Marked { trial, .. } => {
                    it.check(*trial)?;
                    it.mark();
                }
                _ => (),
            }
        }
        Ok(it)
    }

    /// The trial of [`step`](Self::step), whose number in a log is `number`.
    pub(crate) fn check(&mut self, number: usize) -> Result<Step, Diagnostic> {
        self.step().filter(|step| step.number == number).ok_or_else(|| {
            Diagnostic::new(format!("the log's trial {number} is not the one that the study shows here"))
                .help("the study file or its seed changed since; take another output folder")
        })
    }

    /// The plan.
    pub fn trials(&self) -> &[Trial] {
        &self.trials
    }

    /// Adaptive methods by part and track.
    pub fn tracks(&self) -> &BTreeMap<(usize, usize), Track> {
        &self.tracks
    }

    /// Trials still to show, at most.
    pub fn left(&self) -> usize {
        self.ahead.len()
    }

    /// Trials of a part still to show, at most.
    pub fn left_in(&self, part: usize) -> usize {
        self.ahead.iter().filter(|number| self.trials[**number].part == part).count()
    }

    /// The trial to show now. `None`: all are answered.
    pub fn step(&mut self) -> Option<Step> {
        loop {
            let number = *self.ahead.front()?;
            let trial = &self.trials[number];
            let level = match trial.track {
                None => trial.level,
                Some(track) => match self.tracks.get(&(trial.part, track))?.next_level() {
                    // This track has ended.
                    None => {
                        self.ahead.pop_front();
                        continue;
                    }
                    level => level,
                },
            };
            return Some(Step { number, attempt: self.attempts[number], level });
        }
    }

    /// Takes the answers to the trial of [`step`](Self::step).
    pub fn answer(&mut self, answers: &[(String, Answer)]) {
        let Some(number) = self.ahead.pop_front() else { return };
        let trial = &self.trials[number];
        let part = &self.experiment.parts[trial.part];
        if let (Some(track), Some(hit)) = (trial.track, hit(self.experiment, part, answers))
            && let Some(track) = self.tracks.get_mut(&(trial.part, track))
        {
            track.answer(hit);
        }
    }

    /// Leaves the trial of [`step`](Self::step) out: it does not count. It comes again at the end of its
    /// part if the study says so.
    pub fn mark(&mut self) {
        let Some(number) = self.ahead.pop_front() else { return };
        self.attempts[number] += 1;
        if self.experiment.repeat_marked {
            let part = self.trials[number].part;
            let end = self.ahead.iter().take_while(|n| self.trials[**n].part == part).count();
            self.ahead.insert(end, number);
        }
    }
}

/// Whether the answers of a trial name the varied stimulus, or a difference. `None` without one.
pub(crate) fn hit(experiment: &Experiment, part: &Part, answers: &[(String, Answer)]) -> Option<bool> {
    let (judging, vary) = (part.judging()?, part.vary.as_ref()?);
    let (_, answer) = answers.iter().find(|(name, _)| *name == judging.name)?;
    Part::is_hit(answer, &experiment.stimuli[vary.stimulus].name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::experiment;

    const RATE: &str = "ask: [scale(name: \"r\", text: \"?\", from: 1, to: 7, low: \"a\", high: \"b\")],";

    fn answers() -> Vec<(String, Answer)> {
        vec![("r".into(), Answer::Number(3))]
    }

    #[test]
    fn marked_trials_come_again_at_the_end_of_their_part() {
        let study = experiment("", &format!("show: [\"x\", \"y\", \"z\"], order: fixed, {RATE}"));
        let mut progress = Progress::new(&study, 1);
        let mut shown = Vec::new();
        while let Some(step) = progress.step() {
            shown.push((step.number, step.attempt));
            if step == (Step { number: 1, attempt: 0, level: None }) {
                progress.mark();
            } else {
                progress.answer(&answers());
            }
        }
        assert_eq!(shown, [(0, 0), (1, 0), (2, 0), (1, 1)]);
    }

    #[test]
    fn study_that_repeats_nothing_leaves_marked_trials_out() {
        let study =
            experiment("repeat_marked: false,", &format!("show: [\"x\", \"y\"], order: fixed, {RATE}"));
        let mut progress = Progress::new(&study, 1);
        progress.mark();
        assert_eq!(progress.step().map(|step| step.number), Some(1));
        assert_eq!(progress.left(), 1);
    }

    #[test]
    fn resumed_session_stands_where_the_log_ends() {
        let vary = "show: [(\"x\", \"z\")], ask: [which(name: \"w\", text: \"?\")], vary: (stimulus: \"z\",
            set: \"a.b\", by: quest(levels: logarithmic(from: 0.1, to: 10.0, count: 11),
            threshold: logarithmic(from: 0.1, to: 10.0, count: 11),
            slope: linear(from: 1.0, to: 4.0, count: 3), trials: 12)),";
        let study = experiment("", vary);
        let mut events = Vec::new();
        let mut progress = Progress::new(&study, 7);
        while let Some(step) = progress.step() {
            let resumed = Progress::after(&study, 7, &events).unwrap().step();
            assert_eq!(resumed.as_ref(), Some(&step));
            let chosen = if step.level.is_some_and(|level| level > 1.5) { "z" } else { "x" };
            let answers = vec![("w".into(), Answer::Stimulus(chosen.into()))];
            progress.answer(&answers);
            events.push(Event::Answered { trial: step.number, answers, seconds: 1.0 });
        }
        assert_eq!(events.len(), 12);
        let wrong = Event::Answered { trial: 5, answers: answers(), seconds: 1.0 };
        let told = Progress::after(&study, 7, &[wrong]).unwrap_err().to_string();
        assert!(told.contains("trial 5 is not the one"), "{told}");
    }
}
