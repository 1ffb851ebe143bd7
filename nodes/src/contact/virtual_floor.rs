//! `virtual_floor`: Hooke's law against a plane.

use asperity_node::{
    Descriptor, Diagnostic, Input, Node, Output, Param, Prepared, Processor, Setup, ShapeSpec, Status, Tick,
    Unit,
};

/// A horizontal plane that pushes back in proportion to how deep the stylus is in it.
///
/// A parameter that changes while it runs counts from the next tick on. The force on a stylus in the plane
/// then jumps.
pub struct VirtualFloor {
    height_mm: f64,
    stiffness_n_per_mm: f64,
    max_force_n: f64,
    damping_ns_per_m: f64,
}

/// Places of the live parameters.
const STIFFNESS_N_PER_MM: usize = 0;
const MAX_FORCE_N: usize = 1;
const HEIGHT_MM: usize = 2;
const DAMPING_NS_PER_M: usize = 3;

impl Node for VirtualFloor {
    fn descriptor() -> Descriptor {
        Descriptor::new(
            "virtual_floor",
            "A horizontal plane: normal force by Hooke's law, clamped to the device's.",
        )
        .input(
            Input::new("position", ShapeSpec::Control(3), Unit::MILLIMETRE)
                .doc("x, y, z of the stylus, z up"),
        )
        .output(
            Output::new("force", ShapeSpec::Control(1), Unit::NEWTON).doc("normal force, upwards, 0 off it"),
        )
        .output(Output::new("depth", ShapeSpec::Control(1), Unit::MILLIMETRE).doc("penetration, 0 off it"))
        .output(
            Output::new("plane", ShapeSpec::Control(3), Unit::MILLIMETRE)
                .doc("a point of the plane, for a device that pushes back by itself"),
        )
        .output(Output::new("normal", ShapeSpec::Control(3), Unit::NONE).doc("the plane's outward normal"))
        .output(
            Output::new("stiffness", ShapeSpec::Control(1), Unit::NEWTON_PER_MILLIMETRE)
                .doc("stiffness of the plane"),
        )
        .output(
            Output::new("damping", ShapeSpec::Control(1), Unit::NEWTON_SECOND_PER_METRE)
                .doc("damping of the plane along its normal"),
        )
        .param(
            Param::number("stiffness_n_per_mm", 0.5, 0.0..=100.0, "Stiffness of the plane.")
                .unit("N/mm")
                .live(),
        )
        .param(
            Param::number("max_force_n", 3.3, 0.0..=100.0, "The most the device can push.").unit("N").live(),
        )
        .param(Param::number("height_mm", 0.0, -1000.0..=1000.0, "Height of the plane.").unit("mm").live())
        .param(
            Param::number(
                "damping_ns_per_m",
                0.0,
                0.0..=100.0,
                "Damping that a device adds in its own loop; `force`, which the texture follows, is Hooke's \
                 alone.",
            )
            .unit("N s/m")
            .live(),
        )
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        Ok(Prepared::new(Self {
            height_mm: setup.params.number("height_mm"),
            stiffness_n_per_mm: setup.params.number("stiffness_n_per_mm"),
            max_force_n: setup.params.number("max_force_n"),
            damping_ns_per_m: setup.params.number("damping_ns_per_m"),
        }))
    }
}

impl Processor for VirtualFloor {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let z = tick.inputs.control(0)[2];
        let depth = (self.height_mm - z).max(0.0);
        tick.outputs.set(0, (self.stiffness_n_per_mm * depth).min(self.max_force_n));
        tick.outputs.set(1, depth);
        tick.outputs.control(2).copy_from_slice(&[0.0, 0.0, self.height_mm]);
        tick.outputs.control(3).copy_from_slice(&[0.0, 0.0, 1.0]);
        tick.outputs.set(4, self.stiffness_n_per_mm);
        tick.outputs.set(5, self.damping_ns_per_m);
        Status::Continue
    }

    fn reset(&mut self) {}

    fn set_parameter(&mut self, index: usize, value: f64) {
        match index {
            STIFFNESS_N_PER_MM => self.stiffness_n_per_mm = value,
            MAX_FORCE_N => self.max_force_n = value,
            HEIGHT_MM => self.height_mm = value,
            DAMPING_NS_PER_M => self.damping_ns_per_m = value,
            _ => {}
        }
    }
}
