//! `clip`: a recorded acceleration.

use crate::effects::{MAX_RECORDED, acceleration, close};
use crate::prelude::*;
use asperity_data::wav::Wav;
use asperity_dsp::{Conversion, FilterPhase, Resampler};

/// Plays a WAV file while the stylus is in contact, each time from its beginning.
///
/// It fades in, and out where contact or file ends. A contact that comes during the fade out begins after it.
pub struct Clip {
    samples: Vec<f32>,
    repeats: bool,
    rate: f64,
    /// Change of the gain per sample.
    step: f32,
    /// The next sample.
    at: usize,
    gain: f32,
    touches: bool,
    /// Whether a contact waits for the end of the fade out.
    waits: bool,
}

/// Most samples at the audio rate: 64 MiB.
const MOST: u64 = 1 << 24;
/// Largest acceleration.
const MOST_M_S2: f64 = 1e6;
/// Rates of files in Hz.
const RATES_HZ: std::ops::RangeInclusive<u32> = 100..=1_000_000;

impl Node for Clip {
    fn descriptor() -> Descriptor {
        Descriptor::new(
            "clip",
            "Plays a recorded acceleration from a WAV file while the stylus is in contact.",
        )
        .input(control("force", 1, N).doc("normal force; above 0 the stylus is in contact"))
        .output(acceleration().doc("acceleration of the recording"))
        .param(file("file").doc("WAV file of any rate."))
        .param(number("full_scale_m_s2", 1.0, 1e-3..=1e5, "m/s^2").optional())
        .doc("Acceleration at full scale. A file of floats may leave it out if it holds m/s^2.")
        .param(integer("channel", 1, 1..=1024).doc("Channel of the file, counted from 1."))
        .param(Param::flag("loop", false, "").doc("Repeat the file while contact lasts."))
        .param(number("crossfade_ms", 20.0, 0.0..=10_000.0, "ms"))
        .doc("Length over which the end of a repeated file fades into its beginning.")
        .param(number("fade_ms", 5.0, 0.1..=1000.0, "ms"))
        .doc("Duration of the fades where contact begins and ends, and at the end of the file.")
        .timing("no latency; a contact begins with its tick")
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let (p, rate_hz) = (setup.params, setup.audio_hz);
        let samples_of = |ms: f64| (1e-3 * ms * f64::from(rate_hz)).round() as usize;
        let mut samples = recorded(p, rate_hz)?;
        let repeats = p.flag("loop");
        if repeats {
            let fade = samples_of(p.number("crossfade_ms")).min(samples.len() / 2);
            close(&mut samples, fade);
        }
        let fade = samples_of(p.number("fade_ms")).max(1);
        let it = Self {
            samples: samples.into_iter().map(|x| x as f32).collect(),
            repeats,
            rate: f64::from(rate_hz),
            step: 1.0 / fade as f32,
            at: 0,
            gain: 0.0,
            touches: false,
            waits: false,
        };
        Ok(Prepared::new(it).tail(Latency::samples(fade as i64, rate_hz)))
    }
}

