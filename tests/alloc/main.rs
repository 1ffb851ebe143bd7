//! Nodes, ticks, and swaps of a running graph, which must not allocate. All allocations are
//! counted.
#![allow(unreachable_pub, reason = "a test program has no outside")]

mod conformance;
mod networks;
mod rig;
mod swap;
mod swap_long;
mod swap_plugins;
mod ticks;
mod tones;

/// Counts allocations.
#[global_allocator]
static ALLOCATOR: harness::counting::Counting = harness::counting::Counting;
