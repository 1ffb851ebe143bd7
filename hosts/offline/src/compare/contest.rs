//! Runs every method on every vector: scores, response lag and time.
//!
//! Methods take turns on each vector: disturbances by other programs fall on all of them alike.

use std::collections::{BTreeMap, BTreeSet};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::Instant;

use asperity_accuracy::accuracy::{Rhythm, SILENCE_M_S2};
use asperity_accuracy::phase;
use asperity_accuracy::response::{Steps, lag_ms};
use asperity_accuracy::timing::Timing;
use asperity_diagnostics::Diagnostic;
use asperity_engine::NoClock;
use asperity_node::Registry;
use serde::{Serialize, Serializer};
use serde_json::{Value, json};

use super::vectors::{Score, Set, Vector};
use crate::failure::Failure;
use crate::phase::{Chain, FRAME_HZ, Frames, Method, Played};
use crate::render::ClockTime;

/// How often everything is run for its time.
const ROUNDS: usize = 3;
const SEED: u64 = 1;

/// Figures of a method, measured or published.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// A published method has the number of its reference behind its name, so that no node is called alike.
    pub label: String,
    /// The node's kind; `None` for a published method.
    pub kind: Option<String>,
    /// Where a published method comes from.
    pub reference: Option<Cited>,
    /// Score on each vector, by the vector's name.
    pub scores: BTreeMap<String, Option<Score>>,
    /// Declared latency; early where it is negative.
    pub latency_ms: Option<f64>,
    /// Whether it needs the whole signal.
    pub offline: bool,
    /// Response lag on `texture` and `tone`: 10, 50 and 90 % of the way. `None` if it does not follow.
    pub lag_ms: BTreeMap<&'static str, Option<[f64; 3]>>,
    /// Median time from a frame to its samples \[us\], by the rate of the vectors \[Hz\].
    pub us_a_frame: BTreeMap<u32, f64>,
    /// Rhythm of the output for [steady magnitudes](Set::steady); `None` for published methods and silence.
    #[serde(serialize_with = "serialize_rhythm")]
    pub rhythm: Option<Rhythm>,
    /// Problems, in words.
    pub notes: Vec<String>,
}

/// A reference and its number.
#[derive(Clone, Debug, Serialize)]
pub struct Cited {
    /// From 1.
    pub number: usize,
    /// Authors, title and year.
    pub text: String,
}

fn serialize_rhythm<S: Serializer>(rhythm: &Option<Rhythm>, to: S) -> Result<S::Ok, S::Error> {
    rhythm_json(*rhythm).serialize(to)
}

/// A rhythm's figures, for a report.
pub fn rhythm_json(rhythm: Option<Rhythm>) -> Option<Value> {
    let r = rhythm?;
    Some(json!({
        "modulation": r.modulation, "pulses": r.pulses(), "envelope_repetition": r.envelope_repetition,
        "wave_repetition": r.wave_repetition, "repetition": r.repetition(), "kurtosis": r.kurtosis,
        "level_deviation_db": r.level_deviation_db,
    }))
}

impl Row {
    /// A row without figures.
    pub fn new(label: &str, set: &Set) -> Self {
        Self {
            label: label.to_owned(),
            kind: None,
            reference: None,
            scores: set.vectors.iter().map(|v| (v.name.clone(), None)).collect(),
            latency_ms: None,
            offline: false,
            lag_ms: [("texture", None), ("tone", None)].into(),
            us_a_frame: BTreeMap::new(),
            rhythm: None,
            notes: Vec::new(),
        }
    }

    /// Score on a vector, if it has one.
    pub fn score(&self, vector: &Vector) -> Option<Score> {
        self.scores.get(&vector.name).copied().flatten()
    }
}

/// Measured rows, and the rhythm to compare theirs with.
#[derive(Debug)]
pub struct Outcome {
    /// A row for each method, the best first.
    pub rows: Vec<Row>,
    /// Rhythm of Gaussian noise with the spectrum of the [steady magnitudes](Set::steady).
    pub noise: Option<Rhythm>,
}

