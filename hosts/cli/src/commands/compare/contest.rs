//! Every method on every vector: scores, response lag and time.
//!
//! Methods take turns on each vector, and all that is repeated in rounds: disturbances by other programs
//! fall on all methods alike.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::Instant;

use asperity_accuracy::accuracy::{Rhythm, SILENCE_M_S2};
use asperity_accuracy::phase;
use asperity_accuracy::response::{Steps, lag_ms};
use asperity_accuracy::timing::Timing;
use asperity_diagnostics::Diagnostic;
use asperity_node::Registry;

use super::vectors::{Delay, Score, Set, Vector, band, mean_magnitudes};
use crate::commands::render::ClockTime;
use crate::failure::{Failure, progress};
use crate::phase::{Chain, FRAME_HZ, Frames, How, Method};

/// How often everything is run for its time.
const ROUNDS: usize = 3;
/// Seed of the graphs.
const SEED: u64 = 1;

/// Figures of a method, measured or published.
#[derive(Clone, Debug)]
pub struct Row {
    /// Name of the method.
    pub label: String,
    /// The node's kind; `None` for a published method.
    pub kind: Option<String>,
    /// Score on each vector of the set, if there is one.
    pub scores: Vec<Option<Score>>,
    /// How often the node failed on each vector.
    pub faults: Vec<u64>,
    /// Declared latency.
    pub delay: Delay,
    /// Response lag on a texture \[ms\]: 10, 50 and 90 % of the way.
    pub texture_lag_ms: Option<[f64; 3]>,
    /// Response lag on a tone \[ms\], likewise.
    pub tone_lag_ms: Option<[f64; 3]>,
    /// Median time from a frame to its samples \[us\], by the rate of the vectors \[Hz\].
    pub frame_us: BTreeMap<u32, f64>,
    /// Rhythm of the output for [steady magnitudes](Set::steady); `None` for published methods and silence.
    pub rhythm: Option<Rhythm>,
    /// Remarks for the user.
    pub notes: Vec<String>,
}

/// The result of all methods.
#[derive(Debug)]
pub struct Outcome {
    /// A row for each method, the best first.
    pub rows: Vec<Row>,
    /// Rhythm of Gaussian noise with the spectrum of the [steady magnitudes](Set::steady).
    pub noise: Option<Rhythm>,
}

/// A method while it is measured.
struct Entry<'a> {
    method: &'a Method,
    row: Row,
    timing: BTreeMap<u32, Timing>,
    /// Its signal for each vector, from the first round.
    signals: Vec<Option<Vec<f32>>>,
    differs: bool,
    /// Problems, each with the runs in which it occurred.
    problems: Vec<(String, Vec<String>)>,
}

/// Runs all methods over all vectors.
///
/// # Errors
/// None that comes from a method: its row says how it failed.
pub fn run(registry: &Registry, methods: &[Method], set: &Set, quiet: bool) -> Result<Outcome, Failure> {
    let (texture, tone) = (Stimulus::texture()?, Stimulus::tone()?);
    let steps = methods.len() * (ROUNDS * set.vectors.len() + 3);
    let bar = progress(steps as u64, "comparing {wide_bar} {percent:>3} %  {eta} left", quiet);
    let mut entries: Vec<Entry<'_>> = methods.iter().map(|m| Entry::new(m, set.vectors.len())).collect();
    let clock = ClockTime(Instant::now());
    for round in 0..ROUNDS {
        for (v, vector) in set.vectors.iter().enumerate() {
            for entry in &mut entries {
                entry.play(registry, &clock, vector, v, round == 0);
                bar.inc(1);
            }
        }
    }
    let steady = set.steady()?;
    for entry in &mut entries {
        if let Some(steady) = &steady {
            entry.hold(registry, steady);
        }
        bar.inc(1);
        let [over_texture, over_tone] = [("texture", &texture), ("tone", &tone)].map(|(name, stimulus)| {
            let lag = entry.lag(registry, name, stimulus);
            bar.inc(1);
            lag
        });
        (entry.row.texture_lag_ms, entry.row.tone_lag_ms) = (over_texture.ms, over_tone.ms);
        entry.differs |= over_texture.differs || over_tone.differs;
    }
    bar.finish_and_clear();
    let mut rows: Vec<Row> = entries.into_iter().map(Entry::into_row).collect();
    sort(&mut rows);
    let noise = steady.as_ref().and_then(noise);
    Ok(Outcome { rows, noise })
}

/// Rhythm of Gaussian noise of the same length as the steady magnitudes, whose bins are 10 Hz apart.
fn noise(steady: &Vector) -> Option<Rhythm> {
    let frame = steady.unscaled.get(..steady.frames.layout().bins as usize)?;
    let powers: Vec<f64> = frame.iter().map(|x| f64::from(*x).powi(2)).collect();
    let inner = inner(steady);
    Rhythm::of_noise(&powers, 10.0, inner.len() as f64 / f64::from(steady.rate_hz)).ok()
}

