//! Checks whether the device can render a scene without generating energy.

use std::collections::HashMap;

use asperity_diagnostics::Place;
use asperity_node::{Direction, Law, Registry, ShapeSpec};

use super::bound::{Passivity, Quantisation, Sampling};
use super::effects::effect_of;
use super::{Device, NETWORK, Placed, Scene, Touchable};

/// A finding about a scene that its device may not be able to render.
#[derive(Clone, Debug)]
pub struct Finding {
    /// Message with the numbers.
    pub message: String,
    /// Place of the effect that the message is about.
    pub place: Place,
}

impl Scene {
    /// Timing with which this scene reads places and sets forces.
    pub fn sampling(&self) -> Sampling {
        Sampling { tick_hz: f64::from(self.tick_hz), delay_s: 1e-3 * self.device.delay_ms }
    }

    /// Passivity bound of a wall along its normal; `None` for a surface without stiffness.
    pub fn passivity(&self, surface: &Touchable) -> Option<Passivity> {
        let wall = Law {
            stiffness_n_per_mm: surface.effects.stiffness.as_ref()?.of,
            damping_ns_per_m: surface.effects.damping.as_ref().map_or(0.0, |d| d.of),
        };
        Some(Passivity::of(wall, self.sampling(), self.device.damping_ns_per_m))
    }

    /// Finds every law of force that is not passive on this device in any hand. Also finds every wall at
    /// which the device's position steps can be felt. The same finding about several surfaces comes once,
    /// at the first of them.
    pub fn findings(&self, registry: &Registry) -> Vec<Finding> {
        let mut all: Vec<(String, &str, Place, usize)> = Vec::new();
        let mut known: HashMap<String, usize> = HashMap::new();
        for surface in &self.surfaces {
            for (message, place) in self.of(surface, registry) {
                let at = *known.entry(message.clone()).or_insert(all.len());
                match all.get_mut(at) {
                    Some((.., count)) => *count += 1,
                    None => all.push((message, &surface.name, place, 1)),
                }
            }
        }
        let told = |(message, name, place, count): (String, &str, Place, usize)| {
            let more = if count > 1 { format!(" and {} more", count - 1) } else { String::new() };
            Finding { message: format!("`{name}`{more}{message}"), place }
        };
        all.into_iter().map(told).chain(self.unheard(registry)).collect()
    }

    /// Finds vibration that no node plays.
    fn unheard(&self, registry: &Registry) -> Option<Finding> {
        if self.output.is_some() {
            return None;
        }
        let place = |surface: &Touchable| {
            let vibrates = surface.effects.named.iter().find(|named| vibrates(registry, &named.kind));
            vibrates.map(|named| named.value.place())
        };
        let mut all = self.surfaces.iter().filter_map(|surface| Some((&surface.name, place(surface)?)));
        let (name, place) = all.next()?;
        let more = all.count();
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        let message =
            format!("`{name}`{more}: vibration without an output; add `output: audio_out` to the scene");
        Some(Finding { message, place })
    }

    fn of(&self, surface: &Touchable, registry: &Registry) -> Vec<(String, Place)> {
        let mut all = Vec::new();
        let wall = surface.effects.stiffness.as_ref().zip(self.passivity(surface));
        let wall = wall.map(|(Placed { place, .. }, passivity)| ("wall", passivity.law, place.clone()));
        let laws = self.laws(surface, registry);
        let of = |direction: Direction| {
            let laws = laws.iter().filter(move |(of, ..)| *of == direction);
            laws.map(|(_, name, law, place)| (*name, *law, place.clone()))
        };
        // Laws along one direction add up. A law in any direction adds to the others, and counts alone if
        // there are none.
        let normal: Vec<_> = wall.clone().into_iter().chain(of(Direction::Normal)).collect();
        let surface: Vec<_> = of(Direction::Surface).collect();
        let any: Vec<_> = of(Direction::Any).collect();
        let alone = normal.is_empty() && surface.is_empty();
        for (what, laws) in [("along its normal", normal), ("along its surface", surface)] {
            if !laws.is_empty() {
                all.extend(self.sum(what, laws.into_iter().chain(any.clone())));
            }
        }
        if alone {
            all.extend(self.sum("in its volume", any.into_iter()));
        }
        if let Some((_, law, place)) = wall
            && self.device.position_step_mm > 0.0
        {
            let Device { position_step_mm, friction_n, .. } = &self.device;
            let quantisation = Quantisation::of(law, self.sampling(), *position_step_mm, *friction_n);
            if !quantisation.holds() {
                all.push((format!(": {quantisation}"), place));
            }
        }
        all
    }

    /// Laws of a surface's effects, at the largest normal force.
    fn laws<'s>(&self, surface: &'s Touchable, registry: &Registry) -> Vec<(Direction, &'s str, Law, Place)> {
        let of = |named: &'s super::Named| {
            let settings = named.settings(registry).ok()?;
            let effect = effect_of(registry, &named.kind)?;
            let (direction, law) = effect.law_of(&settings, self.device.max_force_n)?;
            Some((direction, named.kind.as_str(), law, named.value.place()))
        };
        surface.effects.named.iter().filter_map(of).collect()
    }

    /// Finding about the sum of some laws, if the device cannot render it.
    fn sum<'s>(
        &self,
        what: &str,
        laws: impl Iterator<Item = (&'s str, Law, Place)>,
    ) -> Option<(String, Place)> {
        let laws: Vec<_> = laws.filter(|(_, law, _)| *law != Law::default()).collect();
        let sum = laws.iter().fold(Law::default(), |sum, (_, law, _)| sum + *law);
        let passivity = Passivity::of(sum, self.sampling(), self.device.damping_ns_per_m);
        let (_, _, place) = laws.first().filter(|_| !passivity.holds())?;
        let names: Vec<&str> = laws.iter().map(|(name, ..)| *name).collect();
        let unset = self.device.damping_ns_per_m == 0.0;
        let hint =
            if unset { "; set the device's own damping with `device: (damping_ns_per_m: ..)`" } else { "" };
        Some((format!(" {what} ({}): {passivity}{hint}", names.join(" + ")), place.clone()))
    }
}

/// Whether an effect is felt as vibration and not as a force: its output is audio.
pub(super) fn vibrates(registry: &Registry, kind: &str) -> bool {
    let outputs = registry.get(kind).map(|kind| &kind.descriptor().outputs);
    kind == NETWORK
        || outputs.is_some_and(|all| all.iter().any(|output| matches!(output.shape, ShapeSpec::Audio(_))))
}
