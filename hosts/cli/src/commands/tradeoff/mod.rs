//! `asperity tradeoff`: the trade-off between accuracy and cost.

mod bars;
mod folder;

use std::path::{Component, Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use asperity_diagnostics::{Diagnostic, Place, Source};
use asperity_graph::{Options, compile};
use asperity_tradeoff::{Figure, Job, LoadedGraph, Machine, Prepared, Results, Row, Tradeoff, content};
use indicatif::ProgressBar;
use parking_lot::Mutex;

use crate::failure::{Failure, be_quiet, print, warn, wrong};
use crate::leave::{INTERRUPTED, stop_flag};
use crate::load::{self, ColumnArgs, PluginArgs};
use crate::number::whole;
use crate::output::{apart, named};

use bars::Bars;
pub use folder::read as read_results;

const SHIPPED: (&str, &str) =
    ("tradeoffs/shipped.ron (shipped)", include_str!("../../../../../graphs/tradeoffs/shipped.ron"));

/// Measure what accuracy costs in time: many settings of a graph, over the same strokes and materials
///
/// Finished settings are kept in the output folder: run the same command again to continue. --shard splits
/// the work between machines, and `tradeoff merge` merges the results.
#[derive(Clone, Debug, clap::Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
#[command(after_help = crate::commands::examples(&[
    "asperity tradeoff --out out/shipped --jobs 2",
    "asperity tradeoff mine.ron --out out/mine --shard 1/4",
]))]
pub struct Args {
    #[command(subcommand)]
    pub command: Option<More>,
    /// A trade-off file, and graphs or scenes. By default the shipped trade-off, and the graph it names
    #[arg(value_name = "TRADEOFF.ron|GRAPH|SCENE", value_parser = crate::shipped::path())]
    pub files: Vec<PathBuf>,
    /// Output folder: results.csv, results.json, REPORT.md, pictures; progress.jsonl, to resume from
    #[arg(long, value_name = "DIR", required = true)]
    pub out: Option<PathBuf>,
    /// Number of threads. Times are always measured alone, whatever the number
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = whole(1_usize, 1024, "threads"))]
    pub jobs: usize,
    /// Run the I-th of N shards of the settings
    #[arg(long, value_name = "I/N", value_parser = shard)]
    pub shard: Option<(usize, usize)>,
    /// Skip the hard cases. `asperity choose` may then choose a setting that fails them
    #[arg(long)]
    pub no_cases: bool,
    /// Set a parameter of the graphs before knobs are applied: NODE.PARAM=VALUE
    #[arg(long = "set", value_name = "NODE.PARAM=VALUE")]
    pub set: Vec<String>,
    #[command(flatten)]
    pub columns: ColumnArgs,
    #[command(flatten)]
    pub plugins: PluginArgs,
    /// Show no progress and no chart
    #[arg(long, short)]
    pub quiet: bool,
}

/// Subcommands of `asperity tradeoff`.
#[derive(Clone, Debug, clap::Subcommand)]
pub enum More {
    /// Merge the results of shards. Times are scaled by the default setting, which every shard times
    Merge(Merge),
}

/// `asperity tradeoff merge`
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = crate::commands::examples(&["asperity tradeoff merge shard1 shard2 --out merged"]))]
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