/// Runs all methods over a set. Calls `step` after each of [`steps`].
///
/// # Errors
/// A set that cannot be held still, and the error of a step, which ends the run.
pub fn run(
    registry: &Registry,
    methods: &[Method],
    set: &Set,
    mut step: impl FnMut() -> Result<(), Failure>,
) -> Result<Outcome, Failure> {
    let stimuli = [("texture", Stimulus::texture()?), ("tone", Stimulus::tone()?)];
    let steady = set.steady()?;
    let mut entries: Vec<Entry<'_>> = methods.iter().map(|m| Entry::new(m, registry, set)).collect();
    let clock = ClockTime(Instant::now());
    for vector in &set.vectors {
        for entry in &mut entries {
            entry.play(&clock, vector);
            step()?;
        }
    }
    for entry in &mut entries {
        entry.hold(&steady);
        for (name, stimulus) in &stimuli {
            entry.follow(name, stimulus);
        }
        step()?;
    }
    let mut rows: Vec<Row> = entries.into_iter().map(Entry::into_row).collect();
    sort(&mut rows);
    // Gaussian noise of the same length as the steady magnitudes, whose bins are 10 Hz apart.
    let frame = &steady.unscaled[..steady.frames.layout().bins as usize];
    let powers: Vec<f64> = frame.iter().map(|x| f64::from(*x).powi(2)).collect();
    let seconds = inner(&steady).len() as f64 / f64::from(steady.rate_hz);
    Ok(Outcome { rows, noise: Rhythm::of_noise(&powers, 10.0, seconds).ok() })
}

/// Number of steps of a run.
pub fn steps(methods: &[Method], set: &Set) -> u64 {
    methods.len() as u64 * (set.vectors.len() as u64 + 1)
}

/// Samples without those of the frames at each end, which no score counts.
fn inner(vector: &Vector) -> std::ops::Range<usize> {
    let start = |frame: usize| vector.frames.start(frame as u64) as usize;
    start(phase::EDGE_FRAMES)..start(vector.frames.count() - phase::EDGE_FRAMES)
}

/// Rows of the published methods with a score on any of the vectors, the best first.
pub fn published(set: &Set) -> Vec<Row> {
    let theirs = |v: &Vector| set.published.sc.get(&v.name);
    let names: BTreeSet<&String> = set.vectors.iter().filter_map(theirs).flat_map(BTreeMap::keys).collect();
    let row = |name: &String| {
        let score = |v: &Vector| (v.name.clone(), theirs(v).and_then(|all| all.get(name)).copied());
        let frames = set.published.latency_frames.get(name);
        let references = &set.published.references;
        let at = references.iter().position(|reference| reference.methods.contains(name));
        let text = at.map_or("no reference is given".to_owned(), |at| references[at].to_string());
        let number = at.unwrap_or(references.len()) + 1;
        Row {
            reference: Some(Cited { number, text }),
            scores: set.vectors.iter().map(score).collect(),
            latency_ms: frames.and_then(Value::as_f64).map(|f| f * 1e3 / f64::from(FRAME_HZ)),
            offline: frames.is_some_and(|f| f == "offline"),
            ..Row::new(&format!("{name} [{number}]"), set)
        }
    };
    let mut rows: Vec<Row> = names.into_iter().map(row).collect();
    sort(&mut rows);
    rows
}

/// Sorts rows by their mean rank in spectral convergence. A missing score is the last rank.
fn sort(rows: &mut [Row]) {
    let db = |row: &Row| -> Vec<f64> {
        row.scores.values().map(|s| s.map_or(f64::INFINITY, |s| s.convergence_db)).collect()
    };
    let all: Vec<Vec<f64>> = rows.iter().map(db).collect();
    rows.sort_by_cached_key(|row| {
        let own = db(row);
        all.iter().map(|other| other.iter().zip(&own).filter(|(a, b)| a < b).count()).sum::<usize>()
    });
}

struct Entry<'a> {
    method: &'a Method,
    registry: &'a Registry,
    row: Row,
    timing: BTreeMap<u32, Timing>,
    /// Problems, each with the runs in which it occurred.
    problems: Vec<(String, Vec<String>)>,
}

impl<'a> Entry<'a> {
    fn new(method: &'a Method, registry: &'a Registry, set: &Set) -> Self {
        let row = Row {
            kind: Some(method.kind.clone()),
            offline: method.is_offline(),
            ..Row::new(&method.label, set)
        };
        Self { method, registry, row, timing: BTreeMap::new(), problems: Vec::new() }
    }

    /// Notes a problem of a run. The same problem of several runs is reported once.
    fn problem(&mut self, what: String, run: &str) {
        match self.problems.iter_mut().find(|(known, _)| *known == what) {
            Some((_, runs)) if runs.iter().any(|known| known == run) => {}
            Some((_, runs)) => runs.push(run.to_owned()),
            None => self.problems.push((what, vec![run.to_owned()])),
        }
    }

