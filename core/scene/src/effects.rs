//! Effects of a surface: its wall, and the other effects that the file names.

use std::collections::HashSet;
use std::path::PathBuf;
use std::sync::LazyLock;

use asperity_diagnostics::ron::{Kind, Record, Value};
use asperity_diagnostics::{Diagnostic, Place, one_of};
use asperity_node::{Acts, Effect, Form, Registry, Settings};

use super::read::{error, word};
use super::{NETWORK, Named, Placed, Scene};

/// Effects of a surface on a stylus. An effect that is not named does not act.
#[derive(Clone, Debug, Default)]
pub struct Effects {
    /// Stiffness of the wall, by Hooke's law \[N/mm\], 0.001 to 100.
    pub stiffness: Option<Placed<f64>>,
    /// Damping of the wall along its normal while it is touched \[N s/m\], 0 to 1000.
    pub damping: Option<Placed<f64>>,
    /// Effects by the names of their kinds, in the order of the file. `network` is the texture by the scene's
    /// network.
    pub named: Vec<Named>,
}

impl Effects {
    /// The effects of a kind, in the order of the file.
    pub fn of<'a>(&'a self, kind: &'a str) -> impl Iterator<Item = &'a Named> {
        self.named.iter().filter(move |named| named.kind == kind)
    }

    /// Whether there is a texture.
    pub fn has_texture(&self) -> bool {
        self.named.iter().any(|named| named.texture)
    }

    /// Place of the first effect of a kind.
    pub fn place(&self, kind: &str) -> Option<Place> {
        self.of(kind).next().map(|named| named.value.place())
    }
}

/// Reads the field `effects` of a surface.
pub(super) fn effects(value: Option<&Value>) -> Result<Effects, Diagnostic> {
    let mut effects = Effects::default();
    let Some(value) = value else { return Ok(effects) };
    let mut record = value.record("Effects")?;
    effects.stiffness = wall(&mut record, "stiffness", "stiffness_n_per_mm", 0.001..=100.0, "N/mm")?;
    effects.damping = wall(&mut record, "damping", "damping_ns_per_m", 0.0..=1000.0, "N s/m")?;
    for (key, value) in record.all() {
        match key.name.as_str() {
            "stiffness" | "damping" => {}
            "texture" => textures(value, &mut effects)?,
            kind => effects.named.push(Named {
                kind: kind.to_owned(),
                name: Place { source: value.source().clone(), span: key.span },
                texture: false,
                value: value.clone(),
            }),
        }
    }
    Ok(effects)
}

/// Reads a property of the wall, a record with one number.
fn wall(
    record: &mut Record<'_>,
    name: &str,
    field: &str,
    range: std::ops::RangeInclusive<f64>,
    unit: &str,
) -> Result<Option<Placed<f64>>, Diagnostic> {
    let Some(value) = record.optional(name) else { return Ok(None) };
    let mut record = value.record(name)?;
    let of = record.required(field)?.f64_in(range, unit)?;
    record.finish()?;
    Ok(Some(Placed { of, place: value.place() }))
}

/// Kind of a texture that is written as the path of its file alone.
const FROM_FILE: &str = "autoregressive";

/// Reads the field `texture`: one texture or a list of them.
fn textures(value: &Value, effects: &mut Effects) -> Result<(), Diagnostic> {
    let all = value.list().unwrap_or_else(|_| std::slice::from_ref(value));
    if all.is_empty() {
        return Err(value.error("an empty list of textures").help("leave `texture` out, or name one"));
    }
    for value in all {
        let (kind, name) = match value.kind() {
            Kind::Word(kind) | Kind::Record { name: Some(kind), .. } => (kind.as_str(), word(value, kind)),
            Kind::Text(_) => (FROM_FILE, value.place()),
            _ => {
                return Err(value
                    .error(format!("expected a texture, found {}", value.describe()))
                    .help("texture: network, texture: \"FILE.ron\", or texture: relief(heights: ...)"));
            }
        };
        if let (NETWORK, Some(first)) = (kind, effects.place(NETWORK)) {
            let second = error(&value.place(), "two network textures of one material");
            return Err(second.related(&first.source, first.span, "the other"));
        }
        effects.named.push(Named { kind: kind.to_owned(), name, texture: true, value: value.clone() });
    }
    Ok(())
}

