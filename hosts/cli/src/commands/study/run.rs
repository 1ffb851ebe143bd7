//! `asperity study run`: a participant's session, with screens, a hand and a sound card.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{BufRead as _, BufReader, ErrorKind, Read as _};
use std::net::IpAddr;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use asperity_diagnostics::file;
use asperity_engine::Options;
use asperity_graph::Schedule;
use asperity_live::view::{Condition, View};
use asperity_live::{DeviceQueues, Session, needs_queues, prepare_live};
use asperity_node::Role;
use asperity_page::{Screen, Who, screen};
use asperity_study::log::{self, Event, Log};
use asperity_study::{Conduct, Experiment, Felt, Press, Side};
use serde_json::{Value, json};
use time::OffsetDateTime;
use time::format_description::well_known::Rfc3339;

use super::inputs::Inputs;
use super::levels::Levels;
use super::stimulus::{self, At, HAND, Loader, POSITION};
use super::{COPY, check, experiment, logs};
use crate::card::{self, DeviceArgs};
use crate::commands::run::hands::Hands;
use crate::commands::run::reloader::fits;
use crate::failure::{Failure, complain, print, warn, wrong};
use crate::load::files::{Stamps, stamps_of};
use crate::load::{Loaded, PluginArgs};
use crate::number::whole;
use crate::output::write_text;

/// Run a study with one participant: two screens, a hand and a sound card
///
/// Open both printed addresses: one for the participant, one for the experimenter. Everything is logged to
/// OUT/PARTICIPANT.jsonl. After a crash or a power cut, the same command goes on with the next trial.
#[derive(Clone, Debug, clap::Args)]
#[command(mut_args = crate::number::may_be_negative)]
#[command(after_help = crate::commands::examples(&[
    "asperity study run graphs/studies/heravi2024.ron --participant P07 --hand openhaptics",
    "asperity study run mine.ron --participant P01 --device simulated --hand page",
]))]
pub struct Args {
    /// Experiment file
    #[arg(value_name = "EXPERIMENT.ron", value_parser = crate::shipped::path())]
    pub file: PathBuf,
    /// Code of the participant: letters, digits, - and _
    #[arg(long, value_name = "CODE")]
    pub participant: String,
    /// Number of the participant, from 1; by default the digits at the end of the code
    #[arg(long, value_name = "N", value_parser = whole(1_u32, 10_000, ""))]
    pub number: Option<u32>,
    /// Folder of the study; by default out/ and the name of the experiment file
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Let a hand device move the stylus, such as openhaptics or osc; page: a pad on the participant's screen
    #[arg(long, value_name = "KIND[:param=value,...]", conflicts_with = "input")]
    pub hand: Option<String>,
    /// Play this recorded stroke instead of a hand, to try a study out
    #[arg(long, value_name = "STROKE.csv", value_parser = crate::shipped::path())]
    pub input: Option<PathBuf>,
    /// Repeat the recorded stroke
    #[arg(long = "loop", requires = "input")]
    pub repeat: bool,
    #[command(flatten)]
    pub device: DeviceArgs,
    /// Serve the screens at this address of the machine, for a tablet or another computer
    #[arg(long, value_name = "ADDRESS")]
    pub bind: Option<IpAddr>,
    #[command(flatten)]
    pub plugins: PluginArgs,
}

/// How often screens and stimuli are looked after.
const PACE: Duration = Duration::from_millis(5);
/// How often the experimenter's figures change.
const FIGURES: Duration = Duration::from_millis(100);
/// How long the last screens are served.
const FAREWELL: Duration = Duration::from_secs(1);
/// Half the width of the strip between left and right in which nothing changes [mm].
const MIDDLE_MM: f32 = 1.0;
/// Ticks of a line of inputs in the log.
const INPUT_TICKS: u64 = 2500;

/// Longest first line of a log.
const MOST_LINE: u64 = 1 << 20;
/// Largest file of a stimulus.
const MOST_BYTES: u64 = 64 << 20;

