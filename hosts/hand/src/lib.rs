//! Sources of a hand's motion, and force feedback.
//!
//! A source runs on a thread of its own and sends [`Sample`](asperity_live::Sample)s to the tick thread:
//! [`osc`] receives network packets, [`openhaptics`] and [`haply`] read arms that push back. An arm's loop
//! evaluates the graph's [`ForceModel`](asperity_live::ForceModel) by the law in [`servo`]. Each module's
//! `start` returns a [`Handle`]; dropping it stops the source.
//!
//! A new device is a module that implements [`HandDevice`], and a line in [`DEVICES`].

mod arm;
mod handle;
pub mod haply;
mod node;
pub mod openhaptics;
pub mod osc;
pub mod servo;

use std::net::SocketAddr;

use asperity_live::{ForceReader, SampleWriter};
use asperity_node::{Diagnostic, Params, Registry};

pub use arm::ArmOptions;
pub use handle::Handle;
pub use node::{HOST_INPUT, host_input};

/// Opens a device that was configured. Without the reader of force models its motors stay off.
pub type Open = Box<dyn FnOnce(SampleWriter, Option<ForceReader>) -> Result<Handle, Diagnostic> + Send>;

/// A kind of hand devices. Its errors have no place; the caller knows the node.
pub trait HandDevice: Sync {
    /// Kind of the node with the motion of the hand.
    fn input(&self) -> &'static str;

    /// Kind of the node that pushes back, if the device can.
    fn force(&self) -> Option<&'static str> {
        None
    }

    /// Adds its node kinds to a registry.
    fn register(&self, registry: Registry) -> Registry;

    /// Checks the parameters of its input node, without touching the device. `max_force_n`: largest force of
    /// its force node \[N\]. Error: an invalid parameter.
    fn configure(&self, params: &Params, max_force_n: f64) -> Result<Open, Diagnostic>;

    /// Whether `open`, a source of this kind, must be closed before a source with `params` is opened.
    /// `address`: where `open` listens.
    fn excludes(&self, params: &Params, open: &Params, address: Option<SocketAddr>) -> bool;

    /// Rate \[Hz\] and delay \[s\] of the loop that pushes back.
    fn servo(&self) -> [f64; 2] {
        [0.0; 2]
    }

    /// Message for the start of a run: what the user does next.
    fn invitation(&self, _params: &Params) -> Option<String> {
        None
    }
}

/// All hand devices.
pub const DEVICES: &[&dyn HandDevice] = &[&osc::Osc, &openhaptics::ARM, &haply::ARM];

/// Adds the node kinds of all devices, and `pointer_input`, which the live page feeds.
pub fn register(registry: Registry) -> Registry {
    let registry = registry.stage("Hand devices").with::<node::PointerInput>();
    DEVICES.iter().fold(registry, |all, device| device.register(all))
}

/// The device of an input or force node, by the node's kind; `None` for `pointer_input`.
pub fn device_of(kind: &str) -> Option<&'static dyn HandDevice> {
    DEVICES.iter().copied().find(|device| device.input() == kind || device.force() == Some(kind))
}

/// An error with its remedy.
fn error(message: impl Into<String>, help: impl Into<String>) -> Diagnostic {
    Diagnostic::new(message).help(help)
}

#[cfg(test)]
mod tests {
    use super::*;
    use asperity_node::Role;

    #[test]
    fn every_device_registers_its_kinds_with_their_roles() {
        let registry = register(Registry::new());
        for device in DEVICES {
            assert_eq!(registry.role(device.input()), Some(Role::Hand));
            let force = device.force().map(|kind| registry.role(kind));
            assert!(force.is_none_or(|role| role == Some(Role::Force)), "{}", device.input());
        }
        assert_eq!(registry.with_role(Role::Hand).count(), DEVICES.len() + 1);
    }
}
