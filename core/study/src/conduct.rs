//! A session as a state machine: it decides about both screens, the stimuli and the log.
//!
//! It has no clock, no device and no file. A host hands it the presses of both people. It appends the events
//! to the log, then shows the screens and plays the stimuli.

use std::fmt;

use asperity_diagnostics::Diagnostic;
use asperity_numbers::Random;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use crate::file::{Experiment, Sides, StimulusKind, word_of};
use crate::log::Event;
use crate::method::Varied;
use crate::plan::Trial;
use crate::progress::{Progress, Step};
use crate::question::{Answer, Question, QuestionKind};

/// Where a session stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// Before the first press.
    Welcome,
    /// Instructions of the trial's part.
    Instructions,
    /// A break before the trial.
    Break,
    /// The experimenter mounts samples for the trial.
    Wait,
    /// The trial's reference is felt.
    Reference,
    /// The experimenter takes the sample of the reference away.
    Exchange,
    /// The trial's stimuli are felt, and its questions answered.
    Explore,
    Survey,
    End,
}

/// Something that a person presses.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "press", rename_all = "snake_case", deny_unknown_fields)]
pub enum Press {
    /// The participant goes on.
    Next {
        /// Token of the screen that was shown.
        token: String,
    },
    /// The participant answers all questions of the screen, in their order.
    Answer {
        /// Token of the screen that was shown.
        token: String,
        /// Answers, in the order of the screen's questions.
        answers: Vec<Given>,
    },
    /// The participant chooses the place that is felt, where a trial has a button for each.
    Feel {
        /// Token of the screen that was shown.
        token: String,
        /// Place in the order of the buttons, from 0.
        place: usize,
    },
    /// The experimenter has mounted the samples.
    Ready {
        /// Token of the screen that was shown.
        token: String,
    },
    /// The experimenter pauses.
    Pause,
    /// The experimenter goes on.
    Resume,
    /// The experimenter marks the trial: it does not count.
    Mark {
        /// Token of the screen that was shown.
        token: String,
        /// The reason.
        why: String,
    },
    /// The experimenter remarks something.
    Note {
        /// The text.
        text: String,
    },
}

/// An answer in the terms of the screen: of places from left to right, never of stimuli.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Given {
    /// *Same or different*.
    Same(bool),
    /// A number of a scale, or a place.
    Number(i64),
    /// A number for each place.
    Numbers(Vec<f64>),
    /// Free text.
    Text(String),
}

/// Why a press does not fit the screen, in words of the study. The session stays as it is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refused(pub String);

impl fmt::Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// Where the stylus feels a stimulus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Where x is below 0.
    Left,
    /// Where x is above 0.
    Right,
    /// Anywhere.
    Everywhere,
}

/// The stimulus at one place.
#[derive(Clone, Debug)]
pub struct Felt {
    /// Place in the trial's order, from 0. That of the reference follows the last.
    pub place: usize,
    /// Where it is felt.
    pub side: Side,
    /// Index of the stimulus.
    pub stimulus: usize,
    /// The stimulus with the trial's levels filled in.
    pub kind: StimulusKind,
    /// The varied parameter.
    pub vary: Option<Varied>,
}

/// A participant's session.
#[derive(Debug)]
pub struct Conduct<'e> {
    experiment: &'e Experiment,
    progress: Progress<'e>,
    state: State,
    /// Since when it is paused, in s of the host's clock.
    paused_s: Option<f64>,
    /// Why the trial that is shown does not count.
    problem: Option<String>,
    step: Option<Step>,
    /// The place that is felt, where the trial has a button for each.
    chosen: usize,
    /// When the trial's stimuli could first be felt, in s of the host's clock.
    since_s: f64,
    /// Changes with every screen and says nothing about it.
    token: String,
    tokens: Random,
}

impl<'e> Conduct<'e> {
    /// A session that goes on after the events of its log. `token_seed` comes from the system's random
    /// numbers, so that no token says anything about a condition.
    ///
    /// # Errors
    /// A log that does not fit the experiment.
    pub fn new(
        experiment: &'e Experiment,
        participant: u32,
        events: &[Event],
        token_seed: u64,
    ) -> Result<Self, Diagnostic> {
        let progress = Progress::after(experiment, participant, events)?;
        let mut it = Self {
            experiment,
            progress,
            state: State::Welcome,
            paused_s: None,
            problem: None,
            step: None,
            chosen: 0,
            since_s: 0.0,
            token: String::new(),
            tokens: Random::new(token_seed),
        };
        it.step = it.progress.step();
        if it.step.is_none() {
            let answered = events.iter().any(|event| matches!(event, Event::Survey { .. }));
            let asks = !experiment.survey.is_empty() && !answered;
            it.state = if asks { State::Survey } else { State::End };
        }
        it.draw();
        Ok(it)
    }

