//! `stroke`: a generated stroke.

use crate::prelude::*;
use asperity_motion::{self, Shape, StrokeParams};

use super::microseconds;

/// Generates a stroke by rule: approach, a path on the surface, lift-off. It is a pure function of time and
/// seed.
pub struct Stroke(asperity_motion::Stroke);

impl Node for Stroke {
    fn descriptor() -> Descriptor {
        Descriptor::new(
            "stroke",
            "Generates a stroke: a zigzag, circle or line, with approach, lift-off and tremor.",
        )
        .role(Role::Stroke)
        .output(control_out("position", 3, MM).doc("stylus position x, y, z; z points up"))
        .param(choice("shape", &["zigzag", "circle", "line"]))
        .doc("Shape of the path. Turns are minimum-jerk movements.")
        .param(
            number("extent_mm", 80.0, 0.1..=1000.0, "mm")
                .doc("Length of the path along x, or diameter of the circle."),
        )
        .param(number("speed_mm_s", 100.0, 0.1..=2000.0, "mm/s").doc("Mean speed along the path."))
        .param(number("force_n", 1.0, 0.0..=100.0, "N"))
        .doc("Mean normal force. It sets the depth below z = 0, by `stiffness_n_per_mm`.")
        .param(
            number("force_swing", 0.3, 0.0..=1.0, "")
                .doc("Slow variation of the force, as a fraction of `force_n`."),
        )
        .param(number("force_swing_hz", 0.3, 0.0..=5.0, "Hz").doc("Frequency of that slow variation."))
        .param(number("stiffness_n_per_mm", 0.5, 0.001..=1000.0, "N/mm"))
        .doc("Stiffness of the surface under the stylus. Use the same value in `virtual_floor`.")
        .param(number("clearance_mm", 10.0, 0.0..=1000.0, "mm"))
        .doc("Height above the surface before the approach and after lift-off.")
        .param(
            number("approach_s", 0.4, 0.01..=10.0, "s").doc("Duration of the approach, and of the lift-off."),
        )
        .param(number("duration_s", 8.0, 0.2..=1e6, "s").doc("Duration from approach to lift-off."))
        .param(number("tremor_mm", 0.05, 0.0..=10.0, "mm"))
        .doc("Largest displacement by hand tremor, 8 to 12 Hz.")
        .param(number("quantum_mm", 0.055, 0.0..=10.0, "mm"))
        .doc("Resolution of the position sensor. Positions are rounded to it; 0 turns it off.")
        .param(seed().doc("Seed of tremor and force; left out, derived from the graph's seed."))
        .resumes(Resume::Continue)
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let p = setup.params;
        let params = StrokeParams {
            shape: Shape::from_name(p.text("shape")).ok_or_else(|| p.error("shape", "unknown shape"))?,
            extent_mm: p.number("extent_mm"),
            mean_speed_mm_s: p.number("speed_mm_s"),
            force_n: p.number("force_n"),
            force_swing: p.number("force_swing"),
            force_swing_hz: p.number("force_swing_hz"),
            stiffness_n_per_mm: p.number("stiffness_n_per_mm"),
            clearance_mm: p.number("clearance_mm"),
            approach_s: p.number("approach_s"),
            duration_s: p.number("duration_s"),
            tremor_mm: p.number("tremor_mm"),
            quantum_mm: p.number("quantum_mm"),
            seed: p.get_integer("seed").map_or(setup.seed, |s| s as u64),
        };
        let stroke = asperity_motion::Stroke::new(params).map_err(|e| {
            let name = e.message.split('`').nth(1).unwrap_or("").to_owned();
            error_at(p, &name, e)
        })?;
        let duration = microseconds(stroke.duration_s());
        Ok(Prepared::new(Self(stroke)).duration(Some(duration)))
    }
}

impl Processor for Stroke {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let sample = self.0.sample(tick.seconds());
        tick.outputs.control(0).copy_from_slice(&sample.position);
        Status::Continue
    }
}
