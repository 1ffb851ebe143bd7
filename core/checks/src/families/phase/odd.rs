//! Frames that no signal has: by turns, in jumps, with numbers that are no magnitudes, or not at all.

use std::ops::Range;
use std::sync::Arc;

use asperity_node::{Buffer, InputRef, Inputs, NodeKind, Outputs, Tick};

use super::bench::{BINS, Method, decibels, frames, layout, lobe, power};
use super::{TONE, asked, each};
use crate::case::{Found, Not, holds};
use crate::played::Frames;
use crate::subject::Subject;
use crate::wrap;

/// Another tone.
const OTHER: f64 = 62.8;
/// Frames before anything happens.
const START: u64 = 300;
/// Frames over which a level is measured.
const LEVEL: u64 = 250;

/// Holds what is heard of troubled frames against what is heard of a tone: after the trouble the level must come back. Answers how far off it is, in dB, and the
/// energy while it lasted and until it had settled.
fn comes_back(
    subject: &Subject<'_>,
    method: &Method,
    troubled: &Subject<'_>,
    frames_of: &Frames,
    trouble: Range<u64>,
) -> Result<(f64, f64), Not> {
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

pub(super) fn alternating(subject: &Subject<'_>) -> Found {
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
            // Until it has settled there is a tone again.
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

pub(super) fn levels(subject: &Subject<'_>) -> Found {
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

/// What stands in a bin instead of a magnitude.
type Instead = fn(u64, usize) -> Option<f32>;

/// A kind that is given something else than magnitudes in some frames: the engine would let none of it through to it.
fn misled(inner: Arc<dyn NodeKind>, frames: Range<u64>, instead: Instead) -> Arc<dyn NodeKind> {
    let make = move |setup: &asperity_node::Setup<'_>| -> wrap::Process {
        let mut given = setup.input(0).map(|port| Buffer::new(port, setup.tick_hz));
        let frames = frames.clone();
        Box::new(move |node, tick| {
            let (Some(buffer), Some(frame)) = (&mut given, tick.inputs.magnitude(0)) else {
                return node.process(tick);
            };
            if !frames.contains(&frame.index) {
                return node.process(tick);
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
            node.process(&mut Tick { index: tick.index, tick_hz: tick.tick_hz, inputs, outputs })
        })
    };
    wrap::wrap(inner, Arc::new(make))
}

pub(super) fn no_magnitudes(subject: &Subject<'_>) -> Found {
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

pub(super) fn missing_frames(subject: &Subject<'_>) -> Found {
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
        // In the second without frames.
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

/// What frames stay away, for how many frames, and which.
type Gap = (&'static str, u64, fn(u64) -> bool);