pub fn run(args: &Args) -> Result<(), Failure> {
    let experiment = experiment(&args.file)?;
    let number = number(args)?;
    if args.device.card.share {
        let what = "a study shares its actuator with no other run";
        return Err(wrong("--share", what, "leave it out: the log lacks what another run plays"));
    }
    experiment.imbalances().iter().for_each(|told| warn(told));
    let (mut loader, others) = Loader::session(&experiment, &options(args), false)?;
    for stimulus in others {
        warn(&format!(
            "`{stimulus}` pushes back with a device that does not move the stylus: it will not push"
        ));
    }
    let loaded = check::load_all(&experiment, &mut loader, follows)?;
    let folder = folder(args);
    std::fs::create_dir_all(&folder).map_err(|e| Failure::writing(&folder, e))?;
    let copy = folder.join(COPY);
    no_simulation(&folder)?;
    if number > experiment.participants {
        warn(&format!("participant number {number} of {} that the study plans", experiment.participants));
    }
    let is_new = is_new(&copy, &experiment)?;
    let path = folder.join(format!("{}.jsonl", args.participant));
    let (mut log, events) = Log::open(&path)?;
    if let Some(Event::Begin { number: before, .. }) = events.first()
        && *before != number
    {
        let what = format!("this participant took part as number {before}");
        return Err(wrong("--number", what, format!("--number {before}")));
    }
    let mut seed = [0; 8];
    getrandom::fill(&mut seed).map_err(|e| Failure::Machine(format!("no random numbers: {e}")))?;
    let mut conduct = Conduct::new(&experiment, number, &events, u64::from_le_bytes(seed))?;
    if conduct.is_over() {
        return print(&format!("participant {} has answered everything\n", args.participant));
    }
    let levels = Levels::measure(&experiment, number, &args.plugins)?;
    let mut stage = Stage::begin(args, &experiment, loader, levels, &loaded.files)?;
    // Until here nobody took part: the file may still be corrected.
    if is_new {
        write_text(&copy, experiment.source.text())?;
    }
    append(&mut log, &path, &[begun(args, &experiment, number, &loaded.files)?])?;
    let pad = stage.hands.take_pointer();
    stage.has_pad = pad.is_some();
    let open = |who, name: &str, pad| {
        let options = asperity_page::Options { bind: args.bind, ..asperity_page::Options::default() };
        let screen = screen(options, who, pad);
        let screen = screen.map_err(|e| Failure::Machine(format!("cannot serve the screens: {e}")))?;
        screen.urls().iter().for_each(|url| complain(&format!("{name} {url}\n")));
        Ok::<_, Failure>(screen)
    };
    let participant = open(Who::Participant, "the participant's screen: ", pad)?;
    let experimenter = open(Who::Experimenter, "the experimenter's screen:", None)?;
    let screens = [participant, experimenter];
    let outcome = stage.play(&experiment, &mut conduct, &mut log, &path, &screens);
    stage.session.stop();
    outcome?;
    if conduct.is_over() {
        return print(&format!("participant {} has answered everything\n", args.participant));
    }
    print(&format!("the session is not over; the same command goes on: {}\n", path.display()))
}

/// Number of the participant: as asked for, or from the code.
fn number(args: &Args) -> Result<u32, Failure> {
    let code = &args.participant;
    let fits = |c: char| c.is_ascii_alphanumeric() || "-_".contains(c);
    if code.is_empty() || !code.chars().all(fits) {
        return Err(wrong("--participant", format!("`{code}` is no code"), "letters, digits, - and _"));
    }
    if let Some(number) = args.number {
        return Ok(number);
    }
    let digits = code.trim_start_matches(|c: char| !c.is_ascii_digit());
    digits.parse().ok().filter(|n| *n > 0).ok_or_else(|| {
        wrong("--participant", format!("`{code}` does not end with a number"), "--number 7 says it")
    })
}

fn folder(args: &Args) -> PathBuf {
    let name = args.file.file_stem().unwrap_or_default();
    args.out.clone().unwrap_or_else(|| Path::new("out").join(name))
}

/// Options that the stimuli depend on.
fn options(args: &Args) -> log::Options {
    log::Options {
        hand: args.hand.clone(),
        input: args.input.clone(),
        repeat: args.repeat,
        plugins: args.plugins.plugin.clone(),
    }
}

/// Refuses a stimulus that cannot follow another one, or whose hand would have to be opened anew.
fn follows(running: &Schedule, next: &Schedule) -> Result<(), Failure> {
    fits(running, next)?;
    match needs_queues(running, next).as_slice() {
        [] => Ok(()),
        [node, ..] => Err(Failure::Machine(format!("the {node} has another kind or other parameters"))),
    }
}

