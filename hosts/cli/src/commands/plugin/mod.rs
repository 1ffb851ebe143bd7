//! `asperity plugin`: makes, checks and lists plugins.

mod check;
pub use check::survives;
mod child;
mod heap;
mod list;
mod new;
mod surroundings;

use clap::Subcommand;

use crate::failure::Failure;

/// Make, check or list plugins
#[derive(Debug, Subcommand)]
pub enum Command {
    New(new::Args),
    List(list::Args),
    Check(CheckPlugin),
    /// The process that runs the cases
    #[command(hide = true)]
    Cases(CasesOfPlugin),
}

/// A plugin, and which cases to run.
#[derive(Clone, Debug, clap::Args)]
pub struct Cases {
    /// The plugin: its file, or its name
    #[arg(value_name = "FILE")]
    pub plugin: String,
    /// Check this kind of node only
    #[arg(long, value_name = "KIND")]
    pub kind: Option<String>,
    /// Run this case only
    #[arg(long = "case", value_name = "CASE")]
    pub case: Vec<String>,
    /// Set a parameter of every kind that has it
    #[arg(long = "set", value_name = "PARAM=VALUE")]
    pub set: Vec<String>,
    /// Number of random ticks
    #[arg(long, value_name = "N", default_value_t = 100_000)]
    pub ticks: u64,
}

/// Run a plugin's conformance cases in a process of its own
///
/// A crash, an abort or an endless loop is reported with its case, and the remaining cases still run. So are
/// changes of the process: rounding, signal handlers, working directory, threads left behind. Exit code 0:
/// all cases that apply pass; 1: one fails; 2: the plugin does not load.
///
/// Allocations are counted on Linux with glibc, in the C library's malloc and free. The check does not see
/// locks, system calls and threads of the plugin. Nor does it see memory from mmap or from an allocator in
/// the plugin, or writes to foreign memory that do not crash.
#[derive(Debug, clap::Args)]
#[command(after_help = crate::commands::examples(&[
    "asperity plugin check target/release/libmine.so",
    "asperity plugin check libmine.so --case nan --set frames=2",
]))]
pub struct CheckPlugin {
    #[command(flatten)]
    pub cases: Cases,
    /// Longest wait for the plugin to return from a call
    #[arg(long, value_name = "S", default_value_t = 10)]
    pub patience: u64,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// Run cases in this process: `plugin check` starts it
#[derive(Debug, clap::Args)]
pub struct CasesOfPlugin {
    #[command(flatten)]
    pub cases: Cases,
    /// Number of cases that were run already
    #[arg(long, default_value_t = 0)]
    pub skip: usize,
}

pub fn run(command: &Command) -> Result<(), Failure> {
    match command {
        Command::New(args) => new::run(args),
        Command::List(args) => list::run(args),
        Command::Check(args) => check::run(args),
        Command::Cases(args) => child::run(args),
    }
}
