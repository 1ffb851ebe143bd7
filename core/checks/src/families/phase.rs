//! Phase retrieval: every kind that takes magnitudes alone and gives spectra or samples, with each of its
//! settings, between played frames and its output.
//!
//! # Energy
//!
//! A stationary signal of variance V has amplitudes `A_k` with `sum A_k^2 = 3 V` on average. Its transforms
//! hold `N / 2 sum w^2 V` up to Nyquist, the window's `sum w^2` is `3 N / 8`, and an amplitude is a
//! magnitude over `N / 4`. So magnitudes ask for a mean square of `sum A_k^2 / 3`, and least squares never
//! give more (Griffin and Lim 1984: a projection). Methods that scale up what overlap-add takes away
//! (`phase_vocoder` by 1.76 dB, `random_phase` by the overlap) reach it on average too. The 3 dB allow for
//! random draws over 2 s, and for bin 0 and Nyquist, which count once where all others count twice.
//! Downwards 30 dB are allowed: `random_phase` loses 17 dB by its nature, and `spsi` 16 dB of a spectrum
//! without peaks.

use std::f64::consts::TAU;
use std::ops::Range;
use std::sync::Arc;

use asperity_accuracy::phase::{self, Score};
use asperity_dsp::Framing;
use asperity_dsp::window::hann_lobe;
use asperity_node::{Buffer, Descriptor, FrameLayout, FrameRate, NodeKind, ParamKind, ParamValue};

use crate::case::{Case, Family, Figures, Found, Stop, not_applicable};
use crate::played::{Frames, Played};
use crate::rig::{CaseGraph, Rig, has_to_be_set};
use crate::subject::Subject;
use crate::wrap::misled;

const PHASE: Family = Family("phase");

pub(super) const CASES: &[Case] = &[
    PHASE.kinds(
        "phase_silence",
        silence,
        "frames without a magnitude, then a tone, then silence",
        "every sample before the tone is 0, and every sample from two windows after it. No sample at its \
         beginning is above twice its amplitude, or four times for noise",
    ),
    PHASE.kinds(
        "phase_spectra",
        spectra,
        "DC alone, Nyquist alone, a single bin, two equal bins, a plateau, a flat spectrum, a tone on a \
         floor",
        "the energy is at most 3 dB above that of the magnitudes, and at most 30 dB below",
    ),
    PHASE.kinds(
        "phase_alternating",
        alternating,
        "frames alternate: a tone and nothing, two tones, all bins and nothing",
        "the energy is at most 3 dB above that of the magnitudes on average. Two windows later a tone has \
         its level within 1 dB",
    ),
    PHASE.kinds(
        "phase_units",
        units,
        "a tone of 1e-30, 1e-12, 1e12 and 1e30",
        "its level scales with the unit, within 0.1 dB of the tone of 1",
    ),
    PHASE.kinds(
        "phase_levels",
        levels,
        "a tone becomes a billion times as loud from one frame to the next, and as soft, and 1e18 times; a \
         tone of 1e30, and of 1e-12 after it",
        "two windows after each change the level is that of a constant tone, within 1 dB",
    ),
    PHASE.kinds(
        "phase_no_magnitudes",
        no_magnitudes,
        "the node itself is given NaN, infinite or negative magnitudes, or the largest number: in some \
         bins of a frame, in all bins for a window",
        "all samples are finite and the node does not fail. Two windows later a tone has its level within \
         1 dB",
    ),
    PHASE.kinds(
        "phase_missing_frames",
        missing_frames,
        "frames do not come: every seventh, ten, all of a second",
        "the energy is at most 3 dB above that of the magnitudes. From two windows into the second on, \
         silence is exact. Two windows after each gap a tone has its level within 1 dB",
    ),
    PHASE.kinds(
        "phase_hop_88_89",
        hop,
        "hops alternate between 88 and 89 samples: 44.1 kHz",
        "the spectral convergence of a tone is that of 44 kHz, where all hops are 88, within 1.5 dB, or \
         better than -60 dB",
    ),
    PHASE.kinds(
        "phase_after_a_day",
        after_a_day,
        "24 hours are skipped, as in a fast-forward: frame 43 200 000 comes next",
        "the spectral convergence of a tone is within 1.5 dB of that at the start, or better than -40 dB, \
         and its frequency within 0.01 Hz",
    ),
    PHASE.kinds(
        "phase_for_a_day",
        for_a_day,
        "24 hours of frames, 250 a second (1000 s with effort `full`, 100 s with `quick`)",
        "the same as after 24 skipped hours",
    ),
    PHASE.kinds(
        "phase_against_f64",
        against_f64,
        "10^7 frames in single precision beside double precision (200 000 with effort `full`, 10 000 with \
         `quick`)",
        "the magnitudes differ by less than -40 dB, or by less than the method's own error minus 3 dB \
         where that is larger. At the end they differ by at most 3 dB more than at the start",
    ),
];