/// Refuses a folder with simulated answers, which never join real ones.
fn no_simulation(folder: &Path) -> Result<(), Failure> {
    for path in logs(folder)? {
        let mut first = String::new();
        let read =
            File::open(&path).and_then(|file| BufReader::new(file.take(MOST_LINE)).read_line(&mut first));
        if read.is_ok() && log::parse(&first).is_ok_and(|events| log::is_simulated(&events)) {
            let what = "this folder has answers of simulated people";
            return Err(wrong(path, what, "take another folder: --out"));
        }
    }
    Ok(())
}

/// Whether the folder has no copy of the experiment yet. Another experiment is refused: its answers would not
/// join.
fn is_new(copy: &Path, experiment: &Experiment) -> Result<bool, Failure> {
    let (what, help) = match std::fs::read_to_string(copy) {
        Ok(text) if text == experiment.source.text() => return Ok(false),
        Err(e) if e.kind() == ErrorKind::NotFound => return Ok(true),
        Ok(_) => {
            ("the experiment file has changed since people took part".into(), "take another folder: --out")
        }
        Err(e) => (format!("cannot read the study's copy of its file: {e}"), "--out names another folder"),
    };
    Err(wrong(copy, what, help))
}

/// The first event of a session: versions, and hashes of the files that trials depend on.
fn begun(
    args: &Args,
    experiment: &Experiment,
    number: u32,
    files: &BTreeSet<PathBuf>,
) -> Result<Event, Failure> {
    let own = [experiment.source.path().to_owned()];
    let others = files.iter().chain(&args.input).filter(|path| **path != own[0]);
    let files: Vec<(String, String)> = own
        .iter()
        .chain(others)
        .map(|path| Ok((path.display().to_string(), hash(path)?)))
        .collect::<Result<_, Failure>>()?;
    let now = OffsetDateTime::now_utc().format(&Rfc3339).unwrap_or_default();
    Ok(Event::Begin {
        study: experiment.title.clone(),
        participant: args.participant.clone(),
        number,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        files,
        at: now,
        options: options(args),
    })
}

/// Hash of a file, as in logs.
pub fn hash(path: &Path) -> Result<String, Failure> {
    let bytes = file::read(path, MOST_BYTES)?;
    Ok(format!("{:016x}", asperity_diagnostics::fnv(&bytes)))
}

fn append(log: &mut Log, path: &Path, events: &[Event]) -> Result<(), Failure> {
    log.append_all(events).map_err(|e| Failure::writing(path, e))
}

/// The stimulus that is felt; `None` for nothing.
type Key = Option<Playing>;

/// A stimulus of a trial.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Playing {
    at: At,
    stimulus: usize,
    level: Option<f64>,
    gain: f64,
}

/// Counts of misses that the log has.
#[derive(Debug, Default)]
struct Missed {
    deadlines: u64,
    skipped: u64,
    samples: u64,
    limited: u64,
    /// Ticks whose inputs nobody read in time: so far, and logged ones.
    unlogged: u64,
    told: u64,
}

impl Missed {
    /// An event, if there are more misses than before.
    fn since(&mut self, view: &View) -> Option<Event> {
        let now = [view.timing.misses, view.skipped_ticks, view.lost_samples, self.unlogged, view.guarded];
        let before = [self.deadlines, self.skipped, self.samples, self.told, self.limited];
        let [deadlines, skipped, samples, unlogged, limited] =
            std::array::from_fn(|i| now[i].saturating_sub(before[i]));
        [self.deadlines, self.skipped, self.samples, self.told, self.limited] = now;
        let tick = view.ticks;
        (now != before).then_some(Event::Missed { tick, deadlines, skipped, samples, unlogged, limited })
    }
}

/// A running session with its stimulus.
struct Stage {
    loader: Loader,
    levels: Levels,
    session: Session,
    hands: Hands,
    /// Whether the participant's screen is the hand.
    has_pad: bool,
    /// The stimulus that plays, and the one that was sent last.
    now: Key,
    sent: Option<(u64, Key)>,
    /// Place of the stylus, and inputs that are not logged yet.
    stylus_mm: [f32; 3],
    inputs: Inputs,
    /// Misses that are logged.
    missed: Missed,
    ticks_per_sample: f64,
    /// The next stimulus, which waits for the stylus to be in the air.
    waiting: Option<(Key, Loaded)>,
    /// Versions of the stimuli's files when the session began.
    stamps: Stamps,
    /// Figures when the trial began.
    before: Option<(usize, View)>,
}

