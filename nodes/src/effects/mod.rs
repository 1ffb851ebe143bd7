//! Effects of surfaces on a stylus. Forces by the tick: `friction`, `viscosity`, `magnet`, and
//! `force_limiter` behind them. Vibration by the sample: `tap`, `vibration`, `autoregressive`, `waveform`,
//! `relief`, and `level` behind these.
//!
//! A node that renders an effect holds it for many surfaces: a list of texts, each as it stands behind the
//! effect's field in a [scene](asperity_scene). The number in its input `slot` picks one; 0 is the first. A
//! number below 0, beyond the list or not a number picks none. Unconnected, `slot` picks the first, so a
//! graph of one surface needs no node that picks.

mod autoregressive;
mod bounds;
mod force_limiter;
mod friction;
mod gliding;
mod level;
mod magnet;
mod mix;
mod path;
mod relief;
mod tap;
#[cfg(test)]
mod tests;
mod track;
mod vibration;
mod viscosity;
mod voices;
mod waveform;

pub use autoregressive::Autoregressive;
pub use force_limiter::ForceLimiter;
pub use friction::Friction;
pub use level::Level;
pub use magnet::Magnet;
pub use relief::Relief;
pub use tap::Tap;
pub use vibration::Vibration;
pub use viscosity::Viscosity;
pub use waveform::Waveform;
pub(crate) use waveform::close;

use std::collections::{HashMap, HashSet};
use std::path::PathBuf;
use std::sync::Arc;

use crate::prelude::*;
use asperity_data::wav::Wav;
use asperity_diagnostics::ron::Value;

/// Audio rate at which settings of a scene are tried. The node tries them again at its own.
const TRIED_HZ: u32 = 48_000;

/// The entry that a slot picks of so many.
fn pick(slot: f64, count: usize) -> Option<usize> {
    // NaN is not at least 0, and a large float becomes the largest integer.
    (slot >= 0.0).then_some(slot as usize).filter(|entry| *entry < count)
}

/// The input that picks; unconnected, the first.
fn slot(doc: &'static str) -> Input {
    control("slot", 1, ONE).or(0.0).doc(doc)
}

/// Declares an effect, and the list of its slots.
trait Renders {
    fn renders(self, effect: Effect) -> Self;
}

impl Renders for Descriptor {
    fn renders(self, effect: Effect) -> Self {
        let texture = effect.acts == Acts::Gliding;
        let key = if texture { "texture" } else { self.kind.as_ref() };
        let example = effect.forms.first().map_or("", |form| form.example.as_ref());
        let sum = if texture { " A list of textures in one entry sounds as their sum." } else { "" };
        let path = effect.path_field().map_or("", |_| " The path of its file alone will do: \"FILE.ron\".");
        let doc = format!(
            "Settings of each slot. An entry is written as after `{key}` in a scene, for example \
             `r#\"{example}\"#`.{path}{sum}"
        );
        let list = Param { name: effect.list.clone(), doc: doc.into(), ..texts("") };
        self.param(list).effect(effect)
    }
}

/// The output for a vibration.
pub(crate) fn acceleration() -> Output {
    Output::new("acceleration", ShapeSpec::Audio(RateSpec::Graph), Unit::METRE_PER_SECOND_SQUARED)
}

/// The output for a force.
fn force(doc: &'static str) -> Output {
    control_out("force", 3, N).doc(doc)
}

/// The values of a control; all 0 where one is not finite.
fn vector<const N: usize>(inputs: &Inputs<'_>, input: usize) -> [f64; N] {
    match <[f64; N]>::try_from(inputs.control(input)) {
        Ok(values) if values.iter().all(|x| x.is_finite()) => values,
        _ => [0.0; N],
    }
}

/// Puts a force out, or none of it where it is not finite.
fn put(tick: &mut Tick<'_>, force: [f64; 3]) {
    let force = if force.iter().all(|f| f.is_finite()) { force } else { [0.0; 3] };
    tick.outputs.control(0).iter_mut().zip(force).for_each(|(out, f)| *out = f);
}

/// Puts no force out. The node is called again when its slot changes.
fn let_go(tick: &mut Tick<'_>) -> Status {
    put(tick, [0.0; 3]);
    Status::Asleep
}

/// A node whose force follows from the settings of its slot and its inputs alone.
struct Force<S> {
    slots: Vec<S>,
    force: fn(&S, &Inputs<'_>) -> [f64; 3],
}

impl<S: Send> Processor for Force<S> {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let slot = pick(tick.inputs.value(0), self.slots.len()).and_then(|slot| self.slots.get(slot));
        let Some(slot) = slot else { return let_go(tick) };
        let force = (self.force)(slot, &tick.inputs);
        put(tick, force);
        Status::Continue
    }

