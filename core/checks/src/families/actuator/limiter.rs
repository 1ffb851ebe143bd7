//! The limiter under every kind of signal, and the limits of a graph's own actuator.

use std::f64::consts::TAU;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use asperity_actuator::{Drive, Dynamics, Plant};
use asperity_node::random::{bits, uniform};
use asperity_node::{Buffer, NodeKind, Role, ShapeSpec};

use super::{ACTUATORS, limiters, named, shipped, unit};
use crate::case::{Found, Stop, fails, holds, not_applicable};
use crate::played::{Motion, Played, Samples};
use crate::rig::{CaseGraph, Rig};
use crate::subject::Subject;
use crate::wrap::after;

/// Part by which the rms current may exceed the rating, as the limiter promises.
const RMS_MARGIN: f64 = 0.01;

/// Limits that a limiter states.
#[derive(Clone, Copy, Debug, Default)]
struct Promise {
    /// A sine at the peak passes up to this frequency \[Hz\].
    slew_hz: Option<f64>,
    /// Corner of the DC removal \[Hz\].
    dc_corner_hz: Option<f64>,
}

/// A simulated coil, apart from any limiter, and the worst that the drive did to it.
struct Judge {
    dynamics: Dynamics,
    drive: Drive,
    rate_hz: f64,
    promise: Promise,
    coil: Plant,
    last: f32,
    heat: f64,
    hottest: f64,
    sum: f64,
    /// Largest step from sample to sample \[A or V\].
    steepest: f64,
    /// Largest sample \[A or V\].
    largest: f64,
    /// Largest displacement \[m\].
    farthest: f64,
    /// Speed of the mover now \[m/s\].
    speed: f64,
}

impl Judge {
    fn new(dynamics: Dynamics, drive: Drive, rate_hz: f64, promise: Promise) -> Self {
        Self {
            dynamics,
            drive,
            rate_hz,
            promise,
            coil: Plant::new(&dynamics, drive, rate_hz),
            last: 0.0,
            heat: 0.0,
            hottest: 0.0,
            sum: 0.0,
            steepest: 0.0,
            largest: 0.0,
            farthest: 0.0,
            speed: 0.0,
        }
    }

    /// The largest allowed sample \[A or V\].
    fn peak(&self) -> f64 {
        match self.drive {
            Drive::Current => self.dynamics.peak_current,
            Drive::Voltage => self.dynamics.peak_voltage,
        }
    }

    /// Takes the next sample and checks its limits. [`verdict`](Self::verdict) checks those of the coil.
    ///
    /// # Errors
    /// The sample is beyond a limit.
    fn see(&mut self, sample: f32) -> Result<(), String> {
        if !sample.is_finite() {
            return Err(format!("a sample is {sample}"));
        }
        let (y, peak, unit) = (f64::from(sample), self.peak(), self.drive.unit());
        let step = (y - f64::from(self.last)).abs();
        self.last = sample;
        (self.largest, self.steepest) = (self.largest.max(y.abs()), self.steepest.max(step));
        if y.abs() > peak {
            return Err(format!("{y} {unit} is over the peak of {peak} {unit}"));
        }
        let slew = self.promise.slew_hz.map(|hz| (TAU * hz * peak / self.rate_hz).min(2.0 * peak));
        if let Some(slew) = slew.filter(|slew| step > *slew) {
            return Err(format!("a step of {step:.4} {unit} is over the slew of {slew:.4} {unit}"));
        }
        let motion = self.coil.step(y);
        self.speed = motion.velocity;
        let part = 1.0 / (self.rate_hz * self.dynamics.thermal_time_constant);
        self.heat += (motion.current * motion.current - self.heat) * part;
        self.hottest = self.hottest.max(self.heat);
        self.farthest = self.farthest.max(motion.displacement.abs());
        self.sum += y;
        Ok(())
    }

    /// Largest rms current over the thermal time constant, as a part of the rated one.
    fn rms(&self) -> f64 {
        self.hottest.sqrt() / self.dynamics.rated_current
    }

