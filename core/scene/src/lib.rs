//! A scene as a file describes it: what can be touched, where it is, and what it does to a stylus.
//!
//! ```ron
//! Scene(
//!     version: 1,
//!     input: trajectory(file: "../trajectories/zigzag.csv"),
//!     device: (damping_ns_per_m: 2.0),
//!     network: (model: "../models/surfaces/texture.onnx", library: "../models/surfaces/materials.ron"),
//!     output: audio_out(volts_at_full_scale: 1.0, amps_per_volt: 1.0),
//!     surfaces: {
//!         "left": (
//!             shape: rectangle(size_mm: (40, 60)),
//!             place_mm: (-20, 0, 0),
//!             material: "canvas",
//!             effects: (
//!                 stiffness: (stiffness_n_per_mm: 0.5),
//!                 friction: viscous_coulomb(coefficient: 0.3),
//!                 texture: network,
//!             ),
//!         ),
//!     },
//! )
//! ```
//!
//! `input`, `phase` and `output` name a node's kind. Their fields are that node's parameters, as are those of
//! `motion` (`velocity`), `network` (`texture_network`), `gate` (`speed_gate`) and `actuator` (`actuator_inverse`
//! and `limiter`). The compiler of the graph checks them. All other fields are read here, with their ranges.
//!
//! Each effect's type has a `parse`, so that nodes read the settings of an effect from a text, without a scene.
//!
//! Effects of one surface add up. Where surfaces overlap, the deepest is touched until another is deeper by
//! `hysteresis_mm`.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod contact;
pub mod effect;
mod effects;
mod felt;
mod lower;
mod parse;
mod passivity;
mod read;
mod slots;
pub mod space;
mod surface;
#[cfg(test)]
mod tests;

use std::path::PathBuf;
use std::sync::Arc;

use asperity_diagnostics::ron::{Key, Value};
use asperity_diagnostics::{Place, Source};

use crate::effect::friction::LuGreSettings;
use crate::effect::{DecayingSinusoid, TapSettings, WaveformQuantity};
use crate::space::Surface;

pub use contact::Contacts;
pub use felt::{ContactSettings, Felt, Motion, VOICED, Voice};
pub use lower::{Lowered, Lowering, draft, lower};
pub use passivity::Finding;
pub use slots::{Kind, Slots};

/// A scene.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The text it was read from.
    pub source: Arc<Source>,
    /// Ticks a second, 100 to 4000.
    pub tick_hz: u32,
    /// Audio rate in Hz, 8000 to 192 000.
    pub audio_hz: u32,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Plugins that the parts below may be of, as in a graph.
    pub plugins: Option<Value>,
    /// Where the stylus is.
    pub input: Part,
    /// How its velocity is measured: parameters of `velocity`.
    pub motion: Part,
    /// The device that holds the stylus.
    pub device: Device,
    /// Model and library of network textures: parameters of `texture_network`.
    pub network: Option<Part>,
    /// Phase retrieval of network textures.
    pub phase: Part,
    /// When textures are felt: parameters of `speed_gate`.
    pub gate: Part,
    /// Factor of the acceleration before the actuator, 0 to 100.
    pub gain: f64,
    /// The actuator: parameters of `actuator_inverse` and `limiter`.
    pub actuator: Part,
    /// Where the signal goes.
    pub output: Option<Part>,
    /// By how much another surface must be deeper to be touched instead, 0 to 10 mm.
    pub hysteresis_mm: f64,
    /// Surfaces in the order of the file.
    pub surfaces: Vec<Touchable>,
    /// Pictures of heights that shapes were made of.
    pub pictures: Vec<PathBuf>,
}

/// A part of the chain that is handed on as it stands.
#[derive(Clone, Debug)]
pub struct Part {
    /// The node's kind.
    pub kind: String,
    /// Where that stands.
    pub place: Place,
    /// Settings in the file.
    pub settings: Vec<(Key, Value)>,
}

/// The device that holds the stylus.
#[derive(Clone, Debug)]
pub struct Device {
    /// The most it pushes, 0.01 to 100 N.
    pub max_force_n: f64,
    /// Damping of its own, 0 to 1000 N s/m.
    pub damping_ns_per_m: f64,
    /// Dry friction of its own, 0 to 10 N.
    pub friction_n: f64,
    /// The step in which it tells places, 0 to 10 mm.
    pub position_step_mm: f64,
    /// From reading a place to setting a force, 0 to 100 ms.
    pub delay_ms: f64,
    /// The node that pushes back, if there is one.
    pub output: Option<Part>,
    /// Where it stands.
    pub place: Place,
}

/// Something that can be touched.
#[derive(Clone, Debug)]
pub struct Touchable {
    /// Its name; no other one has it.
    pub name: String,
    /// Where the name stands.
    pub place: Place,
    /// Shape and place.
    pub surface: Surface,
    /// Its material in the library of the network, if it has one.
    pub material: Option<Placed<String>>,
    /// Its effects.
    pub effects: Effects,
}

/// Something, and where it stands in the file.
#[derive(Clone, Debug)]
pub struct Placed<T> {
    /// The thing itself.
    pub of: T,
    /// Where it stands.
    pub place: Place,
}

