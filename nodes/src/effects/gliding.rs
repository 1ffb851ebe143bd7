//! Textures that are read along the path of the stylus: `waveform` and `relief`.

use crate::prelude::*;

use super::mix::Mix;
use super::path::{Parts, Path};
use super::track::Track;
use super::voices::{Voice, Voices};
use super::{Renders, acceleration, files, slot};

const SLOT: usize = 0;
const PLACE: usize = 1;
const STROKE: usize = 2;

/// A kernel that makes samples along a path.
pub(super) trait Kernel: Voice + Send + 'static {
    /// Forgets where the stylus was: it was put down elsewhere.
    fn lift(&mut self) {}
    /// Writes the samples of a tick in m/s^2, along the path that was [advanced](Path::advance) to it.
    fn process(&mut self, path: &Path, parts: &Parts, out: &mut [f64]);
}

/// A texture. The path between ticks goes through the middles of positions, along parabolas.
struct Gliding<K> {
    voices: Voices<K>,
    track: Track,
    mix: Mix,
    rate_hz: u32,
    /// Number of things that slots share, and its name.
    shared: (&'static str, u64),
}

/// Descriptor of a texture.
pub(super) fn descriptor(
    (kind, summary): (&'static str, &'static str),
    slot_doc: &'static str,
    effect: Effect,
) -> Descriptor {
    Descriptor::new(kind, summary)
        .input(slot(slot_doc))
        .input(control("place", 2, MM).doc("stylus position along the surface"))
        .input(control("stroke", 1, ONE).or(0.0))
        .doc("counts strokes; when it changes, the jump to the new position is no motion")
        .output(acceleration().doc("texture vibration"))
        .param(number("smooth_hz", 0.0, 0.0..=1000.0, "Hz").doc(
            "Corner of a second-order low-pass on positions; 0 turns it off. Use about 20 Hz for a device \
             with coarse position steps.",
        ))
        .timing(
            "latency of 1.5 ticks minus a sample; after waking, silent for a tick, then a fade of a tick; \
             `smooth_hz: 20` adds 11 ms",
        )
        .resumes(Resume::Restart)
        .renders(effect.needs("place", "place").needs("stroke", "stroke"))
}

/// Prepares a texture of kernels for every slot.
pub(super) fn prepare<K: Kernel>(
    setup: &Setup<'_>,
    slots: Vec<Vec<K>>,
    shared: (&'static str, u64),
) -> Result<Prepared, Diagnostic> {
    let track = Track::new(setup, setup.params.number("smooth_hz"))?;
    let latency = track.latency(setup);
    let (voices, mix) = (Voices::new(slots), Mix::new(setup));
    let it = Gliding { voices, track, mix, rate_hz: setup.audio_hz, shared };
    Ok(Prepared::new(it).latency(latency).files(files(setup)))
}

impl<K: Kernel> Processor for Gliding<K> {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let turned = self.voices.turn(tick.inputs.value(SLOT));
        let place = tick.inputs.control(PLACE).try_into().unwrap_or([f64::NAN; 2]);
        let path = self.track.advance(place, tick.inputs.value(STROKE)).copied();
        let voices = self.voices.on();
        let Some(path) = path.filter(|_| !voices.is_empty()) else { return Status::Quiet };
        if self.track.begins() {
            voices.iter_mut().for_each(Kernel::lift);
        }
        let span = tick.samples(self.rate_hz);
        let parts = Parts::new(tick.index, span.start, self.rate_hz, tick.tick_hz);
        self.mix.begin((span.end - span.start) as usize);
        for kernel in voices {
            self.mix.add(|| 1.0, |part| kernel.process(&path, &parts, part));
        }
        if turned || self.track.begins() {
            self.mix.fade_in(&parts);
        }
        self.mix.write(tick.outputs.audio(0));
        Status::Continue
    }

    fn reset(&mut self) {
        self.voices.reset();
        self.track.reset();
    }

    /// Last positions of the stylus, and state of the kernels.
    fn state(&mut self, state: &mut State<'_>) {
        self.track.state(state);
        self.voices.state(state);
    }

    fn facts(&mut self) -> Vec<Fact> {
        let (name, count) = self.shared;
        let mut facts = vec![Fact::count("slots", self.voices.count() as u64), Fact::count(name, count)];
        let lag_s = self.track.lag_s();
        if lag_s > 0.0 {
            facts.push(Fact::number("response_lag", 1e3 * lag_s, "ms"));
        }
        facts
    }
}
