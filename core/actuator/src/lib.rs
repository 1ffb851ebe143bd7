//! A voice-coil actuator: its profile, its motion on a handle, its inverse, its limiter, a simulation
//! and identification.
//!
//! A voice coil on a handle is two masses and a spring. The mover (mass m_a) hangs in the housing on a
//! suspension (k, c). The coil pushes it with k_f I. The housing is fixed to the handle (together m_h),
//! which gets the opposite push. With x the mover's place relative to the handle and mu = m_a m_h /
//! (m_a + m_h):
//! / (m_a + m_h):
//!
//! ```text
//! mu x'' + c x' + k x = k_f I        x/I = (k_f / mu) / (s^2 + 2 zeta w_n s + w_n^2)
//! m_h a = -mu x''                    A/I = -(k_f / m_h) s^2 / (s^2 + 2 zeta w_n s + w_n^2)
//! V = (R + L s) I + k_f s x          w_n^2 = k / mu,  2 zeta w_n = c / mu
//! ```
//!
//! [`ActuatorProfile`] is an actuator as its file in `graphs/actuators/` describes it. [`Dynamics`] is
//! the same on a handle of a given mass. [`Inverse`] turns a wanted acceleration into a current or a
//! voltage. [`Limiter`] is the last stage before the device. [`Plant`] simulates coil and handle.
//! [`identify`] finds a profile's figures from the signal of an accelerometer on the handle.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod dynamics;
pub mod identify;
mod inverse;
mod limiter;
mod plant;
mod profile;
mod shipped;

use std::fmt;

use asperity_dsp::filter::FilterError;

pub use dynamics::Dynamics;
pub use inverse::{Inverse, InverseModel, InverseSettings};
pub use limiter::{ChannelGuard, Limiter, LimiterReport, LimiterSettings, Limits};
pub use plant::{Motion, Plant};
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

/// An actuator or setting that does not fit.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum ActuatorError {
    /// A value outside of its range.
    Range {
        /// The value's name.
        what: &'static str,
        /// The value.
        found: f64,
        /// The least that fits.
        from: f64,
        /// The most that fits.
        to: f64,
        /// Unit of all three.
        unit: &'static str,
    },
    /// The actuator could pass its stroke while its current dies away.
    TooStrong {
        /// Part of the stroke's speed that the peak current gives in that time.
        share: f64,
        /// The largest part that can be limited.
        most: f64,
    },
    /// The back-EMF acts faster than samples of a voltage can.
    TooQuick {
        /// mu R / k_f^2 \[s\].
        emf_s: f64,
        /// The least that can be limited \[s\].
        least_s: f64,
    },
    /// A filter could not be made.
    Filter(FilterError),
}

impl ActuatorError {
    /// `Ok(value)` if it is within `from..=to`.
    pub(crate) fn check(
        what: &'static str,
        found: f64,
        from: f64,
        to: f64,
        unit: &'static str,
    ) -> Result<f64, Self> {
        if (from..=to).contains(&found) {
            Ok(found)
        } else {
            Err(Self::Range { what, found, from, to, unit })
        }
    }
}

impl fmt::Display for ActuatorError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Range { what, found, from, to, unit } => {
                let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
                write!(f, "{what} of {found}{unit} does not fit; from {from} to {to}{unit} does")
            }
            Self::TooStrong { share, most } => write!(
                f,
                "this actuator gains {share:.2} of the speed that its stroke bears before its peak \
                 current has \
                 ended, and at most {most} can be limited: use a higher rate or slew, or a lower peak current"
            ),
            Self::TooQuick { emf_s, least_s } => write!(
                f,
                "this actuator's back-EMF acts within {:.0} us, and at least {:.0} us can be limited: use a \
                 higher rate, or a current drive",
                emf_s * 1e6,
                least_s * 1e6
            ),
            Self::Filter(e) => e.fmt(f),
        }
    }
}

impl std::error::Error for ActuatorError {}

impl From<FilterError> for ActuatorError {
    fn from(e: FilterError) -> Self {
        Self::Filter(e)
    }
}

#[cfg(test)]
mod testing;