/// Effects of a surface on a stylus. An effect that is not named does not happen.
#[derive(Clone, Debug, Default)]
pub struct Effects {
    /// Hooke's wall, in N/mm, 0.001 to 100.
    pub stiffness: Option<Placed<f64>>,
    /// Damping along the normal while touched, in N s/m, 0 to 1000.
    pub damping: Option<Placed<f64>>,
    /// Force against the motion along the surface.
    pub friction: Option<Placed<Friction>>,
    /// Vibration of gliding; they add.
    pub textures: Vec<Placed<Texture>>,
    /// Vibration of coming into contact.
    pub tap: Option<Placed<Knock>>,
    /// Vibration while touched.
    pub vibration: Option<Placed<Hum>>,
    /// Drag in the volume.
    pub viscosity: Option<Placed<Drag>>,
    /// Pull toward the surface.
    pub magnet: Option<Placed<Pull>>,
}

impl Effects {
    /// Files that they are made of.
    pub fn files(&self) -> Vec<&PathBuf> {
        let mut files = Vec::new();
        for texture in &self.textures {
            match &texture.of {
                Texture::Autoregressive { model: file, .. }
                | Texture::Waveform { values: Loop::Recorded { file, .. }, .. }
                | Texture::Relief { heights: Heights::Picture { file, .. }, .. } => files.push(file),
                _ => {}
            }
        }
        if let Some(Sound::Recorded { file, .. }) = self.tap.as_ref().map(|tap| &tap.of.sound) {
            files.push(file);
        }
        files
    }
}

/// Laws of friction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Friction {
    /// [`crate::effect::friction::ViscousCoulomb`].
    ViscousCoulomb {
        /// Friction over normal force, mu.
        coefficient: f64,
        /// Part of the normal force a speed, in s/mm.
        viscosity_s_per_mm: f64,
    },
    /// [`crate::effect::friction::Dahl`].
    Dahl {
        /// Friction over normal force, mu.
        coefficient: f64,
        /// Stiffness of the bristle in N/mm.
        bristle_stiffness_n_per_mm: f64,
    },
    /// [`crate::effect::friction::LuGre`].
    LuGre(LuGreSettings),
}

/// Kinds of texture.
#[derive(Clone, Debug, PartialEq)]
pub enum Texture {
    /// The scene's network, for the surface's material.
    Network,
    /// A piecewise autoregressive model.
    Autoregressive {
        /// Its RON file, or the toolkit's XML.
        model: PathBuf,
        /// Factor, 0 to 100.
        gain: f64,
    },
    /// A loop that is read by distance.
    Waveform {
        /// Source of its values.
        values: Loop,
        /// How much of the end is faded into the beginning, in mm.
        crossfade_mm: f64,
        /// Quantity of the values.
        quantity: WaveformQuantity,
        /// Factor, 0 to 100.
        gain: f64,
    },
    /// Heights under the tip.
    Relief {
        /// The heights.
        heights: Heights,
        /// Cutoff of the low-pass in Hz.
        cutoff_hz: f64,
        /// The largest acceleration in m/s^2.
        max_m_s2: f64,
        /// Factor, 0 to 100.
        gain: f64,
    },
}

/// Where the values of a loop come from.
#[derive(Clone, Debug, PartialEq)]
pub enum Loop {
    /// They were drawn.
    Segments {
        /// Pairs of distance in mm and value.
        segments: Vec<(f64, f64)>,
        /// Distance of the values that are made of them, in mm.
        spacing_mm: f64,
    },
    /// They were recorded at a constant speed.
    Recorded {
        /// A WAV file; of several channels the first.
        file: PathBuf,
        /// The speed, in mm/s.
        speed_mm_s: f64,
        /// Acceleration at full scale, in m/s^2.
        full_scale_m_s2: f64,
    },
}

/// Where heights come from.
#[derive(Clone, Debug, PartialEq)]
pub enum Heights {
    /// A patch of a made surface.
    Made {
        /// The surface's name.
        name: String,
        /// Points along an edge, 8 to 2048.
        side: usize,
        /// Distance of points, 0.005 to 1 mm.
        step_mm: f64,
        /// Which piece.
        piece: u64,
    },
    /// A grey picture, light is high.
    Picture {
        /// PNG, JPEG or BMP, 8 or 16 bits.
        file: PathBuf,
        /// Distance of pixels, 0.001 to 100 mm.
        step_mm: f64,
        /// Height of white over black, 0 to 1000 mm.
        height_mm: f64,
    },
}

/// A tap.
#[derive(Clone, Debug, PartialEq)]
pub struct Knock {
    /// Its sound; [`transient`](Self::transient) reads it.
    pub sound: Sound,
    /// When it sounds.
    pub settings: TapSettings,
}

/// Sound of a tap.
#[derive(Clone, Debug, PartialEq)]
pub enum Sound {
    /// Sinusoids that decay.
    Sinusoids(Vec<DecayingSinusoid>),
    /// A recorded acceleration.
    Recorded {
        /// A WAV file, of which the first channel counts.
        file: PathBuf,
        /// Speed of approach at which it was recorded in mm/s, 0.1 to 10 000.
        speed_mm_s: f64,
        /// Acceleration at which the file is full in m/s^2, 0.001 to 10^5.
        full_scale_m_s2: f64,
        /// Factor, 0 to 100.
        gain: f64,
    },
}

/// A fixed source.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hum {
    /// Frequency in Hz.
    pub frequency_hz: f64,
    /// Amplitude in m/s^2.
    pub amplitude_m_s2: f64,
}

/// Drag.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drag {
    /// Force a speed, in N s/m.
    pub viscosity_ns_per_m: f64,
    /// The largest force in N.
    pub max_force_n: f64,
}

/// Pull.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pull {
    /// Stiffness at the surface in N/mm.
    pub stiffness_n_per_mm: f64,
    /// The largest force in N.
    pub max_force_n: f64,
    /// How far it is felt in mm.
    pub reach_mm: f64,
}
