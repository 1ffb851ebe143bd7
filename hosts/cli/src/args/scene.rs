//! `asperity scene`.

use std::path::PathBuf;

use clap::Subcommand;

use super::{GraphArgs, number};

/// `asperity scene`
#[derive(Debug, Subcommand)]
pub enum SceneCommand {
    /// Print the graph that a scene lowers to, ready to edit
    Expand(Expand),
    /// Say of every effect, node and model whether it is built, why, and what it costs a tick along the scene's stroke
    Explain(Explain),
}

/// `asperity scene expand`
#[derive(Debug, clap::Args)]
pub struct Expand {
    #[command(flatten)]
    pub scene: GraphArgs,
    /// Write it to a file in the scene's folder instead, since its paths are relative to that
    #[arg(long, value_name = "G.ron")]
    pub out: Option<PathBuf>,
}

/// `asperity scene explain`
#[derive(Debug, clap::Args)]
pub struct Explain {
    #[command(flatten)]
    pub scene: GraphArgs,
    /// How much of the stroke is run; all of it, but at most 60 s, unless given
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = number::number(0.002, 3600.0, "s"))]
    pub seconds: Option<f64>,
    /// Run every node in every tick
    #[arg(long)]
    pub no_sleep: bool,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}
