//! `autoregressive`: textures of autoregressive models.

use crate::prelude::*;
use asperity_autoregressive::{self, Synthesis};
use asperity_dsp::{Conversion, FilterPhase, Resampler};

use super::voices::{Voice, Voices};
use super::{Made, Renders, acceleration, each, files, gain, shared, slot};

const SLOT: usize = 0;
const SPEED: usize = 1;
const FORCE: usize = 2;
/// Upper edge of the flat range \[Hz\], where the model's rate allows it: that of the third of an octave at
/// 400 Hz.
const FLAT_HZ: f64 = 450.0;

/// The vibration of a texture whose models were fitted to recordings: noise through the filter of the
/// moment's speed and force.
///
/// The noise depends only on the node's seed and the sample's number. So does the position of every sample
/// between those of the model. So the output after a wake does not depend on the time before. A slot that
/// comes on begins in silence.
pub struct Autoregressive {
    models: Voices<Model>,
    bands: Vec<Band>,
    sum: Box<[f32]>,
    rate_hz: u32,
    /// Number of model files.
    files: u64,
}

/// A model of a texture with its state.
#[derive(Clone)]
struct Model {
    synthesis: Synthesis,
    gain: f32,
    /// Index of its band.
    band: usize,
}

impl Voice for Model {
    fn reset(&mut self) {
        self.synthesis.reset();
    }

    fn state(&mut self, state: &mut State<'_>) {
        self.synthesis.state(state);
    }
}

/// Signals of one rate, on their way to the audio rate.
struct Band {
    rate_hz: u32,
    resampler: Resampler<f32>,
    /// The samples of a tick at the models' rate: those of one model, and the sum of all.
    part: Box<[f32]>,
    sum: Box<[f32]>,
}

impl Band {
    fn new(rate_hz: u32, setup: &Setup<'_>) -> Result<Self, String> {
        let lower = f64::from(rate_hz.min(setup.audio_hz));
        let conversion = Conversion {
            in_hz: rate_hz,
            out_hz: setup.audio_hz,
            tick_num: setup.tick_hz,
            tick_den: 1,
            passband: (FLAT_HZ / lower).clamp(Conversion::PASSBAND, 0.45),
            phase: FilterPhase::Minimum,
        };
        let resampler = Resampler::new(&conversion)
            .map_err(|e| format!("cannot go from {rate_hz} to {} Hz: {e}", setup.audio_hz))?;
        let room = || vec![0.0; time::max_samples(rate_hz, setup.tick_hz)].into();
        Ok(Self { rate_hz, resampler, part: room(), sum: room() })
    }

    /// The sum of models of this band in a tick, at the audio rate.
    fn play(&mut self, models: &mut [Model], tick: (u64, u32), first_out: u64, out: &mut [f32]) {
        let span = time::samples(tick.0, self.rate_hz, tick.1);
        let len = (span.end - span.start) as usize;
        let (part, sum) = (&mut self.part[..len], &mut self.sum[..len]);
        sum.fill(0.0);
        for model in models {
            model.synthesis.process(span.start, part);
            sum.iter_mut().zip(part.iter()).for_each(|(sum, x)| *sum += model.gain * x);
        }
        self.resampler.process(span.start, sum, first_out, out);
    }
}

/// The seed of a model. Models that sound together have different seeds.
fn seed(of_node: u64, number: usize) -> u64 {
    random::bits(of_node, number as u64)
}

/// Returns the band of a rate; makes it if there is none yet.
fn band(bands: &mut Vec<Band>, texture_hz: f64, setup: &Setup<'_>) -> Result<usize, String> {
    if texture_hz.fract() != 0.0 {
        return Err(format!(
            "models of {texture_hz} Hz, where a whole number can be brought to the audio rate"
        ));
    }
    // Rates of textures are far below the largest number.
    let rate_hz = texture_hz as u32;
    if let Some(known) = bands.iter().position(|b| b.rate_hz == rate_hz) {
        return Ok(known);
    }
    bands.push(Band::new(rate_hz, setup)?);
    Ok(bands.len() - 1)
}

