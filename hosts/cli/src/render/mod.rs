//! `asperity render`: the virtual clock. Ticks run one after another, as fast as they go.

pub mod effects;
pub mod record;
pub mod report;
mod taken;
mod traces;
mod watch;

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use asperity_diagnostics::Diagnostic;
use asperity_engine::{Clock, Engine, Options};
use asperity_graph::Compiled;
use asperity_node::Buffer;
use indicatif::{ProgressBar, ProgressStyle};

use crate::args::{GraphArgs, Render};
use crate::failure::{Failure, be_quiet, complain, print};
use crate::kinds::Kinds;
use crate::output::{Pending, keep_all};
use crate::{load, output};

use report::Run;
use taken::Taken;
use watch::{Sent, Watch};

/// Longest render, in seconds: a year.
const MAX_SECONDS: f64 = 365.0 * 86_400.0;
/// Ticks that one call of a node may take while a render is played in real time, unless `--limit-us` says otherwise. A machine that
/// is busy with other things stalls for a few ticks now and then; that is no fault of the node.
const WATCH_LIMIT_TICKS: u64 = 10;
/// Exit code of a render that was interrupted, as a shell would have it.
const INTERRUPTED: u8 = 130;

/// The computer's own clock.
pub struct Wall(Instant);

impl Wall {
    /// A clock that began then.
    pub fn new(began: Instant) -> Self {
        Self(began)
    }
}

impl Clock for Wall {
    fn now_ns(&self) -> u64 {
        self.0.elapsed().as_nanos() as u64
    }
}

/// Runs the command.
pub fn run(args: &Render) -> Result<ExitCode, Failure> {
    be_quiet(args.quiet);
    let mut kinds = Kinds::new(&args.graph.plugins.plugin);
    let (compiled, scene) = compiled(args, &mut kinds)?;
    let schedule = &compiled.schedule;
    nothing_live(args, schedule)?;
    let ticks = ticks(args, schedule)?;
    for warning in load::warnings(schedule) {
        crate::failure::warn(&warning);
    }
    for allocating in schedule.allocating() {
        crate::failure::warn(&format!("`{allocating}` allocates in every tick and is not fit for real time"));
    }

    let named = [("--out", &args.out), ("--plot", &args.plot), ("--report", &args.report)];
    distinct_files(&args.graph, schedule, kinds.files(), &named)?;
    check_lengths(args, schedule, ticks)?;
    let beside = Sent::default();
    let mut taken = Taken::new(args, &compiled, scene, beside.clone())?;
    // Opened now, so that a folder that is not there is known before and not after the work.
    let plot = args.plot.as_deref().map(Pending::create).transpose()?;
    let report_file = args.report.as_deref().map(Pending::create).transpose()?;
    // Played in real time, a node that takes many ticks for one would stop all that is heard.
    let patience = WATCH_LIMIT_TICKS * 1_000_000_000 / u64::from(schedule.tick_hz);
    let limit_ns = args.limit_us.map(|us| us * 1000).or(args.watch.then_some(patience));
    let options = Options { sleep: !args.no_sleep, limit_ns, ..Options::default() };
    let stop = stop_flag();
    let bar = progress(ticks, args.quiet);
    let (mut engine, watch) = if args.watch {
        kinds.plays();
        let (controller, engine) = Engine::controlled(compiled, options);
        (engine, Some(Watch::start(args, kinds, controller, beside, &bar)))
    } else {
        (Engine::new(compiled, options), None)
    };

    let wall = Wall(Instant::now());
    let mut done = 0;
    while done < ticks && !stop.load(Ordering::Relaxed) {
        if args.watch {
            // Only here does a render wait: who changes a graph while it plays wants to hear it in time.
            let due = Duration::from_secs_f64(done as f64 / f64::from(engine.schedule().tick_hz));
            std::thread::sleep(due.saturating_sub(wall.0.elapsed()));
        }
        taken.tick(&mut engine, &wall, done)?;
        done += 1;
        if done.is_multiple_of(1024) {
            bar.set_position(done);
            set_rate(&bar, done, engine.schedule(), wall.0.elapsed().as_secs_f64());
        }
    }
    let elapsed_s = wall.0.elapsed().as_secs_f64();
    let swaps = watch.map(Watch::finish).unwrap_or_default();
    bar.finish_and_clear();

    let Taken { master, recorders, traces, times, drive, .. } = taken;
    let mut files = Vec::new();
    if let Some(master) = master {
        files.push(master.finish()?);
    }
    for recorder in recorders {
        files.push(recorder.finish()?);
    }
    let run = Run {
        graph: &args.graph.graph,
        overrides: &args.graph.set,
        input: args.graph.input.as_deref(),
        ticks: done,
        asked: ticks,
        elapsed_s,
        options: args,
        swaps: &swaps,
    };
    if let (Some(file), Some(traces)) = (plot, traces) {
        files.push(file.fill(&traces.svg(&args.graph.graph, engine.schedule()))?);
    }
    if let Some(file) = report_file {
        files.push(file.fill(&report::json(&run, &engine, &times, &drive))?);
    }
    let written = keep_all(files)?;
    if !args.quiet {
        print(&report::summary(&run, &engine, &times, &drive, &written))?;
    }
    Ok(if done < ticks { ExitCode::from(INTERRUPTED) } else { ExitCode::SUCCESS })
}

