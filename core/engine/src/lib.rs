//! Runs a schedule tick by tick.
//!
//! [`Engine`] has no clock and no device: a driver calls [`Engine::tick`], then reads the sinks. A tick
//! does not allocate, lock, log or call the system. A node that fails is contained: its outputs hold or
//! fade, and the fault is counted. After [`FAULTS_BEFORE_QUARANTINE`] faults the node is no longer
//! called.
//!
//! A [`Controller`] changes the graph of a running engine from another thread: see
//! [`Engine::controlled`].

mod engine;
mod fade;
mod panics;
mod slot;
mod swap;
mod telemetry;

pub use asperity_numbers::denormals::Flushed;
pub use engine::{Engine, Options};
pub use slot::{FAULT_FADE_S, FAULT_FORGIVEN_S, FAULTS_BEFORE_QUARANTINE, NodeReport};
pub use swap::{CROSSFADE_S, Change, Controller, Finished, MAX_SWAPS, SwapError, SwapReport};
pub use telemetry::{Clock, NoClock};
