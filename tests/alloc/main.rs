//! What must not allocate while it runs: nodes, ticks, and swaps of a running graph. All allocations are
//! counted.
#![allow(unreachable_pub, reason = "a test program has no outside")]

mod autoregressive;
mod conformance;
mod contacts;
mod effects;
mod kernels;
mod networks;
mod phase_plugins;
mod rig;
mod swap;
mod swap_kept;
mod swap_long;
mod swap_plugins;
mod ticks;
mod tones;

/// Counts allocations.
#[global_allocator]
static ALLOCATOR: harness::counting::Counting = harness::counting::Counting;
