//! Reads the fields of a scene file.

use std::collections::HashMap;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use asperity_diagnostics::ron::{self, Kind, Record, Value};
use asperity_diagnostics::{Diagnostic, Place, Source, Span, nearest, one_of};

use crate::space::HeightGrid;

use super::{Device, Heights, NETWORK, Part, Placed, Scene, Touchable, effects, surface};

impl Scene {
    /// Reads a scene file.
    ///
    /// # Errors
    /// The file cannot be read, is not RON, or does not have the fields of a scene; see
    /// [`parse`](Self::parse).
    pub fn read(path: impl AsRef<Path>) -> Result<Self, Diagnostic> {
        Self::parse(&Source::read(path)?)
    }

    /// Whether a text is meant as a scene: after comments it begins with `Scene`.
    pub fn is_meant(source: &Arc<Source>) -> bool {
        ron::first_word(source) == Some("Scene")
    }

    /// Reads a scene from a text. Call [`check`](Self::check) to find out whether its effects are known
    /// and their settings fit. That call asks the registry.
    ///
    /// # Errors
    /// - The text is not RON.
    /// - A field or shape is unknown (the error names the nearest known one).
    /// - A number is out of its range.
    /// - A surface has no area.
    /// - The picture of heights of a shape cannot be read. Other files that the scene names are not
    ///   opened.
    pub fn parse(source: &Arc<Source>) -> Result<Self, Diagnostic> {
        let value = ron::parse(source)?;
        let mut record = value.record("Scene")?;
        let scene = &mut record;
        let version = scene.required("version")?;
        if version.i64()? != 1 {
            return Err(version
                .error("unknown version of the scene format")
                .help("this program reads version 1"));
        }
        let here = Place { source: source.clone(), span: Span::at(value.span().start) };
        let usual = |kind: &str| Part { kind: kind.to_owned(), place: here.clone(), settings: Vec::new() };
        let of =
            |value: Option<&Value>, kind: &str| value.map_or_else(|| Ok(usual(kind)), |v| fields(v, kind));
        let mut known = Known::default();
        let read = Self {
            source: source.clone(),
            tick_hz: whole(scene, "tick_hz", 100..=4000, "Hz", 500)? as u32,
            audio_hz: whole(scene, "audio_hz", 8000..=192_000, "Hz", 48_000)? as u32,
            seed: whole(scene, "seed", 0..=i64::MAX, "", 1)? as u64,
            plugins: scene.optional("plugins").cloned(),
            input: part(scene.required("input")?)?,
            motion: of(scene.optional("motion"), "velocity")?,
            device: device(scene.optional("device"), &here)?,
            network: scene.optional(NETWORK).map(|value| fields(value, "texture_network")).transpose()?,
            // Same default as in graphs/texture.ron.
            phase: scene.optional("phase").map_or_else(|| Ok(usual("shaped_noise")), part)?,
            gate: of(scene.optional("gate"), "speed_gate")?,
            gain: number(scene, "gain", 0.0..=100.0, "", Some(1.0))?,
            actuator: of(scene.optional("actuator"), "actuator_inverse")?,
            output: scene.optional("output").map(part).transpose()?,
            hysteresis_mm: number(scene, "hysteresis_mm", 0.0..=10.0, "mm", Some(0.1))?,
            surfaces: surfaces(scene.required("surfaces")?, &mut known)?,
            pictures: known.pictures,
        };
        record.finish()?;
        let networked = read.surfaces.iter().find_map(|surface| surface.effects.place(NETWORK));
        match networked {
            Some(texture) if read.network.is_none() => {
                Err(error(&texture, "a network texture in a scene without a network")
                    .help("network: (model: \"FILE.onnx\", library: \"FILE.ron\")"))
            }
            _ => Ok(read),
        }
    }
}

/// Height grids by their sources: each is made once, which takes a millisecond or more.
#[derive(Default)]
pub(super) struct Known {
    grids: HashMap<String, Arc<HeightGrid>>,
    /// Pictures that were read.
    pictures: Vec<PathBuf>,
}

impl Known {
    pub(super) fn grid(
        &mut self,
        heights: &Heights,
        make: impl FnOnce() -> Result<HeightGrid, Diagnostic>,
    ) -> Result<Arc<HeightGrid>, Diagnostic> {
        let source = format!("{heights:?}");
        if let Some(found) = self.grids.get(&source) {
            return Ok(found.clone());
        }
        if let Heights::Picture { file, .. } = heights {
            self.pictures.push(file.clone());
        }
        let made = Arc::new(make()?);
        self.grids.insert(source, made.clone());
        Ok(made)
    }
}

/// Error at a place.
pub(super) fn error(place: &Place, message: impl Into<String>) -> Diagnostic {
    Diagnostic::new(message).at(&place.source, place.span)
}

/// Number of a record, within a range. It is required if there is no default.
pub(super) fn number(
    record: &mut Record<'_>,
    name: &str,
    range: RangeInclusive<f64>,
    unit: &str,
    default: Option<f64>,
) -> Result<f64, Diagnostic> {
    match (record.optional(name), default) {
        (Some(value), _) => value.f64_in(range, unit),
        (None, Some(default)) => Ok(default),
        (None, None) => record.required(name).and_then(Value::f64),
    }
}

