//! A hand on a stylus, live: `osc_input`, `pointer_input`, `openhaptics_input` and `haply_input` say where it is;
//! `openhaptics_force` and `haply_force` push back.
//!
//! A node does no input or output itself: it says what it wants, and the host feeds it at every tick's own time. While the
//! host has nothing to give, or nothing that is new enough, the last values are held and marked: gates close, and what
//! leads to a device fades.

mod device;
mod osc;
mod pointer;

pub use device::{HaplyForce, HaplyInput, OpenhapticsForce, OpenhapticsInput};
pub use osc::OscInput;
pub use pointer::PointerInput;

use asperity_node::{Descriptor, Input, Output, Param, ShapeSpec, Status, Tick, Unit};

/// Places of what a host feeds an input node; its outputs are in the same order.
pub mod place {
    /// x, y, z in mm.
    pub const POSITION: usize = 0;
    /// Force in N, or pressure from 0 to 1.
    pub const FORCE: usize = 1;
    /// Number of the touch.
    pub const STROKE: usize = 2;
}

/// The inputs that a host feeds, and the outputs, of a node that says where a hand is.
fn ports(descriptor: Descriptor, force: Unit, force_doc: &'static str) -> Descriptor {
    descriptor
        .input(
            Input::new("hand_position", ShapeSpec::Control(3), Unit::MILLIMETRE)
                .fed()
                .doc("where the hand is; a wire here takes the device's place"),
        )
        .input(Input::new("hand_force", ShapeSpec::Control(1), force).fed().doc(force_doc))
        .input(
            Input::new("hand_stroke", ShapeSpec::Control(1), Unit::NONE)
                .fed()
                .doc("counts touches that do not join on to what was before"),
        )
        .output(Output::new("position", ShapeSpec::Control(3), Unit::MILLIMETRE).doc("x, y, z, z up"))
        .output(Output::new("force", ShapeSpec::Control(1), Unit::NEWTON).doc("how hard the hand presses"))
        .output(
            Output::new("stroke", ShapeSpec::Control(1), Unit::NONE)
                .doc("counts touches; wired to `velocity.stroke`, the way from one to the next is no motion"),
        )
}

/// The parameters that say when a source is too old, and how far behind it is read.
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
                "How far behind the hand it is read, so that there are samples on both sides of a tick; left out, as late \
                 as samples come.",
            )
            .unit("ms")
            .optional(),
        )
}

/// Passes on what the host gave.
fn pass_on(tick: &mut Tick<'_>) -> Status {
    for port in [place::POSITION, place::FORCE, place::STROKE] {
        for (to, from) in tick.outputs.control(port).iter_mut().zip(tick.inputs.control(port)) {
            *to = *from;
        }
    }
    Status::Continue
}