    /// Takes what a person pressed at a time of the host's clock, in s. The events are to be on disk before
    /// the next screen is shown.
    ///
    /// # Errors
    /// A press that does not fit the screen, such as an answer to an earlier one.
    pub fn press(&mut self, press: Press, now_s: f64) -> Result<Vec<Event>, Refused> {
        match press {
            Press::Note { text } => {
                return Ok(vec![Event::Note { text, trial: self.step.as_ref().map(|s| s.number) }]);
            }
            Press::Pause if self.paused_s.is_none() => {
                self.paused_s = Some(now_s);
                self.draw();
                return Ok(vec![Event::Paused { paused: true }]);
            }
            Press::Resume => {
                let Some(paused_s) = self.paused_s.take() else { return Ok(Vec::new()) };
                // A pause is no part of the trial's time.
                self.since_s += now_s - paused_s;
                self.draw();
                return Ok(vec![Event::Paused { paused: false }]);
            }
            Press::Pause => return Ok(Vec::new()),
            Press::Mark { token, .. } | Press::Ready { token } if token != self.token => {
                return Err(self.refused("changed"));
            }
            Press::Mark { why, .. } => {
                return self.mark(&why, Vec::new(), now_s).ok_or_else(|| self.refused("no_trial"));
            }
            _ if self.paused_s.is_some() => return Err(self.refused("paused")),
            Press::Ready { .. } => match self.state {
                State::Wait => return Ok(self.begin_trial(now_s)),
                State::Exchange => self.explore(now_s),
                _ => return Err(self.refused("no_sample")),
            },
            Press::Next { token } | Press::Answer { token, .. } | Press::Feel { token, .. }
                if token != self.token =>
            {
                return Err(self.refused("changed"));
            }
            Press::Next { .. } => return self.next(now_s),
            Press::Answer { answers, .. } => return self.answer(&answers, now_s),
            Press::Feel { place, .. } => {
                if place >= self.buttons().len() {
                    return Err(self.refused("invalid"));
                }
                // The screen stays: its answers go on.
                self.chosen = place;
                return Ok(Vec::new());
            }
        }
        self.draw();
        Ok(Vec::new())
    }

    /// A refusal by the key of its word.
    pub fn refused(&self, key: &str) -> Refused {
        Refused(self.word(key))
    }

    /// Tells that the trial which is shown does not count, such as for a lost device. It is marked once it is
    /// answered. The first reason of a trial is kept.
    pub fn spoil(&mut self, why: &str) {
        if matches!(self.state, State::Reference | State::Exchange | State::Explore) {
            self.problem.get_or_insert_with(|| why.to_owned());
        }
    }

    /// Whether a screen with this token is shown.
    pub fn shows(&self, token: &str) -> bool {
        token == self.token
    }

    /// The trial that is shown.
    pub fn shown(&self) -> Option<&Step> {
        let shown = matches!(self.state, State::Reference | State::Exchange | State::Explore);
        self.step.as_ref().filter(|_| shown)
    }

    /// Leaves the trial out that is shown. `None`: no trial is shown.
    fn mark(&mut self, why: &str, answers: Vec<(String, Answer)>, now_s: f64) -> Option<Vec<Event>> {
        let shown = matches!(self.state, State::Wait | State::Reference | State::Exchange | State::Explore);
        let number = self.step.as_ref().filter(|_| shown)?.number;
        self.progress.mark();
        let marked = Event::Marked { trial: number, why: why.to_owned(), answers };
        Some([vec![marked], self.advance(now_s)].concat())
    }

    fn next(&mut self, now_s: f64) -> Result<Vec<Event>, Refused> {
        match self.state {
            State::Welcome => {
                self.enter();
                Ok(self.begun(now_s))
            }
            State::Instructions => {
                self.state = self.before_trial();
                Ok(self.begun(now_s))
            }
            State::Break => {
                self.state = if self.has_sign() { State::Wait } else { State::Explore };
                Ok(self.begun(now_s))
            }
            State::Reference => {
                let sample = self.reference_sample().is_some();
                if sample && !self.part().is_some_and(|part| self.experiment.parts[part].keeps_reference()) {
                    self.state = State::Exchange;
                } else {
                    self.explore(now_s);
                }
                self.draw();
                Ok(Vec::new())
            }
            State::Explore if self.questions().is_empty() => self.answer(&[], now_s),
            _ => Err(self.refused("unanswered")),
        }
    }

    /// Begins the trial where nothing has to be mounted.
    fn begun(&mut self, now_s: f64) -> Vec<Event> {
        if matches!(self.state, State::Explore) {
            return self.begin_trial(now_s);
        }
        self.draw();
        Vec::new()
    }

    /// The trial's stimuli can be felt after the reference.
    fn explore(&mut self, now_s: f64) {
        (self.state, self.since_s) = (State::Explore, now_s);
    }

    fn begin_trial(&mut self, now_s: f64) -> Vec<Event> {
        let Some(step) = &self.step else { return Vec::new() };
        let event = Event::Shown { trial: step.number, attempt: step.attempt, level: step.level };
        let part = &self.experiment.parts[self.progress.trials()[step.number].part];
        self.state = if part.reference.is_some() { State::Reference } else { State::Explore };
        (self.since_s, self.problem, self.chosen) = (now_s, None, 0);
        self.draw();
        vec![event]
    }

    fn answer(&mut self, given: &[Given], now_s: f64) -> Result<Vec<Event>, Refused> {
        let answers = self.answers(given)?;
        match self.state {
            State::Explore => {
                let Some(step) = self.step.clone() else { return Ok(Vec::new()) };
                if let Some(why) = self.problem.take() {
                    return Ok(self.mark(&why, answers, now_s).unwrap_or_default());
                }
                self.progress.answer(&answers);
                let answered = Event::Answered { trial: step.number, answers, seconds: now_s - self.since_s };
                Ok([vec![answered], self.advance(now_s)].concat())
            }
            State::Survey => {
                self.state = State::End;
                self.draw();
                Ok(vec![Event::Survey { answers }, Event::End])
            }
            _ => Err(self.refused("changed")),
        }
    }

