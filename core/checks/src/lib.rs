//! Checks of graphs and nodes: hard cases, each with bounds that must hold.
//!
//! A [`Case`] looks at a [`Subject`]: kinds of nodes, and perhaps a user's graph. It puts the kinds into
//! graphs by the compiler and runs them in the engine ([`Rig`]). Styluses and other inputs are
//! [played](played) from memory. There is one table of cases, in three parts: [`cases`] over graphs and over
//! kinds, which `asperity selftest` runs, and [`node_cases`] over one kind, which `asperity plugin check`
//! runs.
//!
//! A case is worth nothing that no fault fails. For each case, the tests at the top of the repository have a
//! mutant that must fail it: a node that is broken on purpose, by [`wrap`](wrap::wrap).

#[macro_use]
mod case;
mod buffers;
#[cfg(test)]
mod case_tests;
mod families;
mod handle;
mod node;
pub mod played;
mod rig;
mod subject;
mod wall;
pub mod wrap;

pub use buffers::{finite, same};
pub use case::{Case, Found, Stop, not_applicable};
pub use families::autoregressive as textures;
pub use families::{Became, Drawn, Piece, Place, Sound, cases, decibels, drawn, limited, node_cases};
pub use node::{TickTime, tick_time};
pub use rig::Rig;
pub use subject::{Effort, Heap, Subject, Touched, Witness};
