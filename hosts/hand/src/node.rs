//! Inputs, outputs and parameters that the nodes of all hands have, and `pointer_input`: a hand with a
//! mouse, a finger or a pen on the live page.
//!
//! A node itself does no input or output: the host feeds it at every tick's own time. While the host has
//! nothing that is new enough, the last values are held and marked: gates close, and signals to a device
//! fade.

use asperity_live::place;
use asperity_node::{
    Descriptor, Diagnostic, Input, Node, NodeKind, Output, Param, Prepared, Processor, Resume, Role, Setup,
    ShapeSpec, Status, Tick, Unit,
};

/// Descriptor of a node with the motion of a hand: adds role, timing, fed inputs, and outputs in the same
/// order. `force`: unit and meaning of the fed force.
pub(crate) fn hand(descriptor: Descriptor, (force, force_doc): (Unit, &'static str)) -> Descriptor {
    let fed =
        |name, values, unit, doc| Input::new(name, ShapeSpec::Control(values), unit).host_fed().doc(doc);
    let output = |name, values, unit, doc| Output::new(name, ShapeSpec::Control(values), unit).doc(doc);
    let ms = |name, default, range, doc| Param::number(name, default, range, doc).unit("ms");
    let timeout = "Time without a sample after which values are held and marked invalid.";
    let delay = "Delay behind the hand, so that each tick lies between two samples; left out, measured from \
                 the samples.";
    let position = "position of the hand; a wire here replaces the device";
    let stroke = "counts strokes; connect it to `velocity.stroke`, so that a jump is no motion";
    descriptor
        .param(ms("timeout_ms", 50.0, 5.0..=10_000.0, timeout))
        .param(ms("delay_ms", 0.0, 0.0..=100.0, delay).optional())
        .role(Role::Hand)
        .input(fed("hand_position", 3, Unit::MILLIMETRE, position))
        .input(fed("hand_force", 1, force, force_doc))
        .input(fed(
            "hand_stroke",
            1,
            Unit::NONE,
            "counts strokes: it changes when the stylus is put down elsewhere",
        ))
        .output(output("position", 3, Unit::MILLIMETRE, "stylus position x, y, z; z points up"))
        .output(output("force", 1, Unit::NEWTON, "force with which the hand presses"))
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

/// A hand that the host moves itself, tick by tick: position, force, and a count of strokes. No graph file
/// names it; a host puts it in the place of a stroke.
pub fn host_input() -> NodeKind {
    let it = Descriptor::new(HOST_INPUT, "Takes the position and force that the host gives.");
    let it = hand(it, (Unit::NEWTON, "force with which the hand presses"));
    NodeKind::new(it, |_| Ok(Prepared::new(PassOn(1.0))))
}

/// Kind of [`host_input`].
pub const HOST_INPUT: &str = "host_input";

/// A pointer on a surface. Its pressure sets the depth of the stylus below the place that it is fed, and the
/// force.
pub(crate) struct PointerInput {
    height_mm: f64,
    depth_mm: f64,
    lift_mm: f64,
    max_force_n: f64,
}

impl Node for PointerInput {
    fn descriptor() -> Descriptor {
        let mm = |name, default, range, doc| Param::number(name, default, range, doc).unit("mm");
        let it = Descriptor::new(
            "pointer_input",
            "Reads a mouse, finger or pen on the live page. Pressure becomes force.",
        )
        .param(mm("height_mm", 0.0, -1000.0..=1000.0, "Height of the surface."))
        .param(mm("depth_mm", 6.6, 0.01..=1000.0, "Depth of the stylus below the surface at full pressure."))
        .param(mm(
            "lift_mm",
            2.0,
            0.0..=1000.0,
            "Height of the stylus above the surface while it does not touch.",
        ))
        .param(Param::number("max_force_n", 3.3, 0.0..=100.0, "Force at full pressure.").unit("N"));
        hand(it, (Unit::NONE, "pressure from 0 to 1; 0 off the surface"))
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let p = setup.params;
        Ok(Prepared::new(Self {
            height_mm: p.number("height_mm"),
            depth_mm: p.number("depth_mm"),
            lift_mm: p.number("lift_mm"),
            max_force_n: p.number("max_force_n"),
        }))
    }
}

impl Processor for PointerInput {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let &[x, y, z] = tick.inputs.control(place::POSITION) else { return Status::Continue };
        let pressure = tick.inputs.value(place::FORCE).clamp(0.0, 1.0);
        let above = if pressure > 0.0 { -pressure * self.depth_mm } else { self.lift_mm };
        tick.outputs.control(place::POSITION).copy_from_slice(&[x, y, z + self.height_mm + above]);
        tick.outputs.set(place::FORCE, pressure * self.max_force_n);
        tick.outputs.set(place::STROKE, tick.inputs.value(place::STROKE));
        Status::Continue
    }

    fn reset(&mut self) {}
}