    /// Answers in the terms of the file, each checked against its question.
    fn answers(&self, given: &[Given]) -> Result<Vec<(String, Answer)>, Refused> {
        let questions = self.questions();
        if questions.len() != given.len() {
            return Err(self.refused("invalid"));
        }
        let names = self.shown_names();
        let one = |(question, given): (&Question, &Given)| {
            let answer = match (&question.kind, given) {
                (QuestionKind::Scale { .. }, Given::Number(n)) => Some(Answer::Number(*n)),
                (QuestionKind::Which, Given::Number(place)) => usize::try_from(*place)
                    .ok()
                    .and_then(|at| names.get(at))
                    .map(|name| Answer::Stimulus((*name).to_owned())),
                (QuestionKind::Same, Given::Same(same)) => Some(Answer::Same(*same)),
                (QuestionKind::Sliders { .. }, Given::Numbers(all)) if all.len() == names.len() => {
                    let named = names.iter().zip(all).map(|(name, x)| ((*name).to_owned(), *x));
                    Some(Answer::Numbers(named.collect()))
                }
                (QuestionKind::Text, Given::Text(text)) => Some(Answer::Text(text.clone())),
                _ => None,
            };
            let fits = answer.filter(|answer| question.takes(answer, &names));
            fits.map(|answer| (question.name.clone(), answer)).ok_or_else(|| self.refused("invalid"))
        };
        questions.iter().zip(given).map(one).collect()
    }

    /// Goes to the next trial, or to the end. A trial without a mount begins at once.
    fn advance(&mut self, now_s: f64) -> Vec<Event> {
        let before = self.part();
        self.step = self.progress.step();
        match &self.step {
            None if self.experiment.survey.is_empty() => {
                self.state = State::End;
                self.draw();
                return vec![Event::End];
            }
            None => self.state = State::Survey,
            Some(_) if self.part() != before => self.enter(),
            Some(_) => self.state = self.before_trial(),
        }
        self.begun(now_s)
    }

    /// Enters the part of the present trial.
    fn enter(&mut self) {
        let instructs = self.part().is_some_and(|part| !self.experiment.parts[part].instructions.is_empty());
        self.state = if instructs { State::Instructions } else { self.before_trial() };
    }

    fn before_trial(&self) -> State {
        match self.trial() {
            Some(trial) if trial.after_break => State::Break,
            _ if self.has_sign() => State::Wait,
            _ => State::Explore,
        }
    }

    fn trial(&self) -> Option<&Trial> {
        self.progress.trials().get(self.step.as_ref()?.number)
    }

    fn part(&self) -> Option<usize> {
        self.trial().map(|trial| trial.part)
    }

    /// Samples that are mounted for the present trial, or are to be, each with the word of its place. That of
    /// the reference is taken away before the others are felt.
    fn mounts(&self) -> Vec<(String, String)> {
        let Some(trial) = self.trial() else { return Vec::new() };
        let keeps = self.experiment.parts[trial.part].keeps_reference();
        let is_over = matches!(self.state, State::Exchange | State::Explore) && !keeps;
        let reference = self.reference_sample().filter(|_| !is_over);
        let shown = self.places().into_iter().zip(trial.places.iter());
        let sample = |(place, stimulus): (String, &usize)| Some((place, self.sample(trial, *stimulus)?));
        let reference = reference.map(|name| (self.word("reference"), name));
        reference.into_iter().chain(shown.filter_map(sample)).collect()
    }

    /// Name of the sample that a stimulus is.
    fn sample(&self, trial: &Trial, stimulus: usize) -> Option<String> {
        match self.experiment.shown(trial, stimulus) {
            StimulusKind::Real { mount } => mount.text().ok().map(str::to_owned),
            _ => None,
        }
    }

    /// Name of the sample that the trial's reference is.
    fn reference_sample(&self) -> Option<String> {
        let trial = self.trial()?;
        self.sample(trial, self.experiment.parts[trial.part].reference?)
    }

    fn shown_names(&self) -> Vec<&str> {
        let places = self.trial().map_or(&[][..], |trial| &trial.places);
        places.iter().map(|s| self.experiment.stimuli[*s].name.as_str()).collect()
    }