impl Stage {
    fn begin(
        args: &Args,
        experiment: &Experiment,
        mut loader: Loader,
        levels: Levels,
        files: &BTreeSet<PathBuf>,
    ) -> Result<Self, Failure> {
        let masking = experiment.masking.as_ref();
        let Loaded { graph, compiled, .. } = loader.quiet(experiment)?;
        let schedule = &compiled.schedule;
        let device = stimulus::device(&args.device, schedule, masking)?;
        let request = card::request(&device, schedule)?;
        let (hands, queues) = Hands::of(schedule)?;
        let queues = DeviceQueues { record_hands: true, ..queues };
        let coils = card::coils(&args.device, schedule)?;
        let ticks_per_sample = f64::from(schedule.tick_hz) / f64::from(schedule.audio_hz);
        let options = card::options(&args.device, request, coils);
        let (controller, player) =
            prepare_live(compiled, &graph, Options::default(), queues, None, Vec::new());
        let session = Session::start(controller, player, None, options);
        let session = session.map_err(|e| stimulus::not_opened(e, masking))?;
        Ok(Self {
            loader,
            levels,
            session,
            hands,
            has_pad: false,
            now: None,
            sent: None,
            stylus_mm: [0.0, 0.0, f32::INFINITY],
            inputs: Inputs::default(),
            missed: Missed::default(),
            ticks_per_sample,
            waiting: None,
            stamps: stamps_of(files),
            before: None,
        })
    }

    /// Serves the screens and plays stimuli until the session is over or asked to stop.
    fn play(
        &mut self,
        experiment: &Experiment,
        conduct: &mut Conduct<'_>,
        log: &mut Log,
        path: &Path,
        screens: &[Screen; 2],
    ) -> Result<(), Failure> {
        let began = Instant::now();
        let (mut live, mut figures) = (Value::Null, began - FIGURES);
        loop {
            for notice in self.session.poll().map_err(|e| card::not_opened(e, true))? {
                complain(&format!("{notice}\n"));
            }
            for problem in self.hands.problems() {
                complain(&format!("{problem}\n"));
                conduct.spoil(&problem);
            }
            let view = self.session.view();
            self.listen();
            self.judge(conduct, &view);
            for (who, screen) in screens.iter().enumerate() {
                while let Some(pressed) = screen.pressed() {
                    let now_s = began.elapsed().as_secs_f64();
                    let token = pressed.press["token"].as_str().unwrap_or_default();
                    if pressed.press["press"] == "answer" && conduct.shows(token) {
                        self.judge_times(experiment, conduct, &view);
                    }
                    let verdict = match self.press(&pressed.press, who, conduct, now_s) {
                        Ok(events) => {
                            let inputs = if events.is_empty() { Vec::new() } else { self.unlogged(0, &view) };
                            let ends = |e: &Event| matches!(e, Event::Answered { .. } | Event::Marked { .. });
                            if events.iter().any(ends) {
                                // The same trial may come again at once: it is judged anew.
                                self.before = None;
                            }
                            append(log, path, &[inputs, events].concat())?;
                            Ok(())
                        }
                        Err(why) => Err(why),
                    };
                    // The next screen is there before its page hears of the verdict.
                    screens[0].show(self.participant(conduct));
                    pressed.answer(verdict);
                }
            }
            let events = self.change(experiment, conduct, &view)?;
            append(log, path, &[self.unlogged(INPUT_TICKS, &view), events].concat())?;
            screens[0].show(self.participant(conduct));
            let mut screen = conduct.experimenter();
            if figures.elapsed() >= FIGURES {
                (live, figures) = (self.figures(&view), Instant::now());
            }
            screen["live"] = live.clone();
            screens[1].show(screen);
            if conduct.is_over() || self.session.run_control().stopping() {
                let last = self.unlogged(0, &view);
                append(log, path, &last)?;
                if conduct.is_over() {
                    // The last screens are still asked for.
                    std::thread::sleep(FAREWELL);
                }
                return Ok(());
            }
            if !self.session.goes_on() {
                let failed = view.condition == Condition::Failed;
                let why = if failed { "the engine failed" } else { "the device is lost" };
                let note = Event::Note { text: why.into(), trial: conduct.shown().map(|step| step.number) };
                append(log, path, &[self.unlogged(0, &view), vec![note]].concat())?;
                return Err(Failure::Machine(format!("{why}; the same command goes on with this trial")));
            }
            std::thread::sleep(PACE);
        }
    }