/// Frames a second.
const FRAMES_HZ: u32 = 500;
/// Bins of a window of 0.1 s at 2500 Hz, with that of Nyquist.
const BINS: u32 = 126;
/// Bins of a window of 0.1 s at 500 Hz: the least number, for runs of millions of frames.
const FEW_BINS: u32 = 26;
/// Largest latency that can be aligned \[s\].
const MOST_LATE_S: f64 = 1.0;

/// A kind that retrieves phase, with one of its settings.
pub(super) struct Method {
    pub kind: String,
    set: Option<(String, String)>,
    input: String,
    /// Whether it gives spectra, so that an `overlap_add` follows; else it gives samples.
    pub spectrum: bool,
}

/// All kinds that retrieve phase. With `settings`, also with each word of a choice, and with 0 for an
/// integer that may be 0.
pub(super) fn methods(subject: &Subject<'_>, settings: bool) -> Result<Vec<Method>, Stop> {
    let mut all = Vec::new();
    // No case knows a value for a parameter that has to be set.
    for d in subject.registry.iter().map(|k| k.descriptor()).filter(|d| !has_to_be_set(d, &[])) {
        all.extend(Method::of(d, None));
        for p in d.params.iter().filter(|_| settings) {
            let zero = ["0".into()];
            let more = match (&p.kind, &p.default) {
                (ParamKind::Choice(words), _) => words.get(1..).unwrap_or_default(),
                (ParamKind::Integer(range), Some(ParamValue::Integer(1..))) if range.contains(&0) => &zero,
                _ => &[],
            };
            all.extend(more.iter().filter_map(|word| Method::of(d, Some((&p.name, word)))));
        }
    }
    if all.is_empty() { not_applicable("no kind retrieves phase") } else { Ok(all) }
}

impl Method {
    /// A kind with a setting, if it retrieves phase.
    fn of(d: &Descriptor, set: Option<(&str, &str)>) -> Option<Self> {
        let how = d.retrieval()?;
        let set = set.map(|(param, value)| (param.to_owned(), value.to_owned()));
        Some(Self { kind: d.kind.to_string(), set, input: how.input.to_owned(), spectrum: how.spectrum })
    }

    /// Its name in texts.
    fn name(&self) -> String {
        match &self.set {
            Some((param, value)) => format!("{} ({param}: {value})", self.kind),
            None => self.kind.clone(),
        }
    }

    /// Begins a run at the first frame.
    fn begin(&self, subject: &Subject<'_>, layout: FrameLayout, frames: Frames) -> Result<Heard, Stop> {
        let params: Vec<(&str, &str)> = self.set.iter().map(|(p, v)| (p.as_str(), v.as_str())).collect();
        let mut graph = CaseGraph::new(layout.frame_rate.num(), 48_000)
            .plays("frames", Played::magnitudes("frames of the case", layout, frames))?
            .node("phase", &self.kind, &params)?
            .wire("frames", &format!("phase.{}", self.input));
        let mut last = "phase";
        if self.spectrum {
            // A window that a method is set to is that of its overlap-add too, where it has one.
            let known = |p: &&(&str, &str)| {
                let kind = subject.registry.get("overlap_add");
                kind.is_some_and(|k| k.descriptor().params.iter().any(|q| q.name == p.0))
            };
            let same: Vec<(&str, &str)> = params.iter().filter(known).copied().collect();
            last = "synthesis";
            graph = graph.node(last, "overlap_add", &same)?.wire("phase", last);
        }
        let rig = graph.node("end", "probe", &[])?.wire(last, "end").rig(subject)?;
        let (num, den) = rig.schedule.latency().as_ratio();
        let late = (num * i64::from(layout.rate_hz)).div_euclid(den);
        let most = (MOST_LATE_S * f64::from(layout.rate_hz)) as i64;
        ensure!(late.abs() <= most, "a latency of {late} samples");
        Ok(Heard { rig, last, layout, late })
    }
}