impl Node for Autoregressive {
    fn descriptor() -> Descriptor {
        Descriptor::new(
            "autoregressive",
            "Renders textures of autoregressive models: noise through a filter that follows speed and \
             force.",
        )
        .input(slot("index into `models`, from 0; below 0: silent"))
        .input(control("speed", 1, MM_S).doc("speed along the surface; at 0 the texture decays"))
        .input(control("force", 1, N).doc("normal force; at 0 the texture decays"))
        .output(acceleration().doc("texture vibration"))
        .timing("latency of the resampling filter from the model's rate to the audio rate")
        .resumes(Resume::Restart)
        .renders(
            Effect::new("models", Acts::Gliding)
                .form(
                    Form::new("", "autoregressive(model: \"FILE.ron\")")
                        .field(file("model").doc("model file: RON, or XML of the HaTT toolkit"))
                        .field(gain()),
                )
                .needs("speed", "speed")
                .needs("force", "force"),
        )
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let mut textures = Made::default();
        let mut bands = Vec::new();
        let read = |settings: &Settings| {
            let model = settings.file("model");
            let text = model.display().to_string();
            let texture = shared(&mut textures, text, || asperity_autoregressive::Texture::read(model))?;
            let band = band(&mut bands, texture.rate_hz(), setup).map_err(|e| settings.node_error(e))?;
            Ok((texture, settings.number("gain") as f32, band))
        };
        let slots = each(setup, read)?.into_iter().map(|slot| {
            let all = slot.into_iter().enumerate();
            let mut models: Vec<Model> = all
                .map(|(number, (texture, gain, band))| {
                    let synthesis = Synthesis::new(texture, seed(setup.seed, number));
                    Model { synthesis, gain, band }
                })
                .collect();
            // Models of one rate side by side.
            models.sort_by_key(|model| model.band);
            models
        });
        let models = Voices::new(slots.collect());
        let latency = |band: &Band| {
            let (num, den) = band.resampler.latency();
            Latency::ratio(num as i64, den as i64)
        };
        let latency = bands.iter().map(latency).max().unwrap_or(Latency::ZERO);
        let files = files(setup);
        let it = Self {
            models,
            bands,
            sum: vec![0.0; time::max_samples(setup.audio_hz, setup.tick_hz)].into(),
            rate_hz: setup.audio_hz,
            files: files.len() as u64,
        };
        Ok(Prepared::new(it).latency(latency).tail(latency + latency).files(files))
    }
}

impl Processor for Autoregressive {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let Self { models, bands, .. } = self;
        let turned = models.turn(tick.inputs.value(SLOT));
        let models = models.on();
        if models.is_empty() {
            return Status::Quiet;
        }
        let (speed, force) = (tick.inputs.value(SPEED), tick.inputs.value(FORCE));
        let span = tick.samples(self.rate_hz);
        let out = tick.outputs.audio(0);
        let sum = &mut self.sum[..out.len()];
        for together in models.chunk_by_mut(|a, b| a.band == b.band) {
            let Some(band) = together.first().and_then(|model| bands.get_mut(model.band)) else { continue };
            if turned {
                band.resampler.reset();
            }
            together.iter_mut().for_each(|model| model.synthesis.touch(speed, force));
            band.play(together, (tick.index, tick.tick_hz), span.start, sum);
            out.iter_mut().zip(&*sum).for_each(|(y, x)| *y += x);
        }
        Status::Continue
    }

    fn reset(&mut self) {
        self.models.reset();
    }

    /// Samples so far, at the models' rate and on their way to the audio rate. Other models of the same rate
    /// continue from them; models of another rate start anew.
    fn state(&mut self, state: &mut State<'_>) {
        self.models.state(state);
        for band in &mut self.bands {
            band.resampler.state(state);
        }
    }

    fn facts(&mut self) -> Vec<Fact> {
        let rates: Vec<String> = self.bands.iter().map(|b| format!("{} Hz", b.rate_hz)).collect();
        let mut facts =
            vec![Fact::count("slots", self.models.count() as u64), Fact::count("files", self.files)];
        if !rates.is_empty() {
            facts.push(Fact::text("model_rates", rates.join(", ")));
        }
        facts
    }
}
