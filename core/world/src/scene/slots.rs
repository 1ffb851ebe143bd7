//! The different settings of an effect in a scene: surfaces that feel alike share them.

use super::{Effects, Scene, Texture, Touchable};

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

    /// Whether two surfaces have the same of it; both have it.
    fn same(self, a: &Touchable, b: &Touchable) -> bool {
        let (x, y) = (&a.effects, &b.effects);
        match self {
            Self::Friction => of(&x.friction) == of(&y.friction),
            Self::Network => of(&a.material) == of(&b.material),
            Self::Autoregressive | Self::Waveform | Self::Relief => self.textures(x).eq(self.textures(y)),
            Self::Tap => of(&x.tap) == of(&y.tap),
            Self::Vibration => of(&x.vibration) == of(&y.vibration),
            Self::Viscosity => of(&x.viscosity) == of(&y.viscosity),
            Self::Magnet => of(&x.magnet) == of(&y.magnet),
        }
    }

    /// Whether a surface has it.
    pub fn is_of(self, effects: &Effects) -> bool {
        match self {
            Self::Friction => effects.friction.is_some(),
            Self::Network | Self::Autoregressive | Self::Waveform | Self::Relief => {
                self.textures(effects).next().is_some()
            }
            Self::Tap => effects.tap.is_some(),
            Self::Vibration => effects.vibration.is_some(),
            Self::Viscosity => effects.viscosity.is_some(),
            Self::Magnet => effects.magnet.is_some(),
        }
    }

    /// The textures of this kind.
    pub fn textures(self, effects: &Effects) -> impl Iterator<Item = &Texture> {
        effects.textures.iter().map(|t| &t.of).filter(move |t| self == Self::of_texture(t))
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

fn of<T>(placed: &Option<super::Placed<T>>) -> Option<&T> {
    placed.as_ref().map(|p| &p.of)
}

/// Which surfaces share settings of one kind.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Slots {
    /// For each slot the first surface that has it.
    pub first: Vec<usize>,
    /// For each surface its slot, if it has the effect.
    pub of: Vec<Option<usize>>,
}

impl Scene {
    /// The slots of a kind: as many as there are different settings, in the order of the file.
    pub fn slots(&self, kind: Kind) -> Slots {
        let mut slots = Slots::default();
        for (number, surface) in self.surfaces.iter().enumerate() {
            let slot = kind.is_of(&surface.effects).then(|| {
                let known = slots.first.iter().position(|first| kind.same(&self.surfaces[*first], surface));
                known.unwrap_or_else(|| {
                    slots.first.push(number);
                    slots.first.len() - 1
                })
            });
            slots.of.push(slot);
        }
        slots
    }
}