/// A method that runs.
struct Heard {
    rig: Rig,
    last: &'static str,
    layout: FrameLayout,
    /// Latency from a frame to the output, in samples.
    late: i64,
}

impl Heard {
    /// Runs a tick. Answers its samples.
    fn tick(&mut self) -> Result<&[f32], Stop> {
        let tick = self.rig.engine.next_tick();
        self.rig.engine.tick();
        let heard = self.rig.audio(self.last, 0);
        let sound = heard.iter().all(|x| x.is_finite()) && self.rig.engine.faults() == 0;
        ensure!(sound, "it fails in frame {tick}, or its output is not finite");
        Ok(heard)
    }

    /// Runs so many ticks. Answers their samples.
    fn next(&mut self, ticks: u64) -> Result<Vec<f64>, Stop> {
        let mut heard = Vec::new();
        for _ in 0..ticks {
            heard.extend(self.tick()?.iter().map(|x| f64::from(*x)));
        }
        Ok(heard)
    }

    /// Runs so many ticks without keeping the samples.
    fn pass(&mut self, ticks: u64) -> Result<(), Stop> {
        (0..ticks).try_for_each(|_| self.tick().map(|_| ()))
    }

    /// Runs so many ticks. Answers their samples without the latency: sample 0 is the first of the first
    /// frame.
    fn aligned(&mut self, ticks: u64) -> Result<Vec<f64>, Stop> {
        let mut heard = vec![0.0; usize::try_from(-self.late).unwrap_or(0)];
        heard.extend(self.next(ticks)?);
        Ok(heard.split_off(usize::try_from(self.late).unwrap_or(0).min(heard.len())))
    }

    /// Ticks until a change of the frames has settled: two windows and the latency.
    fn settles(&self) -> u64 {
        let FrameLayout { rate_hz, length, frame_rate, .. } = self.layout;
        let ticks = |samples: u64| samples * u64::from(frame_rate.num()) / u64::from(rate_hz);
        2 * ticks(u64::from(length)) + ticks(self.late.unsigned_abs())
    }

    /// Runs until a change has settled. Answers the mean square of so many ticks after that.
    fn settled(&mut self, ticks: u64) -> Result<f64, Stop> {
        self.pass(self.settles())?;
        Ok(power(&self.next(ticks)?))
    }
}

/// Windows of 0.1 s, so many a second, one per tick.
fn layout(rate_hz: u32, bins: u32, frames_hz: u32) -> FrameLayout {
    let frame_rate = FrameRate::new(frames_hz, 1).expect("a rate above 0");
    FrameLayout { rate_hz, length: rate_hz / 10, bins, frame_rate }
}

/// The layout of most cases.
fn usual() -> FrameLayout {
    layout(2500, BINS, FRAMES_HZ)
}

/// Amplitude in bin `k` of a sinusoid of amplitude 1 at bin `at`.
fn lobe(at: f64, k: usize) -> f64 {
    hann_lobe(k as f64 - at).abs()
}

/// Frames whose bins are a function of the frame and the bin.
pub(super) fn frames(of: impl Fn(u64, usize) -> f64 + Send + Sync + 'static) -> Frames {
    Arc::new(move |n, bins| {
        bins.iter_mut().enumerate().for_each(|(k, m)| *m = of(n, k) as f32);
        true
    })
}

