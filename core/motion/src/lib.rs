//! Motion of the stylus: recorded ([`Trajectory`]) or made ([`Stroke`]).
//! [`Table`] reads the files of recordings, and a [`ColumnMap`] says which of their columns is which.
//!
//! Both give a [`Sample`] for a time. Positions are in mm with z up. A surface lies in the plane z
//! = 0, its inside at negative z.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod axes;
mod columns;
mod read;
mod stroke;
mod table;
mod trajectory;
mod tremor;

pub use axes::AxisMap;
pub use columns::{Column, ColumnMap, MAX_ABS_ACCELERATION_M_S2, MAX_ABS_FORCE_N, MAX_SPEED_MM_S};
pub use read::{DEFAULT_MAX_GAP_S, STIFFNESS_N_PER_MM, TrajectoryOptions};
pub use stroke::{Shape, Stroke, StrokeParams, minimum_jerk};
pub use table::Table;
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
    /// Number of the stroke, if recorded.
    pub stroke: Option<f64>,
}

/// `value` rounded to the nearest multiple of `quantum`; unchanged if `quantum` is not above zero.
pub(crate) fn quantise(value: f64, quantum: f64) -> f64 {
    if quantum > 0.0 { (value / quantum).round() * quantum } else { value }
}
