//! `asperity run`: a graph in real time.

pub mod card;
mod closing;
mod editor;
mod hands;
mod maker;
pub mod perform;
mod recordings;
mod report;
mod shows;
mod speaker;

use std::process::ExitCode;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use asperity_diagnostics::Diagnostic;
use asperity_engine::Options;
use asperity_graph::Schedule;
use asperity_live::view::{Condition, Layout, Request, View};
use asperity_live::{DOES_NOT_COME_BACK, FORCES, HANDS, Session, conduct, mic};
use asperity_node::Fault;

use crate::args::Run;
use crate::failure::{Failure, print, warn};
use crate::load;
use crate::output::Pending;
use crate::render::distinct_files;
use editor::{Editor, Playing};
use hands::Hands;
use maker::Made;
use recordings::{AllKept, Recordings};
use shows::Shows;
use speaker::Speaker;

/// Ticks that one call of a node may take, unless `--limit-us` says otherwise. A machine that is busy with other things stalls
/// for a few ticks now and then; that is no fault of the node.
const LIMIT_TICKS: u64 = 10;
/// And at least so long, at any rate of ticks: machines stall by 14 ms and more.
const LIMIT_NS: u64 = 50_000_000;
/// How often devices, files and pages are looked after.
const PACE: Duration = Duration::from_micros(16_667);
/// How much longer than it was to last a run may take whose tick does not end, in seconds.
const LATE_S: f64 = 1.0;
/// How long the end of a run waits for devices that are being closed: their force is ramped down within 100 ms.
const LET_GO: Duration = Duration::from_millis(200);
/// Longest run that may be asked for, in seconds: a year.
const MAX_SECONDS: f64 = 365.0 * 86_400.0;

