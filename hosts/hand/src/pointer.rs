//! `pointer_input`: a hand with a mouse, a finger or a pen on the live page.

use asperity_live::place;
use asperity_node::{Descriptor, Diagnostic, Node, Param, Prepared, Processor, Setup, Status, Tick, Unit};

use crate::node::hand;

/// A pointer on a plane. Its pressure sets the depth of the stylus in the surface, and the force.
pub(crate) struct PointerInput {
    height_mm: f64,
    depth_mm: f64,
    lift_mm: f64,
    max_force_n: f64,
}

impl Node for PointerInput {
    fn descriptor() -> Descriptor {
        let mm = |name, default, range, doc| Param::number(name, default, range, doc).unit("mm");
        let it =
            Descriptor::new("pointer_input", "A mouse, finger or pen on the live page: pressure is force.")
                .param(mm("height_mm", 0.0, -1000.0..=1000.0, "Height of the surface."))
                .param(mm("depth_mm", 6.6, 0.01..=1000.0, "How far below it the stylus is at full pressure."))
                .param(mm("lift_mm", 2.0, 0.0..=1000.0, "How far above it the stylus is off the surface."))
                .param(Param::number("max_force_n", 3.3, 0.0..=100.0, "Force at full pressure.").unit("N"));
        hand(it, (Unit::NONE, "pressure from 0 to 1, 0 off the surface"))
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
        let &[x, y, _] = tick.inputs.control(place::POSITION) else { return Status::Continue };
        let pressure = tick.inputs.value(place::FORCE).clamp(0.0, 1.0);
        let above = if pressure > 0.0 { -pressure * self.depth_mm } else { self.lift_mm };
        tick.outputs.control(place::POSITION).copy_from_slice(&[x, y, self.height_mm + above]);
        tick.outputs.set(place::FORCE, pressure * self.max_force_n);
        tick.outputs.set(place::STROKE, tick.inputs.value(place::STROKE));
        Status::Continue
    }

    fn reset(&mut self) {}
}
