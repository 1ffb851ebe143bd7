//! `asperity render`: runs a graph as fast as possible and writes its output.

pub mod plot;
pub mod recorder;
pub mod report;
mod watch;

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use asperity_diagnostics::Diagnostic;
use asperity_engine::{Engine, Options};
use asperity_graph::{Compiled, Schedule};
use asperity_live::OutputLimits;
use asperity_node::{Role, Shape, time};
use asperity_offline::render::{Level, Run, channels};
use indicatif::ProgressBar;
use serde_json::{Value, json};

use crate::failure::{Failure, be_quiet, print, progress, wrong};
use crate::kinds::Kinds;
use crate::lag::Lag;
use crate::leave::{INTERRUPTED, stop_flag};
use crate::load::files::distinct_files;
use crate::load::{self, GraphArgs, Loaded, OfScene};
use crate::number;
use crate::output::{Format, OutputArgs, Pending, Rows, audio_ending, ending, keep_all, named};
use plot::Traces;
use recorder::{Master, Recorder};
use watch::{Extras, Watch};

pub use asperity_offline::render::Timed;

/// Render a graph or scene to a WAV file, as fast as possible
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = crate::commands::examples(&[
    "asperity render graphs/texture.ron --out canvas.wav --plot canvas.svg",
    "asperity render graphs/texture.ron --out oak.wav --set texture.material=oak",
    "asperity render graphs/texture.ron --out mine.wav --input stroke.csv --seconds 60 --loop",
]))]
pub struct Args {
    #[command(flatten)]
    pub graph: GraphArgs,
    #[command(flatten)]
    pub files: OutputArgs,
    /// Duration to render; by default the duration of the stroke
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub seconds: Option<f64>,
    /// Picture file: position, speed, force, acceleration, current and a spectrogram
    #[arg(long, value_name = "P.svg")]
    pub plot: Option<PathBuf>,
    /// Run every node in every tick, even behind a closed gate
    #[arg(long)]
    pub no_sleep: bool,
    /// Time limit for a call of a node; a longer call is a fault. By default none, with --watch 10 ticks
    #[arg(long, value_name = "US", value_parser = number::whole(1_u64, 10_000_000, "us"))]
    pub limit_us: Option<u64>,
    /// Render at the pace of real time, and reload the graph, its plugins and its files when they change
    #[arg(long)]
    pub watch: bool,
    /// Print errors only
    #[arg(long, short)]
    pub quiet: bool,
}

impl Args {
    /// Those that the report has beside those of the graph.
    fn options(&self) -> Value {
        json!({
            "seconds": self.seconds,
            "probes": self.files.probe,
            "no_sleep": self.no_sleep,
            "limit_us": self.limit_us,
            "watch": self.watch,
            "no_prune": self.graph.no_prune,
            "format": format!("{:?}", self.files.format).to_lowercase(),
        })
    }
}

/// Ticks that one call may take with `--watch`: a busy machine stalls for a few now and then.
const WATCH_LIMIT_TICKS: u64 = 10;

