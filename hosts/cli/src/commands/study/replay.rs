//! `asperity study replay`: plays a trial of a session again, from its log into a file.

use std::collections::{BTreeMap, HashMap, VecDeque};
use std::ops::Range;
use std::path::{Path, PathBuf};

use asperity_diagnostics::{Diagnostic, Source};
use asperity_engine::Options;
use asperity_live::driver::Ticker as _;
use asperity_live::{DeviceQueues, GraphController, HandInput, Player, prepare_live};
use asperity_study::Experiment;
use asperity_study::log::{self, Event};

use super::stimulus::{At, HAND, Loader, POSITION};
use super::{COPY, inputs, run as session};
use crate::failure::{Failure, clean, plural, print, warn, wrong};
use crate::load::Loaded;
use crate::output::{Format, Pending, Rows, keep_all};

/// Play a trial of a session again, from its log into a WAV file
///
/// The file has the samples that the sound card got, bit for bit, where no deadline was missed. The session
/// is played from its beginning, faster than in real time. It needs the files of the session at their paths.
#[derive(Debug, clap::Args)]
#[command(after_help = crate::commands::examples(&[
    "asperity study replay out/heravi2024 --participant P07 --trial 23 --out felt.wav",
]))]
pub struct Args {
    /// Folder of the study
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
    /// Code of the participant
    #[arg(long, value_name = "CODE")]
    pub participant: String,
    /// Number of the trial in the plan, from 0, as in answers.csv
    #[arg(long, value_name = "N")]
    pub trial: usize,
    /// Which showing of the trial, from 0; by default the last
    #[arg(long, value_name = "N")]
    pub attempt: Option<u32>,
    /// WAV file to write, 1 for the card's full scale
    #[arg(long, value_name = "FELT.wav")]
    pub out: PathBuf,
    /// Also write the motion of the stylus, as a stroke that --input plays
    #[arg(long, value_name = "STROKE.csv")]
    pub stroke: Option<PathBuf>,
}

/// A showing of a trial in a log.
struct Showing<'e> {
    /// Events of the session up to the end of the showing, its begin first.
    before: &'e [Event],
    /// Events of the showing.
    during: &'e [Event],
    /// All of the session. A change of the stimulus is logged when it is over.
    session: &'e [Event],
    attempt: u32,
    /// How it ended, in words.
    end: &'static str,
    /// Its ticks.
    ticks: Range<u64>,
}

/// A change of the stimulus.
struct Change {
    tick: u64,
    trial: usize,
    attempt: u32,
    place: Option<usize>,
    stimulus: Option<String>,
    level: Option<f64>,
    gain: f64,
}

pub fn run(args: &Args) -> Result<(), Failure> {
    let path = args.folder.join(format!("{}.jsonl", args.participant));
    let events = log::read(&path)?;
    let showing = showing(&events, args.trial, args.attempt).map_err(|e| e.in_file(&path))?;
    let Some(Event::Begin { number, version, files, options, .. }) = showing.before.first() else {
        return Err(Diagnostic::new("this log does not begin with a session").in_file(&path).into());
    };
    let experiment = experiment(&args.folder, files)?;
    same_files(files)?;
    if version != env!("CARGO_PKG_VERSION") {
        warn(&format!("the session ran on version {version}: the bytes may differ"));
    }
    let damaged = || Diagnostic::new("the inputs of a session are damaged").in_file(&path);
    let before = |event: &&Event| !matches!(event, Event::Inputs { tick, .. } if *tick >= showing.ticks.end);
    let inputs = inputs::read(showing.session.iter().filter(before)).ok_or_else(damaged)?;
    let (loader, _) = Loader::session(&experiment, options, false)?;
    let stage = Stage { loader, experiment: &experiment, number: *number };
    let wav = Pending::create(&args.out)?;
    let stroke = args.stroke.as_deref().map(Pending::create).transpose()?;
    let changes = changes(showing.session, showing.ticks.end);
    let (rows, motion, tick_hz) = stage.play(wav, &inputs, &changes, &showing.ticks)?;
    let mut written = vec![rows.finish()?];
    if let Some(stroke) = stroke {
        written.push(stroke_of(stroke, &motion, tick_hz)?);
    }
    keep_all(written)?;
    print(&report(args, &showing, &changes, tick_hz))
}