/// Compares the magnitudes of the output with constant frames of `bins`. Answers the spectral convergence
/// \[dB\].
fn convergence(layout: &FrameLayout, bins: impl Fn(usize) -> f64, heard: &[f64]) -> Result<f64, Stop> {
    let framing = framing(layout);
    // The last window's worth is still to come.
    let frames_hz = u64::from(layout.frame_rate.num());
    let frames = (heard.len() as u64 * frames_hz / u64::from(layout.rate_hz)).saturating_sub(frames_hz / 10);
    let frame: Vec<f32> = (0..framing.bins).map(|k| (bins(k) * framing.bin_scale()) as f32).collect();
    let all = frame.repeat(usize::try_from(frames).unwrap_or(0));
    scored(phase::score(&all, &framing, heard))
}

fn scored<E: std::fmt::Display>(score: Result<Score, E>) -> Result<f64, Stop> {
    score.map(|score| score.convergence_db).map_err(|e| Stop::Failed(e.to_string()))
}

/// The layout as the figures take it.
fn framing(layout: &FrameLayout) -> Framing {
    Framing {
        rate_hz: layout.rate_hz,
        fft_len: layout.length as usize,
        bins: layout.bins as usize,
        frame_num: layout.frame_rate.num(),
        frame_den: layout.frame_rate.den(),
    }
}

/// The mean square.
fn power(heard: &[f64]) -> f64 {
    heard.iter().map(|x| x * x).sum::<f64>() / heard.len().max(1) as f64
}

/// Decibels between two mean squares.
pub fn decibels(found: f64, wanted: f64) -> f64 {
    10.0 * (found.max(f64::MIN_POSITIVE) / wanted).log10()
}

/// Error of a tone's frequency against `hz`, and its scatter \[Hz\]: from its phase in Hann windows of half
/// a second.
fn detuned(heard: &[f64], rate_hz: f64, hz: f64) -> (f64, f64) {
    let len = (0.5 * rate_hz) as usize;
    let phase = |(part, samples): (usize, &[f64])| {
        let (mut re, mut im) = (0.0, 0.0);
        for (i, x) in samples.iter().enumerate() {
            let window = 0.5 - 0.5 * (TAU * i as f64 / len as f64).cos();
            let (sin, cos) = (TAU * hz * ((part * len + i) as f64 / rate_hz)).sin_cos();
            re += window * x * cos;
            im -= window * x * sin;
        }
        im.atan2(re)
    };
    let phases: Vec<f64> = heard.chunks_exact(len).enumerate().map(phase).collect();
    let turns = phases.windows(2).map(|p| (p[1] - p[0]) / TAU);
    let off: Vec<f64> = turns.map(|turn| (turn - turn.round()) / 0.5).collect();
    let mean = off.iter().sum::<f64>() / off.len().max(1) as f64;
    (mean, off.iter().fold(0.0, |m: f64, x| m.max((x - mean).abs())))
}

/// Checks all methods, perhaps with their settings. Tells the largest figures and their methods.
pub(super) fn each(
    subject: &Subject<'_>,
    settings: bool,
    mut run: impl FnMut(&Method, &mut Figures) -> Result<(), Stop>,
) -> Found {
    let (methods, mut figures) = (methods(subject, settings)?, Figures::default());
    let mut wrong = Vec::new();
    for method in &methods {
        figures.about = method.name();
        match run(method, &mut figures) {
            Ok(()) => {}
            Err(Stop::Failed(why)) => wrong.push(format!("{}: {why}", method.name())),
            Err(other @ Stop::NotApplicable(_)) => return Err(other),
        }
    }
    ensure!(wrong.is_empty(), "{}", wrong.join("; "));
    Ok(format!("{} methods: {figures}", methods.len()))
}

/// Place of the tone: between two bins, and not in their middle.
const TONE: f64 = 15.37;
/// Another tone.
const OTHER: f64 = 62.8;

/// Frames of a tone.
fn tone() -> Frames {
    frames(|_, k| lobe(TONE, k))
}