pub fn run(args: &Args) -> Result<(), Failure> {
    be_quiet(args.quiet);
    let mut kinds = Kinds::new(&args.graph.plugins.plugin);
    let Loaded { graph, registry, compiled, scene } = load_with_probes(args, &mut kinds)?;
    let schedule = &compiled.schedule;
    nothing_live(args, schedule)?;
    let ticks = load::ticks(args.seconds, schedule)?.ok_or_else(|| {
        Diagnostic::new("no source of this graph has a duration")
            .in_file(&args.graph.graph)
            .help("give the duration: --seconds S")
    })?;
    load::warn_about(schedule);

    let written = [
        ("--out", args.files.out.as_ref()),
        ("--plot", args.plot.as_ref()),
        ("--report", args.files.report.as_ref()),
    ];
    distinct_files(&args.graph, schedule, kinds.files(), named(&written))?;
    check_lengths(args, schedule, ticks)?;
    let mut capture = Capture::new(args, &compiled, scene)?;
    // Opened before the work, so that a missing folder is an error at once.
    let plot_file = args.plot.as_deref().map(Pending::create).transpose()?;
    let report_file = args.files.report.as_deref().map(Pending::create).transpose()?;
    // In real time, a node that takes many ticks for one would stop the sound.
    let patience = WATCH_LIMIT_TICKS * 1_000_000_000 / u64::from(schedule.tick_hz);
    let limit_ns = args.limit_us.map(|us| us * 1000).or(args.watch.then_some(patience));
    let options = Options { sleep: !args.no_sleep, limit_ns, ..Options::default() };
    let stop = stop_flag();
    let bar = progress(ticks, "rendering {wide_bar} {percent:>3} %  {msg}  {eta} left", args.quiet);
    let (mut engine, mut watch) = if args.watch {
        kinds.plays();
        let (controller, engine) = Engine::controlled(compiled, options);
        (engine, Some(Watch::new(args, kinds, controller, &bar)))
    } else {
        (Engine::new(compiled, options), None)
    };

    let mut timed = Timed::new(&engine);
    let mut done = 0;
    while done < ticks && !stop.load(Ordering::Relaxed) {
        if let Some(watch) = &mut watch {
            capture.sent = watch.poll().or(capture.sent.take());
            let due = Duration::from_secs_f64(done as f64 / f64::from(engine.schedule().tick_hz));
            std::thread::sleep(due.saturating_sub(timed.clock.0.elapsed()));
        }
        capture.tick(&mut engine, &mut timed, done)?;
        done += 1;
        if done.is_multiple_of(1024) {
            show_rate(&bar, done, engine.schedule(), timed.clock.0.elapsed().as_secs_f64());
        }
    }
    let elapsed_s = timed.clock.0.elapsed().as_secs_f64();
    let swaps = watch.map(Watch::finish).unwrap_or_default();
    bar.finish_and_clear();

    let Capture { master, recorders, traces, level, .. } = capture;
    let master = master.map(Master::finish);
    let mut files: Vec<Pending> =
        master.into_iter().chain(recorders.into_iter().map(Recorder::finish)).collect::<Result<_, _>>()?;
    let facts = (0..engine.schedule().nodes.len()).map(|i| engine.facts(i)).collect();
    let told = !args.quiet || args.files.report.is_some();
    let lag = match told && done == ticks && !args.watch && engine.faults() == 0 {
        true => Lag::of(&graph, &registry, engine.schedule()),
        false => Lag::new(Err("see `asperity latency`".into()), engine.schedule()),
    };
    let request = args.graph.request();
    let run = Run {
        request: &request,
        options: args.options(),
        ticks: done,
        asked: ticks,
        elapsed_s,
        swaps,
        engine: &engine,
        facts,
        times: &timed.times,
        level: &level,
        lag,
    };
    if let (Some(file), Some(traces)) = (plot_file, traces) {
        files.push(file.fill(&traces.svg(&args.graph.graph, engine.schedule()))?);
    }
    if let Some(file) = report_file {
        files.push(file.fill(&format!("{:#}\n", run.json()))?);
    }
    let written = keep_all(files)?;
    if !args.quiet {
        print(&report::summary(&run, &written))?;
    }
    if done < ticks { Err(Failure::Said(INTERRUPTED)) } else { Ok(()) }
}

fn load_with_probes(args: &Args, kinds: &mut Kinds) -> Result<Loaded, Failure> {
    let (mut graph, scene) = load::read(&args.graph, kinds)?;
    args.files.add_probes(&mut graph)?;
    load::compile(&args.graph, kinds, graph, scene)
}

/// Refuses a graph that needs input from a device while it runs.
fn nothing_live(args: &Args, schedule: &Schedule) -> Result<(), Failure> {
    let Some((node, _)) = schedule.host_fed().next() else { return Ok(()) };
    let node = &schedule.nodes[node];
    Err(wrong(
        &args.graph.graph,
        format!("`{}` ({}) needs a live device, and a render has none", node.id, node.kind),
        "play a stroke in its place: --input TRAJ.csv; or run the graph live: asperity run",
    ))
}