    /// Notes why `f` fails. Catches a panic of a node that is prepared, which the engine does not.
    fn attempt<T>(
        &mut self,
        run: &str,
        f: impl FnOnce(&Registry, &Method) -> Result<T, Failure>,
    ) -> Option<T> {
        let why = match catch_unwind(AssertUnwindSafe(|| f(self.registry, self.method))) {
            Ok(Ok(value)) => return Some(value),
            Ok(Err(failure)) => failure.reason(),
            Err(_) => "it panicked outside a tick".into(),
        };
        self.problem(why, run);
        None
    }

    /// Plays a vector some times. The first time it is scored; later the samples must be the same.
    fn play(&mut self, clock: &ClockTime, vector: &Vector) {
        let (name, mut before) = (vector.short_name(), None::<Vec<f32>>);
        // An offline method has no time per frame, and is not repeated.
        for _ in 0..if self.row.offline { 1 } else { ROUNDS } {
            let mut took = Vec::with_capacity(vector.frames.count());
            let played = self.attempt(name, |registry, method| {
                method.play(registry, &vector.frames, SEED, clock, |ns| took.push(ns))
            });
            let Some(played) = played else { return };
            // The time of a run with failures does not count.
            if played.faults == 0 && !took.is_empty() {
                let timing = self.timing.entry(vector.rate_hz).or_insert_with(|| Timing::new(3));
                took.into_iter().for_each(|ns| timing.record(ns));
            }
            match &before {
                None => self.score(vector, &played),
                Some(before) if differ(before, &played.signal) => self.problem(DIFFERS.into(), name),
                Some(_) => {}
            }
            before.get_or_insert(played.signal);
        }
    }

    fn score(&mut self, vector: &Vector, played: &Played) {
        let (name, faults) = (vector.short_name(), played.faults);
        self.row.latency_ms = played.latency_ms;
        if faults > 0 {
            let times = if faults == 1 { "once:".into() } else { format!("{faults} times, the last time") };
            let why = played.report.as_ref().and_then(|r| r.last_fault.as_ref());
            let why = why.map_or("unknown".into(), ToString::to_string);
            let gone = played.report.as_ref().is_some_and(|r| r.quarantined);
            let gone = if gone { ", and was called no more" } else { "" };
            self.problem(format!("it failed {times} it {why}{gone}"), name);
        }
        let framing = phase::framing(vector.rate_hz, vector.frames.layout().bins as usize);
        match phase::score(&vector.unscaled, &framing, &wide(&played.signal)) {
            Ok(s) => {
                let (convergence_db, level_db, ltas_rms_db) = (s.convergence_db, s.gain_db, s.ltas_rms_db);
                let score = Score { convergence_db, level_db, ltas_rms_db, faults };
                self.row.scores.insert(vector.name.clone(), Some(score));
            }
            Err(e) => self.problem(e.to_string(), name),
        }
    }

    /// Plays steady magnitudes, for the rhythm.
    fn hold(&mut self, steady: &Vector) {
        let played = self.attempt(steady.short_name(), |registry, method| {
            method.play(registry, &steady.frames, SEED, &NoClock, |_| {})
        });
        self.row.rhythm = played.and_then(|played| {
            let wide = wide(&played.signal);
            let part = wide.get(inner(steady)).unwrap_or_default();
            Rhythm::new(&[part], f64::from(steady.rate_hz)).ok().filter(|r| r.rms >= SILENCE_M_S2)
        });
    }

    fn follow(&mut self, name: &'static str, stimulus: &Stimulus) {
        if self.row.offline {
            return;
        }
        let run = format!("response to a {name}");
        let lag = self.attempt(&run, |registry, method| stimulus.drive(registry, method));
        let Some(lag) = lag else { return };
        self.row.lag_ms.insert(name, lag.ms);
        if lag.differs {
            self.problem(DIFFERS.into(), &run);
        }
    }

    fn into_row(self) -> Row {
        let timed = self.timing.iter().map(|(&rate, t)| (rate, t.summary()));
        let us_a_frame = timed.filter(|(_, s)| s.count > 0).map(|(rate, s)| (rate, s.p50_ns as f64 / 1e3));
        let notes = self.problems.iter().map(|(what, runs)| format!("{what} ({})", runs.join(", ")));
        Row { us_a_frame: us_a_frame.collect(), notes: notes.collect(), ..self.row }
    }
}

const DIFFERS: &str = "the same frames gave other samples the second time";

fn differ(a: &[f32], b: &[f32]) -> bool {
    a.iter().map(|x| x.to_bits()).ne(b.iter().map(|x| x.to_bits()))
}

