//! Reads the fields of a scene file.

use std::collections::HashMap;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use asperity_diagnostics::ron::{self, Kind, Record, Value};
use asperity_diagnostics::{Diagnostic, Place, Source, Span, nearest, one_of};

use crate::space::HeightGrid;

use super::{Device, NETWORK, Part, Placed, Scene, Touchable, effects, surface};

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
        let mut scene = value.record("Scene")?;
        let version = scene.required("version")?;
        if version.i64()? != 1 {
            return Err(version
                .error("unknown version of the scene format")
                .help("this program reads version 1"));
        }
        let mut whole = |name, range: RangeInclusive<i64>, unit, default: i64| {
            scene.optional(name).map_or(Ok(default), |v| v.i64_in(range, unit))
        };
        let tick_hz = whole("tick_hz", 100..=4000, "Hz", 500)? as u32;
        let audio_hz = whole("audio_hz", 8000..=192_000, "Hz", 48_000)? as u32;
        let seed = whole("seed", 0..=i64::MAX, "", 1)? as u64;
        let plugins = scene.optional("plugins").cloned();
        let input = part(scene.required("input")?)?;
        let here = Place { source: source.clone(), span: Span::at(value.span().start) };
        let mut section = |name, kind: &str| -> Result<Option<Part>, Diagnostic> {
            scene.optional(name).map(|value| fields(value, kind)).transpose()
        };
        let usual = |kind: &str| Part { kind: kind.to_owned(), place: here.clone(), settings: Vec::new() };
        let motion = section("motion", "velocity")?.unwrap_or_else(|| usual("velocity"));
        let network = section("network", "texture_network")?;
        let gate = section("gate", "speed_gate")?.unwrap_or_else(|| usual("speed_gate"));
        let actuator = section("actuator", "actuator_inverse")?.unwrap_or_else(|| usual("actuator_inverse"));
        // Same default as in graphs/texture.ron.
        let phase = scene.optional("phase").map(part).transpose()?.unwrap_or_else(|| usual("shaped_noise"));
        let output = scene.optional("output").map(part).transpose()?;
        let device = device(scene.optional("device"), here)?;
        let gain = number(&mut scene, "gain", 0.0..=100.0, "", Some(1.0))?;
        let hysteresis_mm = number(&mut scene, "hysteresis_mm", 0.0..=10.0, "mm", Some(0.1))?;
        let mut known = Known::default();
        let list = scene.required("surfaces")?;
        let entries = list.map()?;
        if entries.is_empty() {
            return Err(list
                .error("a scene of nothing to touch")
                .help("surfaces: {\"floor\": (shape: plane, ...)}"));
        }
        let surfaces = entries
            .iter()
            .map(|(key, value)| touchable(key, value, &mut known))
            .collect::<Result<Vec<_>, _>>()?;
        scene.finish()?;
        let networked = surfaces.iter().find_map(|surface| surface.effects.place(NETWORK));
        if let (Some(texture), None) = (networked, &network) {
            return Err(error(&texture, "a network texture in a scene without a network")
                .help("network: (model: \"FILE.onnx\", library: \"FILE.ron\")"));
        }
        let source = source.clone();
        Ok(Self {
            source,
            tick_hz,
            audio_hz,
            seed,
            plugins,
            input,
            motion,
            device,
            network,
            phase,
            gate,
            gain,
            actuator,
            output,
            hysteresis_mm,
            surfaces,
            pictures: known.pictures,
        })
    }
}

/// Cache of height grids: a text that stands in the file more than once makes only one grid. Making a
/// grid takes a millisecond or more.
#[derive(Default)]
pub(super) struct Known {
    grids: HashMap<String, Arc<HeightGrid>>,
    /// Pictures that were read.
    pub(super) pictures: Vec<PathBuf>,
}

impl Known {
    pub(super) fn grid(
        &mut self,
        value: &Value,
        make: impl FnOnce(&Value) -> Result<HeightGrid, Diagnostic>,
    ) -> Result<Arc<HeightGrid>, Diagnostic> {
        let text = value.to_string();
        if let Some(found) = self.grids.get(&text) {
            return Ok(found.clone());
        }
        let made = Arc::new(make(value)?);
        self.grids.insert(text, made.clone());
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
    if items.len() != N {
        return Err(value.error(format!("{} numbers, where {N} are wanted", items.len())));
    }
    let mut all = [0.0; N];
    for (to, item) in all.iter_mut().zip(items) {
        *to = item.f64_in(range.clone(), unit)?;
    }
    Ok(all)
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

fn device(value: Option<&Value>, here: Place) -> Result<Device, Diagnostic> {
    let mut device = Device {
        max_force_n: 3.3,
        damping_ns_per_m: 0.0,
        friction_n: 0.0,
        position_step_mm: 0.0,
        delay_ms: 0.0,
        output: None,
        place: here,
    };
    let Some(value) = value else { return Ok(device) };
    device.place = value.place();
    let mut record = value.record("Device")?;
    let mut number = |name, range, unit, default| number(&mut record, name, range, unit, Some(default));
    device.max_force_n = number("max_force_n", 0.01..=100.0, "N", device.max_force_n)?;
    device.damping_ns_per_m = number("damping_ns_per_m", 0.0..=1000.0, "N s/m", 0.0)?;
    device.friction_n = number("friction_n", 0.0..=10.0, "N", 0.0)?;
    device.position_step_mm = number("position_step_mm", 0.0..=10.0, "mm", 0.0)?;
    device.delay_ms = number("delay_ms", 0.0..=100.0, "ms", 0.0)?;
    device.output = record.optional("output").map(part).transpose()?;
    record.finish()?;
    Ok(device)
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
        return Err(error(&texture, "a network texture of no material")
            .help("material: \"NAME\" of the network's library, beside `effects`"));
    }
    Ok(Touchable { name: key.name.clone(), place, surface, material, effects })
}
