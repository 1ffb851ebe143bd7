//! What a surface does to a stylus: forces by the tick, vibration by the sample.
//!
//! | kernel | answers | of |
//! |---|---|---|
//! | [`friction`] | force along the surface, N | velocity and normal force |
//! | [`Magnet`] | force along the normal, N | distance to the surface |
//! | [`Viscosity`] | force, N | velocity |
//! | [`Tap`] | acceleration, m/s^2 | speed of approach |
//! | [`Vibration`] | acceleration, m/s^2 | the sample's number |
//! | [`Waveform`] | acceleration, m/s^2 | the [`Path`] along the surface, by distance |
//! | [`Relief`] | acceleration, m/s^2 | the [`Path`] along the surface, by place |
//!
//! [`passivity`] says of every law of force whether a device at a tick rate bears it; laws state themselves as a [`passivity::Law`].
//!
//! Lengths are in mm, speeds in mm/s, forces in N, accelerations in m/s^2. Constructors check and may allocate; what runs per tick does neither,
//! keeps f64 state, and is finite for any input: a number that is not finite counts as 0, unless a kernel says otherwise, and none counts for more
//! than 10^6.

pub mod friction;
mod magnet;
pub mod passivity;
mod path;
pub mod relief;
mod tap;
mod vibration;
mod viscosity;
pub mod waveform;

use std::fmt;

pub use magnet::Magnet;
pub use path::{Parts, Path, Point, Smoothing};
pub use relief::{HeightSpline, Heights, Jet, Relief, ReliefSettings};
pub use tap::{DecayingSinusoid, Recording, Tap, TapSettings, Transient, crossing};
pub use vibration::Vibration;
pub use viscosity::Viscosity;
pub use waveform::{Waveform, WaveformQuantity, WaveformTable};

/// What cannot be made into an effect.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum EffectError {
    /// A value outside of its range, or not a number.
    Range {
        /// What the value is.
        what: &'static str,
        /// What was given.
        found: f64,
        /// The least that fits.
        from: f64,
        /// The most that fits.
        to: f64,
        /// The unit of the three.
        unit: &'static str,
    },
    /// A list that is too short or too long.
    Count {
        /// What is counted.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// The least that fits.
        from: usize,
        /// The most that fits.
        to: usize,
    },
    /// A value in a list that is not finite.
    NotFinite {
        /// What the list holds.
        what: &'static str,
        /// Its place, from 0.
        index: usize,
    },
    /// Distances that do not rise.
    Order {
        /// The place of the first that is not above the one before, from 0.
        index: usize,
    },
}

impl EffectError {
    /// `Ok(value)` if it is within `from..=to`.
    fn check(
        what: &'static str,
        found: f64,
        (from, to): (f64, f64),
        unit: &'static str,
    ) -> Result<f64, Self> {
        if (from..=to).contains(&found) {
            Ok(found)
        } else {
            Err(Self::Range { what, found, from, to, unit })
        }
    }

    /// Whether a list is of a length that fits and all of it is finite.
    fn check_list(
        what: &'static str,
        list: impl ExactSizeIterator<Item = f64>,
        (from, to): (usize, usize),
    ) -> Result<(), Self> {
        let found = list.len();
        if !(from..=to).contains(&found) {
            return Err(Self::Count { what, found, from, to });
        }
        list.enumerate()
            .find(|(_, value)| !value.is_finite())
            .map_or(Ok(()), |(index, _)| Err(Self::NotFinite { what, index }))
    }
}

impl fmt::Display for EffectError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Range { what, found, from, to, unit } => {
                let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
                write!(f, "{what} of {found}{unit} does not fit; from {from} to {to}{unit} does")
            }
            Self::Count { what, found, from, to } => write!(f, "{found} {what}; from {from} to {to} fit"),
            Self::NotFinite { what, index } => write!(f, "number {} of the {what} is not finite", index + 1),
            Self::Order { index } => write!(f, "distance {} is not above the one before it", index + 1),
        }
    }
}

impl std::error::Error for EffectError {}

/// No input counts for more than this.
const LARGEST: f64 = 1e6;

/// A number as it counts: 0 for what is not finite, no more than [`LARGEST`].
fn counted(x: f64) -> f64 {
    if x.is_finite() { x.clamp(-LARGEST, LARGEST) } else { 0.0 }
}

/// A number that is at least 0, as it counts.
fn counted_positive(x: f64) -> f64 {
    counted(x).max(0.0)
}

/// A vector as it counts: 0 if part of it is not finite.
fn counted_vector<const N: usize>(v: [f64; N]) -> [f64; N] {
    if v.iter().all(|x| x.is_finite()) { v.map(counted) } else { [0.0; N] }
}

fn dot<const N: usize>(a: [f64; N], b: [f64; N]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn length<const N: usize>(a: [f64; N]) -> f64 {
    dot(a, a).sqrt()
}
