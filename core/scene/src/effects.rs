//! The effects of a surface.

use std::path::PathBuf;

use asperity_diagnostics::ron::{Record, Value};
use asperity_diagnostics::{Diagnostic, Place};

use super::read::{Known, body, error, file, number, numbers, place, variant};
use super::surface::heights;
use super::{Drag, Effects, Friction, Hum, Knock, Loop, Placed, Pull, Sound, Texture};
use crate::effect::friction::{Dahl, LuGre, LuGreSettings, ViscousCoulomb};
use crate::effect::{
    DecayingSinusoid, EffectError, Magnet, ReliefSettings, Tap, TapSettings, Transient, Vibration, Viscosity,
    WaveformQuantity, WaveformTable,
};

const EFFECTS: &[&str] =
    &["stiffness", "damping", "friction", "texture", "tap", "vibration", "viscosity", "magnet"];
const FRICTIONS: &[&str] = &["viscous_coulomb", "dahl", "lugre"];
const TEXTURES: &[&str] = &["network", "autoregressive", "waveform", "relief"];
/// Rate at which settings are tried; what depends on the audio rate is looked at again where that is known.
const TRIED_HZ: u32 = 48_000;
/// What gains may be.
const GAIN: std::ops::RangeInclusive<f64> = 0.0..=100.0;

/// The field `effects` of a surface.
pub(super) fn effects(value: Option<&Value>, known: &mut Known) -> Result<Effects, Diagnostic> {
    let mut effects = Effects::default();
    let Some(value) = value else { return Ok(effects) };
    let mut record = value.record("Effects")?;
    effects.stiffness = one(&mut record, "stiffness", stiffness)?;
    effects.damping = one(&mut record, "damping", damping)?;
    effects.friction = one(&mut record, "friction", friction)?;
    if let Some(value) = record.optional("texture") {
        let all = one_or_more(value);
        if all.is_empty() {
            return Err(value.error("a list of no textures").help("leave `texture` out, or name one"));
        }
        for value in all {
            let of = known.texture(value, texture)?;
            effects.textures.push(Placed { of, place: place(value) });
        }
    }
    effects.tap = one(&mut record, "tap", tap)?;
    effects.vibration = one(&mut record, "vibration", vibration)?;
    effects.viscosity = one(&mut record, "viscosity", viscosity)?;
    effects.magnet = one(&mut record, "magnet", magnet)?;
    record.finish(EFFECTS)?;
    agree(&effects)?;
    Ok(effects)
}

fn one<T>(
    record: &mut Record<'_>,
    name: &str,
    read: impl FnOnce(&Value) -> Result<T, Diagnostic>,
) -> Result<Option<Placed<T>>, Diagnostic> {
    record.optional(name).map(|value| Ok(Placed { of: read(value)?, place: place(value) })).transpose()
}

/// The values of a list, or the one that stands there without a list.
pub(super) fn one_or_more(value: &Value) -> &[Value] {
    value.list().unwrap_or_else(|_| std::slice::from_ref(value))
}

/// What an effect's constructor says, at the effect.
fn at<T>(value: &Value, made: Result<T, EffectError>) -> Result<T, Diagnostic> {
    made.map_err(|e| value.error(e.to_string()))
}

fn stiffness(value: &Value) -> Result<f64, Diagnostic> {
    let mut record = value.record("stiffness")?;
    let stiffness = record.required("stiffness_n_per_mm")?.f64_in(0.001..=100.0, "N/mm")?;
    record.finish(&["stiffness_n_per_mm"])?;
    Ok(stiffness)
}

fn damping(value: &Value) -> Result<f64, Diagnostic> {
    let mut record = value.record("damping")?;
    let damping = record.required("damping_ns_per_m")?.f64_in(0.0..=1000.0, "N s/m")?;
    record.finish(&["damping_ns_per_m"])?;
    Ok(damping)
}

