//! `asperity run`: a graph in real time.

pub mod card;
mod editor;
mod hands;
pub mod perform;
mod report;
mod shows;
mod speaker;

use std::collections::{HashMap, VecDeque};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

use asperity_engine::Options;
use asperity_graph::Schedule;
use asperity_live::view::{Condition, Request};
use asperity_live::{Conductor, FORCES, HANDS, Session, conduct, mic};
use asperity_source::Diagnostic;

use crate::args::Run;
use crate::failure::{Failure, print, warn};
use crate::load;
use crate::output::Pending;
use crate::render::record::Recorder;
use crate::render::{distinct_files, stop_flag};
use editor::{Editor, Made};
use hands::Hands;
use shows::Shows;

/// Ticks that one call of a node may take, unless `--limit-us` says otherwise. A machine that is busy with other things stalls
/// for a few ticks now and then; that is no fault of the node.
const LIMIT_TICKS: u64 = 10;
/// And at least so long, at any rate of ticks: machines stall by 14 ms and more.
const LIMIT_NS: u64 = 50_000_000;
/// How often devices, files and pages are looked after.
const PACE: Duration = Duration::from_micros(16_667);
/// Longest run that may be asked for, in seconds: a year.
const MAX_SECONDS: f64 = 365.0 * 86_400.0;

