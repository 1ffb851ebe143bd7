//! The limiter under every kind of signal, and the limits of a graph's own actuator.

use std::f64::consts::TAU;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use asperity_actuator::{Drive, Dynamics, Plant};
use asperity_node::random::{bits, uniform};
use asperity_node::{Buffer, NodeKind, Role, ShapeSpec, Unit};

use super::{ACTUATORS, limiters, named, on_shipped};
use crate::case::{Figures, Found, Stop, not_applicable};
use crate::played::{Motion, Played, Samples};
use crate::rig::{CaseGraph, Rig};
use crate::subject::Subject;
use crate::wrap::after;

/// Part by which the rms current may exceed the rating, as the limiter promises.
const RMS_MARGIN: f64 = 0.01;

/// A simulated coil, apart from any limiter, and the worst that the drive did to it.
struct Judge {
    dynamics: Dynamics,
    drive: Drive,
    rate_hz: f64,
    /// Largest allowed sample, and step from sample to sample where it is stated \[A or V\].
    peak: f64,
    slew: Option<f64>,
    coil: Plant,
    last: f64,
    heat: f64,
    sum: f64,
    /// Largest sample, rms current over the thermal time constant and displacement, as parts of the peak, of
    /// the rated current and of the stroke.
    most: [f64; 3],
    /// Speed of the mover now \[m/s\].
    speed: f64,
}

impl Judge {
    /// A sine at the peak passes up to `slew_hz`.
    fn new(dynamics: Dynamics, drive: Drive, rate_hz: f64, slew_hz: Option<f64>) -> Self {
        let peak = if drive == Drive::Current { dynamics.peak_current } else { dynamics.peak_voltage };
        Self {
            dynamics,
            drive,
            rate_hz,
            peak,
            slew: slew_hz.map(|hz| (TAU * hz * peak / rate_hz).min(2.0 * peak)),
            coil: Plant::new(&dynamics, drive, rate_hz),
            last: 0.0,
            heat: 0.0,
            sum: 0.0,
            most: [0.0; 3],
            speed: 0.0,
        }
    }

    /// Takes the next sample and checks its limits. [`verdict`](Self::verdict) checks those of the coil.
    fn see(&mut self, sample: f32) -> Result<(), Stop> {
        ensure!(sample.is_finite(), "a sample is {sample}");
        let (y, peak, unit, d) = (f64::from(sample), self.peak, self.drive.unit(), &self.dynamics);
        let step = (y - self.last).abs();
        self.last = y;
        ensure!(y.abs() <= peak, "{y} {unit} is over the peak of {peak} {unit}");
        if let Some(slew) = self.slew {
            ensure!(step <= slew, "a step of {step:.5} {unit} is over the slew of {slew:.5} {unit}");
        }
        let motion = self.coil.step(y);
        self.speed = motion.velocity;
        let part = 1.0 / (self.rate_hz * d.thermal_time_constant);
        self.heat += (motion.current * motion.current - self.heat) * part;
        self.sum += y;
        let now = [y.abs() / peak, self.heat.sqrt() / d.rated_current, motion.displacement.abs() / d.stroke];
        self.most = [0, 1, 2].map(|i| self.most[i].max(now[i]));
        Ok(())
    }