/// Finds a showing of a trial.
fn showing(events: &[Event], trial: usize, attempt: Option<u32>) -> Result<Showing<'_>, Diagnostic> {
    let shown = |event: &Event| match event {
        Event::Shown { trial, attempt, .. } => Some((*trial, *attempt)),
        _ => None,
    };
    let fits =
        |event: &Event| shown(event).is_some_and(|(of, at)| of == trial && attempt.is_none_or(|a| a == at));
    let Some(at) = events.iter().rposition(fits) else {
        let most = events.iter().filter_map(shown).map(|(trial, _)| trial).max();
        let help =
            most.map_or("no trial was shown yet".into(), |most| format!("trials 0 to {most} were shown"));
        let which = attempt.map_or(String::new(), |attempt| format!(" in attempt {attempt}"));
        return Err(Diagnostic::new(format!("trial {trial} was not shown{which}")).help(help));
    };
    let begins = |event: &Event| matches!(event, Event::Begin { .. });
    let begin = events[..at].iter().rposition(begins).unwrap_or(0);
    let over = events[at + 1..].iter().position(begins).map_or(events.len(), |n| at + 1 + n);
    let ends = |event: &Event| match event {
        Event::Answered { trial: of, .. } if *of == trial => Some("answered"),
        Event::Marked { trial: of, .. } if *of == trial => Some("marked: it does not count"),
        _ => None,
    };
    let end = events[at..over].iter().position(|event| ends(event).is_some()).map(|n| at + n);
    let last = end.unwrap_or(over);
    let tick = |events: &[Event]| {
        let end = |event: &Event| match event {
            Event::Inputs { tick, ticks, .. } => Some(tick.saturating_add(*ticks)),
            _ => None,
        };
        events.iter().filter_map(end).max().unwrap_or(0)
    };
    let ticks = tick(&events[begin..at])..tick(&events[begin..last]);
    if ticks.is_empty() {
        return Err(Diagnostic::new(format!("the log has no motion of trial {trial}"))
            .help("the session ended before it was logged"));
    }
    Ok(Showing {
        before: &events[begin..last],
        during: &events[at..last],
        session: &events[begin..over],
        attempt: shown(&events[at]).map_or(0, |(_, attempt)| attempt),
        end: end.and_then(|end| ends(&events[end])).unwrap_or("not answered"),
        ticks,
    })
}

/// Changes of the stimulus before a tick.
fn changes(session: &[Event], before: u64) -> Vec<Change> {
    let change = |event: &Event| match event {
        Event::Stimulus { trial, attempt, place, stimulus, level, gain, tick, .. } => Some(Change {
            tick: *tick,
            trial: *trial,
            attempt: *attempt,
            place: *place,
            stimulus: stimulus.clone(),
            level: *level,
            gain: *gain,
        }),
        _ => None,
    };
    session.iter().filter_map(change).filter(|change| change.tick < before).collect()
}

/// The study as its folder keeps it. Its paths begin where the file was.
fn experiment(folder: &Path, files: &[(String, String)]) -> Result<Experiment, Failure> {
    let copy = folder.join(COPY);
    let source = Source::read(&copy)?;
    let Some((path, known)) = files.first() else {
        return Err(wrong(
            copy,
            "simulated people felt nothing",
            "only a session of `study run` can be replayed",
        ));
    };
    if session::hash(&copy)? != *known {
        return Err(wrong(
            copy,
            "the study's copy of its file has changed since the session",
            "take it back",
        ));
    }
    Ok(Experiment::parse(&Source::new(path, source.text()))?)
}

