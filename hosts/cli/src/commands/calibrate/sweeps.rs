//! Sweeps that are played and recorded: a quiet one first, which decides the level of the measurement.

use std::cell::RefCell;

use asperity_actuator::identify::{IdentifySettings, Recording, Sweep, SweepSettings, identify};
use asperity_actuator::{ActuatorProfile, Drive};
use asperity_live::view::View;
use asperity_live::{Ended, Listener};
use asperity_node::FactValue;

use super::{Args, DriveKind, amps_per_volt, option, unit, volts_per_volt};
use crate::card::{DeviceArgs, TICK_HZ, Watching, absolute, graph, play};
use crate::failure::{Failure, complain};

/// Seconds from silence to full at the start of a session.
const START_S: f64 = 0.5;
/// From here on is recorded: the ramp of the start multiplies what the limiter puts out, and is over by then.
const RECORD_S: f64 = START_S + 0.1;
/// Silence that is recorded before the sweep, which tells the noise.
const BEFORE_S: f64 = 0.4;
/// Silence after it, in which latency and ringing end.
const AFTER_S: f64 = 1.0;
/// Of the input's full scale, what counts as clipped.
const CLIPPED: f32 = 0.999;
/// How often a recording with gaps is made anew.
const ATTEMPTS: usize = 3;
/// Frames that the device is asked for, unless the command line says otherwise: nobody waits for an answer here, and long blocks
/// bear a busy machine.
const PERIOD: u32 = 1024;

/// What does not change from one sweep to the next.
pub struct Bench<'a> {
    args: &'a Args,
    device: DeviceArgs,
    /// The base profile as a graph names it.
    base: String,
}

/// A sweep that was played, and what was heard meanwhile; both from the same sample on.
#[derive(Debug)]
pub struct Tape {
    /// Behind the limiter \[A or V\].
    pub drive: Vec<f32>,
    /// \[m/s^2\].
    pub acceleration: Vec<f32>,
    /// Whether the limiter changed the sweep.
    pub limited: bool,
    /// Mass of the handle \[g\].
    pub handle_mass_g: f64,
    /// What was asked for \[A or V\].
    pub amplitude: f64,
    /// The device, as a person knows it.
    pub device: String,
    rate_hz: f64,
    time_constant_s: f64,
}

impl Tape {
    /// As the fit wants it.
    pub fn recording(&self) -> Recording<'_> {
        Recording {
            drive: &self.drive,
            acceleration: &self.acceleration,
            rate_hz: self.rate_hz,
            handle_mass_g: self.handle_mass_g,
            limited: self.limited,
            sweep_time_constant_s: Some(self.time_constant_s),
        }
    }

    /// What was heard before the sweep, and from then on.
    pub fn parts(&self) -> (&[f32], &[f32]) {
        let at = (BEFORE_S * self.rate_hz) as usize;
        self.acceleration.split_at(at.min(self.acceleration.len()))
    }
}

/// How a sweep ended.
#[derive(Debug)]
pub enum Outcome {
    /// As it should.
    Whole(Tape),
    /// The input reached its full scale, and the sweep was stopped there: at this frequency \[Hz\].
    Clipped(f64),
}

impl<'a> Bench<'a> {
    /// A bench for what the command line says.
    pub fn new(args: &'a Args) -> Result<Self, Failure> {
        let mut device = args.output.recording_from(args.input_device.as_deref());
        device.card.period.get_or_insert(PERIOD);
        Ok(Self { args, device, base: absolute(&args.base)? })
    }

    /// What a sample of the drive is.
    pub fn drive(&self) -> Drive {
        match self.args.drive {
            DriveKind::Current => Drive::Current,
            DriveKind::Voltage => Drive::Voltage,
        }
    }

    /// The most that card and amplifier can put out \[A or V\].
    pub fn most(&self) -> f64 {
        let gain = match self.drive() {
            Drive::Current => amps_per_volt(self.args),
            Drive::Voltage => volts_per_volt(self.args),
        };
        gain * self.args.volts_at_full_scale
    }

    /// The sweep with all its silences, from the first sample of a session on.
    fn sweep(&self, amplitude: f64, seconds: f64) -> SweepSettings {
        SweepSettings {
            from_hz: self.args.from_hz,
            to_hz: self.args.to_hz,
            seconds,
            amplitude,
            before_s: RECORD_S + BEFORE_S,
            after_s: AFTER_S,
            ..SweepSettings::default()
        }
    }

