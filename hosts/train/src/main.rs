//! Trains texture models from tactile images and strokes. A model is an encoder of images, a tick
//! network, a library of materials, and a model report with its quality.

mod arguments;
mod data;
mod descent;
mod encoder;
mod evaluation;
mod files;
mod layer;
mod loss;
mod model_report;
mod network;
mod onnx;
mod pattern;
mod stages;
mod statistics;
mod training;

use std::process::ExitCode;

use asperity_diagnostics::Diagnostic;
use asperity_numbers::denormals::Flushed;
use clap::Parser;

use arguments::{Arguments, Command};

/// Reasons for an early end of a run.
#[derive(Debug)]
pub(crate) enum Failure {
    /// A file, a name or a range.
    Input(Diagnostic),
    /// Invalid training or result.
    Model(String),
    /// Stopped by the user; everything is kept.
    Stopped,
}

impl From<Diagnostic> for Failure {
    fn from(e: Diagnostic) -> Self {
        Self::Input(e)
    }
}

fn main() -> ExitCode {
    asperity_texture::run_graphs_by(asperity_tract::compile);
    // The threads of a step's matrix products.
    let flushed = |_| std::mem::forget(Flushed::new());
    if let Err(e) = rayon::ThreadPoolBuilder::new().start_handler(flushed).build_global() {
        eprintln!("error: no threads: {e}");
        return ExitCode::FAILURE;
    }
    let result = match Arguments::parse().command {
        Command::Train(train) => training::train(&train),
        Command::Network(network) => training::network(&network),
        Command::Evaluate(evaluate) => training::evaluate(&evaluate),
        Command::Pattern(found) => pattern::find(&found),
        Command::Statistics(found) => statistics::find(&found),
    };
    let (code, message) = match result {
        Ok(()) => return ExitCode::SUCCESS,
        Err(Failure::Input(e)) => (2, format!("error: {e}")),
        Err(Failure::Model(e)) => (1, format!("error: {e}")),
        Err(Failure::Stopped) => (130, "stopped; the same command goes on from here".to_owned()),
    };
    eprintln!("{message}");
    ExitCode::from(code)
}