/// The mean square that amplitudes ask for.
fn asked(bins: impl Fn(usize) -> f64) -> f64 {
    (0..BINS as usize).map(|k| bins(k).powi(2)).sum::<f64>() / 3.0
}

fn silence(subject: &Subject<'_>) -> Found {
    let (begins, ends) = (150, 400);
    each(subject, true, |method, figures| {
        let sounds = move |n: u64| (begins..ends).contains(&n);
        let tone = frames(move |n, k| if sounds(n) { lobe(TONE, k) } else { 0.0 });
        let mut heard = method.begin(subject, usual(), tone)?;
        ensure!(heard.next(begins)?.iter().all(|x| *x == 0.0), "it sounds before its tone begins");
        let during = heard.next(ends - begins)?;
        let peak = during.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        // Noise of a tone's power exceeds 4 times its amplitude once in 10^8 samples.
        let most = if method.kind == "shaped_noise" { 4.0 } else { 2.0 };
        figures.at_most(peak, most, "times the tone's amplitude at its beginning")?;
        ensure!(power(&during) > 0.0, "it never sounds");
        let settles = heard.settles();
        ensure!(heard.settled(250)? == 0.0, "not silent {settles} frames after the last that sounds");
        Ok(())
    })
}

/// Odd spectra, bin by bin.
const ODD: [(&str, fn(usize) -> f64); 9] = [
    // A constant of 1 reads 2 in bin 0 and 1 beside it. An alternating signal does so at the other end.
    ("DC", |k| [2.0, 1.0].get(k).copied().unwrap_or(0.0)),
    ("Nyquist", |k| [2.0, 1.0].get(BINS as usize - 1 - k).copied().unwrap_or(0.0)),
    ("DC without a lobe", |k| if k == 0 { 2.0 } else { 0.0 }),
    ("a single bin", |k| if k == 40 { 1.0 } else { 0.0 }),
    ("two equal bins", |k| lobe(15.5, k)),
    ("a plateau", |k| [0.2, 0.2, 0.1, 0.1][k % 4]),
    ("a flat spectrum", |_| 0.1),
    // 26.2 dB under the tone.
    ("a tone on a floor", |k| lobe(TONE, k).max(0.049)),
    ("a tone", |k| lobe(TONE, k)),
];

fn spectra(subject: &Subject<'_>) -> Found {
    each(subject, true, |method, figures| {
        for (what, bin) in ODD {
            let mut heard = method.begin(subject, usual(), frames(move |_, k| bin(k)))?;
            let db = decibels(heard.settled(1000)?, asked(bin));
            ensure!(
                (-30.0..=3.0).contains(&db),
                "{what}: the energy is {db:+.1} dB off that of the magnitudes"
            );
            figures.note(db, "dB above the magnitudes");
        }
        Ok(())
    })
}

fn units(subject: &Subject<'_>) -> Found {
    each(subject, true, |method, figures| {
        let steady = |scale: f64| {
            let scaled = frames(move |_, k| scale * lobe(TONE, k));
            let mut heard = method.begin(subject, usual(), scaled)?;
            heard.pass(heard.settles())?;
            Ok::<_, Stop>(power(&heard.next(500)?.iter().map(|x| x / scale).collect::<Vec<_>>()))
        };
        let one = steady(1.0)?;
        for scale in [1e-30, 1e-12, 1e12, 1e30] {
            let off = figures.at_most(decibels(steady(scale)?, one).abs(), 0.1, "dB off");
            off.map_err(|e| e.after(&format!("a tone of {scale:e}")))?;
        }
        Ok(())
    })
}

fn hop(subject: &Subject<'_>) -> Found {
    each(subject, false, |method, figures| {
        let of = |rate_hz: u32| {
            let layout = layout(rate_hz, 101, FRAMES_HZ);
            let all = method.begin(subject, layout, tone())?.aligned(240)?;
            convergence(&layout, |k| lobe(TONE, k), &all)
        };
        let (even, odd) = (of(44_000)?, of(44_100)?);
        ensure!(odd < (even + 1.5).max(-60.0), "{odd:.1} dB at 44.1 kHz, {even:.1} dB at 44 kHz");
        figures.note(odd - even, "dB worse");
        Ok(())
    })
}

