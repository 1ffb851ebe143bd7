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
    /// A trade-off file, and graphs or scenes; the shipped trade-off, and the file's own graph, unless given
    #[arg(value_name = "TRADEOFF.ron|GRAPH|SCENE", value_parser = crate::shipped::path())]
    pub files: Vec<PathBuf>,
    /// Output folder: results.csv, results.json, REPORT.md, pictures, and progress.jsonl, which a stopped run
    /// resumes from
    #[arg(long, value_name = "DIR", required = true)]
    pub out: Option<PathBuf>,
    /// Threads for everything but times, which are always measured alone
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = whole(1_usize, 1024, "threads"))]
    pub jobs: usize,
    /// Run the I-th of N shards of the settings
    #[arg(long, value_name = "I/N", value_parser = shard)]
    pub shard: Option<(usize, usize)>,
    /// Skip the hard cases: settings that fail them can then be chosen
    #[arg(long)]
    pub no_cases: bool,
    /// Set a parameter of the graphs before knobs are applied: NODE.PARAM=VALUE
    #[arg(long = "set", value_name = "NODE.PARAM=VALUE")]
    pub set: Vec<String>,
    #[command(flatten)]
    pub plugins: PluginArgs,
    /// Show no progress and no chart
    #[arg(long, short)]
    pub quiet: bool,
}

/// Subcommands of `asperity tradeoff`.
#[derive(Clone, Debug, Subcommand)]
pub enum TradeoffCommand {
    /// Merge the results of shards; times are scaled by the default that each of them timed
    Merge(Merge),
}

/// `asperity tradeoff merge`
#[derive(Clone, Debug, clap::Args)]
pub struct Merge {
    /// Folders of results
    #[arg(required = true, value_name = "DIR")]
    pub from: Vec<PathBuf>,
    /// Output folder
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Show no chart
    #[arg(long, short)]
    pub quiet: bool,
}

/// `asperity choose`
#[derive(Clone, Debug, clap::Args)]
pub struct Choose {
    /// Results of `asperity tradeoff`: the folder, or its results.json; the shipped results, unless given
    #[arg(value_name = "RESULTS", value_parser = crate::shipped::path())]
    pub results: Option<PathBuf>,
    /// Longest tick in microseconds: of its median, and of its 99.9th percentile without the machine's stalls
    #[arg(long, value_name = "US", value_parser = number(1e-3, 1e9, "us"))]
    pub budget_us: Option<f64>,
    /// Longest response lag in milliseconds: 50 % of a step of the stylus's speed
    #[arg(long, value_name = "MS", value_parser = number(0.0, 1e6, "ms"))]
    pub max_lag_ms: Option<f64>,
    /// Include the machine's stalls in the 99.9th percentile
    #[arg(long)]
    pub strict: bool,
    /// Figures to rank by, the most important first: perceptual, modulation, spectrum, bands, level,
    /// repetition, kurtosis, steadiness, pitch, convergence, precision; all but the last two, unless given
    #[arg(long, value_name = "FIGURE,...", value_delimiter = ',')]
    pub by: Vec<String>,
    /// Required tick rate in Hz
    #[arg(long, value_name = "HZ", value_parser = whole(100_u32, 4000, "Hz"))]
    pub tick_hz: Option<u32>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

fn shard(text: &str) -> Result<(usize, usize), String> {
    let wrong = || format!("`{text}` is not a shard: I/N with I from 1 to N, such as 1/4");
    let (i, n) = text.split_once('/').ok_or_else(wrong)?;
    let (i, n): (usize, usize) =
        (i.trim().parse().map_err(|_| wrong())?, n.trim().parse().map_err(|_| wrong())?);
    if i >= 1 && i <= n && n <= 1_000_000 { Ok((i - 1, n)) } else { Err(wrong()) }
}