fn check_lengths(args: &Args, schedule: &Schedule, ticks: u64) -> Result<(), Failure> {
    let samples = |rate_hz: u32| time::first_sample(ticks, rate_hz, schedule.tick_hz);
    if let Some(path) = args.files.out.as_ref().filter(|p| audio_ending(p) == "wav") {
        let channels = channels(schedule).len() as u64;
        Rows::check_wav_length(path, samples(schedule.audio_hz) * channels, args.files.format)?;
    }
    for (_, node) in schedule.with_role(Role::Recorder) {
        if let (Some(path), Shape::Audio { rate_hz }) = (recorder::file_of(node), node.outputs[0].port.shape)
            && ending(path) == "wav"
        {
            Rows::check_wav_length(path, samples(rate_hz), Format::F32)?;
        }
    }
    Ok(())
}

fn show_rate(bar: &ProgressBar, done: u64, schedule: &Schedule, elapsed_s: f64) {
    bar.set_position(done);
    let seconds = done as f64 / f64::from(schedule.tick_hz);
    bar.set_message(format!("{seconds:.1} s, {:.0} x real time", seconds / elapsed_s.max(1e-9)));
}

/// Files, figures and traces that grow while a render runs.
struct Capture {
    master: Option<Master>,
    recorders: Vec<Recorder>,
    traces: Option<Traces>,
    level: Level,
    /// Of the graph that the engine takes over next.
    sent: Option<Extras>,
    /// With `--watch`: holds the file's channels to their limits while graphs change.
    output_limits: Option<OutputLimits>,
}

impl Capture {
    /// Opens the files that the command line and the graph's sinks name.
    fn new(args: &Args, compiled: &Compiled, scene: Option<OfScene>) -> Result<Self, Failure> {
        let schedule = &compiled.schedule;
        Ok(Self {
            recorders: Recorder::for_sinks(schedule)?,
            master: args
                .files
                .out
                .as_ref()
                .map(|path| Master::new(path, schedule, args.files.format))
                .transpose()?,
            traces: args.plot.as_ref().map(|_| Traces::new(schedule, scene)),
            level: Level::new(schedule),
            sent: None,
            output_limits: args.watch.then(|| OutputLimits::new(compiled, channels(schedule))),
        })
    }

    /// Runs a tick and records its outputs.
    fn tick(&mut self, engine: &mut Engine, timed: &mut Timed, tick: u64) -> Result<(), Failure> {
        let before = timed.schedule.clone();
        timed.tick(engine);
        if !Arc::ptr_eq(&before, engine.schedule()) {
            self.follow(&before, engine.schedule());
        }
        self.level.take(engine);
        if let Some(master) = &mut self.master {
            master.take(engine, self.output_limits.as_mut())?;
        }
        for recorder in &mut self.recorders {
            recorder.take(engine, tick)?;
        }
        if let Some(traces) = &mut self.traces {
            traces.take(engine, tick);
        }
        Ok(())
    }

    /// Continues with the nodes of the same ids in a new graph. [`watch`] has checked that the sinks exist.
    fn follow(&mut self, before: &Schedule, schedule: &Schedule) {
        let moved = |i: usize| {
            let id = before.nodes.get(i).map_or("", |n| n.id.as_str());
            schedule.index_of(id).unwrap_or(usize::MAX)
        };
        self.level.nodes.iter_mut().for_each(|node| *node = moved(*node));
        let channels = self.master.iter_mut().flat_map(|master| &mut master.nodes);
        channels.for_each(|node| *node = moved(*node));
        self.recorders.iter_mut().for_each(|r| r.follow(moved));
        let (scene, next) = self.sent.take().map(|sent| (sent.scene, sent.output_limits)).unzip();
        if let (Some(current), Some(next)) = (&mut self.output_limits, next) {
            let mut before = std::mem::replace(current, next);
            current.go_on(&mut before);
        }
        if let Some(traces) = &mut self.traces {
            traces.follow(schedule, scene.flatten());
        }
    }
}