    fn questions(&self) -> &'e [Question] {
        match (self.state, self.part()) {
            (State::Survey, _) => &self.experiment.survey,
            (_, Some(part)) => &self.experiment.parts[part].ask,
            _ => &[],
        }
    }

    fn draw(&mut self) {
        self.token = format!("{:016x}", self.tokens.bits());
    }

    /// The stimuli that are felt now: none between trials and in a pause.
    pub fn felt(&self) -> Vec<Felt> {
        let Some(trial) = self.trial().filter(|_| self.paused_s.is_none()) else { return Vec::new() };
        let part = &self.experiment.parts[trial.part];
        let level = self.step.as_ref().and_then(|step| step.level);
        let count = trial.places.len();
        let felt = |place: usize, side: Side| {
            let stimulus = self.experiment.at_place(trial, place)?;
            let vary = part.vary.as_ref().filter(|vary| vary.stimulus == stimulus);
            Some(Felt {
                place,
                side,
                stimulus,
                kind: self.experiment.shown(trial, stimulus),
                vary: vary.zip(level).map(|(vary, level)| vary.at(level)),
            })
        };
        match self.state {
            State::Reference => felt(count, Side::Everywhere).into_iter().collect(),
            State::Explore if self.has_buttons() => felt(self.chosen, Side::Everywhere).into_iter().collect(),
            State::Explore => (0..count).filter_map(|at| felt(at, side(part.sides, count, at))).collect(),
            _ => Vec::new(),
        }
    }

    /// Whether the trial has a button for each place: it has more than two, or sliders with a reference.
    fn has_buttons(&self) -> bool {
        let Some((trial, part)) = self.trial().zip(self.part()) else { return false };
        trial.places.len() > 2 || self.experiment.parts[part].keeps_reference()
    }

    /// Words of the buttons that choose a place. None where left and right are felt.
    fn buttons(&self) -> Vec<String> {
        let Some(part) = self.part().filter(|_| self.state == State::Explore && self.has_buttons()) else {
            return Vec::new();
        };
        let reference = self.experiment.parts[part].keeps_reference().then(|| self.word("reference"));
        self.places().into_iter().chain(reference).collect()
    }

    /// Whether the session is over.
    pub fn is_over(&self) -> bool {
        self.state == State::End
    }

    /// Word of the screens by its key.
    fn word(&self, key: &str) -> String {
        word_of(&self.experiment.words, key)
    }

    /// The participant's screen. It has no name of a condition, and nothing that stays the same for one.
    pub fn participant(&self) -> Value {
        let (state, text) = match self.state {
            _ if self.paused_s.is_some() => ("paused", self.word("paused")),
            State::Welcome => ("welcome", self.word("welcome")),
            State::Instructions => {
                let part = self.part().map(|part| self.experiment.parts[part].instructions.clone());
                ("instructions", part.unwrap_or_default())
            }
            State::Break => ("break", self.word("break")),
            State::Wait | State::Exchange => ("wait", self.word("wait")),
            State::Reference => ("reference", self.word("reference")),
            State::Explore => ("explore", self.word("explore")),
            State::Survey => ("survey", self.word("survey")),
            State::End => ("end", self.word("thanks")),
        };
        let asks = self.paused_s.is_none() && matches!(self.state, State::Explore | State::Survey);
        let questions: Vec<Value> =
            if asks { self.questions().iter().map(question).collect() } else { Vec::new() };
        let places = if asks { self.places() } else { Vec::new() };
        let (number, count) = self.position();
        let trial = self.word("trial").replace("{number}", &number.to_string());
        let words: Map<String, Value> =
            ["next", "same", "different", "lost", "space", "language", "choose", "pad"]
                .map(|key| (key.to_owned(), self.word(key).into()))
                .into_iter()
                .collect();
        json!({
            "state": state, "text": text, "token": self.token, "questions": questions, "places": places,
            "buttons": if self.paused_s.is_some() { Vec::new() } else { self.buttons() },
            "chosen": self.chosen,
            "sides": self.felt().iter().any(|felt| felt.side != Side::Everywhere),
            "sign": self.has_sign(), "trial": trial.replace("{count}", &count.to_string()), "words": words,
        })
    }

    /// Words of the trial's places, in their order: sides, or letters where each has a button.
    fn places(&self) -> Vec<String> {
        let (Some(trial), Some(part)) = (self.trial(), self.part()) else { return Vec::new() };
        let (sides, count, letters) =
            (self.experiment.parts[part].sides, trial.places.len(), self.has_buttons());
        let word = |at| match side(sides, count, at) {
            Side::Left if !letters => self.word("left"),
            Side::Right if !letters => self.word("right"),
            _ => char::from(b'A' + (at % 26) as u8).to_string(),
        };
        (0..count).map(word).collect()
    }

    /// Whether the *wait* and *explore* sign is shown: an experimenter mounts samples in this part.
    fn has_sign(&self) -> bool {
        self.part().is_some_and(|part| self.experiment.parts[part].has_real(&self.experiment.stimuli))
    }

    /// Number of the trial in its part from 1, and how many the part has at most.
    fn position(&self) -> (usize, usize) {
        let Some(part) = self.part() else { return (0, 0) };
        let trials = self.progress.trials();
        let count = trials.iter().filter(|trial| trial.part == part).count();
        let left = self.progress.left_in(part);
        (count.saturating_sub(left) + 1, count)
    }

    /// The experimenter's screen.
    pub fn experimenter(&self) -> Value {
        let waits = match self.state {
            _ if self.paused_s.is_some() => "experimenter",
            State::Wait | State::Exchange => "experimenter",
            State::End => "nobody",
            _ => "participant",
        };
        let part = self.part().map(|part| &self.experiment.parts[part]);
        let reference = part.and_then(|part| part.reference).map(|s| &self.experiment.stimuli[s].name);
        let level_of = |(factor, level): &(usize, usize)| {
            let factor = &self.experiment.factors[*factor];
            (factor.name.clone(), factor.levels[*level].clone())
        };
        let cell: Vec<(String, String)> =
            self.trial().map_or(Vec::new(), |trial| trial.cell.iter().map(level_of).collect());
        let (number, count) = self.position();
        json!({
            "title": self.experiment.title, "part": part.map(|part| &part.name), "number": number,
            "count": count, "left": self.progress.left(), "waits_for": waits,
            "is_paused": self.paused_s.is_some(),
            "state": format!("{:?}", self.state).to_lowercase(), "mount": self.mounts(), "levels": cell,
            "shown": self.shown_names(), "places": self.places(), "reference": reference,
            "token": self.token, "level": self.step.as_ref().and_then(|s| s.level),
            "chosen": self.buttons().get(self.chosen),
        })
    }
}

