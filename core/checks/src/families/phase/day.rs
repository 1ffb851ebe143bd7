//! Time that is long: a day that is left out, a day of frames, ten million frames in two precisions.

use asperity_accuracy::phase as figures;
use asperity_node::FrameLayout;

use super::bench::{
    FEW_BINS, FRAMES_HZ, Heard, Method, detuned, frames, framing, layout, layout_at, lobe, methods_with,
    score,
};
use super::{TONE, each};
use crate::case::{Found, Not, holds, not_applicable};
use crate::played::Frames;
use crate::subject::Subject;

/// Seconds of a day.
const DAY_S: u64 = 24 * 3600;
/// Frames a second of a day that is run: half of what is usual, so that a day has an end.
const FEW_FRAMES_HZ: u32 = 250;
/// Frames that are looked at.
const LOOK: u64 = 1250;
/// Where the tone lies where there are few bins.
const LOW_TONE: f64 = 5.37;

/// What there is of a tone: spectral convergence in dB, and how far off its frequency is in Hz, where it has one.
fn look(heard: &mut Heard, layout: &FrameLayout, tone: f64) -> Result<(f64, Option<f64>), Not> {
    let all = heard.aligned(LOOK)?;
    let found = score(layout, |k| lobe(tone, k), &all)?;
    let middle = all.get(layout.length as usize..).unwrap_or(&all);
    let (off, scatter) = detuned(middle, f64::from(layout.rate_hz), tone * layout.bin_hz());
    Ok((found.convergence_db, (off.abs() < 0.01 && scatter < 0.01).then_some(off)))
}

/// Holds a tone after a long time against the tone at the start.
fn as_before(before: (f64, Option<f64>), after: (f64, Option<f64>)) -> Result<f64, Not> {
    holds(after.0 < (before.0 + 1.5).max(-40.0), || {
        format!("spectral convergence is {:.1} dB, and was {:.1} dB at the start", after.0, before.0)
    })?;
    // Noise has no frequency; what has one keeps it.
    match (before.1, after.1) {
        (Some(_), None) => Err(Not::Held("the tone's frequency is off by more than 0.01 Hz".to_owned())),
        (Some(_), Some(off)) => Ok(off.abs()),
        (None, _) => Ok(0.0),
    }
}

pub(super) fn skipped(subject: &Subject<'_>) -> Found {
    let mut tones = 0;
    let (count, worst, of) = each(subject, true, |method| {
        let bench = layout(2500, super::BINS);
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

pub(super) fn run(subject: &Subject<'_>) -> Found {
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
        "{count} kinds over {seconds} s in {total} frames, {tones} of which keep a tone's frequency, within {worst:.1e} Hz ({of})"
    ))
}

pub(super) fn precision(subject: &Subject<'_>) -> Found {
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

/// How far apart the magnitudes of two methods' signals are at the start and at the end, in dB.
fn apart(subject: &Subject<'_>, [single, double]: &[Method; 2], total: u64) -> Result<(f64, f64), Not> {
    let bench = layout(500, FEW_BINS);
    let tones = |_: u64, k: usize| lobe(LOW_TONE, k) + 0.5 * lobe(14.8, k);
    let mut pair =
        [single.begin(subject, bench, frames(tones))?, double.begin(subject, bench, frames(tones))?];
    let look = |pair: &mut [Heard; 2]| {
        let [single, double] = pair;
        let (a, b) = (single.next(LOOK)?, double.next(LOOK)?);
        let layout = framing(&bench);
        let frames = a.len() - layout.fft_len;
        let wanted: Vec<f32> = figures::magnitudes(&b, &layout, frames).iter().map(|m| *m as f32).collect();
        let found = figures::score(&wanted, &layout, &a).map_err(|e| Not::Held(e.to_string()))?;
        Ok::<f64, Not>(found.convergence_db)
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
