//! What a scene asks of its device.

use std::collections::HashMap;

use super::{Friction, Placed, Scene, Touchable};
use crate::effect::Magnet;
use crate::effect::friction::{Dahl, LuGre, ViscousCoulomb};
use crate::effect::passivity::{Law, Passivity, Quantisation, Sampling};
use asperity_source::Place;

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

    /// Every law of force that is not passive on this device in any hand, and every stiffness at which its steps of place can be felt; once for all surfaces of
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
        all.into_iter().map(told).collect()
    }

    fn of(&self, surface: &Touchable) -> Vec<(String, Place)> {
        let mut all = Vec::new();
        let mut check = |law: Law, along: &str, place: &Place| {
            let passivity = Passivity::of(law, self.sampling(), self.device.damping_ns_per_m);
            // Nothing that is asked for is always borne.
            if !passivity.holds() && law != Law::default() {
                all.push((format!(" {along}: {passivity}"), place.clone()));
            }
        };
        let effects = &surface.effects;
        if let (Some(Placed { place, .. }), Some(wall)) = (&effects.stiffness, self.passivity(surface)) {
            check(wall.law, "along its normal", place);
        }
        if let Some(Placed { of, place }) = &effects.friction {
            check(law(*of, self.device.max_force_n), "along its surface", place);
        }
        if let Some(Placed { of: drag, place }) = &effects.viscosity {
            let law = Law { stiffness_n_per_mm: 0.0, damping_ns_per_m: drag.viscosity_ns_per_m };
            check(law, "in its volume", place);
        }
        if let Some(Placed { of: pull, place }) = &effects.magnet
            && let Ok(magnet) = Magnet::new(pull.stiffness_n_per_mm, pull.max_force_n, pull.reach_mm)
        {
            check(magnet.law(), "by its magnet", place);
        }
        if let Some(Placed { of: stiffness, place }) = &effects.stiffness
            && self.device.position_step_mm > 0.0
        {
            let quantisation =
                Quantisation::of(*stiffness, self.device.position_step_mm, self.device.friction_n);
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
