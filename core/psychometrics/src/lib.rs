//! Psychometric functions, adaptive methods and fits for perception studies.
//!
//! - [`Function`]: probability of a correct answer at a stimulus level.
//! - [`Staircase`]: transformed and weighted up/down method.
//! - [`Quest`]: QUEST+, which picks the level that tells most about the parameters.
//! - [`fit()`]: maximum-likelihood fit to counts of the method of constant stimuli.
//! - [`Observer`]: simulated participant.
//!
//! A method's state depends on its settings and the answers so far alone. A [`Log`] holds both, so a study
//! that was cut off goes on by replaying it. Numbers have the same bits on every CPU.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod fit;
mod function;
mod observer;
mod quest;
mod staircase;
#[cfg(test)]
mod tests;

use std::fmt::Display;

use serde::{Deserialize, Serialize};

pub use fit::{Fit, FitSettings, Interval, Row, fit};
pub use function::{Axis, Function, Shape};
pub use observer::Observer;
pub use quest::{Grid, Marginal, Posterior, Quest, QuestSettings};
pub use staircase::{Estimate, Staircase, StaircaseSettings, Steps};

/// Settings of a method and the answers so far, in order. True is a correct answer.
///
/// [`Staircase`] and [`Quest`] are written to files in this form.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Log<S> {
    /// Settings of the method.
    pub settings: S,
    /// Answers so far.
    pub answers: Vec<bool>,
}

/// An error that names a field, its value, and a value that fits, unless `good`.
fn require(good: bool, field: &str, value: impl Display, fitting: &str) -> Result<(), String> {
    if good { Ok(()) } else { Err(format!("`{field}` is {value}: use {fitting}")) }
}

/// Root of a rising function between `low` and `high`, by bisection to the last bit.
fn root(mut low: f64, mut high: f64, f: impl Fn(f64) -> f64) -> f64 {
    for _ in 0..200 {
        let middle = low + (high - low) / 2.0;
        if !(middle > low && middle < high) {
            break;
        }
        *if f(middle) < 0.0 { &mut low } else { &mut high } = middle;
    }
    low + (high - low) / 2.0
}