    /// The sweep, the limiter of the base profile behind it, and both recordings.
    fn nodes(&self, sweep: &SweepSettings, handle_mass_g: f64) -> String {
        let a = self.args;
        let (base, unit) = (&self.base, self.drive().unit());
        format!(
            r#""sweep": (kind: "sweep", params: (from_hz: {:?}, to_hz: {:?}, seconds: {:?}, amplitude: {:?}, fade_ms: {:?},
                 before_s: {:?}, after_s: {:?}, unit: "{unit}")),
               "limiter": (kind: "limiter", params: (profile: {base:?}, handle_mass_g: {handle_mass_g:?})),
               "out": (kind: "audio_out", params: (volts_at_full_scale: {:?}, amps_per_volt: {:?}, volts_per_volt: {:?})),
               "in": (kind: "audio_in", params: (channel: {}, full_scale: {:?})),
               "driven": (kind: "file_out", params: (file: "driven.npy")),
               "heard": (kind: "file_out", params: (file: "heard.npy")),"#,
            sweep.from_hz,
            sweep.to_hz,
            sweep.seconds,
            sweep.amplitude,
            sweep.fade_s * 1e3,
            sweep.before_s,
            sweep.after_s,
            a.volts_at_full_scale,
            amps_per_volt(a),
            volts_per_volt(a),
            a.input_channel,
            a.accelerometer_full_scale,
        )
    }

    /// Plays a sweep and records it; where the recording has gaps, again.
    pub fn play(&self, amplitude: f64, seconds: f64, handle_mass_g: f64) -> Result<Outcome, Failure> {
        for _ in 1..ATTEMPTS {
            match self.play_once(amplitude, seconds, handle_mass_g)? {
                Played::Broken(what) => complain(&format!("{what}: once more\n")),
                Played::To(outcome) => return Ok(outcome),
            }
        }
        match self.play_once(amplitude, seconds, handle_mass_g)? {
            Played::To(outcome) => Ok(outcome),
            Played::Broken(what) => Err(Failure::Machine(format!(
                "{what}, {ATTEMPTS} times in a row: try a longer --period, or a machine with less to do; nothing was written"
            ))),
        }
    }

    fn play_once(&self, amplitude: f64, seconds: f64, handle_mass_g: f64) -> Result<Played, Failure> {
        let settings = self.sweep(amplitude, seconds);
        let rate_hz = f64::from(self.args.rate);
        let sweep = Sweep::new(settings, rate_hz).map_err(|e| Failure::Machine(e.to_string()))?;
        let wires = r#"("sweep", "limiter"), ("limiter", "out"), ("limiter", "driven"), ("in", "heard")"#;
        let made = graph("the measurement", self.args.rate, &self.nodes(&settings, handle_mass_g), wires)?;
        let ticks = (sweep.samples() as f64 / rate_hz * TICK_HZ).ceil() as u64;
        let log = RefCell::new(Log::new((RECORD_S * rate_hz) as u64));
        let limit = CLIPPED * self.args.accelerometer_full_scale as f32;
        let mut disturbances = Disturbances::default();
        let mut view = |view: &View, listener: &Listener| {
            disturbances.look(view, listener);
            log.borrow().clipped.is_none()
        };
        let mut recorded =
            |id: &str, start: u64, samples: &[f32]| log.borrow_mut().take(id, start, samples, limit);
        let watching = Watching { view: &mut view, recorded: &mut recorded };
        let (ended, whole) = play(made, &self.device, START_S, Default::default(), ticks, watching)?;
        let log = log.into_inner();
        if let Some(at) = log.clipped {
            let since = at as f64 / rate_hz - settings.before_s;
            let hz = settings.from_hz * (since / sweep.time_constant_s()).exp();
            return Ok(Played::To(Outcome::Clipped(hz.clamp(settings.from_hz, settings.to_hz))));
        }
        if !whole {
            return Err(Failure::Machine("stopped before the end; nothing was written".into()));
        }
        if let Some(what) = disturbances.what().or_else(|| log.broken()) {
            return Ok(Played::Broken(what));
        }
        Ok(Played::To(Outcome::Whole(Tape {
            drive: log.driven.samples,
            acceleration: log.heard.samples,
            limited: limited(&ended),
            handle_mass_g,
            amplitude,
            device: ended.view.device.clone(),
            rate_hz,
            time_constant_s: sweep.time_constant_s(),
        })))
    }
}

