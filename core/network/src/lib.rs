//! Runs a texture network from an ONNX file.
//!
//! [`Model::load`] reads and checks a file, [`Model::runner`] prepares it for a set of materials, [`Runner::run`]
//! predicts the magnitudes of one tick.

// Errors come once, at load; a Diagnostic is the workspace's error about files, and boxing it would only hide that.
#![allow(clippy::result_large_err)]

mod check;
mod kernel;
mod lower;
mod model;
mod packed;
mod proto;
mod reference;
mod runner;
mod signature;

pub use kernel::Isa;
pub use model::Model;
pub use proto::MAX_MODEL_BYTES;
pub use runner::{Choice, Executor, Info, MAX_MATERIALS, Precision, RunError, Runner};
pub use signature::{FORCE_LEN, MAGNITUDES_LEN, SPEED_LEN, TEXTURE_LEN};