pub fn run(args: &Args) -> Result<(), Failure> {
    if let Some(More::Merge(merge)) = &args.command {
        return self::merge(merge);
    }
    be_quiet(args.quiet);
    let Some(out) = &args.out else { return Err(Diagnostic::new("--out DIR is missing").into()) };
    let (tradeoff, graphs) = tradeoff(args)?;
    let mut bases = Vec::new();
    for (path, place) in &graphs {
        let base = loaded(path, &args.plugins, &args.set).map_err(|e| named_here(e, place.as_ref()))?;
        bases.push(LoadedGraph { strength: tradeoff.strength, ..base });
    }
    let mut baselines = Vec::new();
    for baseline in &tradeoff.baselines {
        let loaded = loaded(&baseline.graph.path, &args.plugins, &[])
            .map_err(|e| named_here(e, Some(&baseline.graph.place)))?;
        baselines.push(LoadedGraph { name: baseline.name.clone(), strength: baseline.strength, ..loaded });
    }
    let job = Job {
        tradeoff: &tradeoff,
        bases: &bases,
        baselines: &baselines,
        jobs: args.jobs,
        shard: args.shard.unwrap_or((0, 1)),
        folder: out,
        machine: machine(),
        // Another build of this program may measure other times.
        program: &std::env::current_exe().map_or_else(|_| String::new(), |file| content(&file)),
        cases: !args.no_cases,
    };
    if cfg!(debug_assertions) {
        warn("this program was built without optimisation: its times mean little (cargo build --release)");
    }
    let prepared = Prepared::new(&job)?;
    prepared.notes().iter().for_each(|note| warn(note));
    folder::make(out)?;
    folder::check(out, (job.shard.0 + 1, job.shard.1.max(1)))?;
    let stop = stop_flag();
    let (bar, told) = (Mutex::new(ProgressBar::hidden()), AtomicBool::new(false));
    let bars = Bars { stop: stop.clone(), parts: prepared.parts(), quiet: args.quiet, bar, told };
    let results = prepared.run(&bars);
    bars.bar.lock().finish_and_clear();
    let results = results?;
    let stopped = results.unfinished > 0 || stop.load(Ordering::Relaxed);
    // Earlier results stay where this run has finished nothing.
    let finished = results.rows.iter().any(Row::is_finished);
    if stopped && !finished && (results.rows.is_empty() || folder::has_results(out)) {
        warn("no setting is finished, and no results are written; the same command resumes");
        return Err(Failure::Said(INTERRUPTED));
    }
    let written = folder::write(out, &results)?;
    if !args.quiet {
        print(&summary(&results, &written))?;
    }
    if stopped {
        warn(&format!("{} settings are not finished; the same command resumes", results.unfinished));
        return Err(Failure::Said(INTERRUPTED));
    }
    if results.rows.iter().all(|row| row.error.is_some()) {
        let why = results.default_row().and_then(|row| row.error.clone()).unwrap_or_default();
        warn(&format!("no setting runs: {why}"));
        return Err(Failure::Said(1));
    }
    Ok(())
}

/// An error in a file, with the place where the trade-off names that file.
fn named_here(e: Failure, place: Option<&Place>) -> Failure {
    let (Failure::Input(all), Some(place)) = (&e, place) else { return e };
    let named = |d: &Diagnostic| d.clone().related(&place.source, place.span, "named here");
    Failure::Input(all.iter().map(named).collect())
}

/// Files of graphs, with the place where a trade-off names them.
type Graphs = Vec<(PathBuf, Option<Place>)>;

/// The trade-off, and the graphs whose settings it varies.
fn tradeoff(args: &Args) -> Result<(Tradeoff, Graphs), Failure> {
    let mut named = None;
    let mut graphs = Graphs::new();
    for path in &args.files {
        let source = Source::read(path)?;
        if !Tradeoff::is_meant(&source) {
            graphs.push((path.clone(), None));
        } else if named.replace(source).is_some() {
            return Err(wrong(path, "this is a second trade-off file", "give one trade-off file at a time"));
        }
    }
    let shipped = named.is_none();
    let source = named.unwrap_or_else(|| Source::new(SHIPPED.0, SHIPPED.1));
    let mut tradeoff = Tradeoff::parse(&source)?;
    tradeoff.map_columns(&args.columns.parsed()?);
    // The shipped trade-off is for any graph, and no graph has all of its knobs.
    tradeoff.lenient = source.text() == SHIPPED.1 && !graphs.is_empty();
    if shipped {
        // An installed program does not have the files of the baselines.
        tradeoff.baselines.clear();
    }
    if graphs.is_empty() {
        let help = match shipped {
            true => "name a graph or scene; or a trade-off file: graphs/tradeoffs/shipped.ron",
            false => "graph: \"../texture.ron\"; or name one on the command line",
        };
        let named = tradeoff.graph.as_ref().filter(|_| !shipped);
        let named = named.ok_or_else(|| wrong(source.path(), "no graph is given", help))?;
        graphs.push((named.path.clone(), Some(named.place.clone())));
    }
    Ok((tradeoff, graphs))
}