/// Reads and compiles the graph with what the command line changes in it. Where it is of a scene, that too.
fn compiled(args: &Render, kinds: &mut Kinds) -> Result<(Compiled, Option<load::OfScene>), Failure> {
    let (mut graph, scene) = load::read_all(&args.graph, kinds)?;
    for (i, text) in args.probe.iter().enumerate() {
        let (port, file) = load::probe(text, &graph)?;
        let id =
            (i + 1..).map(|n| format!("probe {n}")).find(|id| graph.node(id).is_none()).unwrap_or_default();
        graph.add_node(&id, "probe", &[("file", &file)], "--probe")?;
        graph.add_wire(&port, &id, "--probe");
    }
    let registry = kinds.registry(Some(&graph))?;
    Ok((load::compiled(&graph, &args.graph, &registry)?, scene))
}

/// What comes from a device while it happens is not there offline.
fn nothing_live(args: &Render, schedule: &asperity_graph::Schedule) -> Result<(), Failure> {
    let Some((node, _)) = schedule.fed().next() else { return Ok(()) };
    let node = &schedule.nodes[node];
    Err(Diagnostic::new(format!("`{}` ({}) is live, and a render hears nothing of it", node.id, node.kind))
        .in_file(&args.graph.graph)
        .help("play a stroke in its place: --input TRAJ.csv; or run the graph live: asperity run")
        .into())
}

/// Two things written to one file would leave only the last, and what is read must not be written over.
pub fn distinct_files(
    args: &GraphArgs,
    schedule: &asperity_graph::Schedule,
    plugins: &[PathBuf],
    named: &[(&str, &Option<PathBuf>)],
) -> Result<(), Failure> {
    let mut seen = load::files_read(args, schedule);
    seen.extend(plugins.iter().map(|path| (path.clone(), "the graph, as a plugin,".to_owned())));
    let read = seen.len();
    seen.extend(named.iter().filter_map(|(name, path)| Some(((*path).clone()?, (*name).to_owned()))));
    seen.extend(record::files(schedule).map(|(path, id)| (path, format!("`{id}`"))));
    let seen: Vec<(PathBuf, String)> =
        seen.into_iter().map(|(path, who)| (output::resolved(&path), who)).collect();
    for (i, (path, who)) in seen.iter().enumerate().skip(read) {
        if let Some(first) = seen[..i].iter().position(|(other, _)| other == path) {
            let verb = if first < read {
                "reads this file, and would be overwritten by"
            } else {
                "would write the same file as"
            };
            return Err(Diagnostic::new(format!("{} {verb} {who}", seen[first].1))
                .in_file(path)
                .help("give each a file of its own")
                .into());
        }
    }
    Ok(())
}

