//! The network as a whole: against tract and plain f64, and with files that are damaged or unusual.

mod agreement;
mod bad_input;
mod encoder;
mod fallback;
mod networks;
mod statistics;
mod whole;

use crate::onnx::ModelProto;
use crate::{Model, Runner};
use asperity_diagnostics::Diagnostic;
use networks::{Net, Spelling, bytes, model};

/// A folder of shipped files.
const SHIPPED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../graphs/models/surfaces/");

/// A random network of the usual layers.
fn made(seed: u64) -> ModelProto {
    model(&Net::random(seed), Spelling::default())
}

fn load(model: &ModelProto) -> Result<Model, Diagnostic> {
    Model::from_bytes(&bytes(model), "some/where.onnx")
}

fn run(runner: &mut Runner, material: usize, force: &[f32], speed: &[f32]) -> [f32; 100] {
    let mut out = [7.0; 100];
    runner.run(material, force, speed, &mut out).unwrap();
    out
}
