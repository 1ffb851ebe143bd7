//! `asperity selftest`.

use std::path::PathBuf;

use clap::ValueEnum;

use super::PluginArgs;

/// Effort of each case.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum EffortArg {
    /// A second or less per case
    Quick,
    /// Some seconds per case
    Full,
    /// Minutes per case and more
    Long,
}

/// `asperity selftest`
#[derive(Clone, Debug, clap::Args)]
pub struct SelfTest {
    /// A graph or scene file; without one, only kinds of nodes are checked
    #[arg(value_parser = crate::shipped::path())]
    pub graph: Option<PathBuf>,
    /// Set a parameter of the graph: NODE.PARAM=VALUE, NODE.every=N, or tick_hz, audio_hz, seed
    #[arg(long = "set", value_name = "NODE.PARAM=VALUE", requires = "graph")]
    pub set: Vec<String>,
    /// Run the cases of this family only; may be given more than once
    #[arg(long = "family", value_name = "FAMILY")]
    pub family: Vec<String>,
    /// Run this case only; may be given more than once
    #[arg(long = "case", value_name = "CASE")]
    pub case: Vec<String>,
    /// Effort of each case
    #[arg(long, value_enum, default_value = "quick")]
    pub effort: EffortArg,
    #[command(flatten)]
    pub plugins: PluginArgs,
    /// Print the difficulty and the requirement of each case
    #[arg(long, short)]
    pub verbose: bool,
    /// Print JSON
    #[arg(long, conflicts_with = "verbose")]
    pub json: bool,
    /// Show no progress
    #[arg(long, short)]
    pub quiet: bool,
}
