//! Hostile cases by seed: damaged files, files that are none, absurd arguments, kills. The program as a whole is run; what a reader
//! alone does is fuzzed (see `fuzz/`).
//!
//! `ASPERITY_HOSTILE=N` takes N times as many cases. A case that fails says its command line and keeps its folder.
#![cfg(unix)]
#![allow(unreachable_pub, reason = "a test program has no outside")]

mod common;

#[path = "hostile/arguments.rs"]
mod arguments;
#[path = "hostile/budgets.rs"]
mod budgets;
#[path = "hostile/judge.rs"]
mod judge;
#[path = "hostile/kills.rs"]
mod kills;
#[path = "hostile/mutants.rs"]
mod mutants;
#[path = "hostile/plugins.rs"]
mod plugins;
#[path = "hostile/special.rs"]
mod special;
