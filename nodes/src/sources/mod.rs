//! Signals that begin in a graph: `audio_in`, `clip`, `noise`, and `sine`, `sweep` and `impulse` to measure
//! with.

mod audio_in;
mod clip;
mod impulse;
mod noise;
mod sine;
mod sweep;
#[cfg(test)]
mod tests;

pub use audio_in::AudioIn;
pub use clip::Clip;
pub use impulse::Impulse;
pub use noise::Noise;
pub use sine::Sine;
pub use sweep::Sweep;

use crate::prelude::*;

/// Units that a source may put out.
const UNITS: [&str; 4] = ["A", "V", "m/s^2", "FS"];

fn output() -> Output {
    Output::new("out", ShapeSpec::Audio(RateSpec::Graph), Unit::AMPERE)
}

fn unit_param() -> Param {
    choice("unit", &UNITS).doc("Unit of the output: current, voltage, acceleration, or full scale (FS).")
}

/// The ports with the unit that the parameter names.
fn with_unit(config: &Config<'_>, mut ports: Ports) -> Ports {
    let unit = Unit::from_symbol(config.params.text("unit"));
    ports.outputs.iter_mut().for_each(|o| o.unit = UnitSpec::Is(unit.clone()));
    ports
}
