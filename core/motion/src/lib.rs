//! Motion of the stylus: recorded ([`Trajectory`]), made ([`Stroke`]), or scripted ([`Itinerary`]).
//!
//! All three answer `sample(t)` with a [`Sample`]. Positions are in mm with z up; a surface lies in the plane
//! z = 0 and its inside is at negative z.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod axes;
mod interpolate;
mod itinerary;
mod minimum_jerk;
mod read;
mod stroke;
mod trajectory;
mod tremor;

pub use axes::AxisMap;
pub use itinerary::{Itinerary, Move};
pub use minimum_jerk::{minimum_jerk, minimum_jerk_ramp_integral, minimum_jerk_speed};
pub use read::{
    DEFAULT_MAX_GAP_S, MAX_ABS_FORCE_N, MAX_ABS_POSITION_MM, MAX_ABS_TIME_S, MAX_SPEED_MM_S,
    TrajectoryOptions,
};
pub use stroke::{Shape, Stroke, StrokeParams};
pub use trajectory::{Cursor, Interpolation, Trajectory};
pub use tremor::Tremor;

/// Where the stylus is at one moment, and what was recorded with it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// x, y, z in mm; z is up.
    pub position: [f64; 3],
    /// Normal force in N, where it was recorded.
    pub force: Option<f64>,
    /// Planar speed in mm/s, where it was recorded.
    pub speed: Option<f64>,
}

/// `value` rounded to the nearest multiple of `quantum`; unchanged when `quantum` is not above zero.
pub(crate) fn quantise(value: f64, quantum: f64) -> f64 {
    if quantum > 0.0 { (value / quantum).round() * quantum } else { value }
}