    /// Largest displacement, as a part of the stroke.
    fn stroke(&self) -> f64 {
        self.farthest / self.dynamics.stroke
    }

    /// Checks the limits of the coil.
    ///
    /// # Errors
    /// The coil is beyond a limit.
    fn verdict(&self) -> Result<(), String> {
        if self.stroke() > 1.0 {
            return Err(format!("the mover went to {:.3} of its stroke", self.stroke()));
        }
        if self.rms() > 1.0 + RMS_MARGIN {
            return Err(format!("the rms current was {:.3} of the rated one", self.rms()));
        }
        let area = self.sum.abs() / self.rate_hz;
        let bound = self.promise.dc_corner_hz.map(|hz| 8.0 * self.peak() / (TAU * hz));
        if let Some(bound) = bound.filter(|bound| area > *bound) {
            let unit = self.drive.unit();
            return Err(format!(
                "the mean is {area:.3} {unit} s over the time, and at most {bound:.3} {unit} s"
            ));
        }
        Ok(())
    }
}

/// A limiter in its place.
#[derive(Clone, Copy, Debug)]
pub struct Place<'a> {
    /// Its kind.
    pub kind: &'a str,
    /// A shipped actuator, and the mass of its handle in g.
    pub actuator: (&'a str, f64),
    /// Current or voltage drive.
    pub drive: Drive,
    /// Samples a second.
    pub rate_hz: u32,
    /// Its parameters `slew_hz` and `dc_corner_hz` \[Hz\].
    pub settings: (f64, f64),
}

/// A piece of a limiter's input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece {
    /// Its signal.
    pub sound: Sound,
    /// Its amplitude, in peaks.
    pub peaks: f64,
    /// Whether the input is valid; else the limiter mutes.
    pub trusted: bool,
    /// Its length in samples.
    pub samples: u32,
}

/// The signal of a piece; frequencies in Hz.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs)]
pub enum Sound {
    Silence,
    Noise,
    Sine(f64),
    Square(f64),
    Constant,
    /// 35 of every 700 samples.
    Pulses,
    /// Any number that is finite.
    Bits,
    /// Follows the speed of the mover, which puts in most energy.
    Spite,
}

/// Tick rate. A signal that follows the mover is a tick late.
const TICK_HZ: u32 = 4000;

/// Figures of the coil.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stood {
    /// Largest rms current, as a part of the rated one.
    pub rms: f64,
    /// Largest displacement, as a part of the stroke.
    pub stroke: f64,
}

