//! A stylus on a device that pushes back: `openhaptics_input`, `openhaptics_force`, and `haply_input`, `haply_force`.

use std::marker::PhantomData;

use asperity_node::{
    Descriptor, Diagnostic, Input, Node, Param, Resume, Role, Setup, ShapeSpec, Status, Tick, Unit,
};

use super::{pass_on, ports, timing};

/// What is said of a device by its nodes. Everything else is the same for all.
pub trait Device: Send + 'static {
    /// The node that says where its stylus is, with what only that node has to know.
    fn input() -> Descriptor;
    /// The node that pushes back, and its usual largest force in N.
    fn force() -> (Descriptor, f64);
    /// How its device is named, and what it means to leave the name out.
    const NAME: &str;
    /// Which of its axes are x, y and z, unless told otherwise.
    const AXES: &str;
}

/// An arm that is driven by the OpenHaptics library.
pub struct OpenHaptics;

impl Device for OpenHaptics {
    fn input() -> Descriptor {
        Descriptor::new("openhaptics_input", "A stylus on an arm, by the OpenHaptics library.")
            .role(Role::Hand)
            .param(Param::text(
                "library",
                "",
                "The vendor's library libHD; empty to look where systems keep theirs.",
            ))
    }

    fn force() -> (Descriptor, f64) {
        let summary = "Renders a plane on an OpenHaptics device, in the device's own servo loop.";
        (Descriptor::new("openhaptics_force", summary).role(Role::Force), 3.3)
    }

    const NAME: &str = "Name of the device as its set-up tool knows it; empty for the default.";
    const AXES: &str = "x,-z,y";
}

/// An Inverse3, by the service that Haply ships.
pub struct Haply;

impl Device for Haply {
    fn input() -> Descriptor {
        Descriptor::new("haply_input", "A stylus on an Inverse3, by the Haply service.")
            .role(Role::Hand)
            .param(Param::text("service", "ws://localhost:10001", "Address of the Haply service."))
    }

    fn force() -> (Descriptor, f64) {
        let summary = "Renders a plane on an Inverse3, in the loop that talks to it.";
        (Descriptor::new("haply_force", summary).role(Role::Force), 3.0)
    }

    const NAME: &str = "Id of the device; empty where there is one.";
    const AXES: &str = "x,y,z";
}

/// Where the stylus of an OpenHaptics device is.
pub type OpenhapticsInput = DeviceInput<OpenHaptics>;
/// The surface that an OpenHaptics device pushes back with, evaluated in its own servo loop.
pub type OpenhapticsForce = DeviceForce<OpenHaptics>;
/// Where the stylus of an Inverse3 is.
pub type HaplyInput = DeviceInput<Haply>;
/// The surface that an Inverse3 pushes back with, evaluated in the loop that talks to it.
pub type HaplyForce = DeviceForce<Haply>;

/// The parameter by which the two nodes of a device find one another, and the host the device.
fn named<D: Device>(descriptor: Descriptor) -> Descriptor {
    descriptor.param(Param::text("device", "", D::NAME))
}

/// Where a device's stylus is.
pub struct DeviceInput<D>(PhantomData<D>);

impl<D: Device> Node for DeviceInput<D> {
    fn descriptor() -> Descriptor {
        let axes = "Which of the device's axes are x, y and z here, z up: \"x,-z,y\".";
        let it = timing(named::<D>(D::input()).param(Param::text("axes", D::AXES, axes)));
        ports(it, Unit::NEWTON, "the force that the device renders").resumes(Resume::Resume)
    }

    fn prepare(_setup: &Setup<'_>) -> Result<Self, Diagnostic> {
        Ok(Self(PhantomData))
    }

    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        pass_on(tick)
    }

    fn reset(&mut self) {}
}

/// The surface that a device pushes back with. Which device that is, the input node of the same `device` says.
pub struct DeviceForce<D>(PhantomData<D>);

impl<D: Device> Node for DeviceForce<D> {
    fn descriptor() -> Descriptor {
        let (it, max_force_n) = D::force();
        sink(named::<D>(it), max_force_n)
    }

    fn prepare(_setup: &Setup<'_>) -> Result<Self, Diagnostic> {
        Ok(Self(PhantomData))
    }

    fn process(&mut self, _tick: &mut Tick<'_>) -> Status {
        Status::Continue
    }

    fn reset(&mut self) {}
}

/// A sink for a local model of contact: the host hands it to the device's servo loop, which evaluates it at its own rate.
fn sink(descriptor: Descriptor, max_force_n: f64) -> Descriptor {
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
        .input(
            Input::new("force", ShapeSpec::Control(3), Unit::NEWTON)
                .or(0.0)
                .doc("what there is beside the plane: friction, drag, pull; smoothed over 3 ms"),
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
