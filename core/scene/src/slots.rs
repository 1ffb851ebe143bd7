//! The different settings of an effect in a scene: surfaces that feel alike share them.

use std::collections::HashMap;
use std::fmt::Write as _;

use asperity_diagnostics::Place;

use super::{Effects, Placed, Scene, Texture, Touchable};

/// A kind of effect that a node renders, for all surfaces that have it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Kind {
    /// Force against the motion.
    Friction,
    /// A texture by the scene's network; its settings are materials.
    Network,
    /// A texture by autoregressive models.
    Autoregressive,
    /// A texture by a loop.
    Waveform,
    /// A texture by heights.
    Relief,
    /// Contact transients.
    Tap,
    /// A fixed source.
    Vibration,
    /// Drag.
    Viscosity,
    /// Pull.
    Magnet,
}

impl Kind {
    /// All of them.
    pub const ALL: [Self; 9] = [
        Self::Friction,
        Self::Network,
        Self::Autoregressive,
        Self::Waveform,
        Self::Relief,
        Self::Tap,
        Self::Vibration,
        Self::Viscosity,
        Self::Magnet,
    ];

    /// How a scene file calls it.
    pub fn word(self) -> &'static str {
        match self {
            Self::Friction => "friction",
            Self::Network => "network",
            Self::Autoregressive => "autoregressive",
            Self::Waveform => "waveform",
            Self::Relief => "relief",
            Self::Tap => "tap",
            Self::Vibration => "vibration",
            Self::Viscosity => "viscosity",
            Self::Magnet => "magnet",
        }
    }

    /// Whether it is felt as vibration, and not as a force.
    pub fn vibrates(self) -> bool {
        !matches!(self, Self::Friction | Self::Viscosity | Self::Magnet)
    }

    /// Whether a surface has it.
    pub fn is_of(self, effects: &Effects) -> bool {
        !self.places(effects).is_empty()
    }

    /// Where a surface's effects of this kind stand; none where it has none.
    pub fn places(self, effects: &Effects) -> Vec<&Place> {
        fn of<T>(effect: &Option<Placed<T>>) -> Vec<&Place> {
            effect.iter().map(|placed| &placed.place).collect()
        }
        match self {
            Self::Friction => of(&effects.friction),
            Self::Tap => of(&effects.tap),
            Self::Vibration => of(&effects.vibration),
            Self::Viscosity => of(&effects.viscosity),
            Self::Magnet => of(&effects.magnet),
            Self::Network | Self::Autoregressive | Self::Waveform | Self::Relief => {
                let textures = effects.textures.iter().filter(|t| self == Self::of_texture(&t.of));
                textures.map(|texture| &texture.place).collect()
            }
        }
    }

    /// What two surfaces that have the same of it have in common: all settings, of which none is a NaN.
    fn settings(self, surface: &Touchable) -> Option<String> {
        let effects = &surface.effects;
        if !self.is_of(effects) {
            return None;
        }
        let mut key = String::new();
        let _ = match self {
            Self::Friction => write!(key, "{:?}", effects.friction.as_ref().map(|e| &e.of)),
            Self::Network => write!(key, "{:?}", surface.material.as_ref().map(|m| &m.of)),
            Self::Tap => write!(key, "{:?}", effects.tap.as_ref().map(|e| &e.of)),
            Self::Vibration => write!(key, "{:?}", effects.vibration.as_ref().map(|e| &e.of)),
            Self::Viscosity => write!(key, "{:?}", effects.viscosity.as_ref().map(|e| &e.of)),
            Self::Magnet => write!(key, "{:?}", effects.magnet.as_ref().map(|e| &e.of)),
            Self::Autoregressive | Self::Waveform | Self::Relief => {
                let all: Vec<&Texture> = effects.textures.iter().map(|t| &t.of).collect();
                let of_kind: Vec<_> = all.into_iter().filter(|t| self == Self::of_texture(t)).collect();
                write!(key, "{of_kind:?}")
            }
        };
        Some(key)
    }

    fn of_texture(texture: &Texture) -> Self {
        match texture {
            Texture::Network => Self::Network,
            Texture::Autoregressive { .. } => Self::Autoregressive,
            Texture::Waveform { .. } => Self::Waveform,
            Texture::Relief { .. } => Self::Relief,
        }
    }
}

/// Which surfaces share settings of one kind.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Slots {
    /// For each slot the first surface that has it.
    pub first: Vec<usize>,
    /// For each surface its slot, if it has the effect.
    pub of: Vec<Option<usize>>,
}

impl Slots {
    /// How many surfaces have the effect.
    pub fn surfaces(&self) -> usize {
        self.of.iter().flatten().count()
    }
}

impl Scene {
    /// The slots of a kind: as many as there are different settings, in the order of the file.
    pub fn slots(&self, kind: Kind) -> Slots {
        let mut slots = Slots::default();
        let mut known: HashMap<String, usize> = HashMap::new();
        for (number, surface) in self.surfaces.iter().enumerate() {
            let slot = kind.settings(surface).map(|settings| {
                *known.entry(settings).or_insert_with(|| {
                    slots.first.push(number);
                    slots.first.len() - 1
                })
            });
            slots.of.push(slot);
        }
        slots
    }

    /// Hash of all slots, in their order and with all their settings ([`fnv`](asperity_diagnostics::fnv), in
    /// hexadecimal digits).
    pub fn slots_key(&self) -> String {
        let mut all = Vec::new();
        for kind in Kind::ALL {
            let slots = self.slots(kind);
            for slot in 0..slots.first.len() {
                all.extend(self.slot_text(kind, &slots, slot).bytes().chain([0]));
            }
            all.push(1);
        }
        format!("{:016x}", asperity_diagnostics::fnv(&all))
    }

    /// What stands in the file of a slot: as a text for the parameter of the kind's node. Materials are names.
    pub fn slot_text(&self, kind: Kind, slots: &Slots, slot: usize) -> String {
        let Some(surface) = slots.first.get(slot).and_then(|first| self.surfaces.get(*first)) else {
            return String::new();
        };
        if kind == Kind::Network {
            return surface.material.as_ref().map(|m| m.of.clone()).unwrap_or_default();
        }
        let text = |place: &Place| {
            let whole = place.source.text();
            whole.get(place.span.start..place.span.end).unwrap_or_default().to_owned()
        };
        match &kind.places(&surface.effects)[..] {
            [one] => text(one),
            all => format!("[{}]", all.iter().map(|place| text(place)).collect::<Vec<_>>().join(", ")),
        }
    }
}
