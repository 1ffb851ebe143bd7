//! `asperity selftest`.

use std::path::PathBuf;

use clap::ValueEnum;

use super::PluginArgs;

/// How long cases may take.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum EffortArg {
    /// A second or less a case
    Quick,
    /// Some seconds a case
    Full,
    /// As long as it takes: minutes a case and more
    Long,
}

/// `asperity selftest`
#[derive(Clone, Debug, clap::Args)]
pub struct SelfTest {
    /// A graph file, or a scene file; without one, only kinds of nodes are looked at
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
    /// How long cases may take
    #[arg(long, value_enum, default_value = "quick")]
    pub effort: EffortArg,
    #[command(flatten)]
    pub plugins: PluginArgs,
    /// Say of every case what is hard and what must hold
    #[arg(long, short)]
    pub verbose: bool,
    /// Print JSON
    #[arg(long, conflicts_with = "verbose")]
    pub json: bool,
    /// Show no progress
    #[arg(long, short)]
    pub quiet: bool,
}
