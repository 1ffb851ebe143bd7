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

/// Ramp from silence to full level at the start of a session \[s\].
const START_S: f64 = 0.5;
/// Start of the recording \[s\]: by then the ramp behind the limiter is over.
const RECORD_S: f64 = START_S + 0.1;
/// Silence recorded before the sweep, which gives the noise \[s\].
const BEFORE_S: f64 = 0.4;
/// Silence recorded after it, in which latency and ringing end \[s\].
const AFTER_S: f64 = 1.0;
/// Part of the input's full scale that counts as clipped.
const CLIPPED: f32 = 0.999;
/// How often a recording with gaps is tried.
const ATTEMPTS: usize = 3;
/// Default buffer size in frames: latency does not matter here, and large buffers tolerate a busy machine.
const PERIOD: u32 = 1024;

/// Settings of all sweeps.
pub struct Bench<'a> {
    args: &'a Args,
    device: DeviceArgs,
    /// The base profile: its name, or an absolute path.
    base: String,
}

/// A sweep that was played, and its recording, from the same sample on.
#[derive(Debug)]
pub struct Tape {
    /// Output of the limiter \[A or V\].
    pub drive: Vec<f32>,
    /// Acceleration of the handle \[m/s^2\].
    pub acceleration: Vec<f32>,
    /// Whether the limiter changed the sweep.
    pub limited: bool,
    /// Mass of the handle \[g\].
    pub handle_mass_g: f64,
    /// Peak of the sweep \[A or V\].
    pub amplitude: f64,
    /// Name of the device.
    pub device: String,
    rate_hz: f64,
    time_constant_s: f64,
}

impl Tape {
    /// Input of the fit.
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

    /// Acceleration before the sweep, and from its start on.
    pub fn parts(&self) -> (&[f32], &[f32]) {
        let at = (BEFORE_S * self.rate_hz) as usize;
        self.acceleration.split_at(at.min(self.acceleration.len()))
    }
}

/// How a sweep ended.
#[derive(Debug)]
pub enum Outcome {
    /// Completely.
    Whole(Tape),
    /// Stopped at this frequency \[Hz\], where the input clipped.
    Clipped(f64),
}

impl<'a> Bench<'a> {
    /// A bench for the arguments.
    pub fn new(args: &'a Args) -> Result<Self, Failure> {
        let mut device = args.output.recording_from(args.input_device.as_deref());
        device.card.period.get_or_insert(PERIOD);
        Ok(Self { args, device, base: absolute(&args.base)? })
    }

    /// Unit of the drive.
    pub fn drive(&self) -> Drive {
        match self.args.drive {
            DriveKind::Current => Drive::Current,
            DriveKind::Voltage => Drive::Voltage,
        }
    }

    /// Full scale of card and amplifier \[A or V\].
    pub fn most(&self) -> f64 {
        let gain = match self.drive() {
            Drive::Current => amps_per_volt(self.args),
            Drive::Voltage => volts_per_volt(self.args),
        };
        gain * self.args.volts_at_full_scale
    }

    /// The sweep with its silences, from the first sample of a session on.
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

    /// Nodes of the measurement: the sweep, the limiter of the base profile, and both recordings.
    fn nodes(&self, sweep: &SweepSettings, handle_mass_g: f64) -> String {
        let a = self.args;
        let (base, unit) = (&self.base, self.drive().unit());
        format!(
            r#""sweep": (kind: "sweep", params: (from_hz: {:?}, to_hz: {:?}, seconds: {:?}, amplitude: {:?},
                 fade_ms: {:?}, before_s: {:?}, after_s: {:?}, unit: "{unit}")),
               "limiter": (kind: "limiter", params: (profile: {base:?}, handle_mass_g: {handle_mass_g:?})),
               "out": (kind: "audio_out",
                 params: (volts_at_full_scale: {:?}, amps_per_volt: {:?}, volts_per_volt: {:?})),
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

    /// Plays a sweep and records it. A recording with gaps is tried again.
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
                "{what}, {ATTEMPTS} times in a row: try a longer --period, or a less busy machine; \
                 nothing was written"
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
    /// With gaps, described in words.
    Broken(String),
}