    /// The participant's screen, with a pad if it is the hand.
    fn participant(&self, conduct: &Conduct<'_>) -> Value {
        let mut screen = conduct.participant();
        screen["pad"] = self.has_pad.into();
        screen
    }

    /// Takes a press: `mute` and `unmute` are the host's, all others the session's.
    fn press(
        &mut self,
        press: &Value,
        who: usize,
        conduct: &mut Conduct<'_>,
        now_s: f64,
    ) -> Result<Vec<Event>, String> {
        let word = press["press"].as_str().unwrap_or_default();
        let is_participants = matches!(word, "next" | "answer" | "feel");
        if is_participants != (who == 0) {
            return Err(conduct.refused("invalid").0);
        }
        if matches!(word, "mute" | "unmute") {
            let muted = word == "mute";
            self.session.run_control().mute(muted);
            let tick = self.session.view().ticks;
            return Ok(vec![Event::Muted { tick, muted }]);
        }
        let press: Press = serde_json::from_value(press.clone()).map_err(|_| conduct.refused("invalid").0)?;
        conduct.press(press, now_s).map_err(|e| e.0)
    }

    /// Reads the motion of the stylus: from the hand's inputs, or from a stroke's positions.
    fn listen(&mut self) {
        let (inputs, stylus) = (&mut self.inputs, &mut self.stylus_mm);
        let controller = self.session.graph_controller();
        let has_hand = controller.schedule().with_role(Role::Hand).next().is_some();
        let unlogged = controller.recorded(|recorded| {
            let is_position = recorded.sink == POSITION;
            if let (true, Some(last)) = (is_position, recorded.values.last_chunk::<3>()) {
                *stylus = *last;
            }
            if recorded.sink == HAND || (is_position && !has_hand) {
                inputs.add(recorded.start, recorded.values);
            }
        });
        self.missed.unlogged = unlogged;
    }

    /// Inputs that are not logged yet, if there are more ticks than `least`, and new misses.
    fn unlogged(&mut self, least: u64, view: &View) -> Vec<Event> {
        let mut events = self.inputs.take(least);
        if !events.is_empty() {
            events.extend(self.missed.since(view));
        }
        events
    }

    /// Marks a trial in which the graph failed or the device was lost.
    fn judge(&mut self, conduct: &mut Conduct<'_>, view: &View) {
        let Some(number) = conduct.shown().map(|step| step.number) else {
            self.before = None;
            return;
        };
        if self.before.as_ref().is_none_or(|(of, _)| *of != number) {
            self.before = Some((number, view.clone()));
        }
        let Some((_, before)) = &self.before else { return };
        if view.faults > before.faults {
            conduct.spoil("a node of the graph failed");
        }
        if view.losses > before.losses || view.condition == Condition::Lost {
            conduct.spoil("the device was lost");
        }
        if view.muted {
            conduct.spoil("the output was muted");
        }
    }

    /// Marks a trial that ends and missed more than a share of its deadlines.
    fn judge_times(&self, experiment: &Experiment, conduct: &mut Conduct<'_>, view: &View) {
        let Some((_, before)) = &self.before else { return };
        // Samples that were not played count as their ticks, which may have been skipped.
        let late = |view: &View| {
            let unplayed = view.lost_samples as f64 * self.ticks_per_sample;
            view.timing.misses as f64 + unplayed.max(view.skipped_ticks as f64)
        };
        let missed = (late(view) - late(before)).max(0.0);
        let share = (missed / view.ticks.saturating_sub(before.ticks).max(1) as f64).min(1.0);
        if share > experiment.missed {
            conduct.spoil(&format!("{:.1} % of the deadlines were missed", 100.0 * share));
        }
    }

