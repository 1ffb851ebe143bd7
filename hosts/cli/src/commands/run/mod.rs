//! `asperity run`: plays a graph in real time.

mod editor;
pub mod hands;
mod recordings;
pub mod reloader;
mod renders;
mod report;
mod shows;

use std::net::IpAddr;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use asperity_engine::Options;
use asperity_live::view::{By, Condition, Layout, Request, View};
use asperity_live::{DOES_NOT_COME_BACK, RunControl, Session, mic, prepare_live};
use asperity_node::Fault;

use crate::card::{self, DeviceArgs};
use crate::commands::render::recorder::Kept;
use crate::failure::{Failure, print, warn};
use crate::lag::Lag;
use crate::load::files::distinct_files;
use crate::load::{self, GraphArgs};
use crate::number;
use crate::output::{OutputArgs, Pending};
use editor::{Editor, News, Playing};
use hands::Hands;
use recordings::Recordings;
use reloader::Made;
use renders::Renders;
use shows::{Outcome, Shows, Speaker};

/// Play a graph in real time: a hand moves the stylus, the sound card drives the actuator
#[derive(Clone, Debug, clap::Args)]
#[command(mut_args = number::may_be_negative)]
#[command(group = clap::ArgGroup::new("served").multiple(true))]
#[command(after_help = crate::commands::examples(&[
    "asperity run graphs/live.ron --page --device simulated:frames=256",
    "asperity run graphs/live.ron --control 9100 --record stroke.csv --out played.wav",
    "asperity run graphs/texture.ron --device \"USB Audio\" --channel 3",
]))]
pub struct Args {
    #[command(flatten)]
    pub graph: GraphArgs,
    #[command(flatten)]
    pub device: DeviceArgs,
    /// Duration of the run; by default the duration of the stroke, or until Ctrl-C
    #[arg(long, value_name = "S", value_parser = number::number(1e-3, 31_536_000.0, "s"))]
    pub seconds: Option<f64>,
    /// Serve the live page at this port, or at a free one
    #[arg(long, value_name = "PORT", num_args = 0..=1, default_missing_value = "0", group = "served",
        value_parser = number::whole(0, u16::MAX, ""))]
    pub page: Option<u16>,
    /// Let other programs control the run at this port, or at a free one: by WebSocket and OSC
    #[arg(long, value_name = "PORT", num_args = 0..=1, default_missing_value = "0", group = "served",
        value_parser = number::whole(0, u16::MAX, ""))]
    pub control: Option<u16>,
    /// Serve page and control at this address of the machine, so that a phone or tablet is the hand; 0.0.0.0
    /// for all
    #[arg(long, value_name = "ADDRESS", requires = "served")]
    pub bind: Option<IpAddr>,
    /// Show the run in the terminal
    #[arg(long)]
    pub tui: bool,
    /// Reload the graph, its plugins and the files it reads when they change
    #[arg(long)]
    pub watch: bool,
    #[command(flatten)]
    pub files: OutputArgs,
    /// Record the motion of the stylus, as a stroke that --input plays
    #[arg(long, value_name = "STROKE.csv")]
    pub record: Option<PathBuf>,
    /// Run every node in every tick, even behind a closed gate
    #[arg(long)]
    pub no_sleep: bool,
    /// Time limit for a call of a node; a slower node is faded out. By default 10 ticks, at least 50 ms
    #[arg(long, value_name = "US", value_parser = number::whole(1_u64, 10_000_000, "us"))]
    pub limit_us: Option<u64>,
    /// Call plugins on the tick thread. Saves some 50 us a node, but a plugin that hangs stops the sound
    #[arg(long)]
    pub in_place: bool,
    /// Print errors only
    #[arg(long, short)]
    pub quiet: bool,
}

/// Ticks that one call of a node may take, by default: a busy machine stalls for a few now and then.
const LIMIT_TICKS: u64 = 10;
/// Least limit of a call, at any tick rate: machines stall by 14 ms and more.
const LIMIT_NS: u64 = 50_000_000;
/// How often devices, files and pages are served.
const PACE: Duration = Duration::from_micros(16_667);
/// How much longer than planned a run may take whose tick does not end \[s\].
const LATE_S: f64 = 1.0;
/// How long the end of a run waits for devices to close: they ramp their force down within 100 ms.
const LET_GO: Duration = Duration::from_millis(200);

