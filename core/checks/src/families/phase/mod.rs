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

pub(super) use method::{Method, methods};

use std::ops::Range;
use std::sync::Arc;

use asperity_accuracy::phase;
use asperity_node::{Buffer, FrameLayout, InputRef, Inputs, NodeKind, Outputs, Setup, Tick};

use crate::case::{Case, Family, Found, Stop, fails, holds, not_applicable};
use crate::played::Frames;
use crate::subject::Subject;
use crate::wrap::{Process, wrap};
use method::{
    BINS, FEW_BINS, FRAMES_HZ, Heard, decibels, detuned, frames, framing, layout, layout_at, lobe,
    methods_with, power, score,
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

/// Checks all methods. Answers their number, the largest figure, and its method.
///
/// # Errors
/// All failures.
fn each(
    subject: &Subject<'_>,
    settings: bool,
    mut run: impl FnMut(&Method) -> Result<f64, Stop>,
) -> Result<(usize, f64, String), Stop> {
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
    holds(wrong.is_empty(), || wrong.join("; "))?;
    Ok((methods.len(), worst.0, worst.1))
}

fn silence(subject: &Subject<'_>) -> Found {
    let layout = layout(2500, BINS);
    let (begins, ends) = (150, 400);
    let (count, worst, of) = each(subject, true, |method| {
        let sounds = move |n: u64| (begins..ends).contains(&n);
        let tone = frames(move |n, k| if sounds(n) { lobe(TONE, k) } else { 0.0 });
        let mut heard = method.begin(subject, layout, tone)?;
        let before = heard.next(begins)?;
        holds(before.iter().all(|x| *x == 0.0), || "it sounds before its tone begins".to_owned())?;
        let during = heard.next(ends - begins)?;
        let peak = during.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        // Noise of a tone's power exceeds 4 times its amplitude once in 10^8 samples.
        let most = if method.name().starts_with("shaped_noise") { 4.0 } else { 2.0 };
        holds(peak <= most, || format!("it begins with a sample of {peak:.2} times the tone's amplitude"))?;
        holds(power(&during) > 0.0, || "it never sounds".to_owned())?;
        let settles = heard.settles(&layout);
        let end = heard.next(settles)?;
        let rest = heard.next(250)?;
        holds(rest.iter().all(|x| *x == 0.0), || {
            format!("not silent {settles} frames after the last that sounds")
        })?;
        Ok(end.iter().fold(peak, |m, x| m.max(x.abs())))
    })?;
    Ok(format!("{count} methods; the largest sample is {worst:.2} times the tone's amplitude ({of})"))
}

/// A bin of an odd spectrum.
fn odd_spectrum(what: &str, k: usize) -> f64 {
    let last = BINS as usize - 1;
    let at = |bin: usize, value: f64| if k == bin { value } else { 0.0 };
    match what {
        // A constant of 1 reads 2 in bin 0 and 1 beside it. An alternating signal does so at the other end.
        "DC" => at(0, 2.0) + at(1, 1.0),
        "Nyquist" => at(last, 2.0) + at(last - 1, 1.0),
        "DC without a lobe" => at(0, 2.0),
        "a single bin" => at(40, 1.0),
        "two equal bins" => lobe(15.5, k),
        "a plateau" => [0.2, 0.2, 0.1, 0.1][k % 4],
        "a flat spectrum" => 0.1,
        // 26.2 dB under the tone.
        "a tone on a floor" => lobe(TONE, k).max(0.049),
        _ => lobe(TONE, k),
    }
}

fn spectra(subject: &Subject<'_>) -> Found {
    let layout = layout(2500, BINS);
    let all = [
        "DC",
        "Nyquist",
        "DC without a lobe",
        "a single bin",
        "two equal bins",
        "a plateau",
        "a flat spectrum",
        "a tone on a floor",
        "a tone",
    ];
    let mut least = f64::INFINITY;
    let (count, worst, of) = each(subject, true, |method| {
        let mut most = f64::NEG_INFINITY;
        for what in all {
            let mut heard = method.begin(subject, layout, frames(move |_, k| odd_spectrum(what, k)))?;
            let settles = heard.settles(&layout);
            heard.pass(settles)?;
            let db = decibels(power(&heard.next(1000)?), asked(|k| odd_spectrum(what, k)));
            holds((-30.0..=3.0).contains(&db), || {
                format!("{what}: the energy is {db:+.1} dB off what was asked for")
            })?;
            most = most.max(db);
            least = least.min(db);
        }
        Ok(most)
    })?;
    Ok(format!(
        "{count} methods: {least:.1} to {worst:+.1} dB of what {} spectra ask for, most by {of}",
        all.len()
    ))
}

/// The samples of a tone that has settled.
fn steady(subject: &Subject<'_>, method: &Method, scale: f64) -> Result<Vec<f64>, Stop> {
    let layout = layout(2500, BINS);
    let mut heard = method.begin(subject, layout, frames(move |_, k| scale * lobe(TONE, k)))?;
    heard.pass(heard.settles(&layout))?;
    heard.next(500)
}

fn units(subject: &Subject<'_>) -> Found {
    let (count, worst, of) = each(subject, true, |method| {
        let one = power(&steady(subject, method, 1.0)?);
        let mut worst = 0.0_f64;
        for scale in [1e-30, 1e-12, 1e12, 1e30] {
            let scaled: Vec<f64> = steady(subject, method, scale)?.iter().map(|x| x / scale).collect();
            let db = decibels(power(&scaled), one);
            holds(db.abs() <= 0.1, || format!("a tone of {scale:e} is {db:+.2} dB off"))?;
            worst = worst.max(db.abs());
        }
        Ok(worst)
    })?;
    Ok(format!("{count} methods; at most {worst:.3} dB off ({of})"))
}

fn hop(subject: &Subject<'_>) -> Found {
    let tone: Frames = frames(|_, k| lobe(TONE, k));
    let (count, worst, of) = each(subject, false, |method| {
        let of = |rate_hz: u32| {
            let layout = layout(rate_hz, 101);
            let mut heard: Heard = method.begin(subject, layout, Arc::clone(&tone))?;
            let all = heard.aligned(240)?;
            Ok::<f64, Stop>(score(&layout, |k| lobe(TONE, k), &all)?.convergence_db)
        };
        let (even, odd) = (of(44_000)?, of(44_100)?);
        holds(odd < (even + 1.5).max(-60.0), || format!("{odd:.1} dB at 44.1 kHz, {even:.1} dB at 44 kHz"))?;
        Ok(odd - even)
    })?;
    Ok(format!("{count} kinds; at most {worst:+.2} dB worse ({of})"))
}

/// Another tone.
const OTHER: f64 = 62.8;
/// Frames before the trouble.
const START: u64 = 300;
/// Frames over which a level is measured.
const LEVEL: u64 = 250;

/// Compares troubled frames with a constant tone: the level must come back after the trouble. Answers the
/// difference \[dB\], and the mean square from the start of the trouble until it has settled.
fn comes_back(
    subject: &Subject<'_>,
    method: &Method,
    troubled: &Subject<'_>,
    frames_of: &Frames,
    trouble: Range<u64>,
) -> Result<(f64, f64), Stop> {
    let layout = layout(2500, BINS);
    let tone: Frames = frames(|_, k| lobe(TONE, k));
    let mut plain = method.begin(subject, layout, tone)?;
    let mut heard = method.begin(troubled, layout, frames_of.clone())?;
    let settles = heard.settles(&layout);
    heard.pass(trouble.start)?;
    let during = heard.next(trouble.end - trouble.start + settles)?;
    plain.pass(trouble.end + settles)?;
    let db = decibels(power(&heard.next(LEVEL)?), power(&plain.next(LEVEL)?));
    holds(db.abs() <= 1.0, || format!("{settles} frames after it the level is {db:+.1} dB off"))?;
    Ok((db.abs(), power(&during)))
}

fn alternating(subject: &Subject<'_>) -> Found {
    /// A bin of a frame, by whether its number is even.
    type Turn = fn(bool, usize) -> f64;
    let turns: [(&str, Turn); 3] = [
        ("a tone and nothing", |even, k| if even { lobe(TONE, k) } else { 0.0 }),
        ("two tones", |even, k| lobe(if even { TONE } else { OTHER }, k)),
        ("all bins and nothing", |even, _| if even { 0.1 } else { 0.0 }),
    ];
    let trouble = START..START + 1000;
    let (count, worst, of) = each(subject, true, |method| {
        let mut worst = 0.0_f64;
        for (what, of) in turns {
            let during = trouble.clone();
            let given =
                frames(move |n, k| if during.contains(&n) { of(n % 2 == 0, k) } else { lobe(TONE, k) });
            let back = comes_back(subject, method, subject, &given, trouble.clone());
            let (off, energy) = back.map_err(|e| e.after(what))?;
            // Until it has settled, a tone sounds again.
            let wanted = 0.5 * (asked(|k| of(true, k)) + asked(|k| of(false, k)));
            let wanted = wanted.max(asked(|k| lobe(TONE, k)));
            let db = decibels(energy, wanted);
            holds(db <= 3.0, || format!("{what}: the energy is {db:+.1} dB off what was asked for"))?;
            worst = worst.max(off);
        }
        Ok(worst)
    })?;
    Ok(format!("{count} methods; the level is off by {worst:.2} dB at most ({of})"))
}

fn levels(subject: &Subject<'_>) -> Found {
    let layout = layout(2500, BINS);
    let steps = [1.0, 1e9, 1.0, 1e-9, 1e9, 1e-9, 1.0, 1e30, 1e-12, 1.0];
    let (count, worst, of) = each(subject, true, |method| {
        let tone: Frames = frames(|_, k| lobe(TONE, k));
        let mut plain = method.begin(subject, layout, tone)?;
        let each = plain.settles(&layout) + LEVEL;
        let given = frames(move |n, k| {
            let step = usize::try_from(n / each).unwrap_or(usize::MAX);
            steps.get(step).copied().unwrap_or(1.0) * lobe(TONE, k)
        });
        let mut heard = method.begin(subject, layout, given)?;
        let mut worst = 0.0_f64;
        for (i, scale) in steps.into_iter().enumerate() {
            heard.pass(each - LEVEL)?;
            plain.pass(each - LEVEL)?;
            let scaled: Vec<f64> = heard.next(LEVEL)?.iter().map(|x| x / scale).collect();
            let db = decibels(power(&scaled), power(&plain.next(LEVEL)?));
            holds(db.abs() <= 1.0, || format!("the level is {db:+.1} dB off at {scale:e}, step {i}"))?;
            worst = worst.max(db.abs());
        }
        Ok(worst)
    })?;
    Ok(format!("{count} methods; the level is off by {worst:.2} dB at most ({of})"))
}

/// The number in a bin instead of a magnitude, if any.
type Instead = fn(u64, usize) -> Option<f32>;

/// A kind that gets wrong magnitudes in some frames. The engine itself would not pass them on.
fn misled(inner: Arc<NodeKind>, frames: Range<u64>, instead: Instead) -> Arc<NodeKind> {
    let make = move |setup: &Setup<'_>| -> Process {
        let mut given = setup.input(0).map(|port| Buffer::new(port, setup.tick_hz));
        let frames = frames.clone();
        Box::new(move |node, tick| {
            let (Some(buffer), Some(frame)) = (&mut given, tick.inputs.magnitude(0)) else {
                return node.run(tick);
            };
            if !frames.contains(&frame.index) {
                return node.run(tick);
            }
            if let Buffer::Magnitude { bins, frame: place, .. } = buffer {
                for (k, (to, from)) in bins.iter_mut().zip(frame.bins).enumerate() {
                    *to = instead(frame.index, k).unwrap_or(*from);
                }
                *place = Some((frame.index, frame.start));
            }
            let buffers = std::slice::from_ref(buffer);
            let inputs = Inputs::new(buffers, &[], 1, &[InputRef { buffer: 0, connected: true }]);
            let outputs = Outputs::new(tick.outputs.buffers());
            node.run(&mut Tick { index: tick.index, tick_hz: tick.tick_hz, inputs, outputs })
        })
    };
    wrap(inner, Arc::new(make))
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
    let tone: Frames = frames(|_, k| lobe(TONE, k));
    let (count, worst, of) = each(subject, true, |method| {
        let mut worst = 0.0_f64;
        for (what, len, instead) in troubles {
            let trouble = START..START + len;
            let kind = misled(subject.kind(method.kind())?, trouble.clone(), instead);
            let troubled = subject.clone().with(kind);
            let back = comes_back(subject, method, &troubled, &tone, trouble);
            let (off, _) = back.map_err(|e| e.after(what))?;
            worst = worst.max(off);
        }
        Ok(worst)
    })?;
    Ok(format!("{count} methods; the level is off by {worst:.2} dB at most ({of})"))
}

