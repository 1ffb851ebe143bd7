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
            "Makes a stroke: zigzag, circle or line, with tremor, approach and lift-off.",
        )
        .role(Role::Stroke)
        .output(control_out("position", 3, MM).doc("x, y, z, z up"))
        .param(choice("shape", &["zigzag", "circle", "line"]))
        .doc("The path on the surface; its turns are minimum-jerk movements.")
        .param(number("extent_mm", 80.0, 0.1..=1000.0, "mm").doc("Length along x, or diameter."))
        .param(number("speed_mm_s", 100.0, 0.1..=2000.0, "mm/s").doc("Mean speed over the path."))
        .param(number("force_n", 1.0, 0.0..=100.0, "N"))
        .doc("Mean normal force on a floor of `stiffness_n_per_mm`.")
        .param(number("force_swing", 0.3, 0.0..=1.0, "").doc("Slow change of the force, as a part of it."))
        .param(number("force_swing_hz", 0.3, 0.0..=5.0, "Hz").doc("How often the force changes so."))
        .param(number("stiffness_n_per_mm", 0.5, 0.001..=1000.0, "N/mm"))
        .doc("Stiffness of the floor that is pressed on.")
        .param(number("clearance_mm", 10.0, 0.0..=1000.0, "mm"))
        .doc("Height before approach and after lift-off.")
        .param(number("approach_s", 0.4, 0.01..=10.0, "s").doc("Time of the approach, and of the lift-off."))
        .param(number("duration_s", 8.0, 0.2..=1e6, "s").doc("Time from approach to lift-off."))
        .param(number("tremor_mm", 0.05, 0.0..=10.0, "mm"))
        .doc("Largest displacement by a tremor of 8 to 12 Hz.")
        .param(number("quantum_mm", 0.055, 0.0..=10.0, "mm"))
        .doc("The sensor's step, to which positions are rounded; 0 for none.")
        .param(seed().doc("Seed of tremor and force; left out, from the graph's."))
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
