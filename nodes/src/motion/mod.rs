//! Position and motion of the stylus: `trajectory`, `stroke`, `velocity`.

mod stroke;
mod trajectory;
mod velocity;

pub use stroke::Stroke;
pub use trajectory::Trajectory;
pub use velocity::Velocity;

use crate::prelude::*;

/// A duration in seconds as an exact number of microseconds.
fn microseconds(seconds: f64) -> Latency {
    Latency::ratio((seconds * 1e6).round() as i64, 1_000_000)
}
