//! Runs no graph: this program is built without tract.

use std::path::Path;

use crate::onnx::ModelProto;
use asperity_diagnostics::Diagnostic;

/// Names the command that builds tract in.
const INSTALL: &str = "`cargo install --locked --path hosts/cli` installs a program that has it";

/// There is none.
#[derive(Clone)]
pub(crate) enum Plan {}

impl Plan {
    pub(crate) fn compile(
        _: &ModelProto,
        path: &Path,
        _inputs: &[Vec<usize>],
        _most_bytes: u64,
        _help: &str,
    ) -> Result<Self, Diagnostic> {
        Err(Diagnostic::new("tract would run this model, and this program is built without it")
            .in_file(path)
            .help(INSTALL))
    }

    pub(crate) fn run(&self, _: &[&[f32]]) -> Option<Vec<Vec<f32>>> {
        match *self {}
    }
}
