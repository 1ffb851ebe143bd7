//! Phase retrieval: every kind that takes magnitudes alone and gives spectra or samples, with each of its
//! settings.
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

mod method;

pub use method::decibels;
pub(super) use method::{Method, frames, methods};

use std::ops::Range;
use std::sync::Arc;

use asperity_accuracy::phase;
use asperity_node::{Buffer, FrameLayout, NodeKind};

use crate::case::{Case, Family, Found, Stop, not_applicable};
use crate::played::Frames;
use crate::subject::Subject;
use crate::wrap::misled;
use method::{
    BINS, FEW_BINS, FRAMES_HZ, Heard, detuned, framing, layout, layout_at, lobe, methods_with, power, score,
};

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
        "frames by turns: a tone and nothing, two tones, all bins and nothing",
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
        "hops of 88 and 89 samples by turns: 44.1 kHz",
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

/// Place of the tone: between two bins, and not in their middle.
const TONE: f64 = 15.37;

/// The mean square that amplitudes ask for.
fn asked(bins: impl Fn(usize) -> f64) -> f64 {
    (0..BINS as usize).map(|k| bins(k).powi(2)).sum::<f64>() / 3.0
}

/// Checks all methods, perhaps with their settings. Tells their number, the largest figure in the words of
/// `told`, and its method.
pub(super) fn each(
    subject: &Subject<'_>,
    settings: bool,
    told: impl FnOnce(f64) -> String,
    mut run: impl FnMut(&Method) -> Result<f64, Stop>,
) -> Found {
    let methods = methods(subject, settings)?;
    let mut worst = (f64::NEG_INFINITY, String::new());
    let mut wrong = Vec::new();
    for method in &methods {
        match run(method) {
            Ok(figure) if figure > worst.0 => worst = (figure, method.name()),
            Ok(_) => {}
            Err(Stop::Failed(why)) => wrong.push(format!("{}: {why}", method.name())),
            Err(other @ Stop::NotApplicable(_)) => return Err(other),
        }
    }
    ensure!(wrong.is_empty(), "{}", wrong.join("; "));
    Ok(format!("{} methods: {} ({})", methods.len(), told(worst.0), worst.1))
}

