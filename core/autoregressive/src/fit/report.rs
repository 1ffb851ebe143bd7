//! What a fit did.

use std::fmt;

/// A piece that was fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Where it begins, in s from the recording's beginning.
    pub start_s: f64,
    /// How long it is, in s.
    pub length_s: f64,
    /// Its mean speed in mm/s.
    pub speed_mm_s: f64,
    /// Its mean force in N.
    pub force_n: f64,
    /// Variance in (m/s^2)^2 of what its own model, of the order that was chosen, leaves unexplained.
    pub residual_variance: f64,
    /// Its mean square in (m/s^2)^2, with what the high-pass took put back.
    pub mean_square: f64,
    /// The model that it is part of, by number, from 0.
    pub model: usize,
}

/// Why something was dropped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Why {
    /// The samples of acceleration do not change.
    Still,
    /// They stand at the highest or lowest value that there is.
    Clipped,
    /// Too little force.
    NoContact,
    /// Too slow.
    Slow,
    /// A click.
    Click,
    /// Speed or force change too fast.
    Unsteady,
    /// Shorter than the shortest piece.
    Short,
}

impl Why {
    /// All reasons.
    pub const ALL: [Self; 7] =
        [Self::Still, Self::Clipped, Self::NoContact, Self::Slow, Self::Click, Self::Unsteady, Self::Short];
}

impl fmt::Display for Why {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Still => "without a change of acceleration",
            Self::Clipped => "with the acceleration at its limit",
            Self::NoContact => "without contact",
            Self::Slow => "too slow",
            Self::Click => "around clicks",
            Self::Unsteady => "with speed or force changing",
            Self::Short => "too short between others",
        })
    }
}

/// A stretch that was not fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dropped {
    /// Where it begins, in s from the recording's beginning.
    pub start_s: f64,
    /// How long it is, in s.
    pub length_s: f64,
    /// Why.
    pub why: Why,
}

/// What a fit did. Each 10 ms of the recording is in one of the segments or of what was dropped.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// How much of the recording was looked at, in s: whole blocks of 10 ms.
    pub duration_s: f64,
    /// Rate of the models in Hz.
    pub model_hz: f64,
    /// Corner of the high-pass in Hz.
    pub high_pass_hz: f64,
    /// The models' order.
    pub order: usize,
    /// Orders and their criterion, less a constant so that the least is 0; empty where the order was given.
    pub criterion: Vec<(usize, f64)>,
    /// What was fitted, in order of time.
    pub segments: Vec<Segment>,
    /// What was not, in order of time.
    pub dropped: Vec<Dropped>,
}

impl Report {
    /// How much was dropped for a reason, in s.
    pub fn dropped_s(&self, why: Why) -> f64 {
        self.dropped.iter().filter(|d| d.why == why).map(|d| d.length_s).sum()
    }
}
