//! Questions of a trial and their answers.

use asperity_diagnostics::ron::{Record, Value};
use asperity_diagnostics::{Diagnostic, Place};
use serde::{Deserialize, Serialize};

use crate::file::{Part, fields, no_duplicates, variant, words};
use crate::method::Vary;

/// A question.
#[derive(Clone, Debug)]
pub struct Question {
    /// Name, unique in its part: a column of the tables.
    pub name: String,
    /// Text on the screen.
    pub text: String,
    /// Possible answers.
    pub kind: QuestionKind,
    /// Its place in the file.
    pub place: Place,
}

/// Kinds of questions.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum QuestionKind {
    /// A whole number from one end to the other (Likert), both ends labelled.
    Scale {
        /// Lowest number.
        from: i64,
        /// Highest number.
        to: i64,
        /// Label of the lowest.
        low: String,
        /// Label of the highest.
        high: String,
    },
    /// One of the stimuli shown.
    Which,
    /// Whether the stimuli are the same.
    Same,
    /// A number from 0 to 100 for each of the stimuli shown, as in MUSHRA (ITU-R BS.1534).
    Sliders {
        /// Label of 0.
        low: String,
        /// Label of 100.
        high: String,
    },
    /// Free text.
    Text,
}

/// An answer, in the terms of the file: of stimuli, never of sides.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Answer {
    /// To a scale.
    Number(i64),
    /// To *which*: the stimulus.
    Stimulus(String),
    /// To *same or different*.
    Same(bool),
    /// To sliders: each stimulus and its number.
    Numbers(Vec<(String, f64)>),
    /// To free text.
    Text(String),
}

/// Most steps of a scale.
const MOST_STEPS: i64 = 100;

impl Question {
    pub(crate) fn read(value: &Value) -> Result<Self, Diagnostic> {
        let kind = variant(value, &["scale", "which", "same", "sliders", "text"])?;
        let Some(mut record) = fields(value, kind)? else {
            let help = format!("{kind}(name: \"...\", text: \"...\")");
            return Err(value.error("a question has a name and a text").help(help));
        };
        let label = |record: &mut Record<'_>, name: &str| words(record.required(name)?);
        let name = label(&mut record, "name")?;
        let text = label(&mut record, "text")?;
        let kind = match kind {
            "scale" => {
                let from = record.required("from")?.i64_in(-1000..=1000, "")?;
                let last = record.required("to")?;
                let to = last.i64_in(-1000..=1000, "")?;
                if !(1..MOST_STEPS).contains(&(to - from)) {
                    return Err(last.error(format!("a scale from {from} to {to}")).help(format!(
                        "{} to {} are possible",
                        from + 1,
                        from + MOST_STEPS - 1
                    )));
                }
                let (low, high) = (label(&mut record, "low")?, label(&mut record, "high")?);
                QuestionKind::Scale { from, to, low, high }
            }
            "which" => QuestionKind::Which,
            "same" => QuestionKind::Same,
            "sliders" => {
                let (low, high) = (label(&mut record, "low")?, label(&mut record, "high")?);
                QuestionKind::Sliders { low, high }
            }
            _ => QuestionKind::Text,
        };
        record.finish()?;
        Ok(Self { name, text, kind, place: value.place() })
    }

    /// Whether an answer is possible, for a trial with these stimuli.
    pub fn takes(&self, answer: &Answer, shown: &[&str]) -> bool {
        match (&self.kind, answer) {
            (QuestionKind::Scale { from, to, .. }, Answer::Number(n)) => (*from..=*to).contains(n),
            (QuestionKind::Which, Answer::Stimulus(name)) => shown.contains(&name.as_str()),
            (QuestionKind::Same, Answer::Same(_)) | (QuestionKind::Text, Answer::Text(_)) => true,
            (QuestionKind::Sliders { .. }, Answer::Numbers(all)) => {
                all.len() == shown.len()
                    && shown.iter().all(|name| all.iter().any(|(of, _)| of == name))
                    && all.iter().all(|(_, x)| (0.0..=100.0).contains(x))
            }
            _ => false,
        }
    }
}

