//! Runs a texture network, and the encoder that goes with it, from ONNX files.
//!
//! [`Model::load`] reads and checks a file, [`Model::runner`] prepares it for a set of materials,
//! [`Runner::run`] predicts the magnitudes of one tick, [`Runner::answer`] also how they scatter. An
//! [`Encoder`] gives a material's vector from a picture.
//!
//! Any graph of the signature runs by tract, which allocates. A plain multilayer perceptron is lowered to
//! packed kernels that do not, and is used where it agrees with tract: [`Runner::describe`] says which, and
//! how far apart they are.
//!
//! Medians of a run of the shipped sizes (419,700 multiply-adds), back to back, on a virtual machine with 2
//! cores of an AMD EPYC (family 26, Zen 5; 1 MB L2 a core, 32 MB L3) that other work kept busy, three runs
//! of `cargo bench -p asperity-network`: f32 on AVX-512 14.2 to 14.8 us, which is 0.96 to 1.02 times a
//! plain read of the same 1.74 MB; f16 7.1 to 7.5 us for 0.91 MB, 1.2 to 1.6 times its read; AVX2 14.4 to
//! 14.7 and 8.2 to 8.5 us; SSE2 18.5 us (f32, one run); tract 49 to 50 us.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod check;
mod double;
mod encoder;
mod kernel;
mod lower;
mod model;
mod packed;
mod plan;
mod proto;
mod range;
mod reference;
mod round;
mod runner;
mod signature;
mod stored;
mod trained;

pub use asperity_dsp::Isa;
pub use encoder::Encoder;
pub use model::Model;
pub use proto::{MAX_ENCODER_BYTES, MAX_MODEL_BYTES};
pub use range::{Range, hold_magnitudes};
pub use runner::{Answer, Choice, Executor, Info, MAX_MATERIALS, NOISE_RATIO, Precision, RunError, Runner};
pub use signature::{FORCE_LEN, MAGNITUDES_LEN, SPEED_LEN, TEXTURE_LEN};
pub use trained::{Target, Trained};
