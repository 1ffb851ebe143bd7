//! Errors of effects' laws, and how numbers count that are too large or not finite.
//!
//! Constructors check and may allocate. Functions that run per tick do neither, keep f64 state, and are
//! finite for any input.

use std::fmt;

/// Settings that cannot be made into an effect.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum EffectError {
    /// A value outside of its range, or not a number.
    Range {
        /// Name of the value.
        what: &'static str,
        /// The value that was given.
        found: f64,
        /// Smallest allowed.
        from: f64,
        /// Largest allowed.
        to: f64,
        /// The unit of the three.
        unit: &'static str,
    },
    /// A list that is too short or too long.
    Count {
        /// Name of the counted things.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// Smallest allowed.
        from: usize,
        /// Largest allowed.
        to: usize,
    },
    /// A value in a list that is not finite.
    NotFinite {
        /// Name of the list's values.
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
    pub(super) fn check(
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

    /// Checks that a list has an allowed length and that all its values are finite.
    pub(super) fn check_list(
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

/// Largest size that an input counts for.
const LARGEST: f64 = 1e6;

/// Limits a number to a size of [`LARGEST`]. A number that is not finite becomes 0.
pub(super) fn counted(x: f64) -> f64 {
    if x.is_finite() { x.clamp(-LARGEST, LARGEST) } else { 0.0 }
}

/// The same for a quantity that is at least 0: a negative number becomes 0.
pub(super) fn counted_positive(x: f64) -> f64 {
    counted(x).max(0.0)
}

/// The same for a vector: 0 if part of it is not finite.
pub(super) fn counted_vector<const N: usize>(v: [f64; N]) -> [f64; N] {
    if v.iter().all(|x| x.is_finite()) { v.map(counted) } else { [0.0; N] }
}

pub(super) fn dot<const N: usize>(a: [f64; N], b: [f64; N]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

pub(super) fn length<const N: usize>(a: [f64; N]) -> f64 {
    dot(a, a).sqrt()
}
