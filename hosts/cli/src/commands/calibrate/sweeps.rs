//! Sweeps that are played and recorded: a quiet one first, which decides the level of the measurement.

use std::cell::Cell;

use asperity_actuator::ActuatorProfile;
use asperity_actuator::identify::{IdentifySettings, Recording, Sweep, SweepSettings, identify};
use asperity_live::view::View;
use asperity_live::{Ended, Listener};
use asperity_node::FactValue;

use super::{Amplifier, Args};
use crate::card::{DeviceArgs, TICK_HZ, Watching, absolute, graph, play};
use crate::failure::{Failure, complain, warn};

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
/// Longest quiet sweep \[s\].
const QUIET_S: f64 = 2.0;
/// Level of the quiet sweep as a part of the measurement's.
const QUIET: f64 = 0.1;
/// Largest part of the input's full scale that the measurement may reach.
const HEADROOM: f64 = 0.7;
/// Least coherence of the quiet sweep. The measurement has a hundredth of its relative noise power.
const HEARD: f64 = 0.3;
/// Above this coherence, the level of a slower sweep at the resonance is predicted.
const WELL_HEARD: f64 = 0.9;
/// Below this part of full scale, the card's own noise may limit the measurement.
const FAINT: f64 = 0.01;

pub struct Bench<'a> {
    args: &'a Args,
    amplifier: &'a Amplifier,
    base: &'a ActuatorProfile,
    /// The base profile: its name, or an absolute path.
    base_name: String,
    settings: IdentifySettings,
    device: DeviceArgs,
}

/// A sweep that was played, and its recording, from the same sample on.
#[derive(Debug)]
pub struct Tape {
    drive: Vec<f32>,
    acceleration: Vec<f32>,
    /// Whether the limiter changed the sweep.
    pub limited: bool,
    pub handle_mass_g: f64,
    /// Peak of the sweep \[A or V\].
    pub amplitude: f64,
    pub device: String,
    rate_hz: f64,
    time_constant_s: f64,
}

impl Tape {
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
}

impl<'a> Bench<'a> {
    pub fn new(
        args: &'a Args,
        amplifier: &'a Amplifier,
        base: &'a ActuatorProfile,
        settings: IdentifySettings,
    ) -> Result<Self, Failure> {
        let mut device = args.output.recording_from(args.input_device.as_deref());
        device.card.period.get_or_insert(PERIOD);
        Ok(Self { args, amplifier, base, base_name: absolute(&args.base)?, settings, device })
    }

    /// Plays a quiet sweep and, if the input follows it without clipping, the measurement.
    pub fn measure(&self, handle_mass_g: f64) -> Result<Tape, Failure> {
        let (unit, quiet) = (self.amplifier.unit, QUIET * self.amplifier.level);
        let Args { from_hz, to_hz, seconds, .. } = self.args;
        complain(&format!("quiet sweep: {quiet:.3} {unit}, on {handle_mass_g} g\n"));
        let heard = self.play(quiet, seconds.min(QUIET_S), handle_mass_g)?;
        let amplitude = self.level(&heard)?;
        complain(&format!(
            "heard; measuring: {amplitude:.3} {unit}, {from_hz} to {to_hz} Hz in {seconds} s, on {}\n",
            heard.device
        ));
        self.play(amplitude, *seconds, handle_mass_g)
    }

    /// Plays a sweep and records it. A recording with gaps is tried again.
    fn play(&self, amplitude: f64, seconds: f64, handle_mass_g: f64) -> Result<Tape, Failure> {
        for _ in 1..ATTEMPTS {
            match self.play_once(amplitude, seconds, handle_mass_g)? {
                Ok(tape) => return Ok(tape),
                Err(gaps) => complain(&format!("{gaps}: once more\n")),
            }
        }
        self.play_once(amplitude, seconds, handle_mass_g)?.map_err(|gaps| {
            let try_this = "try a longer --period, or a less busy machine";
            refused(format!("{gaps}, {ATTEMPTS} times in a row: {try_this}"))
        })
    }

    fn clipped(&self, amplitude: f64, hz: f64) -> Failure {
        let (channel, Amplifier { unit, level, option, .. }) = (self.args.input_channel, self.amplifier);
        refused(if amplitude <= QUIET * level {
            format!(
                "input channel {channel} clips in the quiet sweep of {amplitude:.3} {unit} already (at \
                 {hz:.0} Hz): lower the input's gain, and give its --accelerometer-full-scale. Is this \
                 the accelerometer's channel?"
            )
        } else {
            format!(
                "input channel {channel} clipped at {hz:.0} Hz, and the sweep was stopped: try less than \
                 {amplitude:.3} {unit} ({option}), or a lower gain of the input with its \
                 --accelerometer-full-scale"
            )
        })
    }