/// A WAV file has room for so many samples.
fn check_lengths(args: &Render, schedule: &asperity_graph::Schedule, ticks: u64) -> Result<(), Failure> {
    let samples = |rate_hz: u32| asperity_node::time::first_sample(ticks, rate_hz, schedule.tick_hz);
    if let Some(path) = args.out.as_ref().filter(|p| output::ending(p) == "wav") {
        let channels = schedule.nodes.iter().filter(|n| n.kind == "audio_out").count() as u64;
        output::Rows::check_wav_length(path, samples(schedule.audio_hz) * channels, args.format)?;
    }
    for node in schedule.nodes.iter().filter(|n| n.kind == "file_out") {
        if let (Some(path), asperity_node::Shape::Audio { rate_hz }) =
            (record::file_of(node), node.outputs[0].port.shape)
            && output::ending(path) == "wav"
        {
            output::Rows::check_wav_length(path, samples(rate_hz), crate::args::Format::F32)?;
        }
    }
    Ok(())
}

fn ticks(args: &Render, schedule: &asperity_graph::Schedule) -> Result<u64, Failure> {
    match args.seconds {
        Some(s) if s > 0.0 && s <= MAX_SECONDS => {
            Ok((s * f64::from(schedule.tick_hz)).round().max(1.0) as u64)
        }
        Some(s) => Err(Diagnostic::new(format!("{s} s is out of range"))
            .in_file("--seconds")
            .help(format!("above 0, at most {MAX_SECONDS} s"))
            .into()),
        None => schedule.duration_ticks().filter(|&t| t > 0).ok_or_else(|| {
            Diagnostic::new("no source of this graph says how long it lasts")
                .in_file(&args.graph.graph)
                .help("say how long to render: --seconds S")
                .into()
        }),
    }
}

/// Set when the user asks the render to stop; what was rendered until then is kept. Who asks for it the third time is not heard by what runs,
/// such as a plugin in an endless loop: the program then ends at once.
///
/// One flag for the whole program, which a command that plays several times asks for again.
pub fn stop_flag() -> Arc<AtomicBool> {
    static STOP: OnceLock<Arc<AtomicBool>> = OnceLock::new();
    let make = || {
        let stop = Arc::new(AtomicBool::new(false));
        let set = stop.clone();
        let mut asked = 0;
        let heard = move || {
            set.store(true, Ordering::Relaxed);
            asked += 1;
            match asked {
                1 => {}
                2 => complain(
                    "it is about to end; once more, and it ends at once and keeps nothing of what it writes\n",
                ),
                _ => crate::leave::now(INTERRUPTED),
            }
        };
        if let Err(e) = ctrlc::set_handler(heard) {
            crate::failure::warn(&format!("Ctrl-C will not be caught: {e}"));
        }
        stop
    };
    STOP.get_or_init(make).clone()
}

fn progress(ticks: u64, quiet: bool) -> ProgressBar {
    if quiet {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(ticks);
    if let Ok(style) = ProgressStyle::with_template("rendering {wide_bar} {percent:>3} %  {msg}  {eta} left")
    {
        bar.set_style(style);
    }
    bar
}

fn set_rate(bar: &ProgressBar, done: u64, schedule: &asperity_graph::Schedule, elapsed_s: f64) {
    let seconds = done as f64 / f64::from(schedule.tick_hz);
    bar.set_message(format!("{seconds:.1} s, {:.0} x real time", seconds / elapsed_s.max(1e-9)));
}

/// This tick's samples of an audio buffer.
fn samples(buffer: Option<&Buffer>) -> &[f32] {
    match buffer {
        Some(Buffer::Audio { samples, len, .. }) => &samples[..*len],
        _ => &[],
    }
}