pub(super) fn friction(value: &Value) -> Result<Friction, Diagnostic> {
    let name = variant(value, "friction", FRICTIONS)?;
    let mut record = body(value, name)?;
    let record = record.as_mut();
    let mut known: Vec<&str> = Vec::new();
    let mut fields = Fields { record, known: &mut known };
    let usual = LuGreSettings::default();
    let friction = match name {
        "viscous_coulomb" => Friction::ViscousCoulomb {
            coefficient: fields.number("coefficient", 0.0..=10.0, "", 0.3)?,
            viscosity_s_per_mm: fields.number(
                "viscosity_s_per_mm",
                0.0..=10.0,
                "s/mm",
                ViscousCoulomb::VISCOSITY_S_PER_MM,
            )?,
        },
        "dahl" => Friction::Dahl {
            coefficient: fields.number("coefficient", 0.0..=10.0, "", 0.3)?,
            bristle_stiffness_n_per_mm: fields.number(
                "bristle_stiffness_n_per_mm",
                0.0..=1000.0,
                "N/mm",
                1.0,
            )?,
        },
        _ => Friction::LuGre(LuGreSettings {
            static_coefficient: fields.number(
                "static_coefficient",
                0.0..=10.0,
                "",
                usual.static_coefficient,
            )?,
            kinetic_coefficient: fields.number(
                "kinetic_coefficient",
                0.0..=10.0,
                "",
                usual.kinetic_coefficient,
            )?,
            stribeck_speed_mm_s: fields.number(
                "stribeck_speed_mm_s",
                0.0..=1000.0,
                "mm/s",
                usual.stribeck_speed_mm_s,
            )?,
            bristle_stiffness_n_per_mm: fields.number(
                "bristle_stiffness_n_per_mm",
                0.0..=1000.0,
                "N/mm",
                usual.bristle_stiffness_n_per_mm,
            )?,
            bristle_damping_ns_per_m: fields.number(
                "bristle_damping_ns_per_m",
                0.0..=1000.0,
                "N s/m",
                usual.bristle_damping_ns_per_m,
            )?,
            viscosity_s_per_mm: fields.number(
                "viscosity_s_per_mm",
                0.0..=10.0,
                "s/mm",
                usual.viscosity_s_per_mm,
            )?,
        }),
    };
    finish(value, name, &known)?;
    match friction {
        Friction::ViscousCoulomb { coefficient, viscosity_s_per_mm } => {
            at(value, ViscousCoulomb::new(coefficient, viscosity_s_per_mm)).map(drop)
        }
        Friction::Dahl { coefficient, bristle_stiffness_n_per_mm } => {
            at(value, Dahl::new(coefficient, bristle_stiffness_n_per_mm)).map(drop)
        }
        Friction::LuGre(settings) => at(value, LuGre::new(settings)).map(drop),
    }?;
    Ok(friction)
}

/// Fields that may be left out, of a variant that may have none.
struct Fields<'r, 'v> {
    record: Option<&'r mut Record<'v>>,
    known: &'r mut Vec<&'static str>,
}

impl Fields<'_, '_> {
    fn number(
        &mut self,
        name: &'static str,
        range: std::ops::RangeInclusive<f64>,
        unit: &str,
        default: f64,
    ) -> Result<f64, Diagnostic> {
        self.known.push(name);
        match &mut self.record {
            Some(record) => number(record, name, range, unit, Some(default)),
            None => Ok(default),
        }
    }
}

/// Refuses fields that are not known, of a variant whose fields were read already.
fn finish(value: &Value, name: &str, known: &[&str]) -> Result<(), Diagnostic> {
    let Some(mut record) = body(value, name)? else { return Ok(()) };
    for name in known {
        record.optional(name);
    }
    record.finish(known)
}

pub(super) fn texture(value: &Value) -> Result<Texture, Diagnostic> {
    let name = variant(value, "texture", TEXTURES)?;
    let record = body(value, name)?;
    if name == "network" {
        if let Some(record) = record {
            record.finish(&[])?;
        }
        return Ok(Texture::Network);
    }
    let Some(mut record) = record else {
        return Err(value.error(format!("a texture by `{name}` needs to be told more")).help(match name {
            "autoregressive" => "autoregressive(model: \"FILE.ron\")",
            "waveform" => "waveform(segments: [(0, 0), (0.5, 1), (1, 0)], reference_speed_mm_s: 100)",
            _ => "relief(heights: made(surface: \"NAME\"))",
        }));
    };
    let gain = number(&mut record, "gain", GAIN, "", Some(1.0))?;
    match name {
        "autoregressive" => {
            let model = file(record.required("model")?)?;
            record.finish(&["model", "gain"])?;
            Ok(Texture::Autoregressive { model, gain })
        }
        "waveform" => waveform(value, record, gain),
        _ => {
            let usual = ReliefSettings::default();
            let heights = heights(record.required("heights")?)?;
            let cutoff_hz = number(&mut record, "cutoff_hz", 20.0..=20_000.0, "Hz", Some(usual.cutoff_hz))?;
            let max_m_s2 = number(&mut record, "max_m_s2", 0.1..=1e4, "m/s^2", Some(usual.max_m_s2))?;
            record.finish(&["heights", "cutoff_hz", "max_m_s2", "gain"])?;
            Ok(Texture::Relief { heights, cutoff_hz, max_m_s2, gain })
        }
    }
}

