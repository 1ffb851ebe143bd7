//! The graph file: read, checked, compiled to a schedule.
//!
//! [`GraphFile`] is what stands in a RON file, with the place of everything in it. [`compile()`] checks it
//! against a registry of node kinds and answers a [`Schedule`] (plain data: what runs when, and which buffers
//! it uses) with the prepared nodes. Whatever is wrong comes back as a list of diagnostics.

mod compile;
mod format;
mod params;
mod schedule;
mod write;

pub use compile::{Compiled, Options, compile};
pub use format::{EVERY, Endpoint, GraphFile, NodeDecl, PluginDecl, Setting, WireDecl};
pub use params::check_settings;
pub use schedule::{
    BufferEntry, Dropped, LiveParam, PathLatency, Schedule, ScheduledInput, ScheduledNode, ScheduledOutput,
    Step, topological_order,
};
pub use write::text_of;
