//! The limiter, driven by all that could be.

use std::f64::consts::TAU;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use asperity_actuator::{Drive, Dynamics};
use asperity_node::random::{bits, uniform};

use super::judge::{Judge, Promise};
use super::{ACTUATORS, limiters, shipped, unit};
use crate::case::{Found, Not, holds};
use crate::played::{Played, Samples};
use crate::small::Small;
use crate::subject::Subject;

/// A limiter in its place.
#[derive(Clone, Copy, Debug)]
pub struct Place<'a> {
    /// Its kind.
    pub kind: &'a str,
    /// A shipped actuator, and the mass of its handle in g.
    pub actuator: (&'a str, f64),
    /// What the amplifier puts out.
    pub drive: Drive,
    /// Samples a second.
    pub rate_hz: u32,
    /// Its parameters `slew_hz` and `dc_corner_hz` \[Hz\].
    pub settings: (f64, f64),
}

/// A piece of what a limiter is given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece {
    /// What it is.
    pub sound: Sound,
    /// How loud, in peaks.
    pub peaks: f64,
    /// Whether the input is to be trusted; else the limiter mutes.
    pub trusted: bool,
    /// How long, in samples.
    pub samples: u32,
}

/// What a piece is; frequencies in Hz.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs)]
pub enum Sound {
    Silence,
    Noise,
    Sine(f64),
    Square(f64),
    Constant,
    /// A twentieth of 700 samples.
    Pulses,
    /// Any number that is finite.
    Bits,
    /// As the mover goes: with what puts in most energy.
    Spite,
}

/// Ticks a second: what follows the mover is as old as a tick.
const TICK_HZ: u32 = 4000;

/// What became of the coil.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stood {
    /// Largest rms current, as a part of the rated one.
    pub rms: f64,
    /// Farthest place of the mover, as a part of the stroke.
    pub stroke: f64,
}

/// Sends pieces through a limiter to a simulated coil. `None` where there can be no limiter in that place.
///
/// # Errors
/// What does not hold.
pub fn limited(
    subject: &Subject<'_>,
    place: Place<'_>,
    seed: u64,
    pieces: &[Piece],
) -> Result<Option<Stood>, Not> {
    let Place { kind, actuator, drive, rate_hz, settings: (slew_hz, dc_hz) } = place;
    // A handle that the actuator cannot be on.
    let Ok(d) = shipped(actuator.0, actuator.1) else { return Ok(None) };
    let promise = Promise { slew_hz: Some(slew_hz), dc_corner_hz: Some(dc_hz) };
    let mut judge = Judge::new(d, drive, f64::from(rate_hz), promise);
    let speed = Arc::new(AtomicU64::new(0));
    let sound = sounds(pieces.to_vec(), judge.peak(), seed, f64::from(rate_hz), speed.clone());
    let played = Played::audio_in_hand("a drive from memory", unit(drive), sound);
    let [grams, slew, dc] = [actuator.1, slew_hz, dc_hz].map(|x| format!("{x:?}"));
    let mut params = vec![("profile", actuator.0), ("handle_mass_g", grams.as_str())];
    let known = subject.kind(kind)?;
    for (name, text) in [("slew_hz", &slew), ("dc_corner_hz", &dc)] {
        if known.descriptor().params.iter().any(|p| p.name == name) {
            params.push((name, text));
        }
    }
    let graph = Small::new(TICK_HZ, rate_hz)
        .plays("asked", played)?
        .node("limiter", kind, &params)?
        .node("out", "audio_out", &[])?
        .chain(&["asked", "limiter", "out"]);
    let Ok(mut rig) = graph.rig(subject) else { return Ok(None) };
    let hand = rig.schedule.index_of("asked").unwrap_or(0);
    let (mut at, mut which) = (0_u64, 0);
    let all: u64 = pieces.iter().map(|p| u64::from(p.samples)).sum();
    while at < all {
        while which + 1 < pieces.len() && begin(pieces, which + 1) <= at {
            which += 1;
        }
        rig.engine.feed_control(hand, 0, &[0.0], pieces[which].trusted);
        rig.run(1, |rig, _| {
            let samples = rig.drive().next().unwrap_or_default();
            at += samples.len() as u64;
            for y in samples {
                judge.see(*y).map_err(|wrong| format!("{wrong}, in {:?} of {place:?}", pieces[which]))?;
            }
            Ok(())
        })?;
        speed.store(judge.speed.to_bits(), Ordering::Relaxed);
        if rig.engine.faults() > 0 {
            return Err(Not::Held(format!("a fault in {:?} of {place:?}", pieces[which])));
        }
    }
    judge.verdict().map_err(|wrong| format!("{wrong}: {place:?}"))?;
    Ok(Some(Stood { rms: judge.rms(), stroke: judge.stroke() }))
}

/// The first sample of a piece.
fn begin(pieces: &[Piece], which: usize) -> u64 {
    pieces.iter().take(which).map(|p| u64::from(p.samples)).sum()
}

fn sounds(pieces: Vec<Piece>, peak: f64, seed: u64, rate: f64, speed: Arc<AtomicU64>) -> Samples {
    let ends: Vec<u64> = (1..=pieces.len()).map(|k| begin(&pieces, k)).collect();
    Arc::new(move |first, out| {
        let along = f64::from_bits(speed.load(Ordering::Relaxed));
        for (x, n) in out.iter_mut().zip(first..) {
            let Some(piece) = ends.iter().position(|end| n < *end).and_then(|k| pieces.get(k)) else {
                continue;
            };
            let turn = |hz: f64| (TAU * (hz * n as f64 % rate) / rate).sin();
            let any = f32::from_bits(bits(seed, n) as u32);
            let a = piece.peaks;
            *x = match piece.sound {
                Sound::Silence => 0.0,
                Sound::Noise => a * (2.0 * uniform(seed, n) - 1.0),
                Sound::Sine(hz) => a * turn(hz),
                Sound::Square(hz) => a.copysign(turn(hz)),
                Sound::Constant => a,
                Sound::Pulses => a * f64::from(u8::from(n % 700 < 35)),
                Sound::Bits if any.is_finite() => f64::from(any) / peak,
                Sound::Bits => 1e30,
                Sound::Spite => a.copysign(along),
            } as f32
                * peak as f32;
            *x = x.clamp(f32::MIN, f32::MAX);
        }
    })
}

