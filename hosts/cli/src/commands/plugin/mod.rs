//! `asperity plugin`: make one, and see what is found where.

mod list;
mod new;

use std::process::ExitCode;

use crate::args::PluginCommand;
use crate::failure::Failure;

/// Runs the command.
pub fn run(command: &PluginCommand) -> Result<ExitCode, Failure> {
    match command {
        PluginCommand::New(args) => new::run(args),
        PluginCommand::List(args) => list::run(args),
    }
}