    /// Swaps to the stimulus under the stylus, while it is in the air. Returns events for the log.
    fn change(
        &mut self,
        experiment: &Experiment,
        conduct: &mut Conduct<'_>,
        view: &View,
    ) -> Result<Vec<Event>, Failure> {
        let mut events = Vec::new();
        let schedule = self.session.graph_controller().schedule().clone();
        for finished in self.session.finished() {
            if let Some((_, key)) = self.sent.take_if(|(swap, _)| *swap == finished.number) {
                let sample = u128::from(finished.tick) * u128::from(schedule.audio_hz);
                let sample = (sample / u128::from(schedule.tick_hz)) as u64;
                let of = key.or(self.now).map(|playing| playing.at);
                events.push(Event::Stimulus {
                    trial: of.map_or(0, |at| at.trial),
                    attempt: of.map_or(0, |at| at.attempt),
                    place: key.map(|playing| playing.at.place),
                    stimulus: key.map(|playing| experiment.stimuli[playing.stimulus].name.clone()),
                    level: key.and_then(|playing| playing.level),
                    gain: key.map_or(0.0, |playing| playing.gain),
                    tick: finished.tick,
                    sample,
                });
                self.now = key;
            }
        }
        // Nothing is felt while the output rises or is muted. Silence comes at once.
        let is_silent = self.session.run_control().muted() || view.condition == Condition::Starting;
        let felt = if is_silent { Vec::new() } else { conduct.felt() };
        let is_in_air = self.stylus_mm[2] >= 0.0;
        let shown = conduct.shown().map(|step| (step.number, step.attempt));
        // The stimulus of another showing is felt no longer, even if the stylus stays down.
        let is_over = !is_in_air && self.now.is_some_and(|now| Some((now.at.trial, now.at.attempt)) != shown);
        let may_change = felt.is_empty() || is_over || is_in_air;
        let felt = self.under_the_stylus(felt).filter(|_| !is_over);
        let playing = |((trial, attempt), felt): ((usize, u32), &Felt)| Playing {
            at: At { trial, attempt, place: felt.place },
            stimulus: felt.stimulus,
            level: felt.vary.as_ref().map(|varied| varied.level),
            gain: if stimulus::file_of(&felt.kind).is_some() { self.levels.gain(trial, felt) } else { 0.0 },
        };
        let key = shown.zip(felt.as_ref()).map(playing);
        if key == self.now || self.sent.is_some() || !self.session.graph_controller().ready() {
            return Ok(events);
        }
        if self.waiting.as_ref().is_none_or(|(of, _)| *of != key) {
            let gain = key.map_or(0.0, |playing| playing.gain);
            let loaded = match (&felt, key) {
                (Some(Felt { kind, vary, .. }), Some(Playing { at, .. })) if gain != 0.0 => {
                    self.loader.load(kind, vary.as_ref(), gain, Some(at))?
                }
                _ => self.loader.quiet(experiment)?,
            };
            if stamps_of(self.stamps.keys()) != self.stamps {
                conduct.spoil("a file of the stimuli has changed");
            }
            // The stylus moved meanwhile: the next look decides.
            self.waiting = Some((key, loaded));
            return Ok(events);
        }
        if !may_change {
            return Ok(events);
        }
        let Some((_, Loaded { graph, compiled, .. })) = self.waiting.take() else { return Ok(events) };
        let controller = self.session.graph_controller();
        match controller.swap(compiled, &graph, &[], Default::default(), Vec::new()) {
            Ok(report) => self.sent = Some((report.number, key)),
            Err(asperity_engine::SwapError::Busy) => (),
            Err(e) => return Err(Failure::Machine(format!("the stimulus {e}"))),
        }
        Ok(events)
    }

    /// The one of these stimuli at the stylus's place. In the strip between the sides, the one before.
    fn under_the_stylus(&self, mut felt: Vec<Felt>) -> Option<Felt> {
        let x = self.stylus_mm[0];
        let before = |felt: &Felt| self.now.is_some_and(|now| now.at.place == felt.place);
        let side = match (x < -MIDDLE_MM, x > MIDDLE_MM) {
            (true, _) => Side::Left,
            (_, true) => Side::Right,
            _ => felt.iter().find(|felt| before(felt)).map_or(Side::Left, |felt| felt.side),
        };
        let at = felt.iter().position(|felt| [side, Side::Everywhere].contains(&felt.side))?;
        Some(felt.swap_remove(at))
    }

    /// Figures for the experimenter.
    fn figures(&mut self, view: &View) -> Value {
        let scopes = &self.session.graph_controller().layout().scopes;
        let last = |name: &str| {
            let at = scopes.iter().position(|scope| scope.name == name)?;
            view.scopes.get(at)?.last().copied()
        };
        let (speed, force) = (last("speed"), last("force"));
        let problem = match view.condition {
            Condition::Lost => Some("the device is lost"),
            Condition::Failed => Some("the engine failed"),
            _ => None,
        };
        let place = self.stylus_mm.map(|x| if x.is_finite() { x } else { 0.0 });
        json!({
            "position_mm": place, "speed_mm_s": speed, "force_n": force, "drive": view.peak,
            "misses": view.timing.misses, "faults": view.faults, "muted": view.muted, "device": view.device,
            "problem": problem,
        })
    }
}
