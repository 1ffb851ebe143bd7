//! Hops that are not all of one length, and ticks without a sample.

use std::sync::Arc;

use super::{Retriever, retrievers, windows};
use crate::case::{Found, Not, holds, not_applicable};
use crate::played::Frames;
use crate::subject::Subject;

/// Bins of the tones, 100 to 800 Hz at windows of 0.1 s: eight, so that where phases are random levels even out.
const BINS: [usize; 8] = [10, 20, 30, 40, 50, 60, 70, 80];
/// By how much the level may differ \[dB\].
const WITHIN_DB: f64 = 3.0;

/// Synthesis, ticks and audio, each uneven and then even.
const PLACES: [[(u32, u32, u32); 2]; 3] = [
    [(44_100, 500, 44_100), (48_000, 500, 48_000)],
    [(2500, 4000, 48_000), (2500, 500, 48_000)],
    [(4410, 997, 44_100), (4410, 882, 44_100)],
];

/// Rms of tones of amplitude 1 behind a kind, at the audio rate \[m/s^2\].
fn level(
    subject: &Subject<'_>,
    kind: &Retriever,
    (rate_hz, tick_hz, audio_hz): (u32, u32, u32),
    seconds: f64,
) -> Result<f64, Not> {
    let Some(windows) = windows(rate_hz, tick_hz) else { return not_applicable("no windows are whole") };
    // A periodic Hann window's transform of a sine on a bin.
    let tone: Frames = Arc::new(|_, bins| {
        bins.fill(0.0);
        for at in BINS {
            for (bin, x) in [(at - 1, 0.5), (at, 1.0), (at + 1, 0.5)] {
                if let Some(bin) = bins.get_mut(bin) {
                    *bin = x;
                }
            }
        }
        true
    });
    let mut rig = kind.chain((tick_hz, audio_hz), windows, tone)?.rig(subject)?;
    let (mut sum, mut count) = (0.0, 0_u64);
    let (settled, ticks) = (rig.ticks(0.4), rig.ticks(0.4 + seconds));
    rig.run(ticks, |rig, tick| {
        if tick >= settled {
            let samples = rig.audio("audio rate", 0);
            sum += samples.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
            count += samples.len() as u64;
        }
        Ok(())
    })?;
    holds(rig.engine.faults() == 0, || format!("`{}` failed at {tick_hz} ticks/s, {rate_hz} Hz", kind.kind))?;
    Ok((sum / count.max(1) as f64).sqrt())
}

pub(super) fn run(subject: &Subject<'_>) -> Found {
    let kinds = retrievers(subject.registry());
    if kinds.is_empty() {
        return not_applicable("no kind retrieves phase");
    }
    let places = subject.by_effort(&PLACES[..2], &PLACES[..], &PLACES[..]);
    let seconds = subject.by_effort(0.5, 1.0, 10.0);
    let (mut most, mut where_most) = (0.0_f64, String::new());
    for kind in &kinds {
        for [uneven, even] in places {
            let [a, b] = [level(subject, kind, *uneven, seconds)?, level(subject, kind, *even, seconds)?];
            let db = 20.0 * (a.max(1e-9) / b.max(1e-9)).log10();
            let place = || format!("`{}` at {} Hz, {} ticks/s", kind.kind, uneven.0, uneven.1);
            holds(db.abs() <= WITHIN_DB, || {
                format!("{}: {db:.1} dB off the level with even hops ({a:.3} and {b:.3})", place())
            })?;
            if db.abs() >= most {
                (most, where_most) = (db.abs(), place());
            }
        }
    }
    Ok(format!("{} kinds, at most {most:.2} dB apart: {where_most}", kinds.len()))
}
