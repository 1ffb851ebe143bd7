//! Errors of effects' laws, and how numbers count that are too large or not finite.
//!
//! Constructors check and may allocate. Functions that run per tick do neither, keep f64 state, and are
//! finite for any input.

/// `Ok(value)` if it is within `from..=to`.
pub(super) fn check(what: &str, found: f64, (from, to): (f64, f64), unit: &str) -> Result<f64, String> {
    if (from..=to).contains(&found) {
        return Ok(found);
    }
    let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
    Err(format!("{what} of {found}{unit} is out of range; allowed is {from} to {to}{unit}"))
}

/// Checks that a list has an allowed length and that all its values are finite.
pub(super) fn check_list(
    what: &str,
    mut list: impl ExactSizeIterator<Item = f64>,
    (from, to): (usize, usize),
) -> Result<(), String> {
    let found = list.len();
    if !(from..=to).contains(&found) {
        return Err(format!("{found} {what}; from {from} to {to} fit"));
    }
    match list.position(|value| !value.is_finite()) {
        Some(index) => Err(format!("number {} of the {what} is not finite", index + 1)),
        None => Ok(()),
    }
}

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