/// The side of a place in a trial of so many.
fn side(sides: Sides, count: usize, at: usize) -> Side {
    match (sides, count, at) {
        (Sides::Right, 1, _) | (_, 2, 1) => Side::Right,
        (_, 1 | 2, _) => Side::Left,
        _ => Side::Everywhere,
    }
}

fn question(question: &Question) -> Value {
    let text = &question.text;
    match &question.kind {
        QuestionKind::Scale { from, to, low, high } => {
            json!({ "kind": "scale", "text": text, "from": from, "to": to, "low": low, "high": high })
        }
        QuestionKind::Which => json!({ "kind": "which", "text": text }),
        QuestionKind::Same => json!({ "kind": "same", "text": text }),
        QuestionKind::Sliders { low, high } => {
            json!({ "kind": "sliders", "text": text, "low": low, "high": high })
        }
        QuestionKind::Text => json!({ "kind": "text", "text": text }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::parse;

    /// Two textures, three stimuli of which one is real, a reference, a break, a survey.
    fn study() -> Experiment {
        let text = "Experiment(version: 1, title: \"Hidden title\", participants: 4,
            factors: {\"texture\": [\"oakwood\", \"feltcloth\"]},
            stimuli: {
                \"Network\": graph(file: \"net.ron\", set: {\"texture.material\": \"{texture}\"}),
                \"Autoregressive\": graph(file: \"ar.ron\"),
                \"Genuine\": real(mount: \"{texture}\"),
            },
            parts: [
                (name: \"warmup\", instructions: \"Feel.\", over: [\"texture\"],
                 show: [\"Genuine\"], sides: right),
                (name: \"likeness\", over: [\"texture\"], show: [(\"Network\", \"Autoregressive\")],
                 repeats: 3, break_every: 4,
                 ask: [scale(name: \"like\", text: \"How like?\", from: 1, to: 7,
                     low: \"not\", high: \"very\")]),
                (name: \"choice\", over: [\"texture\"], reference: \"Genuine\",
                 show: [(\"Network\", \"Autoregressive\")],
                 ask: [which(name: \"closer\", text: \"Which is closer?\"),
                       text(name: \"why\", text: \"Why?\")]),
            ],
            survey: [scale(name: \"hard\", text: \"Hard?\", from: 1, to: 5, low: \"easy\", high: \"hard\")],
        )";
        parse(text).unwrap_or_else(|e| panic!("{e}"))
    }

    /// Presses what the screens ask for, once. Returns the events.
    fn go_on(conduct: &mut Conduct<'_>, random: &mut Random, now_s: f64) -> Vec<Event> {
        let screen = conduct.participant();
        let token = screen["token"].as_str().unwrap().to_owned();
        let answer = |question: &Value, random: &mut Random| match question["kind"].as_str().unwrap() {
            "scale" => Given::Number(question["from"].as_i64().unwrap() + random.below(5) as i64),
            "which" => Given::Number(random.below(2) as i64),
            _ => Given::Text("so".into()),
        };
        let press = match screen["questions"].as_array().unwrap().as_slice() {
            [] if conduct.participant()["state"] == "wait" => Press::Ready { token },
            [] => Press::Next { token },
            questions => {
                Press::Answer { token, answers: questions.iter().map(|q| answer(q, random)).collect() }
            }
        };
        conduct.press(press, now_s).unwrap_or_else(|e| panic!("{e}: {screen}"))
    }

    /// Runs a session to its end; returns the log, the participant's screens and what was felt with each.
    fn whole(study: &Experiment, seed: u64) -> (Vec<Event>, Vec<Value>, Vec<usize>) {
        let mut conduct = Conduct::new(study, 2, &[], seed).unwrap();
        let mut random = Random::new(seed);
        let (mut log, mut screens, mut felt) = (Vec::new(), Vec::new(), Vec::new());
        while !conduct.is_over() {
            screens.push(conduct.participant());
            felt.push(conduct.felt().len());
            log.extend(go_on(&mut conduct, &mut random, log.len() as f64));
            assert!(log.len() < 200, "it never ends");
        }
        (log, screens, felt)
    }

    #[test]
    fn session_shows_every_part_and_ends() {
        let (log, screens, felt) = whole(&study(), 3);
        let count = |of: fn(&Event) -> bool| log.iter().filter(|e| of(e)).count();
        assert_eq!(count(|e| matches!(e, Event::Answered { .. })), 2 + 6 + 2);
        assert_eq!(count(|e| matches!(e, Event::Shown { .. })), 10);
        assert_eq!((count(|e| matches!(e, Event::Survey { .. })), log.last()), (1, Some(&Event::End)));
        let states: Vec<&str> = screens.iter().filter_map(|s| s["state"].as_str()).collect();
        assert_eq!(&states[..4], ["welcome", "instructions", "wait", "explore"]);
        assert_eq!(states.iter().filter(|state| **state == "break").count(), 1);
        assert_eq!(states.iter().filter(|state| **state == "reference").count(), 2);
        // Something is felt while exploring and with a reference only.
        for (state, felt) in states.iter().zip(felt) {
            assert_eq!(felt > 0, ["explore", "reference"].contains(state), "{state}");
        }
    }

    #[test]
    fn participants_screens_never_name_a_condition() {
        for seed in 0..20 {
            for screen in whole(&study(), seed).1 {
                let text = screen.to_string();
                for name in [
                    "Network",
                    "Autoregressive",
                    "Genuine",
                    "oakwood",
                    "feltcloth",
                    "likeness",
                    "warmup",
                    "Hidden",
                    "net.ron",
                    "ar.ron",
                    "closer\"",
                    "\"like\"",
                ] {
                    assert!(!text.contains(name), "{name} in {text}");
                }
            }
        }
    }

    #[test]
    fn screens_of_a_condition_have_nothing_of_their_own() {
        // Without token, number and place in time, screens of a kind are the same for all conditions.
        let strip = |screen: &Value| {
            let mut screen = screen.clone();
            screen["token"] = Value::Null;
            screen["trial"] = Value::Null;
            screen.to_string()
        };
        let (_, screens, _) = whole(&study(), 5);
        let explored: Vec<&Value> = screens.iter().filter(|s| s["state"] == "explore").collect();
        let of = |text: &str| -> std::collections::BTreeSet<String> {
            explored.iter().filter(|s| s.to_string().contains(text)).map(|s| strip(s)).collect()
        };
        assert_eq!((of("How like?").len(), of("Which is closer?").len()), (1, 1));
        // And tokens are all different.
        let tokens: std::collections::BTreeSet<&str> =
            screens.iter().filter_map(|s| s["token"].as_str()).collect();
        assert_eq!(tokens.len(), screens.len());
    }

    #[test]
    fn answers_to_an_earlier_screen_are_refused() {
        let study = study();
        let mut conduct = Conduct::new(&study, 1, &[], 1).unwrap();
        let stale = Press::Next { token: "0".into() };
        assert!(conduct.press(stale, 0.0).unwrap_err().to_string().contains("has changed"));
        let token = conduct.participant()["token"].as_str().unwrap().to_owned();
        conduct.press(Press::Next { token: token.clone() }, 0.0).unwrap();
        assert!(conduct.press(Press::Next { token }, 0.0).is_err(), "a second press of the same screen");
    }

    #[test]
    fn resumed_session_goes_on_with_the_next_trial() {
        let study = study();
        let (log, ..) = whole(&study, 7);
        for cut in 0..log.len() {
            let mut conduct = Conduct::new(&study, 2, &log[..cut], 99).unwrap();
            let mut random = Random::new(1);
            let mut more = Vec::new();
            while !conduct.is_over() {
                more.extend(go_on(&mut conduct, &mut random, 0.0));
            }
            let both = log[..cut].iter().chain(&more);
            let mut answered: Vec<usize> = both
                .filter_map(|e| match e {
                    Event::Answered { trial, .. } => Some(*trial),
                    _ => None,
                })
                .collect();
            answered.sort_unstable();
            assert_eq!(answered, (0..10).collect::<Vec<_>>(), "cut after {cut} events");
        }
    }

    #[test]
    fn every_trial_of_a_part_with_samples_waits() {
        let part = "show: [(\"x\", \"z\"), (\"x\", \"y\")], sides: fixed, order: fixed, repeats: 2,
            ask: [which(name: \"w\", text: \"Which?\")]";
        let study = crate::testing::experiment("", part);
        let mut conduct = Conduct::new(&study, 1, &[], 1).unwrap();
        let mut random = Random::new(1);
        let mut waits = Vec::new();
        while !conduct.is_over() {
            let desk = conduct.experimenter();
            if desk["state"] == "wait" {
                waits.push(desk["mount"].as_array().map_or(0, Vec::len));
            }
            go_on(&mut conduct, &mut random, 0.0);
        }
        // Also where the sample is to be taken away: else *wait* would tell the condition.
        assert_eq!(waits, [0, 1, 0, 1]);
    }

    #[test]
    fn pause_is_no_part_of_a_trials_time() {
        let part = "show: [(\"x\", \"z\")], ask: [which(name: \"w\", text: \"Which?\")]";
        let study = crate::testing::experiment("", part);
        let mut conduct = Conduct::new(&study, 1, &[], 1).unwrap();
        let mut random = Random::new(1);
        go_on(&mut conduct, &mut random, 1.0);
        assert_eq!(conduct.press(Press::Pause, 3.0), Ok(vec![Event::Paused { paused: true }]));
        assert_eq!(conduct.press(Press::Pause, 4.0), Ok(vec![]));
        assert_eq!(conduct.press(Press::Resume, 8.0), Ok(vec![Event::Paused { paused: false }]));
        let events = go_on(&mut conduct, &mut random, 10.0);
        let Event::Answered { seconds, .. } = events[0] else { panic!("{events:?}") };
        assert_eq!(seconds, 4.0);
    }

    #[test]
    fn sample_of_the_reference_is_taken_away_first() {
        let part = "show: [(\"x\", \"z\")], reference: \"y\", sides: fixed,
            ask: [which(name: \"w\", text: \"Which?\")]";
        let study = crate::testing::experiment("", part);
        let mut conduct = Conduct::new(&study, 1, &[], 1).unwrap();
        let mut random = Random::new(1);
        let mut seen = Vec::new();
        while !conduct.is_over() {
            let (desk, felt) = (conduct.experimenter(), conduct.felt().len());
            let mounts = desk["mount"].as_array().map_or(0, Vec::len);
            seen.push((desk["state"].as_str().unwrap().to_owned(), mounts, felt));
            go_on(&mut conduct, &mut random, 0.0);
        }
        let expected =
            [("welcome", 1, 0), ("wait", 1, 0), ("reference", 1, 1), ("exchange", 0, 0), ("explore", 0, 2)];
        let seen: Vec<(&str, usize, usize)> =
            seen.iter().map(|(state, m, f)| (state.as_str(), *m, *f)).collect();
        assert_eq!(seen, expected);
    }

    #[test]
    fn pause_hides_questions_and_stimuli() {
        let study = study();
        let mut conduct = Conduct::new(&study, 1, &[], 1).unwrap();
        let mut random = Random::new(1);
        while conduct.felt().is_empty() {
            go_on(&mut conduct, &mut random, 0.0);
        }
        conduct.press(Press::Pause, 0.0).unwrap();
        assert!(conduct.felt().is_empty());
        assert_eq!(conduct.participant()["state"], "paused");
        let token = conduct.participant()["token"].as_str().unwrap().to_owned();
        assert!(conduct.press(Press::Next { token }, 0.0).is_err());
        conduct.press(Press::Resume, 0.0).unwrap();
        assert!(!conduct.felt().is_empty());
    }

    #[test]
    fn spoiled_trial_is_marked_with_its_answers() {
        let study = study();
        let mut conduct = Conduct::new(&study, 1, &[], 1).unwrap();
        let mut random = Random::new(1);
        while conduct.participant()["questions"].as_array().unwrap().is_empty() {
            go_on(&mut conduct, &mut random, 0.0);
        }
        let number = conduct.shown().unwrap().number;
        conduct.spoil("2 % of the deadlines were missed");
        conduct.spoil("and more");
        let events = go_on(&mut conduct, &mut random, 0.0);
        let Event::Marked { trial, why, answers } = &events[0] else { panic!("{events:?}") };
        assert_eq!((*trial, why.as_str(), answers.len()), (number, "2 % of the deadlines were missed", 1));
        let next = go_on(&mut conduct, &mut random, 0.0);
        assert!(matches!(next[0], Event::Answered { .. }), "the next trial counts: {next:?}");
    }

    #[test]
    fn marked_trial_comes_again_and_its_mark_is_logged() {
        let study = study();
        let mut conduct = Conduct::new(&study, 1, &[], 1).unwrap();
        let mut random = Random::new(1);
        let mut log = Vec::new();
        while conduct.felt().is_empty() {
            log.extend(go_on(&mut conduct, &mut random, 0.0));
        }
        let token = conduct.experimenter()["token"].as_str().unwrap().to_owned();
        log.extend(conduct.press(Press::Mark { token, why: "the sample fell off".into() }, 0.0).unwrap());
        assert!(
            matches!(log.last(), Some(Event::Marked { trial: 0, .. }))
                || log.iter().any(|e| matches!(e, Event::Marked { trial: 0, .. }))
        );
        while !conduct.is_over() {
            log.extend(go_on(&mut conduct, &mut random, 0.0));
        }
        let answered = log.iter().filter(|e| matches!(e, Event::Answered { trial: 0, .. })).count();
        let shown: Vec<u32> = log
            .iter()
            .filter_map(|e| match e {
                Event::Shown { trial: 0, attempt, .. } => Some(*attempt),
                _ => None,
            })
            .collect();
        assert_eq!((answered, shown), (1, vec![0, 1]));
    }

    #[test]
    fn screens_have_the_words_of_the_file() {
        let fields = "words: {\"language\": \"de\", \"lost\": \"Keine Verbindung.\", \"left\": \"Links\"},";
        let part = "show: [(\"x\", \"z\")], sides: fixed, ask: [which(name: \"w\", text: \"Wo?\")]";
        let study = crate::testing::experiment(fields, part);
        let mut conduct = Conduct::new(&study, 1, &[], 1).unwrap();
        go_on(&mut conduct, &mut Random::new(1), 0.0);
        let screen = conduct.participant();
        let words = &screen["words"];
        assert_eq!([&words["language"], &words["lost"], &words["next"]], ["de", "Keine Verbindung.", "Next"]);
        assert_eq!(screen["places"], json!(["Links", "Right"]));
    }

    #[test]
    fn experimenter_sees_what_is_felt_where() {
        let part = "show: [(\"x\", \"y\", \"z\")], sides: fixed, reference: \"y\"";
        let study = crate::testing::experiment("", part);
        let screen = Conduct::new(&study, 1, &[], 1).unwrap().experimenter();
        assert_eq!(screen["places"], json!(["A", "B", "C"]));
        assert_eq!((&screen["shown"], &screen["reference"]), (&json!(["x", "y", "z"]), &json!("y")));
        assert_eq!(screen["mount"], json!([["Reference", "felt"], ["B", "felt"]]));
    }

    /// Three places with sliders, and their first one as the reference.
    const MUSHRA: &str = "show: [(\"x\", \"y\", \"z\")], sides: fixed, reference: \"x\",
        ask: [sliders(name: \"s\", text: \"?\", low: \"bad\", high: \"good\")]";

    fn feel(conduct: &mut Conduct<'_>, place: usize) -> Result<Vec<Event>, Refused> {
        let token = conduct.participant()["token"].as_str().unwrap().to_owned();
        conduct.press(Press::Feel { token, place }, 0.0)
    }

    fn felt(conduct: &Conduct<'_>) -> Vec<(usize, Side, usize)> {
        conduct.felt().iter().map(|felt| (felt.place, felt.side, felt.stimulus)).collect()
    }

    #[test]
    fn chosen_place_is_felt_everywhere_and_keeps_the_screen() {
        let study = crate::testing::experiment("", MUSHRA);
        let mut conduct = Conduct::new(&study, 1, &[], 1).unwrap();
        let mut random = Random::new(1);
        go_on(&mut conduct, &mut random, 0.0);
        go_on(&mut conduct, &mut random, 0.0);
        // The reference comes first. Its place is not that of the hidden one.
        assert_eq!(felt(&conduct), [(3, Side::Everywhere, 0)]);
        assert!(feel(&mut conduct, 0).is_err(), "there is no choice yet");
        go_on(&mut conduct, &mut random, 0.0);
        let screen = conduct.participant();
        assert_eq!(screen["buttons"], json!(["A", "B", "C", "Reference"]));
        assert_eq!((&screen["places"], &screen["chosen"]), (&json!(["A", "B", "C"]), &json!(0)));
        for (place, stimulus) in [(0, 0), (2, 3), (3, 0), (1, 2)] {
            assert_eq!(feel(&mut conduct, place), Ok(Vec::new()));
            assert_eq!(felt(&conduct), [(place, Side::Everywhere, stimulus)]);
            assert_eq!(conduct.participant()["token"], screen["token"]);
            assert_eq!(conduct.participant()["chosen"], place);
        }
        assert!(feel(&mut conduct, 4).is_err());
        conduct.press(Press::Pause, 0.0).unwrap();
        assert!(feel(&mut conduct, 0).is_err() && conduct.participant()["buttons"] == json!([]));
        conduct.press(Press::Resume, 0.0).unwrap();
        assert_eq!(conduct.participant()["chosen"], 1);
    }

    #[test]
    fn two_places_have_sides_and_no_buttons() {
        let which = "ask: [which(name: \"w\", text: \"?\")]";
        let part = format!("show: [(\"x\", \"z\")], sides: fixed, reference: \"w\", {which}");
        let study = crate::testing::experiment("", &part);
        let mut conduct = Conduct::new(&study, 1, &[], 1).unwrap();
        let mut random = Random::new(1);
        go_on(&mut conduct, &mut random, 0.0);
        assert_eq!(felt(&conduct), [(2, Side::Everywhere, 1)]);
        assert_eq!(conduct.participant()["sides"], false);
        go_on(&mut conduct, &mut random, 0.0);
        assert_eq!(felt(&conduct), [(0, Side::Left, 0), (1, Side::Right, 3)]);
        assert_eq!(
            (conduct.participant()["buttons"].clone(), feel(&mut conduct, 0).is_err()),
            (json!([]), true)
        );
        assert_eq!(conduct.participant()["sides"], true);
    }

    #[test]
    fn every_trial_begins_with_its_first_place() {
        let study =
            crate::testing::experiment("", &format!("{MUSHRA}, repeats: 2").replace("reference: \"x\",", ""));
        let mut conduct = Conduct::new(&study, 1, &[], 1).unwrap();
        go_on(&mut conduct, &mut Random::new(1), 0.0);
        go_on(&mut conduct, &mut Random::new(1), 0.0);
        feel(&mut conduct, 2).unwrap();
        let token = conduct.participant()["token"].as_str().unwrap().to_owned();
        let answers = vec![Given::Numbers(vec![1.0, 2.0, 3.0])];
        go_on_with(&mut conduct, Press::Answer { token, answers });
        go_on(&mut conduct, &mut Random::new(1), 0.0);
        assert_eq!(felt(&conduct), [(0, Side::Everywhere, 0)]);
    }

    fn go_on_with(conduct: &mut Conduct<'_>, press: Press) -> Vec<Event> {
        conduct.press(press, 0.0).unwrap_or_else(|e| panic!("{e}"))
    }

    #[test]
    fn refusals_have_the_words_of_the_file() {
        let fields = "words: {\"changed\": \"Neu!\", \"invalid\": \"Nein!\", \"unanswered\": \"Bitte!\",
            \"paused\": \"Pause!\", \"no_sample\": \"Keine!\", \"no_trial\": \"Nichts!\"},";
        let part = "show: [(\"x\", \"z\")], ask: [which(name: \"w\", text: \"?\")]";
        let study = crate::testing::experiment(fields, part);
        let mut conduct = Conduct::new(&study, 1, &[], 1).unwrap();
        let token = conduct.participant()["token"].as_str().unwrap().to_owned();
        let mark = Press::Mark { token: token.clone(), why: String::new() };
        assert_eq!(conduct.press(mark, 0.0).unwrap_err().0, "Nichts!");
        assert_eq!(conduct.press(Press::Ready { token }, 0.0).unwrap_err().0, "Keine!");
        let stale = Press::Mark { token: "0".into(), why: String::new() };
        assert_eq!(conduct.press(stale, 0.0).unwrap_err().0, "Neu!");
        go_on(&mut conduct, &mut Random::new(1), 0.0);
        let token = conduct.participant()["token"].as_str().unwrap().to_owned();
        let stale = Press::Next { token: "0".into() };
        assert_eq!(conduct.press(stale, 0.0).unwrap_err().0, "Neu!");
        assert_eq!(conduct.press(Press::Next { token: token.clone() }, 0.0).unwrap_err().0, "Bitte!");
        for answers in [vec![], vec![Given::Number(2)], vec![Given::Same(true)]] {
            let answer = Press::Answer { token: token.clone(), answers };
            assert_eq!(conduct.press(answer, 0.0).unwrap_err().0, "Nein!");
        }
        conduct.press(Press::Pause, 0.0).unwrap();
        assert_eq!(conduct.press(Press::Next { token }, 0.0).unwrap_err().0, "Pause!");
    }
}