    /// The sweep, from the first sample of a session on; or its gaps in words.
    fn play_once(
        &self,
        amplitude: f64,
        seconds: f64,
        handle_mass_g: f64,
    ) -> Result<Result<Tape, String>, Failure> {
        let (args, rate_hz) = (self.args, f64::from(self.args.rate));
        let settings = SweepSettings {
            from_hz: args.from_hz,
            to_hz: args.to_hz,
            seconds,
            amplitude,
            before_s: RECORD_S + BEFORE_S,
            after_s: AFTER_S,
            ..SweepSettings::default()
        };
        let sweep = Sweep::new(settings, rate_hz).map_err(|e| Failure::Machine(e.to_string()))?;
        let wires = r#"("sweep", "limiter"), ("limiter", "out"), ("limiter", "driven"), ("in", "heard")"#;
        let made = graph("the measurement", args.rate, &self.nodes(&settings, handle_mass_g), wires)?;
        let ticks = (sweep.samples() as f64 / rate_hz * TICK_HZ).ceil() as u64;
        let limit = CLIPPED * args.accelerometer_full_scale as f32;
        let (mut driven, mut heard) = (Track::default(), Track::default());
        let from = (RECORD_S * rate_hz) as u64;
        let clips = Cell::new(None);
        // Gaps of output and recording: at the end of the ramp, and now.
        let (mut before, mut now) = (None, [0; 2]);
        let mut view = |view: &View, listener: &Listener| {
            now = [view.underruns + view.lost_samples + view.xruns, listener.gaps()];
            if view.seconds >= RECORD_S {
                before.get_or_insert(now);
            }
            clips.get().is_none()
        };
        let mut recorded = |id: &str, start: u64, samples: &[f32]| {
            if id == "driven" {
                return driven.take(from, start, samples);
            }
            let at = samples.iter().position(|x| x.abs() >= limit).map(|at| start + at as u64);
            clips.set(clips.get().or(at));
            heard.take(from, start, samples);
        };
        let watching = Watching { view: &mut view, recorded: &mut recorded };
        let (ended, whole) = play(made, &self.device, START_S, Default::default(), ticks, watching)?;
        if let Some(at) = clips.get() {
            let since = at as f64 / rate_hz - settings.before_s;
            let hz = settings.from_hz * (since / sweep.time_constant_s()).exp();
            return Err(self.clipped(amplitude, hz.clamp(settings.from_hz, settings.to_hz)));
        }
        if !whole {
            return Err(refused("stopped before the end".into()));
        }
        let [output, recording] = before.map_or([0; 2], |before| [now[0] - before[0], now[1] - before[1]]);
        if output > 0 {
            return Ok(Err("the device or the machine could not keep up, and the sweep broke off".into()));
        } else if recording > 0 {
            return Ok(Err(format!("the recording has gaps ({recording} frames)")));
        } else if driven.broken || heard.broken {
            return Ok(Err("ticks were left out".into()));
        }
        Ok(Ok(Tape {
            drive: driven.samples,
            acceleration: heard.samples,
            limited: limited(&ended),
            handle_mass_g,
            amplitude,
            device: ended.view.device.clone(),
            rate_hz,
            time_constant_s: sweep.time_constant_s(),
        }))
    }

