//! Phase retrieval outside a graph file: frames in, a signal out. `invert` and `compare` stand on it.
//!
//! [`Frames`] are played by a source of this module's own; a [`Method`] names the node and its settings; a [`Chain`]
//! is the graph of both, with an `overlap_add` behind a node that answers spectra, ready to run.

mod chain;
mod frames;
mod method;
mod offline;

pub use chain::Chain;
pub use frames::{FRAME_HZ, Frames, check_rate};
pub use method::{How, Method, retrievers};
pub use offline::OFFLINE;

#[cfg(test)]
pub mod testing;
#[cfg(test)]
mod tests;