/// The texture by the scene's network: its settings are the surface's material.
static BY_NETWORK: LazyLock<Effect> =
    LazyLock::new(|| Effect::new("materials", Acts::Gliding).form(Form::new("", NETWORK)));

/// Finds the effect of a kind.
pub(super) fn effect_of<'r>(registry: &'r Registry, kind: &str) -> Option<&'r Effect> {
    if kind == NETWORK {
        return Some(&BY_NETWORK);
    }
    registry.get(kind)?.descriptor().effect.as_ref()
}

impl Named {
    /// Reads the settings by the rules of the effect.
    ///
    /// # Errors
    /// The name is not an effect, or the effect refuses the settings.
    pub fn settings(&self, registry: &Registry) -> Result<Settings, Diagnostic> {
        effect_of(registry, &self.kind)
            .filter(|effect| self.fits(effect))
            .map_or_else(|| Err(self.unknown(registry)), |effect| effect.read(&self.kind, &self.value))
    }

    /// Whether the effect stands in the right field: in `texture` or not.
    fn fits(&self, effect: &Effect) -> bool {
        self.texture == (effect.acts == Acts::Gliding)
    }

    fn unknown(&self, registry: &Registry) -> Diagnostic {
        let kinds = registry.effects().filter(|(_, effect)| self.fits(effect)).map(|(kind, _)| kind);
        let others: &[&str] = if self.texture { &[NETWORK] } else { &["stiffness", "damping", "texture"] };
        let names: Vec<&str> = others.iter().copied().chain(kinds).collect();
        let what = if self.texture { "texture" } else { "effect" };
        error(&self.name, format!("unknown {what} `{}`", self.kind)).help(one_of(&self.kind, names))
    }
}

impl Scene {
    /// Files that the effects name, once for each surface that names them.
    pub fn files(&self, registry: &Registry) -> Vec<PathBuf> {
        let named = self.surfaces.iter().flat_map(|surface| &surface.effects.named);
        let settings = named.filter_map(|named| named.settings(registry).ok());
        settings.flat_map(|settings| settings.files()).collect()
    }

    /// Checks the effects of all surfaces against their kinds.
    ///
    /// # Errors
    /// - A name is not an effect (the error names the nearest effect).
    /// - Settings do not fit.
    /// - An effect that needs a wall is on a surface without a stiffness.
    pub fn check(&self, registry: &Registry) -> Result<(), Diagnostic> {
        // Surfaces that are alike need only one check, since some checks take a millisecond.
        let mut known = HashSet::new();
        for surface in &self.surfaces {
            let effects = &surface.effects;
            for named in &effects.named {
                if known.insert((&named.kind, named.texture, named.value.to_string())) {
                    named.settings(registry)?;
                }
            }
            if effects.stiffness.is_some() {
                continue;
            }
            let on_walls = |named: &&Named| {
                let acts = effect_of(registry, &named.kind).map(|effect| effect.acts);
                matches!(acts, Some(Acts::Touching | Acts::Gliding))
            };
            let damping = effects.damping.as_ref().map(|damping| ("damping", &damping.place));
            let named = effects.named.iter().find(on_walls).map(|named| (named.kind.as_str(), &named.name));
            if let Some((what, place)) = damping.or(named) {
                return Err(error(place, format!("`{what}` on a surface that does not push back")).help(
                    "without `stiffness` there is no normal force, and nothing of this would be felt",
                ));
            }
        }
        Ok(())
    }
}