fn wide(signal: &[f32]) -> Vec<f64> {
    signal.iter().map(|x| f64::from(*x)).collect()
}

// Response lag. The method is given magnitudes whose level steps up by 12 dB and down again every 0.2 to
// 0.24 s, and in a second run the same without steps. What is heard live, with the method's latency, is
// compared around every step up. A step is at the tick in which the first louder frame comes.

const RATE_HZ: u32 = 2500;
/// Amplitude after a step up over that before it.
const RISE: f32 = 4.0;
/// Most latency with which a method settles within [`AFTER`] \[ms\].
const MOST_LATENCY_MS: f64 = 50.0;
/// Frames of a constant level: two windows, and up to [`JITTER`] more, so that steps are not periodic.
const STAND: usize = 100;
const JITTER: usize = 20;
/// Frames before and after a step that are compared.
const BEFORE: usize = 20;
const AFTER: usize = 100;

/// Input of a method for its response lag.
pub struct Stimulus {
    stepped: Arc<Frames>,
    still: Arc<Frames>,
    /// First sample of every step up.
    steps: Vec<usize>,
}

/// Answer of a method to steps.
pub struct Lag {
    /// Times until 10, 50 and 90 % of the way; `None` if the method did not follow.
    pub ms: Option<[f64; 3]>,
    /// Whether the same frames gave other samples the second time.
    pub differs: bool,
}

impl Stimulus {
    /// A broad noise: magnitudes that fall slowly from 400 Hz on and end at 950 Hz, with 120 steps.
    ///
    /// # Errors
    /// Frames without a layout.
    pub fn texture() -> Result<Self, Diagnostic> {
        let magnitude = |hz: f32| {
            let end = ((950.0 - hz) / 76.0).clamp(0.0, 1.0);
            let band = 0.5 - 0.5 * (std::f32::consts::PI * end).cos();
            (hz / 20.0).clamp(0.0, 1.0) * band / (hz / 400.0).hypot(1.0)
        };
        Self::new(&Vec::from_iter((0..101).map(|bin| magnitude(10.0 * bin as f32))), 120)
    }

    /// A sine of 250 Hz, on a bin, with 10 steps.
    ///
    /// # Errors
    /// Frames without a layout.
    pub fn tone() -> Result<Self, Diagnostic> {
        let mut spectrum = [0.0; 101];
        spectrum[24..27].copy_from_slice(&[0.5, 1.0, 0.5]);
        Self::new(&spectrum, 10)
    }

    fn new(spectrum: &[f32], count: usize) -> Result<Self, Diagnostic> {
        let mut levels = vec![1.0; STAND];
        let mut frames_of_steps = Vec::new();
        for k in 0..count {
            frames_of_steps.push(levels.len());
            levels.resize(levels.len() + STAND + k * 7 % (JITTER + 1), RISE);
            levels.resize(levels.len() + STAND + k * 11 % (JITTER + 1), 1.0);
        }
        let frames = |levels: &[f32]| {
            let bins = levels.iter().flat_map(|level| spectrum.iter().map(move |x| x * level));
            Frames::from_amplitudes(bins.collect(), spectrum.len(), RATE_HZ).map(Arc::new)
        };
        let (stepped, still) = (frames(&levels)?, frames(&vec![1.0; levels.len()])?);
        let steps = frames_of_steps.iter().map(|&n| stepped.start(n as u64) as usize).collect();
        Ok(Self { stepped, still, steps })
    }

    /// Measures the response lag of a method.
    ///
    /// # Errors
    /// A method that is no node, or whose latency is too long.
    pub fn drive(&self, registry: &Registry, method: &Method) -> Result<Lag, Failure> {
        let hear = |frames| {
            let mut chain = Chain::new(registry, method, frames, SEED)?;
            match chain.latency.ms() {
                ms if ms > MOST_LATENCY_MS => {
                    Err(Failure::Machine(format!("its {ms:.0} ms of latency are too many to see it")))
                }
                _ => Ok(chain.live()),
            }
        };
        let (stepped, still) = (hear(&self.stepped)?, hear(&self.still)?);
        let samples = |frames: usize| frames * (RATE_HZ / FRAME_HZ) as usize;
        let steps =
            Steps { rate_hz: RATE_HZ, at: &self.steps, before: samples(BEFORE), after: samples(AFTER) };
        // Up to the first step, both inputs are the same.
        let same = ..self.steps.first().copied().unwrap_or(0);
        Ok(Lag { ms: lag_ms(&stepped, &still, &steps), differs: differ(&stepped[same], &still[same]) })
    }
}