/// Frames before a trouble.
const START: u64 = 300;
/// Frames over which a level is measured.
const LEVEL: u64 = 250;

/// The number in a bin instead of a magnitude, if any.
type Instead = fn(u64, usize) -> Option<f32>;

/// Frames of a tone that go wrong from [`START`] on.
struct Trouble {
    what: &'static str,
    /// Number of frames.
    len: u64,
    frames: Frames,
    /// Wrong magnitudes that the node itself gets.
    instead: Option<Instead>,
    /// The mean square that the frames ask for on average.
    asked: f64,
}

/// A kind that gets wrong magnitudes in some frames. The engine itself would not pass them on.
fn misled_in(inner: Arc<NodeKind>, frames: Range<u64>, instead: Instead) -> Arc<NodeKind> {
    misled(inner, move |_| {
        let frames = frames.clone();
        Box::new(move |_, inputs| {
            if let Some(Buffer::Magnitude { bins, frame: Some((n, _)), .. }) = inputs.first_mut()
                && frames.contains(n)
            {
                let changed = |(k, bin): (usize, &mut f32)| *bin = instead(*n, k).unwrap_or(*bin);
                bins.iter_mut().enumerate().for_each(changed);
            }
        })
    })
}

/// Compares troubled frames with a constant tone. The level must come back, and the energy until then must
/// be at most 3 dB above that of the magnitudes.
fn overcome(subject: &Subject<'_>, all: &[Trouble]) -> Found {
    each(subject, true, |method, figures| {
        for Trouble { what, len, frames, instead, asked } in all {
            let troubled = match instead {
                None => subject.clone(),
                Some(instead) => {
                    let kind = subject.kind(&method.kind)?;
                    subject.clone().with(misled_in(kind, START..START + len, *instead))
                }
            };
            let mut run = || {
                let mut plain = method.begin(subject, usual(), tone())?;
                let mut heard = method.begin(&troubled, usual(), frames.clone())?;
                let settles = heard.settles();
                heard.pass(START)?;
                plain.pass(START + len + settles)?;
                let during = power(&heard.next(len + settles)?);
                let db = decibels(power(&heard.next(LEVEL)?), power(&plain.next(LEVEL)?));
                ensure!(db.abs() <= 1.0, "{settles} frames after it the level is {db:+.1} dB off");
                let energy = decibels(during, *asked);
                ensure!(energy <= 3.0, "the energy is {energy:+.1} dB off that of the magnitudes");
                figures.note(db.abs(), "dB off the level");
                Ok(())
            };
            run().map_err(|e: Stop| e.after(what))?;
        }
        Ok(())
    })
}

fn alternating(subject: &Subject<'_>) -> Found {
    /// A bin of a frame, by whether its number is even.
    type Turn = fn(bool, usize) -> f64;
    let turns: [(&str, Turn); 3] = [
        ("a tone and nothing", |even, k| if even { lobe(TONE, k) } else { 0.0 }),
        ("two tones", |even, k| lobe(if even { TONE } else { OTHER }, k)),
        ("all bins and nothing", |even, _| if even { 0.1 } else { 0.0 }),
    ];
    let trouble = |(what, of): (&'static str, Turn)| {
        let is = |n| (START..START + 1000).contains(&n);
        let frames = frames(move |n, k| if is(n) { of(n % 2 == 0, k) } else { lobe(TONE, k) });
        // Until it has settled, a tone sounds again.
        let asked = (0.5 * (asked(|k| of(true, k)) + asked(|k| of(false, k)))).max(asked(|k| lobe(TONE, k)));
        Trouble { what, len: 1000, frames, instead: None, asked }
    };
    overcome(subject, &turns.map(trouble))
}

