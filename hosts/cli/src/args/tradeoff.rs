//! `asperity tradeoff` and `asperity choose`

use std::path::PathBuf;

use clap::Subcommand;

use super::PluginArgs;
use super::number::{number, whole};

/// `asperity tradeoff`
#[derive(Clone, Debug, clap::Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub struct Tradeoff {
    #[command(subcommand)]
    pub command: Option<TradeoffCommand>,
    /// A study, and graphs or scenes whose knobs it turns; without a study the one that is shipped, without
    /// a graph the study's own
    #[arg(value_name = "STUDY.ron|GRAPH|SCENE")]
    pub files: Vec<PathBuf>,
    /// Folder of what comes of it: results.csv, results.json, REPORT.md, pictures; what is finished is kept
    /// there
    #[arg(long, value_name = "DIR", required = true)]
    pub out: Option<PathBuf>,
    /// Threads for everything but times, which are always taken alone
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = whole(1_usize, 1024, "threads"))]
    pub jobs: usize,
    /// Run a part of the settings only: the I-th of N
    #[arg(long, value_name = "I/N", value_parser = shard)]
    pub shard: Option<(usize, usize)>,
    /// Leave the hard cases out: settings that fail them can then be chosen
    #[arg(long)]
    pub no_cases: bool,
    /// Set a parameter of the graphs before anything is turned: NODE.PARAM=VALUE
    #[arg(long = "set", value_name = "NODE.PARAM=VALUE")]
    pub set: Vec<String>,
    #[command(flatten)]
    pub plugins: PluginArgs,
    /// Show no progress and no chart
    #[arg(long, short)]
    pub quiet: bool,
}

/// What else is done with studies.
#[derive(Clone, Debug, Subcommand)]
pub enum TradeoffCommand {
    /// Put the results of shards together, by the ratio of times to the setting that each of them timed
    Merge(Merge),
}

/// `asperity tradeoff merge`
#[derive(Clone, Debug, clap::Args)]
pub struct Merge {
    /// Folders of results
    #[arg(required = true, value_name = "DIR")]
    pub from: Vec<PathBuf>,
    /// Folder of what comes of it
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Show no chart
    #[arg(long, short)]
    pub quiet: bool,
}

/// `asperity choose`
#[derive(Clone, Debug, clap::Args)]
pub struct Choose {
    /// Results of `asperity tradeoff`: the folder, or its results.json; those of the shipped study, unless
    /// given
    #[arg(value_name = "RESULTS")]
    pub results: Option<PathBuf>,
    /// Most microseconds that a tick may take: its median, and its 99.9th percentile without what the
    /// machine stalls by itself
    #[arg(long, value_name = "US", value_parser = number(1e-3, 1e9, "us"))]
    pub budget_us: Option<f64>,
    /// Latest that half of a step of the stylus's speed may be felt
    #[arg(long, value_name = "MS", value_parser = number(0.0, 1e6, "ms"))]
    pub max_lag_ms: Option<f64>,
    /// Count what the machine stalls by itself too: the 99.9th percentile as it was measured
    #[arg(long)]
    pub strict: bool,
    /// Figures in the order in which they count: perceptual, modulation, spectrum, bands, level,
    /// repetition, kurtosis, steadiness, convergence, precision; all but the last two, unless given
    #[arg(long, value_name = "FIGURE,...", value_delimiter = ',')]
    pub by: Vec<String>,
    /// Ticks a second that the setting must have
    #[arg(long, value_name = "HZ", value_parser = whole(100_u32, 4000, "Hz"))]
    pub tick_hz: Option<u32>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

fn shard(text: &str) -> Result<(usize, usize), String> {
    let wrong = || format!("`{text}` is no part: I/N with I from 1 to N, such as 1/4");
    let (i, n) = text.split_once('/').ok_or_else(wrong)?;
    let (i, n): (usize, usize) =
        (i.trim().parse().map_err(|_| wrong())?, n.trim().parse().map_err(|_| wrong())?);
    if i >= 1 && i <= n && n <= 1_000_000 { Ok((i - 1, n)) } else { Err(wrong()) }
}
