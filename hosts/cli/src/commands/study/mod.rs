//! `asperity study`: studies with people.

mod check;

use std::path::{Path, PathBuf};

use asperity_diagnostics::ron::Value;
use asperity_diagnostics::{Diagnostic, Source};
use asperity_study::Experiment;
use clap::Subcommand;

use crate::failure::Failure;

/// Check a study with people
#[derive(Debug, Subcommand)]
pub enum Command {
    Check(check::Args),
}

pub fn run(command: &Command) -> Result<(), Failure> {
    match command {
        Command::Check(args) => check::run(args),
    }
}

/// Reads an experiment file.
fn experiment(path: &Path) -> Result<Experiment, Failure> {
    let source = Source::read(path)?;
    if !Experiment::is_meant(&source) {
        let help = "an experiment file begins with `Experiment(`";
        return Err(Diagnostic::new("this is no experiment").in_file(path).help(help).into());
    }
    Ok(Experiment::parse(&source)?)
}

/// Path of a stimulus's file: beside the experiment, or a shipped one.
fn found(file: &Value) -> Result<PathBuf, Failure> {
    let named = Path::new(file.text()?);
    match crate::shipped::file(named).filter(|_| !named.exists()) {
        Some(shipped) => Ok(shipped),
        None => Ok(file.path()?),
    }
}
