//! Nodes that the modules of devices share.
//!
//! A node itself does no input or output: the host feeds it at every tick's own time. While the host has
//! nothing that is new enough, the last values are held and marked: gates close, and what leads to a device
//! fades.

use std::marker::PhantomData;

use asperity_live::place;
use asperity_node::{
    Descriptor, Diagnostic, Input, Node, Output, Param, Prepared, Processor, Resume, Role, Setup, ShapeSpec,
    Status, Tick, Unit,
};

/// Descriptor of a node with the motion of a hand: adds role, timing, fed inputs, and outputs in the same
/// order. `force`: unit and meaning of the fed force.
pub(crate) fn hand(descriptor: Descriptor, (force, force_doc): (Unit, &'static str)) -> Descriptor {
    timing(descriptor)
        .role(Role::Hand)
        .input(
            Input::new("hand_position", ShapeSpec::Control(3), Unit::MILLIMETRE)
                .host_fed()
                .doc("where the hand is; a wire here takes the device's place"),
        )
        .input(Input::new("hand_force", ShapeSpec::Control(1), force).host_fed().doc(force_doc))
        .input(
            Input::new("hand_stroke", ShapeSpec::Control(1), Unit::NONE)
                .host_fed()
                .doc("counts touches that do not join on to what was before"),
        )
        .output(Output::new("position", ShapeSpec::Control(3), Unit::MILLIMETRE).doc("x, y, z, z up"))
        .output(Output::new("force", ShapeSpec::Control(1), Unit::NEWTON).doc("how hard the hand presses"))
        .output(
            Output::new("stroke", ShapeSpec::Control(1), Unit::NONE)
                .doc("counts touches; wired to `velocity.stroke`, the way from one to the next is no motion"),
        )
        .resumes(Resume::Continue)
}

/// Adds the parameters that say when a source is too old, and how far behind it is read.
fn timing(descriptor: Descriptor) -> Descriptor {
    descriptor
        .param(
            Param::number(
                "timeout_ms",
                50.0,
                5.0..=10_000.0,
                "After so long without a sample the source stalls: its values are held and marked.",
            )
            .unit("ms"),
        )
        .param(
            Param::number(
                "delay_ms",
                0.0,
                0.0..=100.0,
                "How far behind the hand it is read, so that there are samples on both sides of a tick; \
                 left out, as late as samples come.",
            )
            .unit("ms")
            .optional(),
        )
}

/// Passes on the fed values.
pub(crate) fn pass_on(tick: &mut Tick<'_>) -> Status {
    for port in [place::POSITION, place::FORCE, place::STROKE] {
        for (to, from) in tick.outputs.control(port).iter_mut().zip(tick.inputs.control(port)) {
            *to = *from;
        }
    }
    Status::Continue
}

/// A device with a stylus on an arm that pushes back. Its two nodes differ from those of other devices in
/// this only.
pub(crate) trait Arm: Send + 'static {
    /// Kind, summary and own parameters of the input node.
    fn input() -> Descriptor;
    /// Kind and summary of the force node, and its default largest force \[N\].
    fn force() -> (Descriptor, f64);
    /// Doc of the parameter `device`: the name of the device, and the meaning of an empty one.
    const NAME: &str;
    /// Default axes.
    const AXES: &str;
}

/// The parameter that joins the two nodes of a device.
fn named<A: Arm>(descriptor: Descriptor) -> Descriptor {
    descriptor.param(Param::text("device", "", A::NAME))
}

/// Position of the stylus on an arm.
pub(crate) struct ArmInput<A>(PhantomData<A>);

impl<A: Arm> Node for ArmInput<A> {
    fn descriptor() -> Descriptor {
        let axes = "Which of the device's axes are x, y and z here, z up: \"x,-z,y\".";
        let it = named::<A>(A::input()).param(Param::text("axes", A::AXES, axes));
        hand(it, (Unit::NEWTON, "the force that the device renders"))
    }

    fn prepare(_setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        Ok(Prepared::new(Self(PhantomData)))
    }
}

impl<A: Arm> Processor for ArmInput<A> {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        pass_on(tick)
    }

    fn reset(&mut self) {}
}

/// Surface that an arm pushes back with. The input node with the same `device` names the device. The host
/// gives the surface to the device's servo loop, which evaluates it at its own rate.
pub(crate) struct ArmForce<A>(PhantomData<A>);

impl<A: Arm> Node for ArmForce<A> {
    fn descriptor() -> Descriptor {
        let (it, max_force_n) = A::force();
        named::<A>(it)
            .role(Role::Force)
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
                Param::number(
                    "max_force_n",
                    max_force_n,
                    0.0..=100.0,
                    "The most it pushes; the device's own limit counts too.",
                )
                .unit("N"),
            )
            .param(
                Param::number(
                    "device_damping_ns_per_m",
                    0.0,
                    0.0..=100.0,
                    "Damping of the device itself, for the warning of a wall that it cannot render \
                     without trembling; 0 for not known.",
                )
                .unit("N s/m"),
            )
            .timing(
                "the wall's own loop holds no tick of the graph: the device evaluates the plane at its own \
                 rate",
            )
            .resumes(Resume::Never)
            .sink()
    }

    fn prepare(_setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        Ok(Prepared::new(Self(PhantomData)))
    }
}

impl<A: Arm> Processor for ArmForce<A> {
    fn process(&mut self, _tick: &mut Tick<'_>) -> Status {
        Status::Continue
    }

    fn reset(&mut self) {}
}