/// Runs the command.
pub fn run(args: &Run) -> Result<ExitCode, Failure> {
    let mut editor = Editor::new(args);
    let Made { graph, compiled, materials, .. } = editor.make()?;
    let schedule = &compiled.schedule;
    let request = card::request(&args.device, schedule)?;
    let ticks = ticks(args, schedule)?;
    for warning in load::warnings(schedule) {
        warn(&warning);
    }
    for id in schedule.allocating() {
        warn(&format!("`{id}` allocates in every tick and is not fit for real time"));
    }
    distinct_files(&args.graph, schedule, editor.plugins(), &[("--report", &args.report)])?;
    let report_file = args.report.as_deref().map(Pending::create).transpose()?;
    let recordings = Recordings::start(schedule)?;
    let mut hands = Hands::default();
    let outside = |kind: &str| HANDS.contains(&kind) || FORCES.contains(&kind);
    let ids: Vec<String> = schedule.nodes.iter().filter(|n| outside(&n.kind)).map(|n| n.id.clone()).collect();
    let mut opened = hands::open(schedule, &ids, &[], &AtomicBool::new(false))?;
    let ends = std::mem::take(&mut opened.ends);
    hands.go_on_with(opened, schedule);
    if args.page.is_none() {
        for node in schedule.nodes.iter().filter(|n| n.kind == "pointer_input") {
            warn(&format!("`{}` is moved on the live page, and nobody serves it: add --page", node.id));
        }
    }
    if args.watch {
        editor.watch(schedule);
    }

    let recorded = request.as_ref().map_or(0, |r| r.inputs.len());
    let coils = card::coils(&args.device, schedule)?;
    editor.hold_to(coils.ceiling());
    let session_options = card::options(&args.device, request, coils);
    let mut shows = Shows::open(args, &session_options.reins, &mut hands)?;
    for node in schedule.nodes.iter().filter(|n| n.kind == "osc_input") {
        let text = |name: &str| node.params.text(name).to_owned();
        let (address, arguments, listen) = (text("address"), text("arguments"), text("listen"));
        shows.say(&format!("`{}` waits for OSC messages {address} ({arguments}) at {listen}", node.id));
    }
    let ticks_ns = LIMIT_TICKS * 1_000_000_000 / u64::from(schedule.tick_hz);
    let limit_ns = args.limit_us.map_or(ticks_ns.max(LIMIT_NS), |us| us * 1000);
    let options = Options { sleep: !args.no_sleep, limit_ns: Some(limit_ns), ..Options::default() };
    let (mic_writer, mic_reader) = if recorded > 0 {
        let (to, from) = mic(recorded, schedule.audio_hz, schedule.tick_hz);
        (Some(to), Some(from))
    } else {
        (None, None)
    };
    let (conductor, player) = conduct(compiled, &graph, options, ends, mic_reader, materials);
    let session = Session::start(conductor, player, mic_writer, session_options).map_err(card::failed)?;

    let mut stage = Stage { session, editor, hands, recordings, hangs: None, stuck: Vec::new() };
    let outcome = stage.play(&mut shows, ticks);
    let Stage { session, editor, hands, mut recordings, .. } = stage;
    // Whoever still opens a device for it is told that nobody wants it.
    editor.end();
    let grants = session.grants();
    let mut ended = session.stop();
    drop(hands);
    closing::wait_for(LET_GO);
    recordings.drain(&mut ended.conductor);
    shows.close();
    // What was recorded until then is kept, whatever ended the run and whatever else cannot be written.
    let AllKept { mut written, said, cut } = recordings.keep();
    // Nor does the end of a run wait for somebody who does not read.
    let last = Speaker::new(false);
    said.iter().for_each(|said| last.say(&format!("warning: {said}")));
    last.close();
    let run = report::Run { args, ended: &ended, grants };
    let reported = report_file.map_or(Ok(()), |file| {
        file.fill(&report::json(&run)).and_then(Pending::keep).map(|path| written.push(path))
    });
    if !args.quiet {
        print(&report::summary(&run, &written))?;
    }
    let recorded = if cut.is_empty() { Ok(()) } else { Err(Failure::Machine(cut.join("; "))) };
    let came_back = match (&ended.player, hanging(&ended.view, ended.conductor.layout())) {
        (None, Some(node)) => {
            Err(Failure::Machine(format!("a tick did not end: {node} {DOES_NOT_COME_BACK}")))
        }
        _ => Ok(()),
    };
    outcome.and(came_back).and(reported).and(recorded)?;
    Ok(if ended.view.condition == Condition::Failed { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

/// What is looked after while a graph plays.
struct Stage {
    session: Session,
    editor: Editor,
    hands: Hands,
    recordings: Recordings,
    /// A node that has been said not to come back.
    hangs: Option<String>,
    /// Nodes that have been said to be cut out.
    stuck: Vec<String>,
}

/// The node whose call does not end, as a person knows it.
fn hanging(view: &View, layout: &Layout) -> Option<String> {
    let (node, _) =
        layout.nodes.iter().zip(&view.nodes).find(|(_, seen)| seen.last_fault == DOES_NOT_COME_BACK)?;
    Some(format!("`{}` ({})", node.id, node.kind))
}

/// Nodes that are called no more since a call did not return, as a person knows them.
fn stuck(view: &View, layout: &Layout) -> Vec<String> {
    let text = Fault::Stuck.to_string();
    let nodes = layout.nodes.iter().zip(&view.nodes).filter(|(_, seen)| seen.last_fault == text);
    nodes.map(|(node, _)| format!("`{}` ({})", node.id, node.kind)).collect()
}

impl Stage {
    /// Plays until the end of the stroke, until it is asked to stop, or until it cannot go on. It waits for a disk that is slow, and
    /// where a device is lost for what played on it: by the callback driver, until the tick that runs has ended (1 s at most); by the
    /// paced driver, until the thread of the ticks has ended, 0.2 to 0.8 s. Pages, edits and recordings wait meanwhile;
    /// devices that push back have threads of their own, and do not.
    fn play(&mut self, shows: &mut Shows, ticks: Option<u64>) -> Result<(), Failure> {
        let (began, mut next) = (Instant::now(), Instant::now());
        loop {
            for notice in self.session.tend().map_err(card::failed)? {
                shows.say(&notice);
            }
            self.hands.problems().iter().for_each(|p| shows.say(p));
            self.serve(shows);
            if self.session.reins().stopping() {
                return Ok(());
            }
            let Self { session, editor, hands, recordings, .. } = self;
            let conductor = session.conductor();
            if let Some(said) = editor.tend(&mut Playing { conductor, hands, recordings }) {
                shows.say(&said);
            }
            for warning in hands.warnings(&conductor.schedule().clone(), conductor.layout()) {
                shows.say(&format!("warning: {warning}"));
            }
            recordings.drain(conductor);
            recordings.complaints().iter().for_each(|said| shows.say(said));
            let view = session.view();
            let hangs = hanging(&view, session.conductor().layout());
            // Where no tick ends, time goes on all the same.
            let tick_hz = f64::from(session.conductor().layout().tick_hz);
            let late = |ticks: u64| began.elapsed().as_secs_f64() > ticks as f64 / tick_hz + LATE_S;
            let done = ticks.is_some_and(|ticks| view.ticks >= ticks || (hangs.is_some() && late(ticks)));
            if hangs != self.hangs {
                if let Some(node) = &hangs {
                    shows.say(&format!(
                        "warning: {node} {DOES_NOT_COME_BACK}, and nothing is heard until it does"
                    ));
                }
                self.hangs = hangs;
            }
            let stuck = stuck(&view, session.conductor().layout());
            for node in stuck.iter().filter(|node| !self.stuck.contains(node)) {
                shows.say(&format!("warning: {node} {}: the graph goes on without it", Fault::Stuck));
            }
            self.stuck = stuck;
            let (condition, losses) = (view.condition, view.losses);
            shows.show(view, session.conductor().layout(), hands);
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

    /// Does what a person asked for since the last time, or begins to.
    fn serve(&mut self, shows: &mut Shows) {
        for request in self.session.reins().asked() {
            match request {
                Request::Set { node, param, value } => {
                    if let Err(failure) = self.editor.set(node, param, value, self.session.conductor()) {
                        shows.say(&failure.reason());
                    }
                }
                Request::Material { node, name } => self.editor.choose(node, name),
            }
        }
    }
}

/// Ticks to run; none for until somebody stops it.
fn ticks(args: &Run, schedule: &Schedule) -> Result<Option<u64>, Failure> {
    match args.seconds {
        Some(s) if s > 0.0 && s <= MAX_SECONDS => {
            Ok(Some((s * f64::from(schedule.tick_hz)).round().max(1.0) as u64))
        }
        Some(s) => Err(Diagnostic::new(format!("{s} s is out of range"))
            .in_file("--seconds")
            .help(format!("above 0, at most {MAX_SECONDS} s"))
            .into()),
        None => Ok(schedule.duration_ticks().filter(|&t| t > 0)),
    }
}