fn silence(subject: &Subject<'_>) -> Found {
    let layout = layout(2500, BINS);
    let (begins, ends) = (150, 400);
    let told = |x| format!("the largest sample is {x:.2} times the tone's amplitude");
    each(subject, true, told, |method| {
        let sounds = move |n: u64| (begins..ends).contains(&n);
        let tone = frames(move |n, k| if sounds(n) { lobe(TONE, k) } else { 0.0 });
        let mut heard = method.begin(subject, layout, tone)?;
        let before = heard.next(begins)?;
        ensure!(before.iter().all(|x| *x == 0.0), "it sounds before its tone begins");
        let during = heard.next(ends - begins)?;
        let peak = during.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        // Noise of a tone's power exceeds 4 times its amplitude once in 10^8 samples.
        let most = if method.name().starts_with("shaped_noise") { 4.0 } else { 2.0 };
        ensure!(peak <= most, "it begins with a sample of {peak:.2} times the tone's amplitude");
        ensure!(power(&during) > 0.0, "it never sounds");
        let settles = heard.settles();
        let end = heard.next(settles)?;
        let rest = heard.next(250)?;
        ensure!(rest.iter().all(|x| *x == 0.0), "not silent {settles} frames after the last that sounds");
        Ok(end.iter().fold(peak, |m, x| m.max(x.abs())))
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
    let told = |db| format!("at most {db:+.1} dB of what {} spectra ask for", ODD.len());
    each(subject, true, told, |method| {
        let mut most = f64::NEG_INFINITY;
        for (what, bin) in ODD {
            let mut heard = method.begin(subject, layout(2500, BINS), frames(move |_, k| bin(k)))?;
            heard.settle()?;
            let db = decibels(power(&heard.next(1000)?), asked(bin));
            ensure!((-30.0..=3.0).contains(&db), "{what}: the energy is {db:+.1} dB off what was asked for");
            most = most.max(db);
        }
        Ok(most)
    })
}

/// Frames of a tone.
fn tone() -> Frames {
    frames(|_, k| lobe(TONE, k))
}

fn units(subject: &Subject<'_>) -> Found {
    let told = |db| format!("at most {db:.3} dB off");
    each(subject, true, told, |method| {
        let steady = |scale: f64| {
            let scaled = frames(move |_, k| scale * lobe(TONE, k));
            let mut heard = method.begin(subject, layout(2500, BINS), scaled)?;
            heard.settle()?;
            Ok::<_, Stop>(power(&heard.next(500)?.iter().map(|x| x / scale).collect::<Vec<_>>()))
        };
        let (one, mut worst) = (steady(1.0)?, 0.0_f64);
        for scale in [1e-30, 1e-12, 1e12, 1e30] {
            let db = decibels(steady(scale)?, one);
            ensure!(db.abs() <= 0.1, "a tone of {scale:e} is {db:+.2} dB off");
            worst = worst.max(db.abs());
        }
        Ok(worst)
    })
}

fn hop(subject: &Subject<'_>) -> Found {
    let told = |db| format!("at most {db:+.2} dB worse");
    each(subject, false, told, |method| {
        let of = |rate_hz: u32| {
            let layout = layout(rate_hz, 101);
            let all = method.begin(subject, layout, tone())?.aligned(240)?;
            Ok::<f64, Stop>(score(&layout, |k| lobe(TONE, k), &all)?.convergence_db)
        };
        let (even, odd) = (of(44_000)?, of(44_100)?);
        ensure!(odd < (even + 1.5).max(-60.0), "{odd:.1} dB at 44.1 kHz, {even:.1} dB at 44 kHz");
        Ok(odd - even)
    })
}

/// Another tone.
const OTHER: f64 = 62.8;
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
    /// The frames.
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

/// Compares troubled frames with a constant tone. The level must come back, and the energy until then must be
/// at most 3 dB above what is asked for.
fn overcome(subject: &Subject<'_>, all: &[Trouble]) -> Found {
    let told = |db| format!("the level is off by {db:.2} dB at most");
    each(subject, true, told, |method| {
        let mut worst = 0.0_f64;
        for Trouble { what, len, frames, instead, asked } in all {
            let troubled = match instead {
                None => subject.clone(),
                Some(instead) => {
                    let kind = subject.kind(method.kind())?;
                    subject.clone().with(misled_in(kind, START..START + len, *instead))
                }
            };
            let layout = layout(2500, BINS);
            let mut plain = method.begin(subject, layout, tone())?;
            let mut heard = method.begin(&troubled, layout, frames.clone())?;
            let settles = heard.settles();
            heard.pass(START).and_then(|()| plain.pass(START + len + settles)).map_err(|e| e.after(what))?;
            let during = power(&heard.next(len + settles).map_err(|e| e.after(what))?);
            let db = decibels(power(&heard.next(LEVEL)?), power(&plain.next(LEVEL)?));
            ensure!(db.abs() <= 1.0, "{what}: {settles} frames after it the level is {db:+.1} dB off");
            let energy = decibels(during, *asked);
            ensure!(energy <= 3.0, "{what}: the energy is {energy:+.1} dB off what was asked for");
            worst = worst.max(db.abs());
        }
        Ok(worst)
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
    let layout = layout(2500, BINS);
    let steps = [1.0, 1e9, 1.0, 1e-9, 1e9, 1e-9, 1.0, 1e30, 1e-12, 1.0];
    let told = |db| format!("the level is off by {db:.2} dB at most");
    each(subject, true, told, |method| {
        let mut plain = method.begin(subject, layout, tone())?;
        let each = plain.settles() + LEVEL;
        let given = frames(move |n, k| {
            let step = usize::try_from(n / each).unwrap_or(usize::MAX);
            steps.get(step).copied().unwrap_or(1.0) * lobe(TONE, k)
        });
        let mut heard = method.begin(subject, layout, given)?;
        let mut worst = 0.0_f64;
        for (i, scale) in steps.into_iter().enumerate() {
            heard.settle()?;
            plain.settle()?;
            let scaled: Vec<f64> = heard.next(LEVEL)?.iter().map(|x| x / scale).collect();
            let db = decibels(power(&scaled), power(&plain.next(LEVEL)?));
            ensure!(db.abs() <= 1.0, "the level is {db:+.1} dB off at {scale:e}, step {i}");
            worst = worst.max(db.abs());
        }
        Ok(worst)
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
    let told = |_| String::new();
    each(subject, true, told, |method| {
        let mut heard = method.begin(subject, layout(2500, BINS), with_gaps(|n| n >= START))?;
        heard.pass(START)?;
        heard.settle()?;
        let silent = heard.next(LEVEL)?.iter().all(|x| *x == 0.0);
        ensure!(silent, "without frames it is not silent");
        Ok(0.0)
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

/// Compares the spectral convergence and the frequency of a tone before and after a long time. Tells how far
/// a frequency that was right is off \[Hz\].
fn lasts(
    subject: &Subject<'_>,
    method: &Method,
    layout: FrameLayout,
    at: f64,
    long: impl FnOnce(&mut Heard) -> Result<(), Stop>,
) -> Result<f64, Stop> {
    let mut heard = method.begin(subject, layout, frames(move |_, k| lobe(at, k)))?;
    // Its frequency where it has one: noise has none.
    let look = |heard: &mut Heard| {
        let all = heard.aligned(LOOK)?;
        let db = score(&layout, |k| lobe(at, k), &all)?.convergence_db;
        let middle = all.get(layout.length as usize..).unwrap_or(&all);
        let (off, scatter) = detuned(middle, f64::from(layout.rate_hz), at * layout.bin_hz());
        Ok::<_, Stop>((db, (off.abs() < 0.01 && scatter < 0.01).then_some(off)))
    };
    heard.settle()?;
    let (db, before) = look(&mut heard)?;
    long(&mut heard)?;
    let (after_db, after) = look(&mut heard)?;
    let still = after_db < (db + 1.5).max(-40.0);
    ensure!(still, "spectral convergence is {after_db:.1} dB, and was {db:.1} dB at the start");
    ensure!(before.is_none() || after.is_some(), "the tone's frequency is off by more than 0.01 Hz");
    Ok(before.and(after).map_or(0.0, f64::abs))
}

fn after_a_day(subject: &Subject<'_>) -> Found {
    let told = |hz| format!("a tone keeps its frequency within {hz:.1e} Hz");
    each(subject, true, told, |method| {
        lasts(subject, method, layout(2500, BINS), TONE, |heard| {
            heard.skip(DAY_S * u64::from(FRAMES_HZ) - LOOK - heard.settles());
            heard.settle()
        })
    })
}

fn for_a_day(subject: &Subject<'_>) -> Found {
    let seconds = subject.by_effort(100, 1000, DAY_S);
    let told = |hz| format!("over {seconds} s a tone keeps its frequency within {hz:.1e} Hz");
    each(subject, false, told, |method| {
        let layout = layout_at(500, FEW_BINS, FEW_FRAMES_HZ);
        lasts(subject, method, layout, LOW_TONE, |heard| heard.pass(seconds * u64::from(FEW_FRAMES_HZ)))
    })
}

fn against_f64(subject: &Subject<'_>) -> Found {
    let pairs = methods_with(subject, "precision", ["f32", "f64"]);
    if pairs.is_empty() {
        return not_applicable("no method can be set to `precision: f32` and to `f64`");
    }
    let total = subject.by_effort(10_000, 200_000, 10_000_000);
    let mut found = Vec::new();
    for pair in &pairs {
        let name = pair[0].name();
        let (start, end) = apart(subject, pair, total).map_err(|e| e.after(&name))?;
        found.push(format!("{name} {end:.1} dB apart, {:+.1} dB more than at the start", end - start));
    }
    Ok(format!("over {total} frames: {}", found.join(", ")))
}

/// Difference of the magnitudes of two methods at the start and at the end \[dB\].
fn apart(subject: &Subject<'_>, pair: &[Method; 2], total: u64) -> Result<(f64, f64), Stop> {
    let bench = layout(500, FEW_BINS);
    let tones = |_: u64, k: usize| lobe(LOW_TONE, k) + 0.5 * lobe(14.8, k);
    let [single, double] = pair;
    let (mut single, mut double) =
        (single.begin(subject, bench, frames(tones))?, double.begin(subject, bench, frames(tones))?);
    let look = |single: &mut Heard, double: &mut Heard| {
        let (a, b) = (single.next(LOOK)?, double.next(LOOK)?);
        let layout = framing(&bench);
        let frames = a.len() - layout.fft_len;
        let wanted: Vec<f32> = phase::magnitudes(&b, &layout, frames).iter().map(|m| *m as f32).collect();
        let found = phase::score(&wanted, &layout, &a).map_err(|e| Stop::Failed(e.to_string()))?;
        Ok::<f64, Stop>(found.convergence_db)
    };
    single.settle()?;
    double.settle()?;
    let start = look(&mut single, &mut double)?;
    single.pass(total)?;
    double.pass(total)?;
    let end = look(&mut single, &mut double)?;
    let limit = (start + 3.0).max(-40.0);
    ensure!(end <= limit, "single and double precision are {end:.1} dB apart, {start:.1} dB at the start");
    Ok((start, end))
}
