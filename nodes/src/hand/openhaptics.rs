//! `openhaptics_input`, `openhaptics_force`: a stylus on an arm that is driven by the OpenHaptics library.

use asperity_node::{Descriptor, Diagnostic, Node, Param, Resume, Setup, Status, Tick, Unit};

use super::{axes, force, pass_on, ports, timing};

/// The parameters by which a device is found.
fn device(descriptor: Descriptor) -> Descriptor {
    descriptor
        .param(Param::text(
            "device",
            "",
            "Name of the device as its set-up tool knows it; empty for the default.",
        ))
        .param(Param::text(
            "library",
            "",
            "The vendor's library libHD; empty to look where systems keep theirs.",
        ))
}

/// Where the stylus of an OpenHaptics device is.
pub struct OpenhapticsInput;

impl Node for OpenhapticsInput {
    fn descriptor() -> Descriptor {
        let it = Descriptor::new("openhaptics_input", "A stylus on an arm, by the OpenHaptics library.");
        let it = timing(device(it).param(axes("x,-z,y")));
        ports(it, Unit::NEWTON, "the force that the device renders").resumes(Resume::Resume)
    }

    fn prepare(_setup: &Setup<'_>) -> Result<Self, Diagnostic> {
        Ok(Self)
    }

    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        pass_on(tick)
    }

    fn reset(&mut self) {}
}

/// The surface that an OpenHaptics device pushes back with, evaluated in its own servo loop.
pub struct OpenhapticsForce;

impl Node for OpenhapticsForce {
    fn descriptor() -> Descriptor {
        let it = Descriptor::new(
            "openhaptics_force",
            "Renders a plane on an OpenHaptics device, in the device's own servo loop.",
        );
        force::sink(device(it), 3.3)
    }

    fn prepare(_setup: &Setup<'_>) -> Result<Self, Diagnostic> {
        Ok(Self)
    }

    fn process(&mut self, _tick: &mut Tick<'_>) -> Status {
        Status::Continue
    }

    fn reset(&mut self) {}
}
