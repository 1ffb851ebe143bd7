//! Motion of the stylus: recorded ([`Trajectory`]) or made ([`Stroke`]).
//! [`Table`] reads the CSV files of recordings.
//!
//! Both give a [`Sample`] for a time. Positions are in mm with z up. A surface lies in the plane z
//! = 0, its inside at negative z.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod axes;
mod read;
mod stroke;
mod table;
mod trajectory;
mod tremor;

pub use axes::AxisMap;
pub use read::{
    DEFAULT_MAX_GAP_S, MAX_ABS_FORCE_N, MAX_ABS_POSITION_MM, MAX_ABS_TIME_S, MAX_SPEED_MM_S,
    TrajectoryOptions,
};
pub use stroke::{Shape, Stroke, StrokeParams, minimum_jerk};
pub use table::{Column, Table};
pub use trajectory::{Cursor, Interpolation, Trajectory};
pub use tremor::Tremor;

/// The stylus at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// x, y, z in mm; z is up.
    pub position: [f64; 3],
    /// Normal force in N, if recorded.
    pub force: Option<f64>,
    /// Planar speed in mm/s, if recorded.
    pub speed: Option<f64>,
}

/// `value` rounded to the nearest multiple of `quantum`; unchanged if `quantum` is not above zero.
pub(crate) fn quantise(value: f64, quantum: f64) -> f64 {
    if quantum > 0.0 { (value / quantum).round() * quantum } else { value }
}
