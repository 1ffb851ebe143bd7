//! Trains texture models from tactile images and strokes. A model is an encoder of images, a tick
//! network, a library of materials, and a model report with its quality.

mod arguments;
mod data;
mod descent;
mod encoder;
mod evaluation;
mod failure;
mod files;
mod layer;
mod loss;
mod model_report;
mod network;
mod onnx;
mod pattern;
mod progress;
mod stages;
mod training;

use std::process::ExitCode;

use asperity_numbers::denormals::Flushed;
use clap::Parser;

use arguments::{Arguments, Command};
use failure::Failure;

fn main() -> ExitCode {
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
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(Failure::Input(e)) => {
            eprintln!("error: {e}");
            ExitCode::from(2)
        }
        Err(Failure::Model(e)) => {
            eprintln!("error: {e}");
            ExitCode::FAILURE
        }
        Err(Failure::Stopped) => {
            eprintln!("stopped; the same command goes on from here");
            ExitCode::from(130)
        }
    }
}
