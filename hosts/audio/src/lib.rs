//! Audio devices: what there is, and how to play on one.
//!
//! This is the only crate that sees cpal. It knows nothing of graphs: a device calls a [`Process`] for every block it
//! wants, and a [`Capture`] for every block it recorded.

mod block;

pub use block::{Block, Capture, Captured, Process, now_ns};