pub fn run(args: &Args) -> Result<(), Failure> {
    let mut editor = Editor::new(args);
    let Made { graph, compiled, materials, .. } = editor.make()?;
    let schedule = &compiled.schedule;
    let request = card::request(&args.device, schedule)?;
    let ticks = load::ticks(args.seconds, schedule)?;
    load::warn_about(schedule);
    let written = reloader::written(&args.files, args.record.as_ref());
    distinct_files(&args.graph, schedule, editor.plugins(), written)?;
    let report_file = args.files.report.as_deref().map(Pending::create).transpose()?;
    let mut recordings = Recordings::open(args, schedule)?;
    let (mut hands, queues) = Hands::of(schedule)?;
    if args.page.is_none() && args.control.is_none() {
        for node in hands::pointers(schedule) {
            warn(&format!("`{}` is moved on the live page: add --page", node.id));
        }
    }
    if args.watch {
        editor.watch(schedule);
    }

    let recorded = request.as_ref().map_or(0, |r| r.inputs.len());
    let coils = card::coils(&args.device, schedule)?;
    editor.hold_to(coils.ceiling());
    let session_options = card::options(&args.device, request, coils);
    let mut shows = Shows::open(args, &session_options.run_control, &mut hands)?;
    hands::invitations(schedule).for_each(|invitation| shows.say(&invitation));
    let ticks_ns = LIMIT_TICKS * 1_000_000_000 / u64::from(schedule.tick_hz);
    let limit_ns = args.limit_us.map_or(ticks_ns.max(LIMIT_NS), |us| us * 1000);
    let options = Options { sleep: !args.no_sleep, limit_ns: Some(limit_ns), ..Options::default() };
    let (mic_writer, mic_reader) =
        (recorded > 0).then(|| mic(recorded, schedule.audio_hz, schedule.tick_hz)).unzip();
    let (graph_controller, mut player) =
        prepare_live(compiled, &graph, options, queues, mic_reader, materials);
    recordings.listen(&mut player);
    let run_control = session_options.run_control.clone();
    let session =
        Session::start(graph_controller, player, mic_writer, session_options).map_err(not_opened)?;

    let mut stage =
        Stage { session, editor, hands, recordings, renders: Renders::default(), failed: Default::default() };
    let outcome = stage.play(&mut shows, ticks);
    let Stage { session, editor, hands, mut recordings, .. } = stage;
    let played = editor.end();
    let grants = session.grants();
    let mut ended = session.stop();
    drop(hands);
    let ending = Instant::now();
    hands::wait(|| ending.elapsed() >= LET_GO);
    recordings.drain(&mut ended.graph_controller);
    shows.close();
    // Recordings are kept, whatever ended the run and whatever else cannot be written.
    let Kept { mut written, said, cut } = recordings.keep();
    // The end of a run does not wait for a reader of its messages.
    let last = Speaker::new(false);
    said.iter().for_each(|said| last.say(&format!("warning: {said}")));
    last.close();
    let schedule = ended.graph_controller.schedule();
    // What failed in the run is not run again.
    let sound =
        ended.player.is_some() && ended.view.faults == 0 && (!args.quiet || args.files.report.is_some());
    let lag = match played.filter(|_| sound) {
        Some((graph, registry)) => Lag::of(&graph, &registry, schedule),
        None => Lag::new(Err("see `asperity latency`".into()), schedule),
    };
    let run = report::Run { args, ended: &ended, grants, changes: run_control.changes(0), lag };
    let reported = report_file
        .map_or(Ok(()), |file| file.fill(&run.json()).and_then(Pending::keep).map(|path| written.push(path)));
    if !args.quiet {
        print(&run.summary(&written))?;
    }
    let recorded = if cut.is_empty() { Ok(()) } else { Err(Failure::Machine(cut.join("; "))) };
    let hangs = failed_by(DOES_NOT_COME_BACK, &ended.view, ended.graph_controller.layout());
    let came_back = match (&ended.player, hangs.first()) {
        (None, Some(node)) => {
            Err(Failure::Machine(format!("a tick did not end: {node} {DOES_NOT_COME_BACK}")))
        }
        _ => Ok(()),
    };
    outcome.and(came_back).and(reported).and(recorded)?;
    Failure::said(ended.view.condition == Condition::Failed)
}

fn not_opened(error: asperity_live::SessionError) -> Failure {
    card::not_opened(error, true)
}

/// A playing graph, and all that is served while it plays.
struct Stage {
    session: Session,
    editor: Editor,
    hands: Hands,
    recordings: Recordings,
    renders: Renders,
    /// Nodes whose call does not end, and nodes that were taken out for it.
    failed: [Vec<String>; 2],
}

/// Nodes with this last fault, as a user knows them.
fn failed_by(fault: &str, view: &View, layout: &Layout) -> Vec<String> {
    let nodes = layout.nodes.iter().zip(&view.nodes).filter(|(_, seen)| seen.last_fault == fault);
    nodes.map(|(node, _)| format!("`{}` ({})", node.id, node.kind)).collect()
}

