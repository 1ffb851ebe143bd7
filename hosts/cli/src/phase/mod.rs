//! Phase retrieval outside a graph file, for `invert` and `compare`: frames in, a signal out.
//!
//! A [`Method`] is a node with settings, or an offline method. A [`Chain`] is the graph of a source that
//! plays [`Frames`], the node, and an `overlap_add` if the node puts out spectra.

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