fn waveform(value: &Value, mut record: Record<'_>, gain: f64) -> Result<Texture, Diagnostic> {
    let crossfade_mm = number(&mut record, "crossfade_mm", 0.0..=1e5, "mm", Some(0.0))?;
    let speed_exponent = number(&mut record, "speed_exponent", 0.0..=2.0, "", Some(1.0))?;
    let list = match (record.optional("segments"), record.optional("recording")) {
        (Some(list), None) => list,
        (None, Some(value)) => {
            record.finish(&["recording", "crossfade_mm", "speed_exponent", "gain"])?;
            let (file, speed_mm_s, full_scale_m_s2) = recorded_loop(value)?;
            let quantity =
                WaveformQuantity::Acceleration { reference_speed_mm_s: speed_mm_s, speed_exponent };
            let values = Loop::Recorded { file, speed_mm_s, full_scale_m_s2 };
            return Ok(Texture::Waveform { values, crossfade_mm, quantity, gain });
        }
        (Some(_), Some(second)) => {
            return Err(second.error("segments and a recording of one waveform").help("one of the two"));
        }
        (None, None) => {
            return Err(value.error("a waveform of no values").help(
                "segments: [(0, 0), (0.5, 1), (1, 0)], or recording: (file: \"felt.wav\", speed_mm_s: 100, full_scale_m_s2: 50)",
            ));
        }
    };
    let mut segments = Vec::new();
    for pair in list.list()? {
        let [distance, height] = numbers::<2>(pair, &(-1e6..=1e6), "")?;
        segments.push((distance, height));
    }
    let spacing_mm = number(&mut record, "spacing_mm", 1e-4..=100.0, "mm", Some(0.05))?;
    let quantity = match record.optional("quantity") {
        Some(word) if word.choice(&["acceleration", "height"])? == "height" => WaveformQuantity::Height,
        _ => WaveformQuantity::Acceleration {
            reference_speed_mm_s: number(
                &mut record,
                "reference_speed_mm_s",
                0.1..=5000.0,
                "mm/s",
                Some(100.0),
            )?,
            speed_exponent,
        },
    };
    record.finish(&[
        "segments",
        "spacing_mm",
        "crossfade_mm",
        "quantity",
        "reference_speed_mm_s",
        "speed_exponent",
        "gain",
    ])?;
    at(value, WaveformTable::check_segments(&segments, spacing_mm, crossfade_mm, quantity))?;
    Ok(Texture::Waveform { values: Loop::Segments { segments, spacing_mm }, crossfade_mm, quantity, gain })
}

/// File, speed and full scale of a recorded loop.
fn recorded_loop(value: &Value) -> Result<(PathBuf, f64, f64), Diagnostic> {
    let mut record = value.record("recording")?;
    let file = file(record.required("file")?)?;
    let speed_mm_s = record.required("speed_mm_s")?.f64_in(0.1..=5000.0, "mm/s")?;
    let full_scale_m_s2 = record.required("full_scale_m_s2")?.f64_in(1e-3..=1e5, "m/s^2")?;
    record.finish(&["file", "speed_mm_s", "full_scale_m_s2"])?;
    Ok((file, speed_mm_s, full_scale_m_s2))
}

pub(super) fn tap(value: &Value) -> Result<Knock, Diagnostic> {
    let mut record = value.record("tap")?;
    let said = (record.optional("sinusoids"), record.optional("recording"));
    let usual = TapSettings::default();
    let mut field = |name, range, unit, default: f64| number(&mut record, name, range, unit, Some(default));
    let settings = TapSettings {
        min_speed_mm_s: field("min_speed_mm_s", 0.0..=1000.0, "mm/s", usual.min_speed_mm_s)?,
        max_speed_mm_s: field("max_speed_mm_s", 1.0..=10_000.0, "mm/s", usual.max_speed_mm_s)?,
        debounce_ms: field("debounce_ms", 2.0..=1000.0, "ms", usual.debounce_ms)?,
        floor_m_s2: field("floor_m_s2", 1e-6..=1.0, "m/s^2", usual.floor_m_s2)?,
    };
    if settings.min_speed_mm_s > settings.max_speed_mm_s {
        let (least, most) = (settings.min_speed_mm_s, settings.max_speed_mm_s);
        return Err(value.error(format!("a tap from {least} mm/s on and up to {most} mm/s is none")));
    }
    record.finish(&[
        "sinusoids",
        "recording",
        "min_speed_mm_s",
        "max_speed_mm_s",
        "debounce_ms",
        "floor_m_s2",
    ])?;
    let sound = match said {
        (Some(list), None) => Sound::Sinusoids(sinusoids(list)?),
        (None, Some(value)) => recording(value)?,
        (Some(_), Some(second)) => {
            return Err(second.error("sinusoids and a recording of one tap").help("one of the two"));
        }
        (None, None) => {
            return Err(value.error("a tap of no sound").help(
                "sinusoids: [(frequency_hz: 200, decay_ms: 10, gain: 30)], or recording: (file: \"tap.wav\", speed_mm_s: 100, \
                 full_scale_m_s2: 50)",
            ));
        }
    };
    if let Sound::Sinusoids(sinusoids) = &sound {
        at(value, Tap::new(&Transient::Sinusoids(sinusoids.clone()), settings, TRIED_HZ))?;
    }
    Ok(Knock { sound, settings })
}

