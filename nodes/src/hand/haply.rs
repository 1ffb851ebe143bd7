//! `haply_input`, `haply_force`: a stylus on an Inverse3, by the service that Haply ships.

use asperity_node::{Descriptor, Diagnostic, Node, Param, Resume, Setup, Status, Tick, Unit};

use super::{axes, force, pass_on, ports, timing};

/// The parameters by which a device is found.
fn device(descriptor: Descriptor) -> Descriptor {
    descriptor
        .param(Param::text("service", "ws://localhost:10001", "Address of the Haply service."))
        .param(Param::text("device", "", "Id of the device; empty where there is one."))
}

/// Where the stylus of an Inverse3 is.
pub struct HaplyInput;

impl Node for HaplyInput {
    fn descriptor() -> Descriptor {
        let it = Descriptor::new("haply_input", "A stylus on an Inverse3, by the Haply service.");
        let it = timing(device(it).param(axes("x,y,z")));
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

/// The surface that an Inverse3 pushes back with, evaluated in the loop that talks to it.
pub struct HaplyForce;

impl Node for HaplyForce {
    fn descriptor() -> Descriptor {
        let it =
            Descriptor::new("haply_force", "Renders a plane on an Inverse3, in the loop that talks to it.");
        force::sink(device(it), 3.0)
    }

    fn prepare(_setup: &Setup<'_>) -> Result<Self, Diagnostic> {
        Ok(Self)
    }

    fn process(&mut self, _tick: &mut Tick<'_>) -> Status {
        Status::Continue
    }

    fn reset(&mut self) {}
}
