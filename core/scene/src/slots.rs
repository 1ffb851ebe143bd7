//! Slots: the different settings of an effect in a scene. Surfaces that feel alike share a slot.

use std::collections::HashMap;

use asperity_diagnostics::Place;
use asperity_node::Registry;

use super::{Scene, Touchable};

/// Name of the texture by the scene's network, whose settings are materials.
pub const NETWORK: &str = "network";

/// Slots of one kind of effect: its different settings, in the order of the file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Slots {
    /// First surface of each slot.
    pub first: Vec<usize>,
    /// Slot of each surface, if it has the effect.
    pub of: Vec<Option<usize>>,
}

impl Slots {
    /// Number of surfaces that have the effect.
    pub fn surfaces(&self) -> usize {
        self.of.iter().flatten().count()
    }
}

impl Touchable {
    /// Settings of a kind of effect as a text, equal for surfaces that share a slot. `None` for a surface
    /// without the effect. For `network` the text is the material's name.
    pub fn settings(&self, kind: &str) -> Option<String> {
        if kind == NETWORK {
            self.effects.place(NETWORK)?;
            return Some(self.material.as_ref().map(|m| m.of.clone()).unwrap_or_default());
        }
        let all: Vec<String> = self.effects.of(kind).map(|named| named.value.to_string()).collect();
        match &all[..] {
            [] => None,
            [one] => Some(one.clone()),
            _ => Some(format!("[{}]", all.join(", "))),
        }
    }
}

impl Scene {
    /// Slots of a kind.
    pub fn slots(&self, kind: &str) -> Slots {
        let mut slots = Slots::default();
        let mut known: HashMap<String, usize> = HashMap::new();
        for (number, surface) in self.surfaces.iter().enumerate() {
            let slot = surface.settings(kind).map(|s| *known.entry(s).or_insert(slots.first.len()));
            if slot == Some(slots.first.len()) {
                slots.first.push(number);
            }
            slots.of.push(slot);
        }
        slots
    }

    /// Texts of a kind's slots, with their places in the file.
    pub fn slot_texts(&self, kind: &str, slots: &Slots) -> Vec<(String, Place)> {
        let surfaces = slots.first.iter().filter_map(|first| self.surfaces.get(*first));
        surfaces.filter_map(|surface| Some((surface.settings(kind)?, surface.effects.place(kind)?))).collect()
    }

    /// Hash of all slots of the named effects, in hexadecimal digits. It tells them apart from other
    /// slots.
    pub fn slots_key<'a>(&self, kinds: impl Iterator<Item = &'a str>) -> String {
        let mut all = Vec::new();
        for kind in kinds {
            all.extend(kind.bytes().chain([1]));
            for (text, _) in self.slot_texts(kind, &self.slots(kind)) {
                all.extend(text.bytes().chain([0]));
            }
        }
        format!("{:016x}", asperity_diagnostics::fnv(&all))
    }
}

/// All kinds of effect by where they act, each in the registry's order.
pub(crate) fn effects_in_order(registry: &Registry) -> impl Iterator<Item = &str> {
    let mut all: Vec<_> = registry.effects().collect();
    all.sort_by_key(|(_, effect)| effect.acts);
    all.into_iter().map(|(kind, _)| kind)
}