/// Samples without those of the frames at each end, which no score counts.
fn inner(vector: &Vector) -> std::ops::Range<usize> {
    let start = |frame: usize| vector.frames.start(frame as u64) as usize;
    start(phase::EDGE_FRAMES)..start(vector.frames.count() - phase::EDGE_FRAMES)
}

/// Rows of the published methods with a score on any of the vectors, the best first.
pub fn published(set: &Set) -> Vec<Row> {
    let rows = set.published.iter().map(|p| {
        let scores: Vec<Option<Score>> = set.vectors.iter().map(|v| p.score(v)).collect();
        Row { delay: p.delay, scores, ..Row::new(&p.name, set.vectors.len()) }
    });
    let mut rows: Vec<Row> = rows.filter(|r| r.scores.iter().any(Option::is_some)).collect();
    sort(&mut rows);
    rows
}

/// Catches a panic of a node that is prepared, which the engine does not.
fn contained<T>(f: impl FnOnce() -> Result<T, Failure>) -> Result<T, String> {
    match catch_unwind(AssertUnwindSafe(f)) {
        Ok(Ok(value)) => Ok(value),
        Ok(Err(failure)) => Err(failure.reason()),
        Err(_) => Err("it panicked outside a tick".into()),
    }
}

impl Row {
    /// A row without figures.
    pub fn new(label: &str, vectors: usize) -> Self {
        Self {
            label: label.to_owned(),
            kind: None,
            scores: vec![None; vectors],
            faults: vec![0; vectors],
            delay: Delay::Unknown,
            texture_lag_ms: None,
            tone_lag_ms: None,
            frame_us: BTreeMap::new(),
            rhythm: None,
            notes: Vec::new(),
        }
    }
}

impl<'a> Entry<'a> {
    fn new(method: &'a Method, vectors: usize) -> Self {
        let row = Row { kind: Some(method.kind().to_owned()), ..Row::new(&method.label, vectors) };
        let (timing, signals) = (BTreeMap::new(), vec![None; vectors]);
        Self { method, row, timing, signals, differs: false, problems: Vec::new() }
    }

    /// Notes a problem of a run. The same problem of several runs is reported once.
    fn problem(&mut self, what: String, run: &str) {
        match self.problems.iter_mut().find(|(known, _)| *known == what) {
            Some((_, runs)) => runs.push(run.to_owned()),
            None => self.problems.push((what, vec![run.to_owned()])),
        }
    }

    /// Plays a vector. The first time it is scored; later the samples must be the same.
    fn play(&mut self, registry: &Registry, clock: &ClockTime, vector: &Vector, v: usize, first: bool) {
        // An offline method has no time per frame, and is not repeated.
        let again = !first && matches!(self.method.how, How::Offline(_));
        if again || !first && self.signals[v].is_none() {
            return;
        }
        let mut took = Vec::with_capacity(vector.frames.count());
        let played = contained(|| {
            if let How::Offline(offline) = &self.method.how {
                return Ok((offline.signal(&vector.frames, SEED)?, Delay::Offline, 0, None, false));
            }
            let mut chain = Chain::new(registry, self.method, &vector.frames, SEED)?;
            let signal = chain.timed_signal(clock, |ns| took.push(ns));
            let (faults, report) = chain.faults();
            let why = report.and_then(|r| r.last_fault).map(|f| f.to_string());
            let gone = report.is_some_and(|r| r.quarantined);
            Ok((signal, Delay::Ms(chain.latency().ms()), faults, why, gone))
        });
        let (signal, delay, faults, why, gone) = match played {
            Ok(played) => played,
            Err(why) => return self.problem(why, vector.short_name()),
        };
        // The time of a run with failures does not count.
        if faults == 0 && !took.is_empty() {
            let timing = self.timing.entry(vector.rate_hz).or_insert_with(|| Timing::new(3));
            took.into_iter().for_each(|ns| timing.record(ns));
        }
        if let Some(before) = &self.signals[v] {
            self.differs |= before.iter().map(|x| x.to_bits()).ne(signal.iter().map(|x| x.to_bits()));
            return;
        }
        self.row.delay = delay;
        self.row.faults[v] = faults;
        if faults > 0 {
            let times = if faults == 1 { "once".into() } else { format!("{faults} times") };
            let when = if faults == 1 { ":" } else { ", the last time" };
            let why = why.map(|w| format!("{when} it {w}")).unwrap_or_default();
            let gone = if gone { ", and was called no more" } else { "" };
            self.problem(format!("it failed {times}{why}{gone}"), vector.short_name());
        }
        let bins = vector.frames.layout().bins as usize;
        let wide: Vec<f64> = signal.iter().map(|x| f64::from(*x)).collect();
        match phase::score(&vector.unscaled, &phase::framing(vector.rate_hz, bins), &wide) {
            Ok(s) => {
                self.row.scores[v] = Some(Score {
                    convergence_db: s.convergence_db,
                    level_db: s.gain_db,
                    ltas_rms_db: s.ltas_rms_db,
                });
            }
            Err(e) => self.problem(e.to_string(), vector.short_name()),
        }
        self.signals[v] = Some(signal);
    }

