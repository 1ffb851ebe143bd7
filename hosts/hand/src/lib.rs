//! Sources of a hand's motion, and force feedback.
//!
//! A source runs on a thread of its own and sends [`Sample`](asperity_live::Sample)s to the tick thread:
//! [`osc`] receives network packets, [`openhaptics`] and [`haply`] read force-feedback devices. A device
//! that can push evaluates the graph's [`ForceModel`](asperity_live::ForceModel) in its own loop, by the
//! law in [`servo`]. Each module's `start` returns a [`Handle`]; dropping it stops the source.

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

/// Effective servo rate [Hz] of a kind of force sink, for [`passivity`](servo::passivity::passivity): 1 /
/// (T + 2 d) with the period T and the delay d of its loop. `openhaptics_force` has
/// [`openhaptics::SERVO_HZ`] and d = 0; `haply_force`, and any unknown kind, have [`haply::USUAL_HZ`] and
/// [`haply::DELAY_S`].
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