/// A graph, or the graph that a scene lowers to, with these changes. Wrong ones are errors.
fn loaded(path: &Path, plugins: &PluginArgs, set: &[String]) -> Result<LoadedGraph, Failure> {
    let load::Offline { whole, mut graph, registry, plugins } = load::offline(path, plugins)?;
    for assignment in set {
        graph.set(assignment, "--set")?;
    }
    if !set.is_empty() {
        compile(&graph, &registry, Options::default())?;
    }
    let name = tidy(path).display().to_string();
    Ok(LoadedGraph { name, graph, file: whole, registry, strength: 1.0, plugins })
}

fn merge(args: &Merge) -> Result<(), Failure> {
    let read = args.from.iter().map(|from| (folder::file(from), "the merge".to_owned())).collect();
    apart(read, named(&[("the merged results", Some(&args.out.join(folder::JSON)))]))?;
    let shards = args.from.iter().map(|path| Ok((path.display().to_string(), read_results(path)?)));
    let results = Results::merge(shards.collect::<Result<Vec<_>, Failure>>()?)?;
    let missing: Vec<String> = results.missing_shards().iter().map(usize::to_string).collect();
    if !missing.is_empty() {
        warn(&format!("missing shards: {} of {}", missing.join(", "), results.shards[0].1));
    }
    folder::make(&args.out)?;
    let written = folder::write(&args.out, &results)?;
    if !args.quiet {
        print(&summary(&results, &written))?;
    }
    Ok(())
}

fn summary(results: &Results, written: &[PathBuf]) -> String {
    let shown = [Figure::Perceptual, Figure::Spectrum, Figure::Convergence]
        .into_iter()
        .find(|f| !results.pareto_front(*f).is_empty());
    let mut out = shown.map_or(String::new(), |figure| results.chart(figure) + "\n");
    written.iter().for_each(|path| out += &format!("wrote {}\n", path.display()));
    let unsound = results.rows.iter().filter(|r| !r.sound()).count();
    let settings = count(results);
    out + &format!("{settings}, of which {unsound} cannot be chosen; read REPORT.md\n")
}

pub fn count(results: &Results) -> String {
    match results.rows.len() {
        1 => "one setting".to_owned(),
        n => format!("{n} settings"),
    }
}

pub fn machine() -> Machine {
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model =
        info.lines().find_map(|l| l.strip_prefix("model name")?.split_once(": ").map(|(_, m)| m.to_owned()));
    let slow = if cfg!(debug_assertions) { ", built without optimisation" } else { "" };
    Machine {
        cpu: model.unwrap_or_else(|| "unknown processor".into()),
        cores: std::thread::available_parallelism().map_or(1, usize::from),
        system: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
        build: format!("asperity {}{slow}", env!("CARGO_PKG_VERSION")),
    }
}

fn tidy(path: &Path) -> PathBuf {
    let mut out = PathBuf::new();
    for part in path.components() {
        match (part, out.components().next_back()) {
            (Component::ParentDir, Some(Component::Normal(_))) => drop(out.pop()),
            _ => out.push(part),
        }
    }
    out
}

fn shard(text: &str) -> Result<(usize, usize), String> {
    let parts =
        text.split_once('/').and_then(|(i, n)| Some((i.trim().parse().ok()?, n.trim().parse().ok()?)));
    match parts {
        Some((i @ 1.., n @ ..=1_000_000)) if i <= n => Ok((i - 1, n)),
        _ => Err(format!("`{text}` is not a shard: I/N with I from 1 to N, such as 1/4")),
    }
}
