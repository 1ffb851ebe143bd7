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
//! Behind `effects` stand the stiffness and damping of the surface, and effects by name: kinds of node whose descriptor
//! has an [`Effect`](asperity_node::Effect), built in or from a plugin. What a scene may say of them, they say themselves.
//!
//! Effects of one surface add up. Where surfaces overlap, the deepest is touched until another is deeper by
//! `hysteresis_mm`.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod bound;
mod contact;
mod effects;
mod lower;
mod passivity;
mod read;
mod slots;
pub mod space;
mod state;
mod surface;
#[cfg(test)]
mod tests;

use std::path::PathBuf;
use std::sync::Arc;

use asperity_diagnostics::ron::{Key, Value};
use asperity_diagnostics::{Place, Source};

use crate::space::Surface;

pub use contact::{Contacts, EffectNames};
pub use effects::Effects;
pub use lower::{Lowered, Lowering, Rendered, draft, lower};
pub use passivity::Finding;
pub use slots::{NETWORK, Slots};
pub use state::{ContactSettings, ContactState, Motion, Pull, Voice};

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

/// An effect that a surface has, as the file names it.
#[derive(Clone, Debug)]
pub struct Named {
    /// Its kind.
    pub kind: String,
    /// Where the name stands.
    pub name: Place,
    /// Whether it stands behind `texture`.
    pub texture: bool,
    /// Its settings, as they stand there.
    pub value: Value,
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