fn levels(subject: &Subject<'_>) -> Found {
    let steps = [1.0, 1e9, 1.0, 1e-9, 1e9, 1e-9, 1.0, 1e30, 1e-12, 1.0];
    each(subject, true, |method, figures| {
        let mut plain = method.begin(subject, usual(), tone())?;
        let each = plain.settles() + LEVEL;
        let given = frames(move |n, k| {
            let step = usize::try_from(n / each).unwrap_or(usize::MAX);
            steps.get(step).copied().unwrap_or(1.0) * lobe(TONE, k)
        });
        let mut heard = method.begin(subject, usual(), given)?;
        for (i, scale) in steps.into_iter().enumerate() {
            heard.pass(heard.settles())?;
            let scaled: Vec<f64> = heard.next(LEVEL)?.iter().map(|x| x / scale).collect();
            let db = decibels(power(&scaled), plain.settled(LEVEL)?);
            ensure!(db.abs() <= 1.0, "the level is {db:+.1} dB off at {scale:e}, step {i}");
            figures.note(db.abs(), "dB off the level");
        }
        Ok(())
    })
}

fn no_magnitudes(subject: &Subject<'_>) -> Found {
    let troubles: [(&str, u64, Instead); 4] = [
        ("some bins of a frame", 1, |_, k| {
            let none = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0];
            if k % 25 == 10 { none.get(k / 25).copied() } else { None }
        }),
        ("a window of NaN and infinite bins", 50, |n, _| {
            Some(if n % 2 == 0 { f32::NAN } else { f32::INFINITY })
        }),
        ("a window of negative bins", 50, |_, _| Some(-1.0)),
        ("a window of the largest number", 50, |_, _| Some(f32::MAX)),
    ];
    let trouble = |(what, len, instead)| {
        // Nothing says how loud that is.
        Trouble { what, len, frames: tone(), instead: Some(instead), asked: f64::INFINITY }
    };
    overcome(subject, &troubles.map(trouble))
}

/// Frames of a tone, some of which do not come.
fn with_gaps(missing: impl Fn(u64) -> bool + Send + Sync + 'static) -> Frames {
    let tone = tone();
    Arc::new(move |n, bins| tone(n, bins) && !missing(n))
}

fn missing_frames(subject: &Subject<'_>) -> Found {
    let gaps: [(&str, u64, fn(u64) -> bool); 3] = [
        ("every seventh missing", 1000, |n| n % 7 == 3),
        ("ten missing", 10, |_| true),
        ("a second missing", 500, |_| true),
    ];
    let trouble = |(what, len, missing): (&'static str, u64, fn(u64) -> bool)| {
        let frames = with_gaps(move |n| (START..START + len).contains(&n) && missing(n));
        Trouble { what, len, frames, instead: None, asked: asked(|k| lobe(TONE, k)) }
    };
    let found = overcome(subject, &gaps.map(trouble))?;
    // Silence in the second without frames.
    each(subject, true, |method, _| {
        let mut heard = method.begin(subject, usual(), with_gaps(|n| n >= START))?;
        heard.pass(START)?;
        ensure!(heard.settled(LEVEL)? == 0.0, "without frames it is not silent");
        Ok(())
    })?;
    Ok(found)
}

/// Seconds of a day.
const DAY_S: u64 = 24 * 3600;
/// Frames a second of a whole day: half the usual number, to save time.
const FEW_FRAMES_HZ: u32 = 250;
/// Frames of a measurement.
const LOOK: u64 = 1250;
/// Place of the tone among few bins.
const LOW_TONE: f64 = 5.37;