impl Stage {
    /// Plays until the end of the stroke, until it is asked to stop, or until it cannot go on. It waits for a
    /// slow disk, and up to 1 s for the driver of a lost device.
    fn play(&mut self, shows: &mut Shows, ticks: Option<u64>) -> Result<(), Failure> {
        let (began, mut next) = (Instant::now(), Instant::now());
        let run_control = self.session.run_control().clone();
        loop {
            for notice in self.session.poll().map_err(not_opened)? {
                shows.say(&notice);
            }
            self.hands.problems().iter().for_each(|p| shows.say(p));
            self.serve(shows);
            if self.session.run_control().stopping() {
                return Ok(());
            }
            let Self { session, editor, hands, recordings, renders, .. } = self;
            let graph_controller = session.graph_controller();
            match editor.poll(&mut Playing { graph_controller, hands, recordings }) {
                Some(News::Files(text, taken_over)) => {
                    shows.say(&text);
                    if taken_over {
                        run_control.list(text, "--watch");
                    }
                }
                Some(News::Chosen(request, by)) => done(&run_control, shows, &request, "", by),
                Some(News::Refused(request, by, failure)) => refused(shows, request, by, &failure),
                None => {}
            }
            for warning in hands.warnings(&graph_controller.schedule().clone(), graph_controller.layout()) {
                shows.say(&format!("warning: {warning}"));
            }
            if let Some(page) = shows.page() {
                renders.poll(page, |folder| editor.render_args(graph_controller.schedule(), folder));
            }
            recordings.drain(graph_controller);
            recordings.complaints().iter().for_each(|said| shows.say(said));
            let view = session.view();
            let layout = session.graph_controller().layout();
            let faults = [
                (DOES_NOT_COME_BACK.to_owned(), ", and nothing is heard until it does"),
                (Fault::Stuck.to_string(), ": the graph goes on without it"),
            ];
            for ((fault, then), known) in faults.iter().zip(&mut self.failed) {
                let failed = failed_by(fault, &view, layout);
                for node in failed.iter().filter(|node| !known.contains(node)) {
                    shows.say(&format!("warning: {node} {fault}{then}"));
                }
                *known = failed;
            }
            // Where no tick ends, the planned time still ends the run.
            let (hangs, tick_hz) = (!self.failed[0].is_empty(), f64::from(layout.tick_hz));
            let late = |ticks: u64| began.elapsed().as_secs_f64() > ticks as f64 / tick_hz + LATE_S;
            let done = ticks.is_some_and(|ticks| view.ticks >= ticks || (hangs && late(ticks)));
            let (condition, losses) = (view.condition, view.losses);
            let graph_controller = session.graph_controller();
            shows.show(view, graph_controller.layout(), graph_controller.schedule(), hands, editor.map());
            if !session.goes_on() {
                return Err(Failure::Machine(match condition {
                    Condition::Failed => "the engine panicked, and the output was ramped down".into(),
                    _ => format!("the device is lost ({losses} losses), and --no-reconnect gives up"),
                }));
            }
            if done {
                return Ok(());
            }
            next = (next + PACE).max(Instant::now());
            std::thread::sleep(next.saturating_duration_since(Instant::now()));
        }
    }

    /// Begins the changes that were requested since the last time.
    fn serve(&mut self, shows: &mut Shows) {
        let run_control = self.session.run_control().clone();
        for (request, by) in run_control.asked() {
            match &request {
                Request::Set { node, param, value } => {
                    let graph_controller = self.session.graph_controller();
                    match self.editor.set(node.clone(), param.clone(), *value, graph_controller) {
                        Ok(value) => done(&run_control, shows, &request, &value, by),
                        Err(failure) => refused(shows, request, by, &failure),
                    }
                }
                Request::Material { node, name } => self.editor.choose(node.clone(), name.clone(), by),
                // These never wait.
                Request::Mute(_) | Request::Strength(_) | Request::Marker(_) | Request::Stop => {}
            }
        }
    }
}

/// Lists a change that the engine was just sent, and answers who asked for it. `value`: that of a parameter.
fn done(run_control: &RunControl, shows: &mut Shows, request: &Request, value: &str, by: By) {
    let what = match request {
        Request::Set { node, param, .. } => format!("set {node}.{param} {value}"),
        Request::Material { node, name } => format!("set {node}.material {name}"),
        // These are listed where they are carried out.
        Request::Mute(_) | Request::Strength(_) | Request::Marker(_) | Request::Stop => return,
    };
    let change = run_control.list(what, &by.name);
    shows.answer(by, Outcome::Done(change));
}

/// Says that a request was refused, and answers who made it.
fn refused(shows: &mut Shows, request: Request, by: By, failure: &Failure) {
    shows.say(&failure.reason());
    let (why, help) = failure.parts();
    shows.answer(by, Outcome::Refused(request, why, help));
}
