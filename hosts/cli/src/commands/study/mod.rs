//! `asperity study`: studies with people.

mod analyse;
mod check;
mod inputs;
mod levels;
mod replay;
mod run;
mod simulate;
mod stimulus;

use std::path::{Path, PathBuf};

use asperity_diagnostics::{Diagnostic, Source};
use asperity_study::Experiment;
use clap::Subcommand;

use crate::failure::{Failure, wrong};

/// Check, run, simulate, analyse and replay a study with people
#[derive(Debug, Subcommand)]
pub enum Command {
    Check(check::Args),
    Run(Box<run::Args>),
    Simulate(simulate::Args),
    Analyse(analyse::Args),
    Replay(replay::Args),
}

pub fn run(command: &Command) -> Result<(), Failure> {
    match command {
        Command::Check(args) => check::run(args),
        Command::Run(args) => run::run(args),
        Command::Simulate(args) => simulate::run(args),
        Command::Analyse(args) => analyse::run(args),
        Command::Replay(args) => replay::run(args),
    }
}

/// Copy of the experiment file in a study's folder.
const COPY: &str = "experiment.ron";

/// Reads an experiment file.
fn experiment(path: &Path) -> Result<Experiment, Failure> {
    let source = Source::read(path)?;
    if !Experiment::is_meant(&source) {
        let help = "an experiment file begins with `Experiment(`";
        return Err(Diagnostic::new("this is no experiment").in_file(path).help(help).into());
    }
    Ok(Experiment::parse(&source)?)
}

/// Logs in a study's folder, in the order of their names.
fn logs(folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let unreadable = |e: std::io::Error| wrong(folder, format!("cannot read this folder: {e}"), FOLDER);
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        if path.extension().is_some_and(|ending| ending == "jsonl") {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}

const FOLDER: &str = "the output folder of `asperity study run` or `simulate` has the logs of participants";
