//! The shipped phase-retrieval plugins, as Rust libraries.

mod gsrtisi_la;
mod rtpghi;
mod survival;
