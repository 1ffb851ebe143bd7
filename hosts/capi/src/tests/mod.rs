//! Tests of the interface as C calls it.

mod header;
mod runs;