/// Refuses files that changed since the session.
fn same_files(files: &[(String, String)]) -> Result<(), Failure> {
    for (path, known) in files.iter().skip(1) {
        let path = Path::new(path);
        let help = "a replay needs the files of the session; run it in the same folder";
        match session::hash(path) {
            Ok(hash) if hash == *known => {}
            Ok(_) => return Err(wrong(path, "this file has changed since the session", help)),
            Err(_) => return Err(wrong(path, "this file of the session cannot be read", help)),
        }
    }
    Ok(())
}

/// Position in each tick of a showing.
type Motion = BTreeMap<u64, Vec<f32>>;

/// Columns of the motion.
const COLUMNS: [&str; 3] = ["x_mm", "y_mm", "z_mm"];

/// Where a session is played again.
struct Stage<'e> {
    loader: Loader,
    experiment: &'e Experiment,
    number: u32,
}

impl Stage<'_> {
    /// Plays the session to the end of these ticks, and writes their samples. Answers their motion, too, and
    /// the tick rate.
    fn play(
        mut self,
        wav: Pending,
        inputs: &BTreeMap<u64, HandInput>,
        changes: &[Change],
        ticks: &Range<u64>,
    ) -> Result<(Rows, Motion, u32), Failure> {
        let quiet = self.load(None)?;
        let motion: Vec<(u64, HandInput)> = inputs.iter().map(|(tick, input)| (*tick, *input)).collect();
        let replayed = HashMap::from([(HAND.to_owned(), motion)]);
        let queues = DeviceQueues { replayed, ..DeviceQueues::default() };
        let Loaded { graph, compiled, .. } = quiet;
        let (mut controller, mut player) =
            prepare_live(compiled, &graph, Options::default(), queues, None, Vec::new());
        let rates = player.rates();
        let mut rows = Rows::wav(wav, rates.channels, rates.rate_hz, Format::F32)?;
        let mut changes: VecDeque<&Change> = changes.iter().collect();
        let (mut out, mut motion) = (Vec::new(), Motion::new());
        // Ticks without inputs were skipped.
        for tick in inputs.range(..ticks.end).map(|(tick, _)| *tick) {
            player.skip(tick - player.next_tick());
            while let Some(change) = changes.pop_front_if(|change| change.tick <= tick) {
                self.change(change, &mut controller)?;
            }
            run_tick(&mut player, &mut out);
            let is_in = ticks.contains(&tick);
            if is_in {
                rows.append(&out, rates.channels, |_| 0.0)?;
            }
            controller.recorded(|recorded| {
                if is_in && recorded.sink == POSITION {
                    motion.entry(tick - ticks.start).or_default().extend(recorded.values);
                }
            });
        }
        Ok((rows, motion, rates.tick_hz))
    }

    /// Sends a stimulus, which the engine takes over in its next tick.
    fn change(&mut self, change: &Change, controller: &mut GraphController) -> Result<(), Failure> {
        controller.collect();
        let Loaded { graph, compiled, .. } = self.load(Some(change))?;
        let sent = controller.swap(compiled, &graph, &[], DeviceQueues::default(), Vec::new());
        let astray = |e| Failure::Machine(format!("the replay differs from tick {} on: {e}", change.tick));
        sent.map(|_| ()).map_err(astray)
    }

    /// A stimulus as the session loaded it; silence for `None`.
    fn load(&mut self, change: Option<&Change>) -> Result<Loaded, Failure> {
        let experiment = self.experiment;
        let named = change.and_then(|change| {
            let name = change.stimulus.as_ref().filter(|_| change.gain != 0.0)?;
            Some((change, experiment.stimuli.iter().position(|stimulus| stimulus.name == *name)?))
        });
        let trials = experiment.trials(self.number);
        let Some((change, stimulus, trial)) =
            named.and_then(|(change, stimulus)| Some((change, stimulus, trials.get(change.trial)?)))
        else {
            return self.loader.quiet(experiment);
        };
        let kind = experiment.shown(trial, stimulus);
        let vary = experiment.parts[trial.part].vary.as_ref().filter(|vary| vary.stimulus == stimulus);
        let vary = vary.zip(change.level).map(|(vary, level)| vary.at(level));
        let Change { trial, attempt, gain, .. } = *change;
        self.loader.load(&kind, vary.as_ref(), gain, change.place.map(|place| At { trial, attempt, place }))
    }
}

