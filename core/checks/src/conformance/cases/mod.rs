//! The cases, by name.

mod cost;
mod descriptor;
mod engine;
mod input;
mod memory;
mod parameters;
mod rates;
mod state;

use crate::conformance::place::Place;
use crate::conformance::signal::Signal;
use crate::conformance::subject::Subject;

/// What became of a case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// What must hold holds.
    Pass,
    /// It does not.
    Fail,
    /// The kind has nothing that the case is about, or it cannot be found out here.
    NotApplicable,
}

/// A verdict and what was found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Outcome {
    /// The verdict.
    pub verdict: Verdict,
    /// What was found, in a sentence or a few figures.
    pub found: String,
}

/// Why a case does not pass.
enum Not {
    Failed(String),
    Applicable(String),
}

impl From<String> for Not {
    fn from(wrong: String) -> Self {
        Self::Failed(wrong)
    }
}

/// What was found where all is well.
type Found = Result<String, Not>;

fn not_applicable(why: impl Into<String>) -> Found {
    Err(Not::Applicable(why.into()))
}

/// Something that must hold for every kind.
#[derive(Clone, Copy, Debug)]
pub struct Case {
    /// Its name: lower case, words joined by `_`.
    pub name: &'static str,
    /// What must hold, in a sentence.
    pub about: &'static str,
    run: fn(&Subject<'_>) -> Found,
}

impl Case {
    /// Finds out whether it holds.
    pub fn run(&self, subject: &Subject<'_>) -> Outcome {
        let (verdict, found) = match (self.run)(subject) {
            Ok(found) => (Verdict::Pass, found),
            Err(Not::Failed(found)) => (Verdict::Fail, found),
            Err(Not::Applicable(found)) => (Verdict::NotApplicable, found),
        };
        Outcome { verdict, found }
    }
}

/// The place where most cases put the kind. That it has none is said by one case, `prepare`.
fn main<'a>(subject: &'a Subject<'_>) -> Result<&'a Place, Not> {
    subject.main().map_err(|_| Not::Applicable("it cannot be prepared".into()))
}

/// All cases, in the order in which they are run: what is plain first.
pub fn cases() -> &'static [Case] {
    &CASES
}

static CASES: [Case; 23] = [
    Case {
        name: "descriptor",
        about: "Names, docs, ranges and defaults are there and agree.",
        run: descriptor::descriptor,
    },
    Case {
        name: "prepare",
        about: "It is prepared among ordinary rates and types.",
        run: descriptor::prepare,
    },
    Case { name: "zero", about: "Zeros lead to no fault.", run: |s| input::on(s, Signal::Zero) },
    Case { name: "random", about: "Noise leads to no fault.", run: |s| input::on(s, Signal::Random) },
    Case { name: "steps", about: "Steps lead to no fault.", run: |s| input::on(s, Signal::Steps) },
    Case {
        name: "denormal",
        about: "Denormal numbers lead to no fault.",
        run: |s| input::on(s, Signal::Denormal),
    },
    Case {
        name: "huge",
        about: "Values to 1e6, and frames to 1e30, lead to no fault.",
        run: |s| input::on(s, Signal::Huge).and_then(|_| input::on(s, Signal::Enormous)),
    },
    Case {
        name: "not_finite",
        about: "After NaN, infinities and negative magnitudes it is well again within a second.",
        run: input::not_finite,
    },
    Case { name: "rates", about: "It runs at every rate of ticks and audio.", run: rates::rates },
    Case { name: "layouts", about: "It runs with every layout of frames.", run: rates::layouts },
    Case { name: "unconnected", about: "Optional inputs may stay unconnected.", run: rates::unconnected },
    Case { name: "missing_frames", about: "Frames may stay away.", run: input::missing_frames },
    Case {
        name: "outputs",
        about: "It writes whole outputs, says so, and writes nowhere else.",
        run: input::outputs,
    },
    Case { name: "reset", about: "After a reset it is as a fresh one.", run: memory::reset },
    Case {
        name: "determinism",
        about: "Two instances put out the same, whatever runs beside them.",
        run: memory::determinism,
    },
    Case { name: "engine", about: "In the engine it puts out the same, asleep or not.", run: engine::engine },
    Case { name: "sleep", about: "After a sleep it goes on as it says of itself.", run: memory::sleep },
    Case { name: "cycle", about: "It closes a cycle.", run: memory::cycle },
    Case { name: "state", about: "What it saves goes on in another instance.", run: state::state },
    Case {
        name: "garbage_state",
        about: "It refuses or survives a state that is none.",
        run: state::garbage_state,
    },
    Case {
        name: "live_parameters",
        about: "Live parameters may change at any time, within their ranges.",
        run: parameters::live,
    },
    Case { name: "random_ticks", about: "Many random ticks lead to no fault.", run: input::random_ticks },
    Case { name: "allocation", about: "It neither allocates nor frees in real time.", run: cost::allocation },
];

/// How long a call of the kind takes: median, 99th percentile and longest, in microseconds. A figure, not a case: nothing is
/// asked of it.
///
/// # Errors
/// The kind cannot be prepared, or fails.
pub fn tick_time(subject: &Subject<'_>) -> Result<TickTime, String> {
    cost::time(subject)
}

pub use cost::TickTime;