/// Refuses questions of one name.
pub(crate) fn distinct(questions: &[Question]) -> Result<(), Diagnostic> {
    no_duplicates(questions.iter().map(|q| (q.name.as_str(), &q.place)))
}

/// Refuses questions about several stimuli where a trial shows fewer or one twice, and entries that repeat.
pub(crate) fn fit_shown(part: &Part, shown: &Value) -> Result<(), Diagnostic> {
    let fewest = part.show.iter().map(Vec::len).min().unwrap_or(0);
    if let Some(twice) = (1..part.show.len()).find(|i| part.show[..*i].contains(&part.show[*i])) {
        let what = format!("entry {} of `show` stands there twice", twice + 1);
        return Err(shown.error(what).help("`repeats` says how often each is shown"));
    }
    let repeats = |kind: &Vec<usize>| (1..kind.len()).any(|i| kind[..i].contains(&kind[i]));
    let names = |q: &&Question| matches!(q.kind, QuestionKind::Which | QuestionKind::Sliders { .. });
    if let (Some(question), true) = (part.ask.iter().find(names), part.show.iter().any(repeats)) {
        return Err(Diagnostic::new("a trial shows a stimulus twice: an answer cannot name one of them")
            .at_place(&question.place)
            .related(shown.source(), shown.span(), "shown here")
            .help("`same(...)` or a scale"));
    }
    for question in &part.ask {
        let (what, least) = match question.kind {
            QuestionKind::Which => ("which", 2),
            QuestionKind::Same => ("same", 2),
            _ => continue,
        };
        if fewest < least {
            return Err(Diagnostic::new(format!("`{what}` needs two stimuli, and a trial shows {fewest}"))
                .at_place(&question.place)
                .related(shown.source(), shown.span(), "shown here")
                .help("show: [(\"first\", \"second\")]"));
        }
    }
    Ok(())
}

/// Refuses a varied parameter whose trials give no right or wrong answer.
pub(crate) fn judges(part: &Part, vary: &Vary) -> Result<(), Diagnostic> {
    let judges = |q: &&Question| matches!(q.kind, QuestionKind::Which | QuestionKind::Same);
    let count = part.ask.iter().filter(judges).count();
    if count != 1 {
        return Err(Diagnostic::new(format!("a varied parameter, and {count} questions that judge it"))
            .at_place(&vary.place)
            .help("ask exactly one `which(...)` or `same(...)`"));
    }
    let lacks = |kind: &Vec<usize>| kind.iter().filter(|s| **s == vary.stimulus).count() != 1;
    if part.show.iter().any(lacks) {
        return Err(Diagnostic::new("the varied stimulus is not in every trial")
            .at_place(&vary.place)
            .help("each entry of `show` has it once"));
    }
    Ok(())
}

impl Part {
    /// The question whose answers are right or wrong, if a parameter varies.
    pub fn judging(&self) -> Option<&Question> {
        self.vary.as_ref()?;
        self.ask.iter().find(|q| matches!(q.kind, QuestionKind::Which | QuestionKind::Same))
    }

    /// Whether its reference stays there beside the places: sliders compare with it, as in MUSHRA.
    pub fn keeps_reference(&self) -> bool {
        let slides = |q: &Question| matches!(q.kind, QuestionKind::Sliders { .. });
        self.reference.is_some() && self.ask.iter().any(slides)
    }

    /// Whether an answer to [`judging`](Self::judging) names the varied stimulus `name`, or a difference.
    pub fn is_hit(answer: &Answer, name: &str) -> Option<bool> {
        match answer {
            Answer::Stimulus(chosen) => Some(chosen == name),
            Answer::Same(same) => Some(!same),
            _ => None,
        }
    }
}
