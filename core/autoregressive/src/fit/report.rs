//! Report of a fit.

use std::fmt;

/// A fitted piece.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Start in s from the recording's beginning.
    pub start_s: f64,
    /// Length in s.
    pub length_s: f64,
    /// Its mean speed in mm/s.
    pub speed_mm_s: f64,
    /// Its mean force in N.
    pub force_n: f64,
    /// Variance in (m/s^2)^2 that its own model of the chosen order leaves unexplained.
    pub residual_variance: f64,
    /// Mean square in (m/s^2)^2, with the power that the high-pass took.
    pub mean_square: f64,
    /// Number of its model, from 0.
    pub model: usize,
}

/// Reason for dropping a stretch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Why {
    /// The acceleration does not change.
    Still,
    /// The acceleration stays at its highest or lowest value.
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

/// A dropped stretch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dropped {
    /// Start in s from the recording's beginning.
    pub start_s: f64,
    /// Length in s.
    pub length_s: f64,
    /// Reason.
    pub why: Why,
}

/// Report of a fit. Each 10 ms of the recording belong to a segment or a dropped stretch.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// Length of the recording in whole blocks of 10 ms, in s.
    pub duration_s: f64,
    /// Rate of the models in Hz.
    pub model_hz: f64,
    /// Corner of the high-pass in Hz.
    pub high_pass_hz: f64,
    /// The models' order.
    pub order: usize,
    /// Orders and their criterion, shifted so that the least is 0. Empty where the order was given.
    pub criterion: Vec<(usize, f64)>,
    /// Fitted pieces, in order of time.
    pub segments: Vec<Segment>,
    /// Dropped stretches, in order of time.
    pub dropped: Vec<Dropped>,
}

impl Report {
    /// Time dropped for a reason, in s.
    pub fn dropped_s(&self, why: Why) -> f64 {
        dropped_s(&self.dropped, why)
    }
}

pub(super) fn dropped_s(dropped: &[Dropped], why: Why) -> f64 {
    dropped.iter().filter(|d| d.why == why).map(|d| d.length_s).sum()
}
