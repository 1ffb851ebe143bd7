//! Inputs, outputs and parameters that the nodes of all hands have.
//!
//! A node itself does no input or output: the host feeds it at every tick's own time. While the host has
//! nothing that is new enough, the last values are held and marked: gates close, and what leads to a device
//! fades.

use asperity_live::place;
use asperity_node::{
    Descriptor, Input, Output, Param, Processor, Resume, Role, ShapeSpec, Status, Tick, Unit,
};

/// Descriptor of a node with the motion of a hand: adds role, timing, fed inputs, and outputs in the same
/// order. `force`: unit and meaning of the fed force.
pub(crate) fn hand(descriptor: Descriptor, (force, force_doc): (Unit, &'static str)) -> Descriptor {
    let fed =
        |name, values, unit, doc| Input::new(name, ShapeSpec::Control(values), unit).host_fed().doc(doc);
    let output = |name, values, unit, doc| Output::new(name, ShapeSpec::Control(values), unit).doc(doc);
    let ms = |name, default, range, doc| Param::number(name, default, range, doc).unit("ms");
    let timeout = "After so long without a sample the source stalls: its values are held and marked.";
    let delay = "How far behind the hand it is read, so that there are samples on both sides of a tick; \
                 left out, as late as samples come.";
    let position = "where the hand is; a wire here takes the device's place";
    let stroke = "counts touches; wired to `velocity.stroke`, the way from one to the next is no motion";
    descriptor
        .param(ms("timeout_ms", 50.0, 5.0..=10_000.0, timeout))
        .param(ms("delay_ms", 0.0, 0.0..=100.0, delay).optional())
        .role(Role::Hand)
        .input(fed("hand_position", 3, Unit::MILLIMETRE, position))
        .input(fed("hand_force", 1, force, force_doc))
        .input(fed("hand_stroke", 1, Unit::NONE, "counts touches that do not join on to what was before"))
        .output(output("position", 3, Unit::MILLIMETRE, "x, y, z, z up"))
        .output(output("force", 1, Unit::NEWTON, "how hard the hand presses"))
        .output(output("stroke", 1, Unit::NONE, stroke))
        .resumes(Resume::Continue)
}

/// Passes on the fed values, the force times a factor.
pub(crate) struct PassOn(pub(crate) f64);

impl Processor for PassOn {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        for (port, gain) in [(place::POSITION, 1.0), (place::FORCE, self.0), (place::STROKE, 1.0)] {
            for (to, from) in tick.outputs.control(port).iter_mut().zip(tick.inputs.control(port)) {
                *to = from * gain;
            }
        }
        Status::Continue
    }

    fn reset(&mut self) {}
}
