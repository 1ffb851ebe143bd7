//! A voice-coil actuator: its profile, its motion on a handle, its inverse, its limiter, a simulation and
//! identification.
//!
//! A voice coil on a handle is two masses and a spring. The mover (mass m_a) hangs in the housing on a
//! suspension (k, c). The coil pushes it with k_f I. The housing is fixed to the handle (together m_h), which
//! gets the opposite push. With x the mover's place relative to the handle and mu = m_a m_h / (m_a + m_h):
//!
//! ```text
//! mu x'' + c x' + k x = k_f I        x/I = (k_f / mu) / (s^2 + 2 zeta w_n s + w_n^2)
//! m_h a = -mu x''                    A/I = -(k_f / m_h) s^2 / (s^2 + 2 zeta w_n s + w_n^2)
//! V = (R + L s) I + k_f s x          w_n^2 = k / mu,  2 zeta w_n = c / mu
//! ```
//!
//! [`ActuatorProfile`] is an actuator as its file in `graphs/actuators/` describes it. [`Dynamics`] is the
//! same on a handle of a given mass. [`Inverse`] turns a wanted acceleration into a current or a voltage.
//! [`Limiter`] is the last stage before the device. [`Plant`] simulates coil and handle. [`identify`] finds a
//! profile's figures from the signal of an accelerometer on the handle.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod dynamics;
pub mod identify;
mod inverse;
mod limiter;
mod plant;
mod profile;

use asperity_diagnostics::Diagnostic;

pub use dynamics::Dynamics;
pub use inverse::{Inverse, InverseModel, InverseSettings};
pub use limiter::{ChannelGuard, Limiter, LimiterReport, LimiterSettings, Limits};
pub use plant::{Motion, Plant, exponential};
pub use profile::{ActuatorProfile, Quantity};

/// The meaning of a sample to the amplifier.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Drive {
    /// A current \[A\]: a transconductance amplifier, such as one of 1 A/V.
    #[default]
    Current,
    /// A voltage \[V\]: an ordinary amplifier, whose current follows through resistance, inductance and
    /// back-EMF.
    Voltage,
}

impl Drive {
    /// The unit of a sample.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Current => "A",
            Self::Voltage => "V",
        }
    }
}

/// Checks that a value is within `from..=to`.
fn check(what: &str, found: f64, from: f64, to: f64, unit: &str) -> Result<(), Diagnostic> {
    if (from..=to).contains(&found) {
        return Ok(());
    }
    let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
    Err(Diagnostic::new(format!("{what} of {found}{unit} is out of range; allowed is {from} to {to}{unit}")))
}

#[cfg(test)]
mod testing;
