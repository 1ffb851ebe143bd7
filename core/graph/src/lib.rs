//! The graph file: read, checked, compiled to a schedule.
//!
//! [`GraphFile`] is the content of a RON file, with the position of every part. [`compile()`] checks it
//! against a registry of node kinds. It returns a [`Schedule`] (plain data: run order and buffers) with
//! the prepared nodes, or a list of diagnostics.

mod compile;
mod format;
mod order;
mod params;
mod schedule;
mod slots;
mod write;

pub use compile::{Compiled, Options, compile};
pub use format::{EVERY, Endpoint, GraphFile, NodeDecl, PluginDecl, Setting, WireDecl};
pub use order::{GateSets, Waiting, gate_sets, steps};
pub use params::check_settings;
pub use schedule::{
    BufferEntry, Dropped, LiveParam, PathLatency, Schedule, ScheduledInput, ScheduledNode, ScheduledOutput,
    SlowestPath, Step,
};
