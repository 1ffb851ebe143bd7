//! Checks whether the device can render a scene without generating energy.

use std::collections::HashMap;

use asperity_diagnostics::Place;
use asperity_node::{Direction, Law, Param, ParamKind, Registry, ShapeSpec};

use super::bound::{Passivity, Quantisation, Sampling, above, below};
use super::effects::effect_of;
use super::{Device, NETWORK, Named, Scene, Touchable};

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

    /// Finds forces that no device renders. A wall counts only where nothing vibrates: else it is there to
    /// tell how hard the stylus presses.
    pub fn unfelt(&self, registry: &Registry) -> Option<Finding> {
        if self.device.output.is_some() {
            return None;
        }
        let named = |surface: &'_ Touchable| -> Vec<(String, Place)> {
            let forces = surface.effects.named.iter().filter(|named| !vibrates(registry, &named.kind));
            forces.map(|named| (named.kind.clone(), named.value.place())).collect()
        };
        let mut all: Vec<(String, Place)> = self.surfaces.iter().flat_map(named).collect();
        let quiet = |surface: &Touchable| surface.effects.named.iter().all(|n| !vibrates(registry, &n.kind));
        if all.is_empty() && self.surfaces.iter().all(quiet) {
            let walls = self.surfaces.iter().filter_map(|surface| surface.effects.stiffness.as_ref());
            all.extend(walls.map(|wall| ("stiffness".to_owned(), wall.place.clone())));
        }
        let place = all.first()?.1.clone();
        let mut kinds: Vec<String> = all.into_iter().map(|(kind, _)| format!("`{kind}`")).collect();
        kinds.sort();
        kinds.dedup();
        let message = format!(
            "no device renders the forces of {}; add one to the scene's `device`, such as \
             `output: haply_force()`",
            kinds.join(", ")
        );
        Some(Finding { message, place })
    }

    fn of(&self, surface: &Touchable, registry: &Registry) -> Vec<(String, Place)> {
        let mut all = Vec::new();
        let effects = surface.effects.named.iter().filter_map(|named| self.part(named, registry));
        let effects: Vec<Part<'_>> = effects.collect();
        let along = |direction| effects.iter().filter(move |part| part.direction == direction);
        let wall = wall(surface);
        // Laws along one direction add up. A law in any direction adds to the others, and counts alone if
        // there are none.
        let normal: Vec<&Part<'_>> = wall.iter().chain(along(Direction::Normal)).collect();
        let surface: Vec<&Part<'_>> = along(Direction::Surface).collect();
        let alone = normal.is_empty() && surface.is_empty();
        for (what, laws) in [("along its normal", normal), ("along its surface", surface)] {
            if !laws.is_empty() {
                all.extend(self.sum(what, laws.into_iter().chain(along(Direction::Any)).collect()));
            }
        }
        if alone {
            all.extend(self.sum("in its volume", along(Direction::Any).collect()));
        }
        if let Some(wall) = &wall
            && self.device.position_step_mm > 0.0
        {
            let Device { position_step_mm, friction_n, .. } = &self.device;
            let of = |law| Quantisation::of(law, self.sampling(), *position_step_mm, *friction_n);
            let quantisation = of(wall.law());
            if !quantisation.holds() {
                let advice = advice(&[wall], |law| of(law).holds()).unwrap_or_else(|| {
                    let least = above(quantisation.needed_n);
                    format!("holds on a device with `friction_n: {least}` or more")
                });
                all.push((format!(": {quantisation}; {advice}"), wall.place.clone()));
            }
        }
        all
    }

    /// The law of an effect at the largest normal force; `None` for an effect without one.
    fn part<'s>(&self, named: &'s Named, registry: &'s Registry) -> Option<Part<'s>> {
        let settings = named.settings(registry).ok()?;
        let effect = effect_of(registry, &named.kind)?;
        let (direction, _) = effect.law_of(&settings, self.device.max_force_n)?;
        let form = effect.forms.iter().find(|form| form.name == settings.form())?;
        let number = |field: &'s Param| match &field.kind {
            ParamKind::Number(range) => Some(Number {
                of: &named.kind,
                name: &field.name,
                value: settings.get_number(&field.name)?,
                least: *range.start(),
            }),
            _ => None,
        };
        let numbers: Vec<Number<'_>> = form.fields.iter().filter_map(number).collect();
        let names: Vec<&str> = numbers.iter().map(|number| number.name).collect();
        let most_n = self.device.max_force_n;
        let of = move |values: &[f64]| {
            let mut changed = settings.clone();
            names.iter().zip(values).for_each(|(name, value)| changed.set_number(name, *value));
            // Settings that the effect refuses are passive on no device.
            let refused = Law { stiffness_n_per_mm: f64::NAN, damping_ns_per_m: f64::NAN };
            let law = effect.checked(&changed).ok().and_then(|()| effect.law_of(&changed, most_n));
            law.map_or(refused, |(_, law)| law)
        };
        let (name, place) = (named.kind.as_str(), named.value.place());
        Some(Part { name, place, direction, numbers, of: Box::new(of) })
    }

    /// Finding about the sum of some laws, if the device cannot render it. It names a number to change.
    fn sum(&self, what: &str, mut laws: Vec<&Part<'_>>) -> Option<(String, Place)> {
        laws.retain(|part| part.law() != Law::default());
        let of = |law| Passivity::of(law, self.sampling(), self.device.damping_ns_per_m);
        let passivity = of(laws.iter().fold(Law::default(), |sum, part| sum + part.law()));
        let first = laws.first().filter(|_| !passivity.holds())?;
        let names: Vec<&str> = laws.iter().map(|part| part.name).collect();
        let advice = advice(&laws, |law| of(law).holds()).unwrap_or_else(|| {
            let least = above(passivity.needed_ns_per_m);
            format!("holds on a device with `damping_ns_per_m: {least}` or more")
        });
        Some((format!(" {what} ({}): {passivity}; {advice}", names.join(" + ")), first.place.clone()))
    }
}