/// The file's accelerations at the audio rate.
fn recorded(p: &Params, rate_hz: u32) -> Result<Vec<f64>, Diagnostic> {
    let path = p.file("file");
    let fail = |what: String| Diagnostic::new(what).in_file(path);
    let wav = Wav::read(path, MAX_RECORDED)?;
    let channel = p.integer("channel");
    if usize::try_from(channel).is_ok_and(|channel| channel > wav.channels) {
        let found = format!("channel {channel} of a file that has {}", wav.channels);
        return Err(p.error("channel", found).help(format!("1 to {}", wav.channels)));
    }
    let full_scale = match p.get_number("full_scale_m_s2") {
        Some(full_scale) => full_scale,
        None if wav.is_float => 1.0,
        None => {
            let help = "full_scale_m_s2: the acceleration at full scale, such as 50";
            return Err(p.error("file", "a file of whole numbers does not say its acceleration").help(help));
        }
    };
    let samples: Vec<f64> = wav.channel(channel as usize - 1).map(|x| full_scale * x).collect();
    if let Some(at) = samples.iter().position(|x| x.is_nan() || x.abs() > MOST_M_S2) {
        let what = format!("sample {at} of a clip is {:e} m/s^2", samples[at]);
        return Err(fail(what).help(format!("up to {MOST_M_S2:e} m/s^2")));
    }
    if samples.len() < 2 {
        return Err(fail(format!("a clip of {} samples", samples.len())).help("at least 2"));
    }
    if !RATES_HZ.contains(&wav.rate_hz) {
        let rates = format!("{} to {} Hz", RATES_HZ.start(), RATES_HZ.end());
        return Err(fail(format!("a clip of {} Hz", wav.rate_hz)).help(rates));
    }
    if wav.rate_hz == rate_hz {
        return Ok(samples);
    }
    let count = samples.len() as u64 * u64::from(rate_hz) / u64::from(wav.rate_hz);
    if count > MOST {
        let seconds = MOST / u64::from(rate_hz);
        return Err(fail("this clip is too long".into()).help(format!("at most {seconds} s at {rate_hz} Hz")));
    }
    let conversion = Conversion {
        in_hz: wav.rate_hz,
        out_hz: rate_hz,
        tick_num: 1,
        tick_den: 1,
        phase: FilterPhase::Linear,
        passband: 0.45,
    };
    let mut resampler = Resampler::<f64>::new(&conversion)
        .map_err(|e| fail(format!("cannot go from {} to {rate_hz} Hz: {e}", wav.rate_hz)))?;
    let (num, den) = resampler.latency();
    let delay = (num * u64::from(rate_hz) / den) as usize;
    let mut out = vec![0.0; delay + count as usize];
    resampler.process(0, &samples, 0, &mut out);
    out.drain(..delay);
    Ok(out)
}

impl Processor for Clip {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let touches = tick.inputs.valid(0) && tick.inputs.value(0) > 0.0;
        self.waits = touches && (self.waits || !self.touches);
        self.touches = touches;
        if self.gain == 0.0 && !self.waits && (!touches || self.left() == 0) {
            return Status::Quiet;
        }
        for y in tick.outputs.audio(0) {
            if self.waits && self.gain == 0.0 {
                (self.at, self.waits) = (0, false);
            }
            let rises = self.touches && !self.waits;
            let most = (self.left() as f32 * self.step).min(1.0);
            self.gain = (self.gain + if rises { self.step } else { -self.step }).clamp(0.0, most);
            // A rest of rounding is the end of a fade.
            if self.gain < 0.5 * self.step {
                self.gain = 0.0;
            }
            // Smoothstep: no corner where a fade begins or ends.
            let fade = self.gain * self.gain * (3.0 - 2.0 * self.gain);
            *y = fade * self.samples.get(self.at).copied().unwrap_or(0.0);
            self.at = match self.at + 1 {
                next if next < self.samples.len() => next,
                _ if self.repeats => 0,
                _ => self.samples.len(),
            };
        }
        Status::Continue
    }

    fn reset(&mut self) {
        (self.at, self.gain, self.touches, self.waits) = (0, 0.0, false, false);
    }

    /// Place in the file, and level of the fade. Another file continues at the same place.
    fn state(&mut self, state: &mut State<'_>) {
        state.keep(&mut self.at).keep(&mut self.gain).keep(&mut self.touches).keep(&mut self.waits);
        state.require((0.0..=1.0).contains(&self.gain));
        let length = self.samples.len();
        self.at = if self.repeats { self.at % length } else { self.at.min(length) };
    }

    fn facts(&mut self) -> Vec<Fact> {
        vec![Fact::number("duration", self.samples.len() as f64 / self.rate, "s")]
    }
}

impl Clip {
    /// Samples until the end of the file.
    fn left(&self) -> usize {
        if self.repeats { usize::MAX } else { self.samples.len().saturating_sub(self.at) }
    }
}
