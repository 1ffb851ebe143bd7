//! What the sinks of devices that push back have in common.

use asperity_node::{Descriptor, Input, Param, Resume, ShapeSpec, Unit};

/// A sink for a local model of contact: the host hands it to the device's servo loop, which evaluates it at its own rate.
pub(super) fn sink(descriptor: Descriptor, max_force_n: f64) -> Descriptor {
    descriptor
        .input(
            Input::new("plane", ShapeSpec::Control(3), Unit::MILLIMETRE)
                .doc("a point of the plane, such as `virtual_floor.plane`"),
        )
        .input(
            Input::new("normal", ShapeSpec::Control(3), Unit::NONE)
                .doc("the plane's outward normal; all 0 for no surface"),
        )
        .input(
            Input::new("stiffness", ShapeSpec::Control(1), Unit::NEWTON_PER_MILLIMETRE)
                .doc("stiffness of the plane"),
        )
        .input(
            Input::new("damping", ShapeSpec::Control(1), Unit::NEWTON_SECOND_PER_METRE)
                .or(0.0)
                .doc("damping along the normal while in the plane"),
        )
        .param(
            Param::number("max_force_n", max_force_n, 0.0..=100.0, "The most it pushes; the device's own limit counts too.")
                .unit("N"),
        )
        .param(
            Param::number(
                "device_damping_ns_per_m",
                0.0,
                0.0..=100.0,
                "Damping of the device itself, for the warning of a wall that it cannot render without trembling; 0 for not \
                 known.",
            )
            .unit("N s/m"),
        )
        .timing("the wall's own loop holds no tick of the graph: the device evaluates the plane at its own rate")
        .resumes(Resume::Never)
        .sink()
}