/// A number of a surface's effect.
struct Number<'s> {
    /// The effect.
    of: &'s str,
    name: &'s str,
    value: f64,
    /// Least value that the effect takes.
    least: f64,
}

/// A law of force of a surface, and the numbers that it follows from.
struct Part<'s> {
    name: &'s str,
    place: Place,
    direction: Direction,
    numbers: Vec<Number<'s>>,
    /// The law for other values of the numbers.
    of: Box<dyn Fn(&[f64]) -> Law + 's>,
}

impl Part<'_> {
    fn law(&self) -> Law {
        (self.of)(&self.numbers.iter().map(|number| number.value).collect::<Vec<_>>())
    }
}

fn wall(surface: &Touchable) -> Option<Part<'_>> {
    let effects = &surface.effects;
    let stiffness = effects.stiffness.as_ref()?;
    let number = |of, name, value, least| Number { of, name, value, least };
    let mut numbers = vec![number("stiffness", "stiffness_n_per_mm", stiffness.of, 0.001)];
    numbers.extend(effects.damping.as_ref().map(|d| number("damping", "damping_ns_per_m", d.of, 0.0)));
    let of = |values: &[f64]| Law {
        stiffness_n_per_mm: values[0],
        damping_ns_per_m: values.get(1).copied().unwrap_or(0.0),
    };
    let (place, direction) = (stiffness.place.clone(), Direction::Normal);
    Some(Part { name: "wall", place, direction, numbers, of: Box::new(of) })
}

/// A number that has to fall below this part of its value is not worth naming alone.
const LEAST_SHARE: f64 = 0.05;

/// Names a number to lower, and a value with which the sum of these laws holds. It is the number that has to
/// change least, or all that matter where one is not enough. `None` where that leaves next to nothing.
fn advice(laws: &[&Part<'_>], holds: impl Fn(Law) -> bool) -> Option<String> {
    let numbers: Vec<&Number<'_>> = laws.iter().flat_map(|part| &part.numbers).collect();
    let sum = |values: &[f64]| {
        let mut rest = values;
        laws.iter().fold(Law::default(), |sum, part| {
            let (own, others) = rest.split_at(part.numbers.len());
            rest = others;
            sum + (part.of)(own)
        })
    };
    let given: Vec<f64> = numbers.iter().map(|number| number.value).collect();
    // The values with some of them lowered to a share, each to two digits.
    let lowered = |which: &[usize], share: f64| {
        let mut values = given.clone();
        which.iter().for_each(|&i| values[i] = below(share * given[i]).max(numbers[i].least));
        values
    };
    let matters = |i: &usize| {
        let law = sum(&lowered(&[*i], 0.5));
        law != sum(&given) && law.stiffness_n_per_mm.is_finite()
    };
    let all: Vec<usize> = (0..numbers.len()).filter(matters).collect();
    // The largest share that holds, by bisection.
    let share = |which: &[usize]| {
        let passes = |share| holds(sum(&lowered(which, share)));
        let (mut low, mut high) = (LEAST_SHARE, 1.0);
        if which.is_empty() || !passes(low) {
            return None;
        }
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            if passes(middle) { low = middle } else { high = middle }
        }
        Some(low)
    };
    let alone = all.iter().filter_map(|&i| Some((vec![i], share(&[i])?)));
    let alone = alone.max_by(|(_, a), (_, b)| a.total_cmp(b));
    let (which, share) = alone.or_else(|| Some((all.clone(), share(&all)?)))?;
    let values = lowered(&which, share);
    let named = |&i: &usize| format!("`{}: {}` in `{}`", numbers[i].name, values[i], numbers[i].of);
    Some(format!("passive with {}", which.iter().map(named).collect::<Vec<_>>().join(" and ")))
}

/// Whether an effect is felt as vibration and not as a force: its output is audio.
pub(super) fn vibrates(registry: &Registry, kind: &str) -> bool {
    let outputs = registry.get(kind).map(|kind| &kind.descriptor().outputs);
    kind == NETWORK
        || outputs.is_some_and(|all| all.iter().any(|output| matches!(output.shape, ShapeSpec::Audio(_))))
}
