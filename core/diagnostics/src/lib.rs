//! Text files and errors about them.
//!
//! [`Source`] is a file with its text, and [`Diagnostic`] an error that points into it. [`ron`] is a strict
//! reader for RON that keeps the position of every value (its parser is the feature `ron`). It reads graphs,
//! materials and actuator profiles. So every bad file is reported in one way: file, line, column, the value
//! that was found and those that would fit.

pub mod budget;
mod diagnostic;
pub mod file;
mod nearest;
mod quote;
mod recent;
pub mod ron;

pub use diagnostic::{Diagnostic, MAX_TEXT_BYTES, Place, Position, Source, Span};
pub use nearest::{nearest, one_of};
pub use recent::{Recent, fingerprint, fnv};