    /// Plays steady magnitudes, for the rhythm.
    fn hold(&mut self, registry: &Registry, steady: &Vector) {
        let signal = contained(|| match &self.method.how {
            How::Offline(offline) => offline.signal(&steady.frames, SEED),
            How::Node(_) => Ok(Chain::new(registry, self.method, &steady.frames, SEED)?.signal()),
        });
        match signal {
            Ok(signal) => {
                let wide: Vec<f64> = signal.iter().map(|x| f64::from(*x)).collect();
                let part = wide.get(inner(steady)).unwrap_or_default();
                let rhythm = Rhythm::new(&[part], f64::from(steady.rate_hz)).ok();
                self.row.rhythm = rhythm.filter(|r| r.rms >= SILENCE_M_S2);
            }
            Err(why) => self.problem(why, steady.short_name()),
        }
    }

    fn lag(&mut self, registry: &Registry, name: &str, stimulus: &Stimulus) -> Lag {
        if matches!(self.method.how, How::Offline(_)) {
            return Lag::default();
        }
        match contained(|| stimulus.drive(registry, self.method)) {
            Ok(lag) => lag,
            Err(why) => {
                self.problem(why, &format!("response to a {name}"));
                Lag::default()
            }
        }
    }

    fn into_row(mut self) -> Row {
        let timed = self.timing.iter().map(|(&rate, t)| (rate, t.summary()));
        let us = timed.filter(|(_, s)| s.count > 0).map(|(rate, s)| (rate, s.p50_ns as f64 / 1e3));
        self.row.frame_us = us.collect();
        let problems = self.problems.iter().map(|(what, runs)| format!("{what} ({})", runs.join(", ")));
        self.row.notes.extend(problems);
        if self.differs {
            self.row.notes.push("the same frames gave other samples the second time".into());
        }
        self.row
    }
}

/// Sorts rows by their mean rank in spectral convergence over the vectors. A missing score is the last
/// rank.
fn sort(rows: &mut [Row]) {
    let db = |row: &Row, v: usize| row.scores[v].map_or(f64::INFINITY, |s| s.convergence_db);
    let vectors = rows.first().map_or(0, |r| r.scores.len());
    let ranks: BTreeMap<String, usize> = rows
        .iter()
        .map(|row| {
            let better = |v: usize| rows.iter().filter(|other| db(other, v) < db(row, v)).count();
            (row.label.clone(), (0..vectors).map(better).sum())
        })
        .collect();
    rows.sort_by_key(|row| ranks.get(&row.label).copied().unwrap_or(usize::MAX));
}

// Response lag. The method is given magnitudes whose level steps up by 12 dB and down again every 0.2 to
// 0.24 s, and in a second run the same without steps. What is heard live, with the method's latency, is
// compared around every step up. A step is at the tick in which the first louder frame comes.

/// Rate of the stimuli \[Hz\].
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

/// Response lag.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lag {
    /// Times until 10, 50 and 90 % of the way \[ms\]; `None` if the method did not follow.
    pub ms: Option<[f64; 3]>,
    /// Whether the same frames gave other samples the second time.
    pub differs: bool,
}

impl Stimulus {
    /// A broad noise: mean magnitudes that fall slowly from 400 Hz on, with 120 steps.
    ///
    /// # Errors
    /// None.
    pub fn texture() -> Result<Self, Diagnostic> {
        let density = |hz: f64| (hz / 20.0).clamp(0.0, 1.0) * band(hz) / (hz / 400.0).hypot(1.0);
        let spectrum = mean_magnitudes(&density);
        let top = spectrum.iter().copied().fold(0.0, f64::max);
        Self::new(&spectrum.iter().map(|x| (x / top) as f32).collect::<Vec<_>>(), 120)
    }

    /// A sine of 250 Hz, on a bin, with 10 steps.
    ///
    /// # Errors
    /// None.
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

    /// Plays the stimulus through a method.
    ///
    /// # Errors
    /// A method that refuses the frames.
    pub fn drive(&self, registry: &Registry, method: &Method) -> Result<Lag, Failure> {
        let hear = |frames| {
            let mut chain = Chain::new(registry, method, frames, SEED)?;
            let latency = chain.latency().ms();
            if latency > MOST_LATENCY_MS {
                return Err(Failure::Machine(format!(
                    "its {latency:.0} ms of latency are too many to see it"
                )));
            }
            Ok(chain.live())
        };
        let (stepped, still) = (hear(&self.stepped)?, hear(&self.still)?);
        let samples = |frames: usize| frames * (RATE_HZ / FRAME_HZ) as usize;
        let steps =
            Steps { rate_hz: RATE_HZ, at: &self.steps, before: samples(BEFORE), after: samples(AFTER) };
        // Up to the first step, both inputs are the same.
        let first = self.steps.first().copied().unwrap_or(0);
        let bits = |signal: &[f32]| signal.iter().take(first).map(|x| x.to_bits()).collect::<Vec<_>>();
        Ok(Lag { ms: lag_ms(&stepped, &still, &steps), differs: bits(&stepped) != bits(&still) })
    }
}