/// Pieces, and where they go, from random numbers.
fn drawn(seed: u64, kinds: &[String]) -> (Place<'_>, Vec<Piece>) {
    let mut count = 0;
    let mut next = || {
        count += 1;
        uniform(seed, count)
    };
    let mut log = |from: f64, to: f64| from * (to / from).powf(next());
    let grams = log(5.0, 2000.0);
    let settings = (log(500.0, 20_000.0), log(0.5, 20.0));
    let mut pick = |n: usize| ((next() * n as f64) as usize).min(n - 1);
    let place = Place {
        kind: &kinds[pick(kinds.len())],
        actuator: (ACTUATORS[pick(ACTUATORS.len())].0, grams),
        drive: [Drive::Current, Drive::Voltage][pick(2)],
        rate_hz: [8000, 44_100, 48_000, 96_000][pick(4)],
        settings,
    };
    let mut trusted = true;
    let pieces = (0..1 + pick(13)).map(|_| {
        let hz = 10_f64.powf(4.3 * next());
        let near = 40.0 + 80.0 * next();
        let sounds = [
            Sound::Silence,
            Sound::Noise,
            Sound::Sine(hz),
            Sound::Sine(near),
            Sound::Square(hz),
            Sound::Square(near),
            Sound::Constant,
            Sound::Pulses,
            Sound::Bits,
            Sound::Spite,
        ];
        let sound = sounds[((next() * sounds.len() as f64) as usize).min(sounds.len() - 1)];
        trusted ^= next() < 0.1;
        Piece {
            sound,
            peaks: 10_f64.powf(6.0 * next() - 3.0),
            trusted,
            samples: 1 + (6000.0 * next()) as u32,
        }
    });
    (place, pieces.collect())
}

pub(super) fn random(subject: &Subject<'_>) -> Found {
    let kinds = limiters(subject)?;
    let runs = subject.by_effort(40, 400, 20_000);
    let (mut held, mut rms, mut stroke) = (0_u64, 0.0_f64, 0.0_f64);
    for seed in 0..runs {
        let (place, pieces) = drawn(seed, &kinds);
        if let Some(stood) = limited(subject, place, seed, &pieces)? {
            held += 1;
            (rms, stroke) = (rms.max(stood.rms), stroke.max(stood.stroke));
        }
    }
    holds(2 * held > runs, || format!("there was a limiter in {held} of {runs} places only"))?;
    Ok(format!(
        "{held} coils went to at most {stroke:.3} of their stroke and {rms:.3} of their rated current"
    ))
}

/// Sines at the peak on the resonance.
pub(super) fn resonance(subject: &Subject<'_>) -> Found {
    const RATE_HZ: u32 = 48_000;
    let seconds = subject.by_effort(5.0, 60.0, 600.0);
    let (mut rms, mut stroke, mut steepest) = (0.0_f64, 0.0_f64, 0.0_f64);
    for kind in limiters(subject)? {
        for (profile, grams) in ACTUATORS {
            let d = shipped(profile, grams)?;
            for drive in [Drive::Current, Drive::Voltage] {
                let place = format!("`{kind}`, {profile} on {grams} g, {drive:?}");
                let mut judge = Judge::new(d, drive, f64::from(RATE_HZ), Promise::default());
                // Of f32, a step of which the last bits are rounded.
                let own = TAU * d.natural_hz() / f64::from(RATE_HZ) * judge.peak() * 1.0001;
                let mut rig = Small::new(500, RATE_HZ)
                    .plays(
                        "asked",
                        Played::audio("a resonance from memory", unit(drive), tone(&d, judge.peak())),
                    )?
                    .node(
                        "limiter",
                        &kind,
                        &[("profile", profile), ("handle_mass_g", &format!("{grams:?}"))],
                    )?
                    .node("out", "audio_out", &[])?
                    .chain(&["asked", "limiter", "out"])
                    .rig(subject)?;
                rig.run(rig.ticks(seconds), |rig, tick| {
                    for y in rig.drive().flatten() {
                        judge.see(*y).map_err(|wrong| format!("{wrong}, tick {tick}: {place}"))?;
                    }
                    Ok(())
                })?;
                judge.verdict().map_err(|wrong| format!("{wrong}: {place}"))?;
                holds(judge.steepest <= own, || {
                    format!("a step of {:.5} clicks, the sine's own are {own:.5}: {place}", judge.steepest)
                })?;
                holds(rig.engine.faults() == 0, || format!("{} faults: {place}", rig.engine.faults()))?;
                (rms, stroke) = (rms.max(judge.rms()), stroke.max(judge.stroke()));
                steepest = steepest.max(judge.steepest / own);
            }
        }
    }
    Ok(format!(
        "{seconds} s each: at most {rms:.3} of the rated current, {stroke:.3} of the stroke; the largest step is {steepest:.3} of the sine's"
    ))
}

fn tone(d: &Dynamics, peak: f64) -> Samples {
    let hz = d.natural_hz();
    Arc::new(move |first, out| {
        for (x, n) in out.iter_mut().zip(first..) {
            *x = (peak * (TAU * (hz * n as f64 % 48_000.0) / 48_000.0).sin()) as f32;
        }
    })
}