/// Whole number of a record, within a range.
pub(super) fn whole(
    record: &mut Record<'_>,
    name: &str,
    range: RangeInclusive<i64>,
    unit: &str,
    default: i64,
) -> Result<i64, Diagnostic> {
    record.optional(name).map_or(Ok(default), |value| value.i64_in(range, unit))
}

/// Fixed count of numbers, each within a range.
pub(super) fn numbers<const N: usize>(
    value: &Value,
    range: &RangeInclusive<f64>,
    unit: &str,
) -> Result<[f64; N], Diagnostic> {
    let items = value.list().map_err(|_| {
        value.error(format!("expected {N} numbers, found {}", value.describe())).help(match N {
            2 => "(x, y)",
            _ => "(x, y, z)",
        })
    })?;
    let all = items.iter().map(|item| item.f64_in(range.clone(), unit)).collect::<Result<Vec<_>, _>>()?;
    let wrong = |all: Vec<f64>| value.error(format!("expected {N} numbers, found {}", all.len()));
    all.try_into().map_err(wrong)
}

/// Name of a variant, out of a given set: `name` or `name(...)`.
pub(super) fn variant<'v>(
    value: &'v Value,
    what: &str,
    names: &[&'static str],
) -> Result<&'v str, Diagnostic> {
    let (Kind::Word(name) | Kind::Record { name: Some(name), .. }) = value.kind() else {
        let message = format!("expected a {what}, found {}", value.describe());
        return Err(value.error(message).help(one_of("", names.iter().copied())));
    };
    if names.contains(&name.as_str()) {
        return Ok(name);
    }
    let all = one_of("", names.iter().copied());
    let help = match nearest(name, names.iter().copied()) {
        Some(near) => format!("did you mean `{near}`? {all}"),
        None => all,
    };
    Err(error(&word(value, name), format!("unknown {what} `{name}`")).help(help))
}

/// Place of the word that a value begins with.
pub(super) fn word(value: &Value, word: &str) -> Place {
    let start = value.span().start;
    Place { source: value.source().clone(), span: Span { start, end: start + word.len() } }
}

/// Fields of a variant. A bare word has none.
pub(super) fn body<'v>(value: &'v Value, name: &str) -> Result<Option<Record<'v>>, Diagnostic> {
    if matches!(value.kind(), Kind::Word(_)) { Ok(None) } else { value.record(name).map(Some) }
}

fn part(value: &Value) -> Result<Part, Diagnostic> {
    match value.kind() {
        Kind::Word(kind) => Ok(Part { kind: kind.clone(), place: value.place(), settings: Vec::new() }),
        Kind::Record { name: Some(kind), fields } => {
            Ok(Part { kind: kind.clone(), place: word(value, kind), settings: fields.clone() })
        }
        _ => Err(value
            .error(format!("expected a node's kind and its parameters, found {}", value.describe()))
            .help("kind(parameter: value)")),
    }
}

fn fields(value: &Value, kind: &str) -> Result<Part, Diagnostic> {
    let settings = value.record(kind)?.all().to_vec();
    Ok(Part { kind: kind.to_owned(), place: value.place(), settings })
}

fn device(value: Option<&Value>, here: &Place) -> Result<Device, Diagnostic> {
    let mut record = value.map(|value| value.record("Device")).transpose()?;
    let mut number = |name, range, unit, usual| match &mut record {
        Some(record) => number(record, name, range, unit, Some(usual)),
        None => Ok(usual),
    };
    let mut device = Device {
        max_force_n: number("max_force_n", 0.01..=100.0, "N", 3.3)?,
        damping_ns_per_m: number("damping_ns_per_m", 0.0..=1000.0, "N s/m", 0.0)?,
        friction_n: number("friction_n", 0.0..=10.0, "N", 0.0)?,
        position_step_mm: number("position_step_mm", 0.0..=10.0, "mm", 0.0)?,
        delay_ms: number("delay_ms", 0.0..=100.0, "ms", 0.0)?,
        output: None,
        place: value.map_or_else(|| here.clone(), Value::place),
    };
    if let Some(mut record) = record {
        device.output = record.optional("output").map(part).transpose()?;
        record.finish()?;
    }
    Ok(device)
}

fn surfaces(list: &Value, known: &mut Known) -> Result<Vec<Touchable>, Diagnostic> {
    let entries = list.map()?;
    if entries.is_empty() {
        let help = "surfaces: {\"floor\": (shape: plane, ...)}";
        return Err(list.error("a scene without surfaces").help(help));
    }
    entries.iter().map(|(key, value)| touchable(key, value, known)).collect()
}

fn touchable(key: &ron::Key, value: &Value, known: &mut Known) -> Result<Touchable, Diagnostic> {
    let place = Place { source: value.source().clone(), span: key.span };
    if key.name.trim().is_empty() {
        return Err(error(&place, "a surface without a name"));
    }
    let mut record = value.record("Surface")?;
    let surface = surface::surface(&mut record, known)?;
    let material = record.optional("material");
    let material = material.map(|v| Ok(Placed { of: v.text()?.to_owned(), place: v.place() })).transpose()?;
    let effects = effects::effects(record.optional("effects"))?;
    record.finish()?;
    if let (Some(texture), None) = (effects.place(NETWORK), &material) {
        return Err(error(&texture, "a network texture without a material")
            .help("material: \"NAME\" of the network's library, beside `effects`"));
    }
    Ok(Touchable { name: key.name.clone(), place, surface, material, effects })
}
