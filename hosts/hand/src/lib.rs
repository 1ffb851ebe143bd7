//! Where a hand's motion comes from, and how a device pushes back.
//!
//! A source runs on a thread of its own and sends [`Sample`](asperity_live::Sample)s to the tick thread:
//! [`osc`] hears packets of a network, [`openhaptics`] and [`haply`] read force-feedback devices. A device
//! that can push evaluates the [`ForceModel`](asperity_live::ForceModel) that the graph publishes in its
//! own loop, by the law in [`servo`]. Every source is started by a function that answers a [`Handle`]; it
//! stops when the handle is dropped.

mod error;
mod frame;
mod handle;
pub mod haply;
pub mod openhaptics;
pub mod osc;
pub mod servo;

pub use error::{HandError, Next};
pub use frame::Frame;
pub use handle::{Device, Handle};

/// The servo rate in Hz to hand to [`passivity`](servo::passivity::passivity) for a sink of this kind: 1 /
/// (T + 2 d) with the period T and the delay d of its loop. `openhaptics_force` is evaluated within its
/// period ([`openhaptics::SERVO_HZ`], d = 0); `haply_force` and whatever is not known count with
/// [`haply::USUAL_HZ`] and [`haply::DELAY_S`].
pub fn servo_hz(kind: &str) -> f64 {
    match kind {
        "openhaptics_force" => f64::from(openhaptics::SERVO_HZ),
        _ => 1.0 / (1.0 / f64::from(haply::USUAL_HZ) + 2.0 * haply::DELAY_S),
    }
}

#[cfg(test)]
mod tests {
    use super::servo_hz;

    #[test]
    fn delay_of_half_a_period_halves_the_servo_rate() {
        assert_eq!(servo_hz("openhaptics_force"), 1000.0);
        assert!((servo_hz("haply_force") - 500.0).abs() < 1e-9);
    }
}
