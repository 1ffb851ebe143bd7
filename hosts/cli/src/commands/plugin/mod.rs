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

/// Make a plugin, check one, or list those that are found
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
    /// Run this case only; may be given more than once
    #[arg(long = "case", value_name = "CASE")]
    pub case: Vec<String>,
    /// Set a parameter of the kinds that have it, such as one that must be set
    #[arg(long = "set", value_name = "PARAM=VALUE")]
    pub set: Vec<String>,
    /// Number of random ticks
    #[arg(long, value_name = "N", default_value_t = 100_000)]
    pub ticks: u64,
}

/// Run a plugin's conformance cases in a process of its own
///
/// A crash, an abort or an endless loop is reported with its case, and the cases behind it still run. So
/// are changes of the process: rounding, signal handlers, working directory, threads left behind. Exit code
/// 0: all cases that apply pass; 1: one fails; 2: the plugin does not load.
///
/// Allocations are counted on Linux with glibc, in the C library's malloc and free. Not seen are locks and
/// system calls, threads of the plugin, memory from mmap or from an allocator that is linked into the
/// plugin, and writes to foreign memory that do not crash.
#[derive(Debug, clap::Args)]
pub struct CheckPlugin {
    #[command(flatten)]
    pub cases: Cases,
    /// Longest wait for an answer of the plugin, to one call or a few
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
