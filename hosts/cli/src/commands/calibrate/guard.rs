//! What a quiet sweep must show before a loud one is played.

use asperity_actuator::ActuatorProfile;
use asperity_actuator::identify::{IdentifySettings, identify};

use super::bench::Tape;
use crate::args::Calibrate;
use crate::failure::Failure;

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
    args: &Calibrate,
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
fn choose(args: &Calibrate, asked: f64, reaches: f64) -> Level {
    let percent = 100.0 * reaches;
    let unit = super::unit(args);
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
    args: &Calibrate,
    (before, during): (&[f32], &[f32]),
    mean: f64,
    (coherence, amplitude): (f64, f64),
) -> String {
    let db = |x: &[f32]| {
        let power = x.iter().map(|x| (f64::from(*x) - mean).powi(2)).sum::<f64>() / x.len().max(1) as f64;
        20.0 * (power.sqrt() / args.accelerometer_full_scale).max(1e-9).log10()
    };
    let channel = args.output.channel();
    let (input, unit) = (args.input_channel, super::unit(args));
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
pub fn clips_already(args: &Calibrate, amplitude: f64, hz: f64) -> Failure {
    let unit = super::unit(args);
    refused(format!(
        "input channel {} clips in the quiet sweep of {amplitude:.3} {unit} already (at {hz:.0} Hz): lower the input's gain, and give its \
         --accelerometer-full-scale; or is this another signal than the accelerometer's?",
        args.input_channel
    ))
}

/// The input reached full scale while measuring.
pub fn clipped(args: &Calibrate, amplitude: f64, hz: f64) -> Failure {
    let (option, unit) = (super::option(args), super::unit(args));
    refused(format!(
        "input channel {} clipped at {hz:.0} Hz, and the sweep was stopped: less than {amplitude:.3} {unit} ({option}), or a lower gain of \
         the input with its --accelerometer-full-scale",
        args.input_channel
    ))
}

fn refused(what: String) -> Failure {
    Failure::Machine(format!("{what}\nnothing was written"))
}
