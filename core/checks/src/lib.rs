//! Hard cases: what a graph and its nodes must live through, and within which bounds.
//!
//! A [`Case`] says what is hard and what must hold, and finds out over a [`Subject`]: all kinds of nodes there are, and, where there is one, a
//! user's graph. It puts the kinds into graphs by the real compiler and runs them by the real engine. What a stylus does, and what else comes from
//! outside, is [played](played) from memory.
//!
//! A case is only worth having where something fails it: kinds can be [wrapped](wrap) so that they go wrong, and the tests at the top
//! of the house have at least one such mutant for every case.

mod buffers;
mod case;
pub mod conformance;
#[cfg(test)]
mod docs_tests;
mod families;
mod handle;
pub mod played;
mod rig;
mod small;
mod subject;
mod wall;
pub mod wrap;

pub use case::{Case, Family, Found, Not, Outcome, Verdict, holds, not_applicable};
pub use families::{Became, Drawn, Piece, Place, Sound, Stood, cases, drawn, limited};
pub use rig::Rig;
pub use small::Small;
pub use subject::{Effort, Subject};