/// Both recordings of a sweep.
struct Log {
    driven: Track,
    heard: Track,
    /// First sample at which the input clipped.
    clipped: Option<u64>,
}

/// Samples of one sink, from number `from` on.
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

/// Counts of gaps since the ramp: of the output, of the recording.
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

/// Whether the limiter changed anything beside DC.
fn limited(ended: &Ended) -> bool {
    let limiter = ended.graph_controller.schedule().index_of("limiter");
    let Some(facts) = limiter.and_then(|i| ended.facts.get(i)) else { return false };
    facts.iter().any(|f| {
        let counts = f.name.starts_with("limited_") || f.name == "reduced";
        counts && matches!(f.value, FactValue::Count(n) if n > 0)
    })
}

/// Level of the quiet sweep as a part of the measurement's.
pub const QUIET: f64 = 0.1;
/// Largest part of the input's full scale that the measurement may reach.
const HEADROOM: f64 = 0.7;
/// Least coherence of the quiet sweep. The measurement has a hundredth of its relative noise power.
const HEARD: f64 = 0.3;
/// Above this coherence, the level of a slower sweep at the resonance is predicted.
const WELL_HEARD: f64 = 0.9;
/// Below this part of full scale, the card's own noise may limit the measurement.
const FAINT: f64 = 0.01;

/// Level of the measurement.
#[derive(Debug, PartialEq)]
pub struct Level {
    /// Peak \[A or V\], at most the requested one.
    pub amplitude: f64,
    /// Part of the input's full scale that it reaches.
    pub reaches: f64,
    /// Warning for the user: why it is lower, or how to improve it.
    pub note: Option<String>,
}

/// Checks that the input follows the quiet sweep, and answers the highest level without clipping.
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
            "input channel {channel} of {} is silent, without any noise: is the accelerometer on another \
             channel (--input-channel), or another device (--input-device)?",
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

/// The level, if the requested one would reach this part of the input's full scale.
fn choose(args: &Args, asked: f64, reaches: f64) -> Level {
    let percent = 100.0 * reaches;
    let unit = unit(args);
    if reaches > HEADROOM {
        let amplitude = asked * HEADROOM / reaches;
        let note = format!(
            "{asked} {unit} would reach {percent:.0} % of the input's full scale, \
             so the level is lowered to {amplitude:.3} {unit} (a lower gain of the input, \
             and its --accelerometer-full-scale, would leave more)"
        );
        return Level { amplitude, reaches: HEADROOM, note: Some(note) };
    }
    let note = (reaches < FAINT).then(|| {
        format!(
            "{asked} {unit} reaches only {percent:.2} % of the input's full scale: \
             a higher gain of the input, and its --accelerometer-full-scale, may lower the noise"
        )
    });
    Level { amplitude: asked, reaches, note }
}

/// The error for a sweep that the input does not follow.
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
        "input channel {input} does not follow the quiet sweep of {amplitude:.3} {unit} \
         on channel {channel}: \
         coherence {coherence:.2}, {:.0} dB of full scale before the sweep and {:.0} dB from its start on. \
         Is the amplifier on? Does the actuator move (asperity tone --channel {channel})? \
         Is the accelerometer on another channel (--input-channel)? \
         If all is right but faint, raise the level or the input's gain",
        db(before),
        db(during)
    )
}

/// The error for an input that clips in the quiet sweep.
pub fn clips_already(args: &Args, amplitude: f64, hz: f64) -> Failure {
    let unit = unit(args);
    refused(format!(
        "input channel {} clips in the quiet sweep of {amplitude:.3} {unit} already (at {hz:.0} Hz): \
         lower the input's gain, and give its --accelerometer-full-scale; \
         or is this another signal than the accelerometer's?",
        args.input_channel
    ))
}

/// The error for an input that clips in the measurement.
pub fn clipped(args: &Args, amplitude: f64, hz: f64) -> Failure {
    let (option, unit) = (option(args), unit(args));
    refused(format!(
        "input channel {} clipped at {hz:.0} Hz, and the sweep was stopped: \
         try less than {amplitude:.3} {unit} ({option}), \
         or a lower gain of the input with its --accelerometer-full-scale",
        args.input_channel
    ))
}

fn refused(what: String) -> Failure {
    Failure::Machine(format!("{what}\nnothing was written"))
}