/// Runs the command.
pub fn run(args: &Run) -> Result<ExitCode, Failure> {
    let mut editor = Editor::new(&args.graph);
    let Made { graph, compiled, materials } = editor.make()?;
    let schedule = &compiled.schedule;
    let request = card::request(&args.device, schedule)?;
    let ticks = ticks(args, schedule)?;
    for warning in load::warnings(schedule) {
        warn(&warning);
    }
    for id in schedule.allocating() {
        warn(&format!("`{id}` allocates in every tick and is not fit for real time"));
    }
    distinct_files(
        &args.graph,
        schedule,
        editor.kinds(),
        &[("--report", &args.report), ("--picture", &args.picture)],
    )?;
    let picture_file = args.picture.as_deref().map(Pending::create).transpose()?;
    let report_file = args.report.as_deref().map(Pending::create).transpose()?;
    let mut recorders = recorders(schedule)?;
    let mut hands = Hands::default();
    let outside = |kind: &str| HANDS.contains(&kind) || FORCES.contains(&kind);
    let ids: Vec<String> = schedule.nodes.iter().filter(|n| outside(&n.kind)).map(|n| n.id.clone()).collect();
    let mut opened = hands.open(schedule, &ids)?;
    let ends = std::mem::take(&mut opened.ends);
    hands.go_on_with(opened, schedule)?;
    if args.page.is_none() {
        for node in schedule.nodes.iter().filter(|n| n.kind == "pointer_input") {
            warn(&format!("`{}` is moved on the live page, and nobody serves it: add --page", node.id));
        }
    }
    if args.watch {
        editor.watch(schedule);
    }

    let stop = stop_flag();
    let mut shows = Shows::open(args, &mut hands)?;
    for node in schedule.nodes.iter().filter(|n| n.kind == "osc_input") {
        let text = |name: &str| node.params.text(name).to_owned();
        let (address, arguments, listen) = (text("address"), text("arguments"), text("listen"));
        shows.say(&format!("`{}` waits for OSC messages {address} ({arguments}) at {listen}", node.id));
    }
    let ticks_ns = LIMIT_TICKS * 1_000_000_000 / u64::from(schedule.tick_hz);
    let limit_ns = args.limit_us.map_or(ticks_ns.max(LIMIT_NS), |us| us * 1000);
    let options = Options { sleep: !args.no_sleep, limit_ns: Some(limit_ns) };
    let recorded = request.as_ref().map_or(0, |r| r.inputs.len());
    let (mic_writer, mic_reader) = if recorded > 0 {
        let (to, from) = mic(recorded, schedule.audio_hz, schedule.tick_hz);
        (Some(to), Some(from))
    } else {
        (None, None)
    };
    let (conductor, player) = conduct(compiled, &graph, options, ends, mic_reader, materials);
    let session_options = card::options(&args.device, request);
    let session = Session::start(conductor, player, mic_writer, session_options).map_err(card::failed)?;

    let mut stage =
        Stage { session, editor, hands, recorders: &mut recorders, materials: VecDeque::new(), lost: 0 };
    let outcome = stage.play(&mut shows, &stop, ticks);
    let Stage { session, lost, .. } = stage;
    let grants = session.grants();
    let mut ended = session.stop();
    let tick_hz = ended.conductor.schedule().tick_hz;
    let lost = lost.max(drain(&mut ended.conductor, &mut recorders, tick_hz));
    let picture = shows.close();
    let mut written = Vec::new();
    if let (Some(file), Some(svg)) = (picture_file, picture) {
        written.push(file.keep_text(&svg)?);
    }
    // What was recorded until then is kept, whatever ended the run.
    for recorder in recorders.into_values() {
        let (path, said) = recorder.end();
        said.iter().for_each(|said| warn(said));
        written.extend(path);
    }
    if lost > 0 {
        warn(&format!("{lost} ticks were not recorded: the disk was too slow"));
    }
    let run = report::Run { args, ended: &ended, grants };
    if let Some(file) = report_file {
        written.push(file.keep_text(&report::json(&run))?);
    }
    if !args.quiet {
        print(&report::summary(&run, &written))?;
    }
    outcome?;
    Ok(if ended.view.condition == Condition::Failed { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

/// What is looked after while a graph plays.
struct Stage<'a> {
    session: Session,
    editor: Editor,
    hands: Hands,
    recorders: &'a mut HashMap<String, Recorder>,
    /// Textures that were chosen and not yet made.
    materials: VecDeque<Request>,
    /// Ticks that were not recorded.
    lost: u64,
}

impl Stage<'_> {
    /// Plays until the end of the stroke, until it is asked to stop, or until it cannot go on.
    fn play(&mut self, shows: &mut Shows, stop: &Arc<AtomicBool>, ticks: Option<u64>) -> Result<(), Failure> {
        let mut next = Instant::now();
        loop {
            for notice in self.session.tend().map_err(card::failed)? {
                shows.say(&notice);
            }
            self.hands.problems().iter().for_each(|p| shows.say(p));
            let asked_to_stop = self.serve_all(shows) || stop.load(Relaxed);
            for warning in self
                .hands
                .warnings(&self.session.conductor().schedule().clone(), self.session.conductor().layout())
            {
                shows.say(&format!("warning: {warning}"));
            }
            if asked_to_stop {
                return Ok(());
            }
            if let Some(said) = self.editor.look(self.session.conductor(), &mut self.hands) {
                shows.say(&said);
            }
            let tick_hz = self.session.conductor().schedule().tick_hz;
            self.lost = drain(self.session.conductor(), self.recorders, tick_hz);
            self.recorders.values_mut().filter_map(Recorder::complaint).for_each(|said| shows.say(&said));
            let view = self.session.view();
            let done = ticks.is_some_and(|ticks| view.ticks >= ticks);
            let (condition, losses) = (view.condition, view.losses);
            shows.show(view, self.session.conductor().layout(), &mut self.hands);
            if !self.session.goes_on() {
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

    /// Does what a person asked for since the last time; of materials, which take a while to make, the newest of one node at
    /// a time, so that nothing else has to wait for them. Answers whether the run is to stop.
    fn serve_all(&mut self, shows: &mut Shows) -> bool {
        for request in shows.requests() {
            match &request {
                Request::Stop => return true,
                Request::Material { node, .. } => {
                    self.materials
                        .retain(|r| !matches!(r, Request::Material { node: other, .. } if other == node));
                    self.materials.push_back(request);
                }
                _ => self.serve(&request, shows),
            }
        }
        if self.session.conductor().ready()
            && let Some(material) = self.materials.pop_front()
        {
            self.serve(&material, shows);
        }
        false
    }

    /// Does one thing that a person asks for.
    fn serve(&mut self, request: &Request, shows: &mut Shows) {
        let done = match request {
            Request::Set { node, param, value } => {
                self.editor.set(node, param, *value, self.session.conductor())
            }
            Request::Material { node, name } => {
                self.editor.choose(node, name, self.session.conductor(), &mut self.hands)
            }
            Request::Mute(mute) => {
                self.session.mute(*mute);
                Ok(())
            }
            Request::Stop => Ok(()),
        };
        if let Err(failure) = done {
            shows.say(&failure.reason());
        }
    }
}

/// Writes down what sinks recorded. Answers how many ticks were lost so far.
fn drain(conductor: &mut Conductor, recorders: &mut HashMap<String, Recorder>, tick_hz: u32) -> u64 {
    conductor.recorded(|id, start, values| {
        if let Some(recorder) = recorders.get_mut(id) {
            recorder.append_while_possible(start, values, tick_hz);
        }
    })
}

/// The files that sinks want written, by node id.
fn recorders(schedule: &Schedule) -> Result<HashMap<String, Recorder>, Failure> {
    let ids =
        schedule.nodes.iter().filter(|n| crate::render::record::file_of(n).is_some()).map(|n| n.id.clone());
    Ok(ids.zip(Recorder::for_sinks(schedule)?).collect())
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
