//! What a scene asks of its device.

use std::collections::HashMap;

use super::{Device, Friction, Kind, Placed, Scene, Touchable};
use crate::effect::Magnet;
use crate::effect::friction::{Dahl, LuGre, ViscousCoulomb};
use crate::effect::passivity::{Law, Passivity, Quantisation, Sampling};
use asperity_diagnostics::Place;

/// Something about a scene that its device may not bear.
#[derive(Clone, Debug)]
pub struct Finding {
    /// What, with the numbers.
    pub message: String,
    /// The effect it is about.
    pub place: Place,
}

impl Scene {
    /// When this scene reads places and sets forces.
    pub fn sampling(&self) -> Sampling {
        Sampling { tick_hz: f64::from(self.tick_hz), delay_s: 1e-3 * self.device.delay_ms }
    }

    /// What a wall asks of the device along its normal; none of a surface without stiffness.
    pub fn passivity(&self, surface: &Touchable) -> Option<Passivity> {
        let wall = Law {
            stiffness_n_per_mm: surface.effects.stiffness.as_ref()?.of,
            damping_ns_per_m: surface.effects.damping.as_ref().map_or(0.0, |d| d.of),
        };
        Some(Passivity::of(wall, self.sampling(), self.device.damping_ns_per_m))
    }

    /// Every law of force that is not passive on this device in any hand, and every wall at which its steps of place can be felt; once for all surfaces of
    /// which the same is to be said, at the first of them.
    pub fn findings(&self) -> Vec<Finding> {
        let mut all: Vec<(String, &str, Place, usize)> = Vec::new();
        let mut known: HashMap<String, usize> = HashMap::new();
        for surface in &self.surfaces {
            for (message, place) in self.of(surface) {
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
        all.into_iter().map(told).chain(self.unheard()).collect()
    }

    /// Vibration that nothing plays.
    fn unheard(&self) -> Option<Finding> {
        if self.output.is_some() {
            return None;
        }
        let place = |surface: &Touchable| {
            let kinds = Kind::ALL.iter().filter(|kind| kind.vibrates());
            kinds.flat_map(|kind| kind.places(&surface.effects)).next().cloned()
        };
        let mut all = self.surfaces.iter().filter_map(|surface| Some((&surface.name, place(surface)?)));
        let (name, place) = all.next()?;
        let more = all.count();
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        let message =
            format!("`{name}`{more}: nothing plays what vibrates here; add `output: audio_out` to the scene");
        Some(Finding { message, place })
    }

    fn of(&self, surface: &Touchable) -> Vec<(String, Place)> {
        let mut all = Vec::new();
        let effects = &surface.effects;
        let drag = effects.viscosity.as_ref().map(|Placed { of, place }| {
            let law = Law { stiffness_n_per_mm: 0.0, damping_ns_per_m: of.viscosity_ns_per_m };
            ("drag", law, place)
        });
        let wall = effects.stiffness.as_ref().zip(self.passivity(surface));
        let wall = wall.map(|(Placed { place, .. }, passivity)| ("wall", passivity.law, place));
        let magnet = effects.magnet.as_ref().and_then(|Placed { of, place }| {
            let magnet = Magnet::new(of.stiffness_n_per_mm, of.max_force_n, of.reach_mm).ok()?;
            Some(("magnet", magnet.law(), place))
        });
        let friction = effects
            .friction
            .as_ref()
            .map(|Placed { of, place }| ("friction", law(*of, self.device.max_force_n), place));
        // What acts along one direction adds. Drag acts along all, and is told of once where there is nothing else.
        let along = |what: &str, laws: [Option<(&str, Law, &Place)>; 3]| {
            let laws: Vec<_> =
                laws.into_iter().flatten().filter(|(_, law, _)| *law != Law::default()).collect();
            let sum = laws.iter().fold(Law::default(), |sum, (_, law, _)| sum + *law);
            let passivity = Passivity::of(sum, self.sampling(), self.device.damping_ns_per_m);
            let (_, _, place) = laws.first().filter(|_| !passivity.holds())?;
            let names: Vec<&str> = laws.iter().map(|(name, ..)| *name).collect();
            let unset = self.device.damping_ns_per_m == 0.0;
            let hint = if unset { "; `device: (damping_ns_per_m: ..)` says what it has" } else { "" };
            Some((format!(" {what} ({}): {passivity}{hint}", names.join(" + ")), (*place).clone()))
        };
        let of_normal = wall.is_some() || magnet.is_some();
        all.extend(along("along its normal", [wall, magnet, drag.filter(|_| of_normal)]));
        all.extend(friction.and_then(|friction| along("along its surface", [Some(friction), drag, None])));
        if !of_normal && friction.is_none() {
            all.extend(along("in its volume", [drag, None, None]));
        }
        if let Some((_, law, place)) = wall
            && self.device.position_step_mm > 0.0
        {
            let Device { position_step_mm, friction_n, .. } = &self.device;
            let quantisation = Quantisation::of(law, self.sampling(), *position_step_mm, *friction_n);
            if !quantisation.holds() {
                all.push((format!(": {quantisation}"), place.clone()));
            }
        }
        all
    }
}

/// Friction as a law, at the largest normal force.
fn law(friction: Friction, normal_force_n: f64) -> Law {
    match friction {
        Friction::ViscousCoulomb { coefficient: 0.0, .. } | Friction::Dahl { coefficient: 0.0, .. } => None,
        Friction::ViscousCoulomb { coefficient, viscosity_s_per_mm } => {
            ViscousCoulomb::new(coefficient, viscosity_s_per_mm).map(|f| f.law(normal_force_n)).ok()
        }
        Friction::Dahl { coefficient, bristle_stiffness_n_per_mm } => {
            Dahl::new(coefficient, bristle_stiffness_n_per_mm).map(|f| f.law()).ok()
        }
        Friction::LuGre(settings) => LuGre::new(settings).map(|f| f.law(normal_force_n)).ok(),
    }
    .unwrap_or_default()
}