/// Sends pieces through a limiter to a simulated coil. `None` where the limiter cannot be in that place.
///
/// # Errors
/// A limit that does not hold.
pub fn limited(
    subject: &Subject<'_>,
    place: Place<'_>,
    seed: u64,
    pieces: &[Piece],
) -> Result<Option<Stood>, Stop> {
    let Place { kind, actuator, drive, rate_hz, settings: (slew_hz, dc_hz) } = place;
    // The actuator may not take such a handle.
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
    let graph = CaseGraph::new(TICK_HZ, rate_hz)
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
            return fails(format!("a fault in {:?} of {place:?}", pieces[which]));
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

/// A random place and random pieces.
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
                // With the rounding of f32.
                let own = TAU * d.natural_hz() / f64::from(RATE_HZ) * judge.peak() * 1.0001;
                let mut rig = CaseGraph::new(500, RATE_HZ)
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
        "{seconds} s each: at most {rms:.3} of the rated current, {stroke:.3} of the stroke; the largest \
         step is {steepest:.3} of the sine's"
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

/// A wild stylus: a second each of strokes at up to 1.5 m/s, jumps in every tick, taps at 20 Hz, and random
/// heights.
fn thrown(hz: f64) -> Motion {
    Arc::new(move |tick| {
        let t = tick as f64 / hz;
        let any = |which: u64| 2.0 * uniform(which, tick) - 1.0;
        match tick / hz as u64 % 4 {
            0 => [50.0 * (30.0 * t).sin(), 50.0 * (17.0 * t).cos(), -3.0 + 3.0 * (5.0 * t).sin()],
            1 => [60.0 * any(1), 60.0 * any(2), 10.0 * any(3) - 4.0],
            2 => [20.0 * t, 3.0, 4.0 * (125.7 * t).sin()],
            _ => [40.0 * t.sin(), 40.0 * t.cos(), 20.0 * any(4)],
        }
    })
}

/// A kind whose frames are nonsense.
fn spoiled(kind: Arc<NodeKind>) -> Arc<NodeKind> {
    after(kind, |tick| {
        let index = tick.index;
        for buffer in tick.outputs.buffers() {
            if let Buffer::Magnitude { bins, frame: Some(_), .. } = buffer {
                // Every seventh frame is silent, so that the next follows silence.
                let level = if index % 7 == 0 { 0.0 } else { 10_f64.powf(9.0 * uniform(5, index) - 3.0) };
                for (i, bin) in bins.iter_mut().enumerate() {
                    *bin = (level * uniform(6, 4096 * index + i as u64)) as f32;
                }
            }
        }
    })
}

pub(super) fn own(subject: &Subject<'_>) -> Found {
    let graph = subject.its_graph()?;
    let hz = f64::from(graph.tick_hz);
    let asks = |kind: &&Arc<NodeKind>| {
        let d = kind.descriptor();
        let frames = d.outputs.iter().any(|o| matches!(o.shape, ShapeSpec::Magnitude(_)));
        frames && graph.nodes.iter().any(|n| n.kind == d.kind)
    };
    let networks: Vec<Arc<NodeKind>> = subject.registry().iter().filter(asks).cloned().collect();
    let mut worse = subject.clone();
    for kind in &networks {
        worse = worse.with(spoiled(kind.clone()));
    }
    let mut found = Vec::new();
    let runs = if networks.is_empty() {
        vec![("as it is", subject)]
    } else {
        vec![("as it is", subject), ("nonsense", &worse)]
    };
    for (name, subject) in runs {
        let mut rig = Rig::moved_if_possible(subject, thrown(hz))?;
        let mut judges = judges(&rig)?;
        let ticks = rig.ticks(subject.by_effort(4.0, 12.0, 300.0));
        rig.run(ticks, |rig, tick| {
            for (judge, samples) in judges.iter_mut().zip(rig.drive()) {
                for y in samples {
                    judge.see(*y).map_err(|wrong| format!("{wrong}, tick {tick}, {name}"))?;
                }
            }
            Ok(())
        })?;
        for judge in &judges {
            judge.verdict().map_err(|wrong| format!("{wrong}, {name}"))?;
        }
        let faults = rig.engine.faults();
        holds(faults == 0, || format!("{faults} faults, {name}"))?;
        let most = |of: fn(&Judge) -> f64| judges.iter().map(of).fold(0.0, f64::max);
        found.push(format!(
            "{name}: {:.3} of the peak, {:.3} of the stroke, {:.3} of the rated current",
            most(|j| j.largest / j.peak()),
            most(Judge::stroke),
            most(Judge::rms)
        ));
    }
    Ok(found.join("; "))
}

/// A judge for each sound card, by the limiter before it.
fn judges(rig: &Rig) -> Result<Vec<Judge>, Stop> {
    let mut all = Vec::new();
    for (_, out) in rig.schedule.with_role(Role::AudioOutput) {
        let Some(input) = out.inputs.first() else { continue };
        let (Some((from, _)), Some(port)) = (input.from, &input.port) else { continue };
        let limiter = &rig.schedule.nodes[from];
        let Some(dynamics) = named(&limiter.params) else {
            return not_applicable(format!("`{}` does not say of which actuator it is", limiter.id));
        };
        let drive = if port.unit.symbol() == "V" { Drive::Voltage } else { Drive::Current };
        // `limiter_random` checks the mean.
        let promise = Promise { slew_hz: limiter.params.get_number("slew_hz"), dc_corner_hz: None };
        all.push(Judge::new(dynamics?, drive, f64::from(rig.schedule.audio_hz), promise));
    }
    if all.is_empty() { not_applicable("nothing in this graph plays on a sound card") } else { Ok(all) }
}