fn sinusoids(list: &Value) -> Result<Vec<DecayingSinusoid>, Diagnostic> {
    let one = |item: &Value| {
        let mut one = item.record("sinusoid")?;
        let sinusoid = DecayingSinusoid {
            frequency_hz: one.required("frequency_hz")?.f64_in(1.0..=20_000.0, "Hz")?,
            decay_ms: one.required("decay_ms")?.f64_in(0.1..=1e5, "ms")?,
            gain: one.required("gain")?.f64_in(-1e5..=1e5, "(m/s^2)/(m/s)")?,
        };
        one.finish(&["frequency_hz", "decay_ms", "gain"])?;
        Ok(sinusoid)
    };
    list.list()?.iter().map(one).collect()
}

fn recording(value: &Value) -> Result<Sound, Diagnostic> {
    let mut record = value.record("recording")?;
    let file = file(record.required("file")?)?;
    let speed_mm_s = record.required("speed_mm_s")?.f64_in(0.1..=1e4, "mm/s")?;
    let full_scale_m_s2 = record.required("full_scale_m_s2")?.f64_in(1e-3..=1e5, "m/s^2")?;
    let gain = number(&mut record, "gain", GAIN, "", Some(1.0))?;
    record.finish(&["file", "speed_mm_s", "full_scale_m_s2", "gain"])?;
    Ok(Sound::Recorded { file, speed_mm_s, full_scale_m_s2, gain })
}

pub(super) fn vibration(value: &Value) -> Result<Hum, Diagnostic> {
    let mut record = value.record("vibration")?;
    let frequency_hz = record.required("frequency_hz")?.f64()?;
    let amplitude_m_s2 = record.required("amplitude_m_s2")?.f64()?;
    record.finish(&["frequency_hz", "amplitude_m_s2"])?;
    at(value, Vibration::new(frequency_hz, amplitude_m_s2, TRIED_HZ))?;
    Ok(Hum { frequency_hz, amplitude_m_s2 })
}

pub(super) fn viscosity(value: &Value) -> Result<Drag, Diagnostic> {
    let mut record = value.record("viscosity")?;
    let viscosity_ns_per_m = record.required("viscosity_ns_per_m")?.f64()?;
    let max_force_n = number(&mut record, "max_force_n", 0.0..=100.0, "N", Some(3.3))?;
    record.finish(&["viscosity_ns_per_m", "max_force_n"])?;
    at(value, Viscosity::new(viscosity_ns_per_m, max_force_n))?;
    Ok(Drag { viscosity_ns_per_m, max_force_n })
}

pub(super) fn magnet(value: &Value) -> Result<Pull, Diagnostic> {
    let mut record = value.record("magnet")?;
    let stiffness_n_per_mm = record.required("stiffness_n_per_mm")?.f64()?;
    let max_force_n = record.required("max_force_n")?.f64()?;
    let reach_mm = record.required("reach_mm")?.f64()?;
    record.finish(&["stiffness_n_per_mm", "max_force_n", "reach_mm"])?;
    at(value, Magnet::new(stiffness_n_per_mm, max_force_n, reach_mm))?;
    Ok(Pull { stiffness_n_per_mm, max_force_n, reach_mm })
}

/// Refuses effects that cannot be had together, or not alone.
fn agree(effects: &Effects) -> Result<(), Diagnostic> {
    let Effects { stiffness, damping, friction, textures, tap, .. } = effects;
    if stiffness.is_none() {
        let places: [(&str, Option<&Place>); 4] = [
            ("damping", damping.as_ref().map(|e| &e.place)),
            ("friction", friction.as_ref().map(|e| &e.place)),
            ("a texture", textures.first().map(|e| &e.place)),
            ("a tap", tap.as_ref().map(|e| &e.place)),
        ];
        if let Some((what, place)) = places.into_iter().find_map(|(what, place)| Some((what, place?))) {
            return Err(error(place, format!("{what} on a surface that does not push back"))
                .help("without `stiffness` there is no normal force, and nothing of this would be felt"));
        }
    }
    let mut networks = textures.iter().filter(|t| t.of == Texture::Network);
    if let (Some(first), Some(second)) = (networks.next(), networks.next()) {
        return Err(error(&second.place, "two network textures of one material").related(
            &first.place.source,
            first.place.span,
            "the other",
        ));
    }
    Ok(())
}
