//! Runs a texture network and its image encoder from ONNX files.
//!
//! [`Model::load`] reads and checks a file. [`Model::runner`] prepares it for a set of materials.
//! [`Runner::run`] predicts the magnitudes of one tick, [`Runner::answer`] also their scatter. An
//! [`Encoder`] turns a picture into a material's vector.
//!
//! Any graph with the right signature runs in tract, which allocates. A plain multilayer perceptron is
//! lowered to packed kernels that do not allocate, if they agree with tract. [`Runner::describe`] says
//! which one runs, and how far apart they are. A program without tract runs only such
//! networks, and no encoder; kernels are compared with the network in f64.
//!
//! Median time of a run of the shipped sizes (419,700 multiply-adds), on 2 cores of a virtual Intel
//! Xeon under other load, by `cargo bench -p asperity-texture`. f32 on AVX-512: 15.0 us, 1.2 times a
//! plain read of the same 1.74 MB; f16 15.5 us for 0.91 MB; int8 3.8 us for 0.5 MB. AVX2: 18.0, 16.1
//! and 14.0 us. Plain code: 28, 240 and 69 us. f64: 146 us. tract: 115 us.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod check;
mod encoder;
mod kernel;
mod library;
mod lower;
mod model;
pub mod onnx;
mod packed;
pub mod picture;
mod plan;
mod proto;
mod range;
mod reference;
mod round;
mod runner;
mod signature;
pub mod statistics;
#[cfg(test)]
mod tests;
mod trained;

pub use asperity_dsp::Isa;
pub use encoder::{Channels, Encoded, Encoder};
pub use library::{
    Assignment, BLENDED, Events, Harmonic, Library, LibraryMaterial, MAX_HARMONICS, MAX_WAVES, Neighbour,
    Pattern, VECTOR_LEN, Wave,
};
pub use model::Model;
pub use plan::{Compile, Run, run_graphs_by};
pub use proto::{MAX_ENCODER_BYTES, MAX_MODEL_BYTES};
pub use range::{Range, hold_magnitudes};
pub use runner::{Answer, Choice, Executor, Info, MAX_MATERIALS, NOISE_RATIO, Precision, RunError, Runner};
pub use signature::{FORCE_LEN, MAGNITUDES_LEN, SPEED_LEN, TEXTURE_LEN};
pub use trained::{Target, Trained};
