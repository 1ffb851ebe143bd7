//! Hostile cases by seed: damaged files, files that are none, absurd arguments, kills. The program as a whole
//! is run; what a reader alone does is fuzzed (see `fuzz/`).
//!
//! `ASPERITY_HOSTILE=N` takes N times as many cases. A case that fails says its command line and keeps its
//! folder.
#![cfg(unix)]
#![allow(unreachable_pub, reason = "a test program has no outside")]

mod arguments;
mod budgets;
mod judge;
mod kills;
mod mutants;
mod plugins;
mod special;