    /// Checks the limits of the coil, and of the mean where the corner of the DC removal is known \[Hz\].
    fn verdict(&self, dc_corner_hz: Option<f64>, figures: &mut Figures) -> Result<(), Stop> {
        let [peak, rms, stroke] = self.most;
        figures.note(peak, "of the peak");
        figures.at_most(stroke, 1.0, "of its stroke")?;
        figures.at_most(rms, 1.0 + RMS_MARGIN, "of the rated current")?;
        if let Some(hz) = dc_corner_hz {
            let (area, bound) = (self.sum.abs() / self.rate_hz, 8.0 * self.peak / (TAU * hz));
            let unit = self.drive.unit();
            ensure!(area <= bound, "the mean is {area:.3} {unit} s over the time; the bound is {bound:.3}");
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
    /// Its parameters `slew_hz` and `dc_corner_hz` \[Hz\]; its defaults without.
    pub settings: Option<(f64, f64)>,
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

/// Sends pieces through a limiter to a simulated coil. Answers whether the limiter can be in that place.
///
/// # Errors
/// A limit that does not hold.
pub fn limited(subject: &Subject<'_>, place: Place<'_>, seed: u64, pieces: &[Piece]) -> Result<bool, Stop> {
    judged(subject, place, seed, pieces, None, &mut Figures::default())
}

/// The same. No step may be larger than `clicks`, if that is given \[A or V\].
fn judged(
    subject: &Subject<'_>,
    place: Place<'_>,
    seed: u64,
    pieces: &[Piece],
    clicks: Option<f64>,
    figures: &mut Figures,
) -> Result<bool, Stop> {
    let Place { kind, actuator: (profile, grams), drive, rate_hz, settings } = place;
    // The actuator may not take such a handle.
    let Ok(d) = on_shipped(profile, grams) else { return Ok(false) };
    let mut judge = Judge::new(d, drive, f64::from(rate_hz), settings.map(|it| it.0));
    judge.slew = judge.slew.or(clicks);
    let speed = Arc::new(AtomicU64::new(0));
    let sound = sounds(pieces.to_vec(), judge.peak, seed, f64::from(rate_hz), speed.clone());
    let unit = if drive == Drive::Current { Unit::AMPERE } else { Unit::VOLT };
    let numbers = settings.map_or(vec![], |(slew, dc)| vec![("slew_hz", slew), ("dc_corner_hz", dc)]);
    let known = subject.kind(kind)?;
    let known = |name: &str| known.descriptor().params.iter().any(|p| p.name == name);
    let numbers = [("handle_mass_g", grams)].into_iter().chain(numbers.into_iter().filter(|it| known(it.0)));
    let numbers: Vec<(&str, String)> = numbers.map(|(name, x)| (name, format!("{x:?}"))).collect();
    let params: Vec<(&str, &str)> = numbers.iter().map(|(name, text)| (*name, text.as_str())).collect();
    let graph = CaseGraph::new(TICK_HZ, rate_hz)
        .plays("asked", Played::audio_in_hand("a drive from memory", unit, sound))?
        .node("limiter", kind, &[&[("profile", profile)], params.as_slice()].concat())?
        .node("out", "audio_out", &[])?
        .chain(&["asked", "limiter", "out"]);
    let Ok(mut rig) = graph.rig(subject) else { return Ok(false) };
    let hand = rig.schedule.index_of("asked").unwrap_or(0);
    let mut at = 0_u64;
    let ends = ends(pieces);
    while let Some(piece) = pieces.get(ends.partition_point(|end| *end <= at)) {
        rig.engine.feed_control(hand, 0, &[0.0], piece.trusted);
        let told = |e: Stop| e.after(&format!("in {piece:?} of {place:?}"));
        rig.run(1, |rig, _| {
            let samples = rig.drive().next().unwrap_or_default();
            at += samples.len() as u64;
            samples.iter().try_for_each(|y| judge.see(*y)).map_err(told)
        })?;
        speed.store(judge.speed.to_bits(), Ordering::Relaxed);
        rig.sound().map_err(told)?;
    }
    judge.verdict(settings.map(|it| it.1), figures).map_err(|e| e.after(&format!("{place:?}")))?;
    Ok(true)
}

/// The end of each piece, in samples.
fn ends(pieces: &[Piece]) -> Vec<u64> {
    (1..=pieces.len()).map(|n| pieces[..n].iter().map(|p| u64::from(p.samples)).sum()).collect()
}

fn sounds(pieces: Vec<Piece>, peak: f64, seed: u64, rate: f64, speed: Arc<AtomicU64>) -> Samples {
    let ends = ends(&pieces);
    Arc::new(move |first, out| {
        let along = f64::from_bits(speed.load(Ordering::Relaxed));
        for (x, n) in out.iter_mut().zip(first..) {
            let Some(piece) = pieces.get(ends.partition_point(|end| *end <= n)) else { continue };
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
    let settings = Some((log(500.0, 20_000.0), log(0.5, 20.0)));
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
        use Sound::{Bits, Constant, Noise, Pulses, Silence, Sine, Spite, Square};
        let usual = [Silence, Noise, Sine(hz), Sine(near), Square(hz)];
        let sounds = [usual, [Square(near), Constant, Pulses, Bits, Spite]].concat();
        let sound = sounds[((next() * sounds.len() as f64) as usize).min(sounds.len() - 1)];
        trusted ^= next() < 0.1;
        let peaks = 10_f64.powf(6.0 * next() - 3.0);
        Piece { sound, peaks, trusted, samples: 1 + (6000.0 * next()) as u32 }
    });
    (place, pieces.collect())
}

pub(super) fn random(subject: &Subject<'_>) -> Found {
    let (kinds, mut figures) = (limiters(subject)?, Figures::default());
    let runs = subject.by_effort(40, 400, 20_000);
    let mut held = 0_u64;
    for seed in 0..runs {
        let (place, pieces) = drawn(seed, &kinds);
        held += u64::from(judged(subject, place, seed, &pieces, None, &mut figures)?);
    }
    ensure!(2 * held > runs, "there was a limiter in {held} of {runs} places only");
    Ok(format!("{held} coils: {figures}"))
}

/// Sines at the peak on the resonance.
pub(super) fn resonance(subject: &Subject<'_>) -> Found {
    let seconds = subject.by_effort(5, 60, 600);
    let (rate_hz, mut figures) = (48_000, Figures::default());
    for kind in &limiters(subject)? {
        for (actuator, drive) in
            ACTUATORS.into_iter().flat_map(|a| [(a, Drive::Current), (a, Drive::Voltage)])
        {
            let d = on_shipped(actuator.0, actuator.1)?;
            let place = Place { kind, actuator, drive, rate_hz, settings: None };
            let sound = Sound::Sine(d.natural_hz());
            let sine = Piece { sound, peaks: 1.0, trusted: true, samples: seconds * rate_hz };
            let peak = Judge::new(d, drive, f64::from(rate_hz), None).peak;
            // The steps of the sine, with the rounding of f32: more would click.
            let own = TAU * d.natural_hz() / f64::from(rate_hz) * peak * 1.0001;
            let is = judged(subject, place, 0, &[sine], Some(own), &mut figures)?;
            ensure!(is, "no limiter: {place:?}");
        }
    }
    Ok(format!("{seconds} s each: {figures}"))
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
    let networks: Vec<Arc<NodeKind>> = subject.registry.iter().filter(asks).cloned().collect();
    let worse = networks.iter().fold(subject.clone(), |all, kind| all.with(spoiled(kind.clone())));
    let mut figures = Figures::default();
    let runs = [("as it is", subject), ("nonsense", &worse)];
    for (name, subject) in runs.into_iter().take(if networks.is_empty() { 1 } else { 2 }) {
        figures.about = name.into();
        let mut rig = Rig::moved_if_possible(subject, thrown(hz))?;
        let mut judges = judges(&rig)?;
        rig.run(rig.ticks(subject.by_effort(4.0, 12.0, 300.0)), |rig, tick| {
            let mut drives = judges.iter_mut().zip(rig.drive());
            let told = |e: Stop| e.after(&format!("tick {tick}, {name}"));
            drives.try_for_each(|(judge, y)| y.iter().try_for_each(|y| judge.see(*y))).map_err(told)
        })?;
        // `limiter_random` checks the mean.
        let verdict = judges.iter().try_for_each(|judge| judge.verdict(None, &mut figures));
        verdict.and_then(|()| rig.sound()).map_err(|e| e.after(name))?;
    }
    Ok(figures.to_string())
}

/// A judge for each sound card, by the limiter before it.
fn judges(rig: &Rig) -> Result<Vec<Judge>, Stop> {
    let mut all = Vec::new();
    for (_, out) in rig.schedule.with_role(Role::AudioOutput) {
        let Some(input) = out.inputs.first() else { continue };
        let (Some((from, _)), Some(port)) = (input.from, &input.port) else { continue };
        let limiter = &rig.schedule.nodes[from];
        let Some(dynamics) = named(&limiter.params) else {
            return not_applicable(format!("`{}` does not name its actuator", limiter.id));
        };
        let drive = if port.unit.symbol() == "V" { Drive::Voltage } else { Drive::Current };
        let slew_hz = limiter.params.get_number("slew_hz");
        all.push(Judge::new(dynamics?, drive, f64::from(rig.schedule.audio_hz), slew_hz));
    }
    if all.is_empty() { not_applicable("nothing in this graph plays on a sound card") } else { Ok(all) }
}
