//! `asperity plugin`: make one, check one, and see what is found where.

mod check;
pub use check::survives;
mod child;
mod heap;
mod list;
mod new;
mod report;
mod surroundings;

use std::process::ExitCode;

use crate::args::PluginCommand;
use crate::failure::Failure;

/// Runs the command.
pub fn run(command: &PluginCommand) -> Result<ExitCode, Failure> {
    match command {
        PluginCommand::New(args) => new::run(args),
        PluginCommand::List(args) => list::run(args),
        PluginCommand::Check(args) => check::run(args),
        PluginCommand::Cases(args) => Ok(child::run(args)),
    }
}
