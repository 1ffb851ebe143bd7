//! Any ONNX graph runs by tract, where the program has it.

use std::path::Path;
use std::sync::{Arc, OnceLock};

use crate::onnx::ModelProto;
use asperity_diagnostics::Diagnostic;
use prost::Message;

/// Names the command that builds tract in.
const INSTALL: &str = "`cargo install --locked --path hosts/cli` installs a program that has it";

/// `asperity_tract::compile`. Takes the bytes of a model, its name in errors, shapes of the inputs, the
/// largest size of such a file and a help. Makes a function from inputs to outputs.
pub type Compile = fn(&[u8], &Path, &[Vec<usize>], u64, &str) -> Result<Arc<Run>, Diagnostic>;

/// A compiled graph: from its inputs to its outputs, or `None` where it fails.
pub type Run = dyn Fn(&[&[f32]]) -> Option<Vec<Vec<f32>>> + Send + Sync;

static COMPILE: OnceLock<Compile> = OnceLock::new();

/// Lets models that are no plain multilayer perceptron, and encoders, run by `compile`. A program calls it
/// before it loads the first model. Later calls change nothing.
pub fn run_graphs_by(compile: Compile) {
    let _ = COMPILE.set(compile);
}

fn compiler() -> Option<Compile> {
    #[cfg(test)]
    run_graphs_by(asperity_tract::compile);
    COMPILE.get().copied()
}

/// Whether this program runs any graph.
pub(crate) fn runs_any_graph() -> bool {
    compiler().is_some()
}

/// Compiles a model, of which only the checked parts are passed on.
pub(crate) fn compile(
    model: &ModelProto,
    path: &Path,
    inputs: &[Vec<usize>],
    most_bytes: u64,
    help: &str,
) -> Result<Arc<Run>, Diagnostic> {
    let Some(compile) = compiler() else {
        return Err(Diagnostic::new("tract would run this model, and this program is built without it")
            .in_file(path)
            .help(INSTALL));
    };
    compile(&model.encode_to_vec(), path, inputs, most_bytes, help)
}
