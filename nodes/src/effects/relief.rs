//! `relief`: a texture straight from heights under the tip.

use std::path::PathBuf;
use std::sync::Arc;

use asperity_diagnostics::ron::Value;
use asperity_node::{Descriptor, Diagnostic, Fact, Latency, Node, Param, Resume, Setup, State, Status, Tick};
use asperity_scene::effect::{self, HeightSpline, Parts, ReliefSettings};
use asperity_scene::{Heights, Texture};

use super::mix::Mix;
use super::texts::{self, Shared};
use super::track::Track;
use super::voices::{Voice, Voices};
use super::{acceleration, at, slot, waveform};

const SLOT: usize = 0;
const PLACE: usize = 1;
const STROKE: usize = 2;

/// The acceleration of a tip that rises and falls with the heights under it.
///
/// The path between ticks goes through the middles of places, along parabolas. Heights that several slots want are there once.
pub struct Relief {
    reliefs: Voices<Field>,
    track: Track,
    mix: Mix,
    rate_hz: u32,
    latency: Latency,
    lag_s: f64,
    fields: u64,
    files: Vec<PathBuf>,
}

/// Heights as they are felt.
#[derive(Clone)]
struct Field {
    relief: effect::Relief,
    heights: Arc<HeightSpline>,
    gain: f64,
}

impl Voice for Field {
    fn reset(&mut self) {
        self.relief.reset();
    }

    fn state(&mut self, state: &mut State<'_>) {
        self.relief.state(state);
    }
}

fn read(
    value: &Value,
    rate_hz: u32,
    fields: &mut Shared<Heights, HeightSpline>,
) -> Result<Field, Diagnostic> {
    let Texture::Relief { heights, cutoff_hz, max_m_s2, gain } = Texture::parse(value)? else {
        return Err(value
            .error("a texture of another kind")
            .help("relief(heights: made(surface: \"NAME\"))"));
    };
    let relief = at(value, effect::Relief::new(ReliefSettings { cutoff_hz, max_m_s2 }, rate_hz))?;
    let heights = fields.get(heights.clone(), || heights.field().map(|field| HeightSpline::new(&field)))?;
    Ok(Field { relief, heights, gain })
}

impl Node for Relief {
    fn descriptor() -> Descriptor {
        let [place, stroke] = waveform::place();
        Descriptor::new("relief", "A texture straight from the heights under the tip, as acceleration.")
            .input(slot("which of `reliefs`, from 0; below 0 none is felt"))
            .input(place)
            .input(stroke)
            .output(acceleration().doc("the vibration of gliding"))
            .param(Param::texts(
                "reliefs",
                "Reliefs, each a text as behind `texture` in a scene: `relief(heights: made(surface: \"hessian\", side: 512, step_mm: 0.04, piece: 1), \
                 cutoff_hz: 1000, max_m_s2: 200, gain: 1)`, or `heights: picture(file: \"heights.png\", step_mm: 0.05, height_mm: 0.2)`, light is \
                 high; or a list of them, `[relief(..), relief(..)]`, whose sum is one entry. Quotes within a text are written r#\"..\"#.",
            ))
            .param(waveform::smooth_hz())
            .timing("a tick and a half less a sample; silent in the first tick after it wakes, which has no speed yet, and faded in over the second; smoothing at 20 Hz adds 11 ms")
            .resumes(Resume::Restart)
    }

    fn prepare(setup: &Setup<'_>) -> Result<Self, Diagnostic> {
        let mut fields = Shared::default();
        let rate_hz = setup.audio_hz;
        let reliefs = texts::read_each(setup, "reliefs", |value| read(value, rate_hz, &mut fields))?;
        let track = Track::new(setup, setup.params.number("smooth_hz"))?;
        let files = fields.wanted().filter_map(|heights| match heights {
            Heights::Picture { file, .. } => Some(file.clone()),
            Heights::Made { .. } => None,
        });
        Ok(Self {
            reliefs: Voices::new(reliefs),
            latency: track.latency(setup),
            lag_s: track.lag_s(),
            track,
            mix: Mix::new(setup),
            rate_hz,
            fields: fields.count(),
            files: files.collect(),
        })
    }

    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let turned = self.reliefs.turn(tick.inputs.value(SLOT));
        let place = tick.inputs.control(PLACE).try_into().unwrap_or([f64::NAN; 2]);
        let path = self.track.advance(place, tick.inputs.value(STROKE)).copied();
        let reliefs = self.reliefs.on();
        let Some(path) = path.filter(|_| !reliefs.is_empty()) else { return Status::Quiet };
        let span = tick.samples(self.rate_hz);
        let parts = Parts::new(tick.index, span.start, self.rate_hz, tick.tick_hz);
        self.mix.begin((span.end - span.start) as usize);
        for one in reliefs {
            self.mix.add(one.gain, |part| one.relief.process(&*one.heights, &path, &parts, part));
        }
        if turned || self.track.begins() {
            self.mix.fade_in(&parts);
        }
        self.mix.write(tick.outputs.audio(0));
        Status::Continue
    }

    fn reset(&mut self) {
        self.reliefs.reset();
        self.track.reset();
    }

    /// Where the stylus was, and what was felt.
    fn state(&mut self, state: &mut State<'_>) {
        self.track.state(state);
        self.reliefs.state(state);
    }

    fn latency(&self) -> Latency {
        self.latency
    }

    fn files(&self) -> Vec<PathBuf> {
        self.files.clone()
    }

    fn facts(&self) -> Vec<Fact> {
        let mut facts = vec![
            Fact::count("slots", self.reliefs.count() as u64),
            Fact::count("height_fields", self.fields),
        ];
        if self.lag_s > 0.0 {
            facts.push(Fact::number("response_lag", 1e3 * self.lag_s, "ms"));
        }
        facts
    }
}
