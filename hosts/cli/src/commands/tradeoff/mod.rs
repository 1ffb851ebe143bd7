//! `asperity tradeoff`: what accuracy costs in time.

mod folder;
mod onlooker;

use std::path::{Component, Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use asperity_diagnostics::{Diagnostic, Place, Source};
use asperity_graph::{Options, compile};
use asperity_tradeoff::{Base, Figure, Machine, Order, Prepared, Results, Row, Study, content};

use crate::args::{Merge, PluginArgs, Tradeoff, TradeoffCommand};
use crate::failure::{Failure, be_quiet, print, warn};
use crate::leave::stop_flag;
use crate::load;

pub use folder::read as read_results;
use onlooker::Bars;

/// The study that is run where none is named.
const SHIPPED: (&str, &str) =
    ("studies/shipped.ron (shipped)", include_str!("../../../../../graphs/studies/shipped.ron"));
/// Exit code of a study that was interrupted, as a shell would have it.
const INTERRUPTED: u8 = 130;

/// Runs the command.
pub fn run(args: &Tradeoff) -> Result<ExitCode, Failure> {
    if let Some(TradeoffCommand::Merge(merge)) = &args.command {
        return self::merge(merge);
    }
    be_quiet(args.quiet);
    let Some(out) = &args.out else { return Err(Diagnostic::new("--out DIR is missing").into()) };
    let (study, graphs) = study(args)?;
    let mut bases = Vec::new();
    for (path, place) in &graphs {
        let base = base(path, args).map_err(|e| placed(e, place.as_ref()))?;
        bases.push(Base { strength: study.strength, ..base });
    }
    let mut marks = Vec::new();
    for mark in &study.marks {
        marks.push(Base {
            name: mark.name.clone(),
            strength: mark.strength,
            ..base_as_it_is(&mark.graph.path, &args.plugins)
                .map_err(|e| placed(e, Some(&mark.graph.place)))?
        });
    }
    let order = Order {
        study: &study,
        bases: &bases,
        marks: &marks,
        jobs: args.jobs,
        shard: args.shard.unwrap_or((0, 1)),
        folder: &out.join("kept"),
        machine: machine(),
        program: &program(),
        cases: !args.no_cases,
    };
    if cfg!(debug_assertions) {
        warn("this program was not built to be fast: its times say little (cargo build --release)");
    }
    let prepared = Prepared::new(&order)?;
    let (accuracy, times) = prepared.parts();
    prepared.notes().iter().for_each(|note| warn(note));
    folder::make(out)?;
    folder::look(out, (order.shard.0 + 1, order.shard.1.max(1)))?;
    let stop = stop_flag();
    let bars = Bars::new(accuracy, times, args.quiet, stop.clone());
    let results = prepared.run(&bars);
    bars.finish();
    let results = results?;
    let stopped = results.unfinished > 0 || stop.load(Ordering::Relaxed);
    // What was found earlier is not lost to next to nothing.
    if stopped && !results.rows.iter().any(Row::is_finished) && (results.rows.is_empty() || folder::has(out))
    {
        warn("no setting is finished, and no results are written; the same command goes on");
        return Ok(ExitCode::from(INTERRUPTED));
    }
    let written = folder::write(out, &results)?;
    if !args.quiet {
        print(&summary(&results, &written))?;
    }
    if stopped {
        warn(&format!(
            "settings that are not finished: {}; the same command goes on with them",
            results.unfinished
        ));
        return Ok(ExitCode::from(INTERRUPTED));
    }
    if results.rows.iter().all(|row| row.error.is_some()) {
        let why = results.default_row().and_then(|row| row.error.clone()).unwrap_or_default();
        warn(&format!("no setting runs: {why}"));
        return Ok(ExitCode::FAILURE);
    }
    Ok(ExitCode::SUCCESS)
}

/// What is wrong with a file that a study names, with the place where it does.
fn placed(e: Failure, place: Option<&Place>) -> Failure {
    match (e, place) {
        (Failure::Input(all), Some(place)) => Failure::Input(
            all.into_iter().map(|d| d.related(&place.source, place.span, "named here")).collect(),
        ),
        (e, _) => e,
    }
}

/// Files of graphs, with the place where a study names them.
type Graphs = Vec<(PathBuf, Option<Place>)>;

/// The study, and the graphs whose knobs it turns.
fn study(args: &Tradeoff) -> Result<(Study, Graphs), Failure> {
    let mut study = None;
    let mut graphs = Graphs::new();
    for path in &args.files {
        let source = Source::read(path)?;
        if !Study::is_meant(&source) {
            graphs.push((path.clone(), None));
        } else if study.replace(source).is_some() {
            return Err(Diagnostic::new("a second study").in_file(path).help("one study at a time").into());
        }
    }
    let shipped = study.is_none();
    let source = study.unwrap_or_else(|| Source::new(SHIPPED.0, SHIPPED.1));
    let mut study = Study::parse(&source)?;
    // It is for any graph, by its file's name too: no graph has all that it turns.
    study.lenient = source.text() == SHIPPED.1 && !graphs.is_empty();
    if shipped {
        // What stands beside is named by its place in the folder of graphs, which a program that was put
        // elsewhere does not have.
        study.marks.clear();
        if graphs.is_empty() {
            return Err(Diagnostic::new("there is no graph to study")
                .in_file("asperity tradeoff")
                .help("name a graph or scene; or a study that names one: asperity tradeoff graphs/studies/shipped.ron --out out/tradeoff")
                .into());
        }
    }
    if graphs.is_empty() {
        let Some(named) = &study.graph else {
            return Err(Diagnostic::new("this study names no graph")
                .in_file(source.path())
                .help("graph: \"../texture.ron\"; or name one on the command line")
                .into());
        };
        graphs.push((named.path.clone(), Some(named.place.clone())));
    }
    Ok((study, graphs))
}

/// A graph, or what a scene lowers to, with what the command line changes.
///
/// Wrong settings are found here, before anything is written.
fn base(path: &Path, args: &Tradeoff) -> Result<Base, Failure> {
    let mut base = base_as_it_is(path, &args.plugins)?;
    for assignment in &args.set {
        base.graph.set(assignment, "--set")?;
    }
    if !args.set.is_empty() {
        compile(&base.graph, &base.registry, Options::default())?;
    }
    Ok(base)
}

fn base_as_it_is(path: &Path, plugins: &PluginArgs) -> Result<Base, Failure> {
    let load::Offline { whole, graph, registry, plugins } = load::offline(path, plugins)?;
    Ok(Base { name: tidy(path).display().to_string(), graph, file: whole, registry, strength: 1.0, plugins })
}

fn merge(args: &Merge) -> Result<ExitCode, Failure> {
    folder::keep_apart(&args.from, &args.out)?;
    let shards = args.from.iter().map(|path| Ok((path.display().to_string(), read_results(path)?)));
    let results = Results::merge(shards.collect::<Result<Vec<_>, Failure>>()?)?;
    let missing = results.missing_shards();
    if !missing.is_empty() {
        let missing: Vec<String> = missing.iter().map(usize::to_string).collect();
        warn(&format!("shards that are not there: {} of {}", missing.join(", "), results.shards[0].1));
    }
    folder::make(&args.out)?;
    let written = folder::write(&args.out, &results)?;
    if !args.quiet {
        print(&summary(&results, &written))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// What a terminal shows.
fn summary(results: &Results, written: &[PathBuf]) -> String {
    let shown = [Figure::Perceptual, Figure::Spectrum, Figure::Convergence]
        .into_iter()
        .find(|f| !results.undominated(*f).is_empty());
    let mut out = shown.map_or(String::new(), |figure| results.chart(figure) + "\n");
    for path in written {
        out += &format!("wrote {}\n", path.display());
    }
    let unsound = results.rows.iter().filter(|r| !r.sound()).count();
    let settings = match results.rows.len() {
        1 => "one setting".to_owned(),
        n => format!("{n} settings"),
    };
    out += &format!("{settings}, of which {unsound} cannot be chosen; read REPORT.md\n");
    out
}

/// What this program runs on.
pub fn machine() -> Machine {
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model =
        info.lines().find_map(|l| l.strip_prefix("model name")?.split_once(": ").map(|(_, m)| m.to_owned()));
    Machine {
        cpu: model.unwrap_or_else(|| "a processor that does not say its name".into()),
        cores: std::thread::available_parallelism().map_or(1, usize::from),
        system: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
        build: format!(
            "asperity {}{}",
            env!("CARGO_PKG_VERSION"),
            if cfg!(debug_assertions) { ", not built to be fast" } else { "" }
        ),
    }
}

/// What tells this program from another build of it: what is in its file.
fn program() -> String {
    std::env::current_exe().map_or_else(|_| String::new(), |file| content(&file))
}

/// A path without `FOLDER/..` in it, for a person.
fn tidy(path: &Path) -> PathBuf {
    let mut out = PathBuf::new();
    for part in path.components() {
        let back = part == Component::ParentDir
            && matches!(out.components().next_back(), Some(Component::Normal(_)));
        if back {
            out.pop();
        } else {
            out.push(part);
        }
    }
    out
}

/// Whether the user asks to stop.
pub type Stop = Arc<std::sync::atomic::AtomicBool>;
