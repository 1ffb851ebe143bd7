//! `relief`: a texture straight from heights under the tip.

mod follow;
mod spline;

use std::sync::Arc;

use asperity_node::{
    Acts, Descriptor, Diagnostic, Effect, Fact, Form, Node, Param, Prepared, Processor, Resume, Settings,
    Setup, State, Status, Tick,
};
use asperity_scene::Heights;

use super::mix::Mix;
use super::path::Parts;
use super::shared::Shared;
use super::track::Track;
use super::voices::{Voice, Voices};
use super::{acceleration, each, files, gain, made, slot, waveform};
pub use follow::{Follower, Jet, ReliefSettings, Surface};
pub use spline::HeightSpline;

const SLOT: usize = 0;
const PLACE: usize = 1;
const STROKE: usize = 2;

/// The acceleration of a tip that rises and falls with the heights under it.
///
/// The path between ticks goes through the middles of positions, along parabolas. Slots with the same heights
/// share one copy of them.
pub struct Relief {
    reliefs: Voices<Field>,
    track: Track,
    mix: Mix,
    rate_hz: u32,
    lag_s: f64,
    fields: u64,
}

/// Heights with the state of their reading.
#[derive(Clone)]
struct Field {
    relief: Follower,
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

fn effect() -> Effect {
    let usual = ReliefSettings::default();
    Effect::new("reliefs", Acts::Gliding)
        .form(
            Form::new("", "relief(heights: made(surface: \"hessian\"))")
                .nested("heights")
                .field(
                    Param::number("cutoff_hz", usual.cutoff_hz, 20.0..=20_000.0, "cutoff of the low-pass")
                        .unit("Hz"),
                )
                .field(
                    Param::number("max_m_s2", usual.max_m_s2, 0.1..=1e4, "the largest acceleration")
                        .unit("m/s^2"),
                )
                .field(gain()),
        )
        .needs("place", "place")
        .needs("stroke", "stroke")
        .check(|settings| heights(settings).map(drop))
}

fn heights(settings: &Settings) -> Result<Heights, Diagnostic> {
    let Some(heights) = settings.nested("heights") else {
        return Err(settings
            .node_error("a relief needs `heights`")
            .help("relief(heights: made(surface: \"hessian\"))"));
    };
    Heights::parse(heights)
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
                "Reliefs, each a text as behind `texture` in a scene; or a list of them, `[relief(..), \
                 relief(..)]`, whose sum is one entry. Quotes within a text are written r#\"..\"#.",
            ))
            .param(waveform::smooth_hz())
            .timing(
                "a tick and a half less a sample; silent in the first tick after it wakes, which has no \
                 speed yet, and faded in over the second; smoothing at 20 Hz adds 11 ms",
            )
            .resumes(Resume::Restart)
            .effect(effect())
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let mut fields = Shared::default();
        let rate_hz = setup.audio_hz;
        let reliefs = each(setup, |settings| {
            let usual = ReliefSettings {
                cutoff_hz: settings.number("cutoff_hz"),
                max_m_s2: settings.number("max_m_s2"),
            };
            let relief = made(settings, Follower::new(usual, rate_hz))?;
            let heights = heights(settings)?;
            let field = || heights.field().map(|field| HeightSpline::new(&field));
            let heights = fields.get_by(format!("{heights:?}"), field)?;
            Ok(Field { relief, heights, gain: settings.number("gain") })
        })?;
        let track = Track::new(setup, setup.params.number("smooth_hz"))?;
        let latency = track.latency(setup);
        let it = Self {
            reliefs: Voices::new(reliefs),
            lag_s: track.lag_s(),
            track,
            mix: Mix::new(setup),
            rate_hz,
            fields: fields.count(),
        };
        Ok(Prepared::new(it).latency(latency).files(files(setup)))
    }
}

impl Processor for Relief {
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

    /// Last positions of the stylus, and state of the reliefs.
    fn state(&mut self, state: &mut State<'_>) {
        self.track.state(state);
        self.reliefs.state(state);
    }

    fn facts(&mut self) -> Vec<Fact> {
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