enum Played {
    To(Outcome),
    /// There are gaps, of which a person is told.
    Broken(String),
}

/// What is recorded.
struct Log {
    driven: Track,
    heard: Track,
    /// First sample at which the input is at its full scale.
    clipped: Option<u64>,
}

/// Samples of one sink, from a given one on.
struct Track {
    from: u64,
    samples: Vec<f32>,
    broken: bool,
}

impl Log {
    fn new(from: u64) -> Self {
        let track = || Track { from, samples: Vec::new(), broken: false };
        Self { driven: track(), heard: track(), clipped: None }
    }

    fn take(&mut self, id: &str, start: u64, samples: &[f32], limit: f32) {
        if id == "driven" {
            self.driven.take(start, samples);
            return;
        }
        if self.clipped.is_none()
            && let Some(at) = samples.iter().position(|x| x.abs() >= limit)
        {
            self.clipped = Some(start + at as u64);
        }
        self.heard.take(start, samples);
    }

    fn broken(&self) -> Option<String> {
        (self.driven.broken || self.heard.broken).then(|| "ticks were left out".to_owned())
    }
}

impl Track {
    fn take(&mut self, start: u64, samples: &[f32]) {
        let left_out = self.from.saturating_sub(start).min(samples.len() as u64);
        let samples = &samples[left_out as usize..];
        if samples.is_empty() {
            return;
        }
        self.broken |= start + left_out != self.from + self.samples.len() as u64;
        self.samples.extend_from_slice(samples);
    }
}

/// Gaps in what was played or recorded since the ramp of the start.
#[derive(Debug, Default)]
struct Disturbances {
    before: Option<[u64; 2]>,
    now: [u64; 2],
}

impl Disturbances {
    fn look(&mut self, view: &View, listener: &Listener) {
        self.now = [view.underruns + view.lost_samples + view.xruns, listener.gaps()];
        if view.seconds >= RECORD_S {
            self.before.get_or_insert(self.now);
        }
    }

    fn what(&self) -> Option<String> {
        let before = self.before.unwrap_or(self.now);
        match [self.now[0] - before[0], self.now[1] - before[1]] {
            [0, 0] => None,
            [0, gaps] => Some(format!("the recording has gaps ({gaps} frames)")),
            _ => Some("the device or the machine could not keep up, and the sweep broke off".to_owned()),
        }
    }
}

/// Whether the limiter changed anything, the removal of DC aside.
fn limited(ended: &Ended) -> bool {
    let Some(player) = &ended.player else { return false };
    let engine = player.engine();
    let facts = engine.schedule().index_of("limiter").map(|i| engine.facts(i)).unwrap_or_default();
    facts.iter().any(|f| {
        let counts = f.name.starts_with("limited_") || f.name == "reduced";
        counts && matches!(f.value, FactValue::Count(n) if n > 0)
    })
}

/// The quiet sweep's part of the level.
pub const QUIET: f64 = 0.1;
/// Most of the input's full scale that the measurement is to reach.
const HEADROOM: f64 = 0.7;
/// Least coherence of the quiet sweep: the measurement's noise is a hundredth of its.
const HEARD: f64 = 0.3;
/// Above this coherence the response is known well enough to say what a slower sweep will reach at the resonance.
const WELL_HEARD: f64 = 0.9;
/// Below this part of full scale a card's own noise may be what limits the measurement.
const FAINT: f64 = 0.01;

/// At what level to measure, and what a person should know of it.
#[derive(Debug, PartialEq)]
pub struct Level {
    /// \[A or V\], at most what was asked for.
    pub amplitude: f64,
    /// Part of the input's full scale that it will reach.
    pub reaches: f64,
    /// Why it is not as asked, or what might be better.
    pub note: Option<String>,
}