/// A gap: its name, its length in frames, and the frames that do not come.
type Gap = (&'static str, u64, fn(u64) -> bool);

fn missing_frames(subject: &Subject<'_>) -> Found {
    let layout = layout(2500, BINS);
    let gaps: [Gap; 3] = [
        ("every seventh missing", 1000, |n| n % 7 == 3),
        ("ten missing", 10, |_| true),
        ("a second missing", 500, |_| true),
    ];
    let (count, worst, of) = each(subject, true, |method| {
        let mut worst = 0.0_f64;
        for (what, len, missing) in gaps {
            let trouble = START..START + len;
            let during = trouble.clone();
            let given: Frames = Arc::new(move |n, bins| {
                bins.iter_mut().enumerate().for_each(|(k, m)| *m = lobe(TONE, k) as f32);
                !(during.contains(&n) && missing(n))
            });
            let back = comes_back(subject, method, subject, &given, trouble.clone());
            let (off, energy) = back.map_err(|e| e.after(what))?;
            let db = decibels(energy, asked(|k| lobe(TONE, k)));
            holds(db <= 3.0, || format!("{what}: the energy is {db:+.1} dB off what was asked for"))?;
            worst = worst.max(off);
        }
        // Silence in the second without frames.
        let given: Frames = Arc::new(move |n, bins| {
            bins.iter_mut().enumerate().for_each(|(k, m)| *m = lobe(TONE, k) as f32);
            n < START
        });
        let mut heard = method.begin(subject, layout, given)?;
        heard.pass(START + heard.settles(&layout))?;
        let rest = heard.next(LEVEL)?;
        holds(rest.iter().all(|x| *x == 0.0), || "without frames it is not silent".to_owned())?;
        Ok(worst)
    })?;
    Ok(format!("{count} methods; the level is off by {worst:.2} dB at most ({of})"))
}

/// Seconds of a day.
const DAY_S: u64 = 24 * 3600;
/// Frames a second of a whole day: half the usual number, to save time.
const FEW_FRAMES_HZ: u32 = 250;
/// Frames of a measurement.
const LOOK: u64 = 1250;
/// Place of the tone among few bins.
const LOW_TONE: f64 = 5.37;

/// Spectral convergence of a tone \[dB\], and the error of its frequency \[Hz\] where it has one.
fn look(heard: &mut Heard, layout: &FrameLayout, tone: f64) -> Result<(f64, Option<f64>), Stop> {
    let all = heard.aligned(LOOK)?;
    let found = score(layout, |k| lobe(tone, k), &all)?;
    let middle = all.get(layout.length as usize..).unwrap_or(&all);
    let (off, scatter) = detuned(middle, f64::from(layout.rate_hz), tone * layout.bin_hz());
    Ok((found.convergence_db, (off.abs() < 0.01 && scatter < 0.01).then_some(off)))
}

/// Compares a tone after a long time with the tone at the start.
fn as_before(before: (f64, Option<f64>), after: (f64, Option<f64>)) -> Result<f64, Stop> {
    holds(after.0 < (before.0 + 1.5).max(-40.0), || {
        format!("spectral convergence is {:.1} dB, and was {:.1} dB at the start", after.0, before.0)
    })?;
    // Noise has no frequency. A method that has one keeps it.
    match (before.1, after.1) {
        (Some(_), None) => fails("the tone's frequency is off by more than 0.01 Hz"),
        (Some(_), Some(off)) => Ok(off.abs()),
        (None, _) => Ok(0.0),
    }
}

fn after_a_day(subject: &Subject<'_>) -> Found {
    let mut tones = 0;
    let (count, worst, of) = each(subject, true, |method| {
        let bench = layout(2500, BINS);
        let tone: Frames = frames(|_, k| lobe(TONE, k));
        let mut heard = method.begin(subject, bench, tone)?;
        heard.pass(heard.settles(&bench))?;
        let before = look(&mut heard, &bench, TONE)?;
        heard.skip(DAY_S * u64::from(FRAMES_HZ) - LOOK - heard.settles(&bench));
        heard.pass(heard.settles(&bench))?;
        tones += usize::from(before.1.is_some());
        as_before(before, look(&mut heard, &bench, TONE)?)
    })?;
    Ok(format!("{count} methods, {tones} of which keep a tone's frequency, within {worst:.1e} Hz ({of})"))
}

fn for_a_day(subject: &Subject<'_>) -> Found {
    let seconds = subject.by_effort(100, 1000, DAY_S);
    let total = seconds * u64::from(FEW_FRAMES_HZ);
    let mut tones = 0;
    let (count, worst, of) = each(subject, false, |method| {
        let bench = layout_at(500, FEW_BINS, FEW_FRAMES_HZ);
        let tone: Frames = frames(|_, k| lobe(LOW_TONE, k));
        let mut heard = method.begin(subject, bench, tone)?;
        heard.pass(heard.settles(&bench))?;
        let before = look(&mut heard, &bench, LOW_TONE)?;
        heard.pass(total)?;
        tones += usize::from(before.1.is_some());
        as_before(before, look(&mut heard, &bench, LOW_TONE)?)
    })?;
    Ok(format!(
        "{count} kinds over {seconds} s in {total} frames, {tones} of which keep a tone's frequency, within \
         {worst:.1e} Hz ({of})"
    ))
}

fn against_f64(subject: &Subject<'_>) -> Found {
    let pairs = methods_with(subject, "precision", ["f32", "f64"]);
    if pairs.is_empty() {
        return not_applicable("no method can be set to `precision: f32` and to `f64`");
    }
    let total = subject.by_effort(10_000, 200_000, 10_000_000);
    let (mut worst, mut grown) = ((f64::NEG_INFINITY, String::new()), f64::NEG_INFINITY);
    for pair in &pairs {
        let [single, _] = pair;
        let (start, end) = apart(subject, pair, total).map_err(|e| e.after(&single.name()))?;
        grown = grown.max(end - start);
        if end > worst.0 {
            worst = (end, single.name());
        }
    }
    Ok(format!(
        "{} kinds over {total} frames: at most {:.1} dB apart ({}), {grown:+.1} dB more than at the start",
        pairs.len(),
        worst.0,
        worst.1
    ))
}

/// Difference of the magnitudes of two methods at the start and at the end \[dB\].
fn apart(subject: &Subject<'_>, [single, double]: &[Method; 2], total: u64) -> Result<(f64, f64), Stop> {
    let bench = layout(500, FEW_BINS);
    let tones = |_: u64, k: usize| lobe(LOW_TONE, k) + 0.5 * lobe(14.8, k);
    let mut pair =
        [single.begin(subject, bench, frames(tones))?, double.begin(subject, bench, frames(tones))?];
    let look = |pair: &mut [Heard; 2]| {
        let [single, double] = pair;
        let (a, b) = (single.next(LOOK)?, double.next(LOOK)?);
        let layout = framing(&bench);
        let frames = a.len() - layout.fft_len;
        let wanted: Vec<f32> = phase::magnitudes(&b, &layout, frames).iter().map(|m| *m as f32).collect();
        let found = phase::score(&wanted, &layout, &a).map_err(|e| Stop::Failed(e.to_string()))?;
        Ok::<f64, Stop>(found.convergence_db)
    };
    for heard in &mut pair {
        heard.pass(heard.settles(&bench))?;
    }
    let start = look(&mut pair)?;
    for heard in &mut pair {
        heard.pass(total)?;
    }
    let end = look(&mut pair)?;
    let limit = (start + 3.0).max(-40.0);
    holds(end <= limit, || {
        format!("single and double precision are {end:.1} dB apart, {start:.1} dB at the start")
    })?;
    Ok((start, end))
}