fn run_tick(player: &mut Player, out: &mut Vec<f32>) {
    let (rates, tick) = (player.rates(), player.next_tick());
    let samples = asperity_node::time::samples(tick, rates.rate_hz, rates.tick_hz);
    out.clear();
    out.resize((samples.end - samples.start) as usize * rates.channels, 0.0);
    player.tick(0, out);
}

/// Writes motion as a stroke.
fn stroke_of(file: Pending, motion: &Motion, tick_hz: u32) -> Result<Pending, Failure> {
    let count = motion.values().map(Vec::len).max().unwrap_or(0);
    let header: Vec<String> = COLUMNS.iter().take(count).map(|name| (*name).to_owned()).collect();
    let mut rows = Rows::csv(file, &header)?;
    for (tick, values) in motion {
        rows.append(values, count, |_| *tick as f64 / f64::from(tick_hz))?;
    }
    rows.finish()
}

/// A summary for people.
fn report(args: &Args, showing: &Showing<'_>, changes: &[Change], tick_hz: u32) -> String {
    let Range { start, end } = showing.ticks;
    let seconds = |tick: u64| tick.saturating_sub(start) as f64 / f64::from(tick_hz);
    let mut out = format!(
        "trial {} of {}, attempt {}, {}: {:.2} s\n",
        args.trial,
        args.participant,
        showing.attempt,
        showing.end,
        seconds(end)
    );
    let (earlier, during) = changes.split_at(changes.partition_point(|change| change.tick <= start));
    let felt = |change: Option<&Change>| match change {
        Some(Change { stimulus: Some(name), place: Some(place), level, .. }) => {
            let level = level.map_or(String::new(), |level| format!(", level {level}"));
            format!("`{}` at place {}{level}", clean(name), place + 1)
        }
        _ => "nothing".into(),
    };
    out += &format!("{:8.3} s  {}\n", 0.0, felt(earlier.last()));
    for change in during {
        out += &format!("{:8.3} s  {}\n", seconds(change.tick), felt(Some(change)));
    }
    let (mut late, mut lost, mut unlogged, mut limited, mut muted) = (0, 0, 0, 0, false);
    for event in showing.during {
        match event {
            Event::Missed { deadlines, skipped, samples, limited: changed, .. } => {
                late += deadlines + skipped;
                lost += samples;
                limited += changed;
            }
            Event::Muted { muted: now, .. } => muted |= now,
            _ => {}
        }
    }
    for event in showing.before {
        if let Event::Missed { unlogged: n, .. } = event {
            unlogged += n;
        }
    }
    if late + lost > 0 {
        let late = plural(late as usize, "missed deadline");
        let lost = plural(lost as usize, "sample");
        out += &format!("the trial had {late}; the card did not get {lost} in time, which this file has\n");
    }
    if muted {
        out += "the output was muted in the trial; this file has it all\n";
    }
    if unlogged > 0 {
        let ticks = plural(unlogged as usize, "tick");
        out += &format!("the log lacks the inputs of {ticks}: this file is not exact\n");
    }
    if limited > 0 {
        let samples = plural(limited as usize, "sample");
        out += &format!("the limits of the sound card changed {samples}, which this file has as they were\n");
    }
    if late + lost + unlogged + limited == 0 && !muted {
        out += "no deadline was missed: these are the samples that were played\n";
    }
    out
}