/// Whether the quiet sweep was heard, and what level the input bears.
pub fn level(
    args: &Args,
    quiet: &Tape,
    asked: f64,
    base: &ActuatorProfile,
    settings: IdentifySettings,
) -> Result<Level, Failure> {
    let channel = args.input_channel;
    let (before, during) = quiet.parts();
    let mean = quiet.acceleration.iter().map(|x| f64::from(*x)).sum::<f64>()
        / quiet.acceleration.len().max(1) as f64;
    let peak = |x: &[f32]| x.iter().map(|x| (f64::from(*x) - mean).abs()).fold(0.0, f64::max);
    if peak(&quiet.acceleration) == 0.0 {
        return Err(refused(format!(
            "input channel {channel} of {} is silent, not even noise comes from it: is the accelerometer on another channel \
             (--input-channel), or another device (--input-device)?",
            quiet.device
        )));
    }
    let found = identify(&[quiet.recording()], base, settings).map_err(|e| refused(e.to_string()))?;
    let coherence = found.recordings.first().map_or(0.0, |m| m.coherence);
    if coherence < HEARD {
        return Err(refused(not_heard(args, (before, during), mean, (coherence, quiet.amplitude))));
    }
    let full_scale = args.accelerometer_full_scale;
    let noise = peak(before);
    let louder = asked / quiet.amplitude;
    let mut most = louder * (peak(during) - noise).max(0.0) + noise;
    if coherence > WELL_HEARD {
        let steady = found.curves.iter().flatten().map(|p| p.measured_db).fold(f64::MIN, f64::max);
        most = most.max(asked * 10f64.powf(steady / 20.0) + noise);
    }
    Ok(choose(args, asked, (most + mean.abs()) / full_scale))
}

/// The level for an input of which the one that was asked for would reach so much.
fn choose(args: &Args, asked: f64, reaches: f64) -> Level {
    let percent = 100.0 * reaches;
    let unit = unit(args);
    if reaches > HEADROOM {
        let amplitude = asked * HEADROOM / reaches;
        let note = format!(
            "{asked} {unit} would reach {percent:.0} % of the input's full scale, so the level is lowered to {amplitude:.3} {unit} \
             (a lower gain of the input, and its --accelerometer-full-scale, would leave more)"
        );
        return Level { amplitude, reaches: HEADROOM, note: Some(note) };
    }
    let note = (reaches < FAINT).then(|| {
        format!(
            "{asked} {unit} reaches {percent:.2} % of the input's full scale only: a higher gain of the input, and its \
             --accelerometer-full-scale, may lower the noise"
        )
    });
    Level { amplitude: asked, reaches, note }
}

/// A sweep that nothing at the input follows.
fn not_heard(
    args: &Args,
    (before, during): (&[f32], &[f32]),
    mean: f64,
    (coherence, amplitude): (f64, f64),
) -> String {
    let db = |x: &[f32]| {
        let power = x.iter().map(|x| (f64::from(*x) - mean).powi(2)).sum::<f64>() / x.len().max(1) as f64;
        20.0 * (power.sqrt() / args.accelerometer_full_scale).max(1e-9).log10()
    };
    let channel = args.output.channel();
    let (input, unit) = (args.input_channel, unit(args));
    format!(
        "what comes from input channel {input} does not follow the quiet sweep of {amplitude:.3} {unit} on channel {channel}: coherence \
         {coherence:.2}, {:.0} dB of full scale before the sweep and {:.0} dB from its start on. Is the amplifier on? Does the \
         actuator move (asperity tone --channel {channel})? Is the accelerometer on another channel (--input-channel)? If all is \
         right and only faint, raise the level or the input's gain",
        db(before),
        db(during)
    )
}

/// The input reached full scale in the quiet sweep already.
pub fn clips_already(args: &Args, amplitude: f64, hz: f64) -> Failure {
    let unit = unit(args);
    refused(format!(
        "input channel {} clips in the quiet sweep of {amplitude:.3} {unit} already (at {hz:.0} Hz): lower the input's gain, and give its \
         --accelerometer-full-scale; or is this another signal than the accelerometer's?",
        args.input_channel
    ))
}

/// The input reached full scale while measuring.
pub fn clipped(args: &Args, amplitude: f64, hz: f64) -> Failure {
    let (option, unit) = (option(args), unit(args));
    refused(format!(
        "input channel {} clipped at {hz:.0} Hz, and the sweep was stopped: less than {amplitude:.3} {unit} ({option}), or a lower gain of \
         the input with its --accelerometer-full-scale",
        args.input_channel
    ))
}

fn refused(what: String) -> Failure {
    Failure::Machine(format!("{what}\nnothing was written"))
}