    /// Nodes of the measurement: the sweep, the limiter of the base profile, and both recordings.
    fn nodes(&self, sweep: &SweepSettings, handle_mass_g: f64) -> String {
        let SweepSettings { from_hz, to_hz, seconds, amplitude, fade_s, before_s, after_s, .. } = sweep;
        let Args { volts_at_full_scale, input_channel, accelerometer_full_scale, .. } = self.args;
        let Amplifier { unit, gain, .. } = self.amplifier;
        let (base, fade_ms) = (&self.base_name, fade_s * 1e3);
        // Only the gain of the amplifier that is there counts.
        format!(
            r#""sweep": (kind: "sweep", params: (from_hz: {from_hz:?}, to_hz: {to_hz:?}, seconds: {seconds:?},
                 amplitude: {amplitude:?}, fade_ms: {fade_ms:?}, before_s: {before_s:?}, after_s: {after_s:?},
                 unit: "{unit}")),
               "limiter": (kind: "limiter", params: (profile: {base:?}, handle_mass_g: {handle_mass_g:?})),
               "out": (kind: "audio_out", params: (volts_at_full_scale: {volts_at_full_scale:?},
                 {}: {gain:?})),
               "in": (kind: "audio_in",
                 params: (channel: {input_channel}, full_scale: {accelerometer_full_scale:?})),
               "driven": (kind: "file_out", params: (file: "driven.npy")),
               "heard": (kind: "file_out", params: (file: "heard.npy")),"#,
            if *unit == "A" { "amps_per_volt" } else { "volts_per_volt" }
        )
    }

    /// Checks that the input follows the quiet sweep, and answers the highest level without clipping.
    fn level(&self, quiet: &Tape) -> Result<f64, Failure> {
        let Args { input_channel, accelerometer_full_scale, output, .. } = self.args;
        let (asked, unit, all) = (self.amplifier.level, self.amplifier.unit, &quiet.acceleration);
        let (before, during) = all.split_at(((BEFORE_S * quiet.rate_hz) as usize).min(all.len()));
        let mean = all.iter().map(|x| f64::from(*x)).sum::<f64>() / all.len().max(1) as f64;
        let peak = |x: &[f32]| x.iter().map(|x| (f64::from(*x) - mean).abs()).fold(0.0, f64::max);
        if peak(all) == 0.0 {
            return Err(refused(format!(
                "input channel {input_channel} of {} is silent, without any noise: is the accelerometer on \
                 another channel (--input-channel), or another device (--input-device)?",
                quiet.device
            )));
        }
        let found = identify(&[quiet.recording()], self.base, self.settings);
        let found = found.map_err(|e| refused(e.to_string()))?;
        let coherence = found.recordings.first().map_or(0.0, |m| m.coherence);
        if coherence < HEARD {
            let db = |x: &[f32]| {
                let power = x.iter().map(|x| (f64::from(*x) - mean).powi(2)).sum::<f64>();
                let rms = (power / x.len().max(1) as f64).sqrt();
                20.0 * (rms / accelerometer_full_scale).max(1e-9).log10()
            };
            let (amplitude, channel) = (quiet.amplitude, output.channel());
            return Err(refused(format!(
                "input channel {input_channel} does not follow the quiet sweep of {amplitude:.3} {unit} \
                 on channel {channel}. Coherence {coherence:.2}; {:.0} dB of full scale before the sweep, \
                 {:.0} dB during it. Is the amplifier on? Does the actuator move (asperity tone --channel \
                 {channel})? Is the accelerometer on another channel (--input-channel)? If all is right \
                 but faint, raise the level or the input's gain",
                db(before),
                db(during)
            )));
        }
        let noise = peak(before);
        let mut most = asked / quiet.amplitude * (peak(during) - noise).max(0.0) + noise;
        if coherence > WELL_HEARD {
            let steady = found.curves.iter().flatten().map(|p| p.measured_db).fold(f64::MIN, f64::max);
            most = most.max(asked * 10f64.powf(steady / 20.0) + noise);
        }
        let reaches = (most + mean.abs()) / accelerometer_full_scale;
        let percent = 100.0 * reaches;
        if reaches > HEADROOM {
            let amplitude = asked * HEADROOM / reaches;
            warn(&format!(
                "{asked} {unit} would reach {percent:.0} % of the input's full scale, \
                 so the level is lowered to {amplitude:.3} {unit} (a lower gain of the input, \
                 and its --accelerometer-full-scale, would leave more)"
            ));
            return Ok(amplitude);
        }
        if reaches < FAINT {
            warn(&format!(
                "{asked} {unit} reaches only {percent:.2} % of the input's full scale: \
                 a higher gain of the input, and its --accelerometer-full-scale, may lower the noise"
            ));
        }
        Ok(asked)
    }
}

/// Samples of one sink.
#[derive(Default)]
struct Track {
    samples: Vec<f32>,
    broken: bool,
}

impl Track {
    /// Takes samples from number `from` on.
    fn take(&mut self, from: u64, start: u64, samples: &[f32]) {
        let left_out = from.saturating_sub(start).min(samples.len() as u64);
        let samples = &samples[left_out as usize..];
        self.broken |= !samples.is_empty() && start + left_out != from + self.samples.len() as u64;
        self.samples.extend_from_slice(samples);
    }
}

/// Whether the limiter changed anything beside DC.
fn limited(ended: &Ended) -> bool {
    let limiter = ended.graph_controller.schedule().index_of("limiter");
    let facts = limiter.and_then(|i| ended.facts.get(i));
    facts.into_iter().flatten().any(|f| {
        let counts = f.name.starts_with("limited_") || f.name == "reduced";
        counts && matches!(f.value, FactValue::Count(n) if n > 0)
    })
}

/// The error for a measurement that cannot be used.
pub fn refused(what: String) -> Failure {
    Failure::Machine(format!("{what}\nnothing was written"))
}
