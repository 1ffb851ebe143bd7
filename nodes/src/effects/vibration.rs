//! `vibration`: a fixed source while a surface is touched.

use asperity_node::{Descriptor, Diagnostic, Fact, Latency, Node, Param, Setup, State, Status, Tick};
use asperity_scene::Hum;
use asperity_scene::effect;

use super::mix::Mix;
use super::{acceleration, at, pick, slot, texts};

/// Sources that sound at a time; another begins when one of them has faded out.
const MOST: usize = 8;

/// A sine of a fixed frequency, faded over into that of the next surface.
///
/// Phases follow from the sample's number: whenever a source comes on again, it is where it would have been. A source whose slot comes back while it
/// fades out turns round where it is.
pub struct Vibration {
    sources: Vec<effect::Vibration>,
    voices: [Voice; MOST],
    /// Samples of a fade.
    fade: u32,
    mix: Mix,
    rate_hz: u32,
}

/// A source that sounds.
#[derive(Clone, Copy, Debug, Default)]
struct Voice {
    slot: Option<usize>,
    /// How far it is faded in, 0 to the samples of a fade.
    level: u32,
}

impl Node for Vibration {
    fn descriptor() -> Descriptor {
        Descriptor::new(
            "vibration",
            "A sine of a fixed frequency while a surface is touched, faded from one surface to the next.",
        )
        .input(slot("which of `sources`, from 0; below 0 none sounds").wakes())
        .output(acceleration().doc("the sine"))
        .param(Param::texts(
            "sources",
            "Sources, each a text as behind `vibration` in a scene: [\"(frequency_hz: 120, amplitude_m_s2: 2)\"].",
        ))
        .param(
            Param::number(
                "fade_ms",
                20.0,
                0.1..=1000.0,
                "How long a source takes to fade in or out, in a straight line.",
            )
            .unit("ms"),
        )
        .timing("fades over `fade_ms`; not called while nothing sounds")
    }

    fn prepare(setup: &Setup<'_>) -> Result<Self, Diagnostic> {
        let rate_hz = setup.audio_hz;
        let sources = texts::read(setup, "sources", |value| {
            let hum = Hum::parse(value)?;
            at(value, effect::Vibration::new(hum.frequency_hz, hum.amplitude_m_s2, rate_hz))
        })?;
        let fade = (setup.params.number("fade_ms") * 1e-3 * f64::from(rate_hz)).round().max(1.0) as u32;
        Ok(Self { sources, voices: [Voice::default(); MOST], fade, mix: Mix::new(setup), rate_hz })
    }

    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let wanted = pick(tick.inputs.value(0), self.sources.len());
        if wanted.is_some()
            && self.voices.iter().all(|v| v.slot != wanted)
            && let Some(free) = self.voices.iter_mut().find(|v| v.slot.is_none())
        {
            *free = Voice { slot: wanted, level: 0 };
        }
        if self.voices.iter().all(|v| v.slot.is_none()) {
            return Status::Asleep;
        }
        let span = tick.samples(self.rate_hz);
        self.mix.begin((span.end - span.start) as usize);
        let fade = self.fade;
        for voice in &mut self.voices {
            let Some(source) = voice.slot.and_then(|slot| self.sources.get(slot)) else { continue };
            let on = voice.slot == wanted;
            if on && voice.level == fade {
                self.mix.add(1.0, |part| source.process(span.start, part));
                continue;
            }
            let level = || {
                voice.level = if on { fade.min(voice.level + 1) } else { voice.level.saturating_sub(1) };
                f64::from(voice.level) / f64::from(fade)
            };
            self.mix.add_each(level, |part| source.process(span.start, part));
            if !on && voice.level == 0 {
                voice.slot = None;
            }
        }
        self.mix.write(tick.outputs.audio(0));
        Status::Continue
    }

    fn reset(&mut self) {
        self.voices = [Voice::default(); MOST];
    }

    /// What sounds, and how far it is faded in, which is kept as a part of the fade.
    fn state(&mut self, state: &mut State<'_>) {
        let mut fade = self.fade;
        state.keep(&mut fade);
        for voice in &mut self.voices {
            state.keep(&mut voice.slot).keep(&mut voice.level);
            if state.restores() && fade != self.fade {
                let level = u64::from(voice.level) * u64::from(self.fade) / u64::from(fade.max(1));
                voice.level = u32::try_from(level).unwrap_or(u32::MAX);
            }
            state
                .require(voice.level <= self.fade && voice.slot.is_none_or(|slot| slot < self.sources.len()));
        }
        if state.restores() && state.failed() {
            self.reset();
        }
    }

    fn tail(&self) -> Latency {
        Latency::samples(i64::from(self.fade), self.rate_hz)
    }

    fn facts(&self) -> Vec<Fact> {
        vec![Fact::count("slots", self.sources.len() as u64)]
    }
}
