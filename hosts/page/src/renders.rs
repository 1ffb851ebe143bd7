//! Renders of strokes: one at a time, and the last result.

use axum::body::Bytes;
use serde::Deserialize;
use serde_json::{Value, json};

/// A render of a stroke.
#[derive(Clone, Debug)]
pub struct Rendered {
    /// The WAV file.
    pub wav: Vec<u8>,
    /// The report of the render.
    pub report: Value,
}

/// The render under way, or the last one.
#[derive(Debug, Default)]
pub(crate) struct Renders {
    number: u64,
    state: State,
}

#[derive(Debug, Default)]
enum State {
    #[default]
    Nothing,
    /// The stroke as CSV waits for the control thread.
    Waits(String),
    Works,
    Done(Bytes, Value),
    Failed(String),
}

/// The number of a render.
#[derive(Clone, Copy, Debug, Deserialize)]
pub(crate) struct Numbered {
    pub(crate) number: u64,
}

impl Renders {
    /// Begins a render and answers its number; `None` while another is under way.
    pub(crate) fn begin(&mut self, csv: String) -> Option<u64> {
        if matches!(self.state, State::Waits(_) | State::Works) {
            return None;
        }
        self.number += 1;
        self.state = State::Waits(csv);
        Some(self.number)
    }

    pub(crate) fn take(&mut self) -> Option<String> {
        let State::Waits(csv) = &mut self.state else { return None };
        let csv = std::mem::take(csv);
        self.state = State::Works;
        Some(csv)
    }

    pub(crate) fn finish(&mut self, result: Result<Rendered, String>) {
        self.state = match result {
            Ok(Rendered { wav, report }) => State::Done(wav.into(), report),
            Err(why) => State::Failed(why),
        };
    }

    /// The state for a page.
    pub(crate) fn state(&self) -> Value {
        let (state, report, why) = match &self.state {
            State::Nothing => ("nothing", &Value::Null, ""),
            State::Waits(_) | State::Works => ("working", &Value::Null, ""),
            State::Done(_, report) => ("done", report, ""),
            State::Failed(why) => ("failed", &Value::Null, why.as_str()),
        };
        json!({ "number": self.number, "state": state, "report": report, "why": why })
    }

    /// The WAV file of a render, if it is the last one.
    pub(crate) fn wav(&self, number: u64) -> Option<Bytes> {
        match &self.state {
            State::Done(wav, _) if number == self.number => Some(wav.clone()),
            _ => None,
        }
    }
}
