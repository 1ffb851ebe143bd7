//! Sources of a hand's motion, and force feedback.
//!
//! A source runs on a thread of its own and sends [`Sample`](asperity_live::Sample)s to the tick thread:
//! [`osc`] receives network packets, [`openhaptics`] and [`haply`] read force-feedback devices. A device
//! that can push evaluates the graph's [`ForceModel`](asperity_live::ForceModel) in its own loop, by the
//! law in [`servo`]. Each module's `start` returns a [`Handle`]; dropping it stops the source.
//!
//! A new device is a module that implements [`HandDevice`], and a line in [`DEVICES`].

mod device;
mod error;
mod frame;
mod handle;
pub mod haply;
mod node;
pub mod openhaptics;
pub mod osc;
mod pointer;
pub mod servo;

use asperity_node::Registry;

pub use device::{HandDevice, Open};
pub use error::{HandError, Next};
pub use frame::Frame;
pub use handle::{Device, Handle};

/// All hand devices.
pub const DEVICES: &[&dyn HandDevice] = &[&osc::Osc, &openhaptics::OpenHaptics, &haply::Haply];

/// Adds the node kinds of all devices, and `pointer_input`, which the live page feeds.
pub fn register(registry: Registry) -> Registry {
    DEVICES.iter().fold(registry.with::<pointer::PointerInput>(), |all, device| device.register(all))
}

/// The device of an input or force node, by the node's kind; `None` for `pointer_input`.
pub fn device_of(kind: &str) -> Option<&'static dyn HandDevice> {
    DEVICES.iter().copied().find(|device| device.input() == kind || device.force() == Some(kind))
}

#[cfg(test)]
mod tests {
    use super::*;
    use asperity_node::Role;

    #[test]
    fn delay_of_half_a_period_halves_the_servo_rate() {
        assert_eq!(openhaptics::OpenHaptics.servo_hz(), 1000.0);
        assert!((haply::Haply.servo_hz() - 500.0).abs() < 1e-9);
    }

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