    fn facts(&mut self) -> Vec<Fact> {
        vec![Fact::count("slots", self.slots.len() as u64)]
    }
}

/// Things that take time or memory to make, by their sources.
type Made<T> = HashMap<String, Arc<T>>;

/// Returns the thing of a name; makes it if there is none yet.
fn shared<T>(
    all: &mut Made<T>,
    name: String,
    make: impl FnOnce() -> Result<T, Diagnostic>,
) -> Result<Arc<T>, Diagnostic> {
    if let Some(made) = all.get(&name) {
        return Ok(made.clone());
    }
    let made = Arc::new(make()?);
    all.insert(name, made.clone());
    Ok(made)
}

/// Makes the settings of every slot into players.
fn each<T>(
    setup: &Setup<'_>,
    mut make: impl FnMut(&Settings) -> Result<T, Diagnostic>,
) -> Result<Vec<Vec<T>>, Diagnostic> {
    setup.params.slots().iter().map(|slot| slot.iter().map(&mut make).collect()).collect()
}

/// The same for an effect whose slots have one setting each.
fn one_each<T>(
    setup: &Setup<'_>,
    mut make: impl FnMut(&Settings) -> Result<T, Diagnostic>,
) -> Result<Vec<T>, Diagnostic> {
    let one = |slot: &Vec<Settings>| match &slot[..] {
        [one] => make(one),
        [] => Err(setup.params.node_error("an empty slot")),
        [_, second, ..] => Err(second.node_error("expected one setting")),
    };
    setup.params.slots().iter().map(one).collect()
}

/// The files that the settings of all slots name, each once.
fn files(setup: &Setup<'_>) -> Vec<PathBuf> {
    let mut known = HashSet::new();
    let files = setup.params.slots().iter().flatten().flat_map(Settings::files);
    files.filter(|file| known.insert(file.clone())).collect()
}

/// Most samples of a recording: a minute and a half at 48 kHz.
pub(crate) const MAX_RECORDED: u32 = 1 << 22;

/// A recording that settings name. Its file is not read yet.
struct Recorded {
    file: PathBuf,
    speed_mm_s: f64,
    /// Acceleration of full scale, times a gain.
    scale_m_s2: f64,
}

impl Recorded {
    /// Rate and accelerations, of several channels the first.
    fn read(&self) -> Result<(f64, Vec<f64>), Diagnostic> {
        let wav = Wav::read(&self.file, MAX_RECORDED)?;
        Ok((f64::from(wav.rate_hz), wav.channel(0).map(|x| self.scale_m_s2 * x).collect()))
    }
}

/// Source of samples: a list that stands in the settings, or a recording.
enum Samples<'s> {
    Listed(&'s [Value]),
    Recorded(Recorded),
}

/// Reads either the field `list` or the field `recording` of `what`. A recording is of a speed up to
/// `fastest`; a gain of its own it may have where `gains`.
fn samples<'s>(
    settings: &'s Settings,
    (what, list, example): (&str, &str, &str),
    (fastest_mm_s, gains): (f64, bool),
) -> Result<Samples<'s>, Diagnostic> {
    match (settings.nested(list), settings.nested("recording")) {
        (Some(list), None) => list.list().map(Samples::Listed),
        (None, Some(value)) => {
            let mut record = value.record("recording")?;
            let file = record.required("file")?.path()?;
            let speed_mm_s = record.required("speed_mm_s")?.f64_in(0.1..=fastest_mm_s, "mm/s")?;
            let full_scale_m_s2 = record.required("full_scale_m_s2")?.f64_in(1e-3..=1e5, "m/s^2")?;
            let gain = if gains { record.optional("gain") } else { None };
            let gain = gain.map_or(Ok(1.0), |gain| gain.f64_in(0.0..=100.0, ""))?;
            record.finish()?;
            Ok(Samples::Recorded(Recorded { file, speed_mm_s, scale_m_s2: gain * full_scale_m_s2 }))
        }
        (Some(_), Some(second)) => {
            let message = format!("{what} has both `{list}` and a `recording`");
            Err(second.error(message).help("leave one of the two out"))
        }
        (None, None) => {
            let recording = "recording: (file: \"NAME.wav\", speed_mm_s: 100, full_scale_m_s2: 50)";
            let message = format!("{what} needs `{list}` or a `recording`");
            Err(settings.node_error(message).help(format!("{list}: {example}, or {recording}")))
        }
    }
}

/// Takes the result of a law's constructor. Its error points at the settings.
fn made<T>(settings: &Settings, made: Result<T, String>) -> Result<T, Diagnostic> {
    made.map_err(|e| settings.node_error(e))
}

/// The field `gain` of textures.
fn gain() -> Param {
    number("gain", 1.0, 0.0..=100.0, "").doc("factor on the acceleration")
}
