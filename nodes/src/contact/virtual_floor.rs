//! `virtual_floor`: Hooke's law against a plane.

use crate::prelude::*;

/// A horizontal plane that pushes back in proportion to how deep the stylus is in it.
///
/// A parameter that changes while it runs counts from the next tick on. The force on a stylus in the plane
/// then jumps.
pub struct VirtualFloor([f64; 4]);

/// The parameters, all live, in the order of the values.
const PARAMS: [&str; 4] = ["stiffness_n_per_mm", "max_force_n", "height_mm", "damping_ns_per_m"];

impl Node for VirtualFloor {
    fn descriptor() -> Descriptor {
        Descriptor::new(
            "virtual_floor",
            "Computes the normal force of a horizontal plane by Hooke's law, up to a limit.",
        )
        .input(control("position", 3, MM).doc("stylus position x, y, z; z points up"))
        .output(control_out("force", 1, N).doc("normal force, upwards; 0 above the plane"))
        .output(control_out("depth", 1, MM).doc("penetration depth; 0 above the plane"))
        .output(control_out("plane", 3, MM))
        .doc("a point of the plane, for a device that renders it in its own loop")
        .output(control_out("normal", 3, ONE).doc("outward normal of the plane"))
        .output(control_out("stiffness", 1, Unit::NEWTON_PER_MILLIMETRE).doc("stiffness of the plane"))
        .output(control_out("damping", 1, Unit::NEWTON_SECOND_PER_METRE))
        .doc("damping of the plane along its normal")
        .param(number("stiffness_n_per_mm", 0.5, 0.0..=100.0, "N/mm").live().doc("Stiffness of the plane."))
        .param(
            number("max_force_n", 3.3, 0.0..=100.0, "N")
                .live()
                .doc("Largest force that the device can render."),
        )
        .param(number("height_mm", 0.0, -1000.0..=1000.0, "mm").live().doc("Height of the plane."))
        .param(
            number("damping_ns_per_m", 0.0, 0.0..=100.0, "N s/m")
                .live()
                .doc("Damping that a device adds in its own loop. The output `force` does not contain it."),
        )
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        Ok(Prepared::new(Self(PARAMS.map(|name| setup.params.number(name)))))
    }
}

impl Processor for VirtualFloor {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let [stiffness, max_force, height, damping] = self.0;
        let depth = (height - tick.inputs.control(0)[2]).max(0.0);
        tick.outputs.set(0, (stiffness * depth).min(max_force));
        tick.outputs.set(1, depth);
        tick.outputs.control(2).copy_from_slice(&[0.0, 0.0, height]);
        tick.outputs.control(3).copy_from_slice(&[0.0, 0.0, 1.0]);
        tick.outputs.set(4, stiffness);
        tick.outputs.set(5, damping);
        Status::Continue
    }

    fn set_parameter(&mut self, index: usize, value: f64) {
        self.0.get_mut(index).into_iter().for_each(|parameter| *parameter = value);
    }
}