/// Compares the spectral convergence and the frequency of a tone before and after a long time. Notes how far
/// a frequency that was right is off.
fn lasts(
    subject: &Subject<'_>,
    (method, figures): (&Method, &mut Figures),
    layout: FrameLayout,
    at: f64,
    long: impl FnOnce(&mut Heard) -> Result<(), Stop>,
) -> Result<(), Stop> {
    let mut heard = method.begin(subject, layout, frames(move |_, k| lobe(at, k)))?;
    // Its frequency where it has one: noise has none.
    let look = |heard: &mut Heard| {
        let all = heard.aligned(LOOK)?;
        let db = convergence(&layout, |k| lobe(at, k), &all)?;
        let middle = all.get(layout.length as usize..).unwrap_or(&all);
        let (off, scatter) = detuned(middle, f64::from(layout.rate_hz), at * layout.bin_hz());
        Ok::<_, Stop>((db, (off.abs() < 0.01 && scatter < 0.01).then_some(off)))
    };
    heard.pass(heard.settles())?;
    let (db, before) = look(&mut heard)?;
    long(&mut heard)?;
    let (after_db, after) = look(&mut heard)?;
    let still = after_db < (db + 1.5).max(-40.0);
    ensure!(still, "spectral convergence is {after_db:.1} dB, and was {db:.1} dB at the start");
    ensure!(before.is_none() || after.is_some(), "the tone's frequency is off by more than 0.01 Hz");
    figures.note(before.and(after).map_or(0.0, f64::abs), "Hz off");
    Ok(())
}

fn after_a_day(subject: &Subject<'_>) -> Found {
    each(subject, true, |method, figures| {
        lasts(subject, (method, figures), usual(), TONE, |heard| {
            let settles = heard.settles();
            heard.rig.engine.skip(DAY_S * u64::from(FRAMES_HZ) - LOOK - settles);
            heard.pass(settles)
        })
    })
}

fn for_a_day(subject: &Subject<'_>) -> Found {
    let frames = subject.by_effort(100, 1000, DAY_S) * u64::from(FEW_FRAMES_HZ);
    each(subject, false, |method, figures| {
        let layout = layout(500, FEW_BINS, FEW_FRAMES_HZ);
        lasts(subject, (method, figures), layout, LOW_TONE, |heard| heard.pass(frames))
    })
}

fn against_f64(subject: &Subject<'_>) -> Found {
    let (param, words) = ("precision", ["f32", "f64"]);
    let known = |d: &&Descriptor| match d.params.iter().find(|p| p.name == param).map(|p| &p.kind) {
        Some(ParamKind::Choice(known)) => words.iter().all(|w| known.iter().any(|k| k == w)),
        _ => false,
    };
    let total = subject.by_effort(10_000, 200_000, 10_000_000);
    let mut found = Vec::new();
    for d in subject.registry.iter().map(|k| k.descriptor()).filter(known) {
        let [Some(single), Some(double)] = words.map(|word| Method::of(d, Some((param, word)))) else {
            continue;
        };
        let (start, end) = apart(subject, &single, &double, total).map_err(|e| e.after(&d.kind))?;
        found.push(format!("{} {end:.1} dB apart, {:+.1} dB more than at the start", d.kind, end - start));
    }
    if found.is_empty() {
        return not_applicable("no method can be set to `precision: f32` and to `f64`");
    }
    Ok(format!("over {total} frames: {}", found.join(", ")))
}

/// Difference of the magnitudes of two methods at the start and at the end \[dB\].
fn apart(subject: &Subject<'_>, single: &Method, double: &Method, total: u64) -> Result<(f64, f64), Stop> {
    let bench = layout(500, FEW_BINS, FRAMES_HZ);
    let tones = |_: u64, k: usize| lobe(LOW_TONE, k) + 0.5 * lobe(14.8, k);
    let mut both =
        [single.begin(subject, bench, frames(tones))?, double.begin(subject, bench, frames(tones))?];
    let mut look = |wait: Option<u64>| {
        let heard = both.iter_mut().map(|heard| {
            heard.pass(wait.unwrap_or(heard.settles()))?;
            heard.next(LOOK)
        });
        let heard: Vec<Vec<f64>> = heard.collect::<Result<_, Stop>>()?;
        let layout = framing(&bench);
        let magnitudes = phase::magnitudes(&heard[1], &layout, heard[0].len() - layout.fft_len);
        let wanted: Vec<f32> = magnitudes.iter().map(|m| *m as f32).collect();
        scored(phase::score(&wanted, &layout, &heard[0]))
    };
    let (start, end) = (look(None)?, look(Some(total))?);
    let limit = (start + 3.0).max(-40.0);
    ensure!(end <= limit, "single and double precision are {end:.1} dB apart, {start:.1} dB at the start");
    Ok((start, end))
}
