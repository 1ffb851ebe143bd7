//! Tests of texture networks and encoders from ONNX files.
#![allow(missing_docs, clippy::unwrap_used)]

mod agreement;
mod bad_input;
#[path = "../common/mod.rs"]
mod common;
mod encoder;
mod fallback;
mod whole;
