//! Scene files: the surfaces that can be touched, where they are, and how they feel to a stylus.
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
//! `input`, `phase` and `output` name a node's kind. Their fields are the parameters of that node. So are
//! the fields of `motion` (`velocity`), `network` (`texture_network`), `gate` (`speed_gate`) and
//! `actuator` (`actuator_inverse` and `limiter`). The compiler of the graph checks these parameters. This
//! crate reads all other fields and checks their ranges.
//!
//! `effects` holds the stiffness and damping of the surface, and effects by name. An effect is a kind of
//! node whose descriptor has an [`Effect`](asperity_node::Effect), built in or from a plugin. Each effect
//! declares the settings that a scene may give it.
//!
//! Effects of one surface add up. Where surfaces overlap, the deepest is touched until another is deeper
//! by `hysteresis_mm`.

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
    /// Text that the scene was read from.
    pub source: Arc<Source>,
    /// Ticks per second, 100 to 4000.
    pub tick_hz: u32,
    /// Audio rate in Hz, 8000 to 192 000.
    pub audio_hz: u32,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Plugins that the parts below may come from, as in a graph.
    pub plugins: Option<Value>,
    /// Source of the stylus position.
    pub input: Part,
    /// Measurement of the velocity: parameters of `velocity`.
    pub motion: Part,
    /// The device that holds the stylus.
    pub device: Device,
    /// Model and library of network textures: parameters of `texture_network`.
    pub network: Option<Part>,
    /// Phase retrieval of network textures.
    pub phase: Part,
    /// Gate of the textures: parameters of `speed_gate`.
    pub gate: Part,
    /// Factor of the acceleration before the actuator, 0 to 100.
    pub gain: f64,
    /// The actuator: parameters of `actuator_inverse` and `limiter`.
    pub actuator: Part,
    /// Node that the signal goes to.
    pub output: Option<Part>,
    /// Hysteresis: how much deeper another surface must be to be touched instead, 0 to 10 mm.
    pub hysteresis_mm: f64,
    /// Surfaces in the order of the file.
    pub surfaces: Vec<Touchable>,
    /// Pictures of heights that shapes were made from.
    pub pictures: Vec<PathBuf>,
}

/// A part of the chain, passed on to its node unchanged.
#[derive(Clone, Debug)]
pub struct Part {
    /// Kind of the node.
    pub kind: String,
    /// Place of the kind in the file.
    pub place: Place,
    /// Settings in the file.
    pub settings: Vec<(Key, Value)>,
}

/// The device that holds the stylus.
#[derive(Clone, Debug)]
pub struct Device {
    /// Largest force, 0.01 to 100 N.
    pub max_force_n: f64,
    /// Damping of the device itself, 0 to 1000 N s/m.
    pub damping_ns_per_m: f64,
    /// Dry friction of the device itself, 0 to 10 N.
    pub friction_n: f64,
    /// Step of the reported places, 0 to 10 mm.
    pub position_step_mm: f64,
    /// Time from reading a place to setting a force, 0 to 100 ms.
    pub delay_ms: f64,
    /// Node that pushes back, if there is one.
    pub output: Option<Part>,
    /// Place of the device in the file.
    pub place: Place,
}

/// A surface that can be touched.
#[derive(Clone, Debug)]
pub struct Touchable {
    /// Unique name.
    pub name: String,
    /// Place of the name in the file.
    pub place: Place,
    /// Shape and pose.
    pub surface: Surface,
    /// Material in the network's library, if the surface has one.
    pub material: Option<Placed<String>>,
    /// Its effects.
    pub effects: Effects,
}

/// A value and its place in the file.
#[derive(Clone, Debug)]
pub struct Placed<T> {
    /// The value.
    pub of: T,
    /// Place of the value.
    pub place: Place,
}

/// An effect that a surface has, as the file names it.
#[derive(Clone, Debug)]
pub struct Named {
    /// Kind of the effect.
    pub kind: String,
    /// Place of the name in the file.
    pub name: Place,
    /// Whether the effect stands in the field `texture`.
    pub texture: bool,
    /// Settings, as they stand in the file.
    pub value: Value,
}

/// Source of heights.
#[derive(Clone, Debug, PartialEq)]
pub enum Heights {
    /// A patch of a made surface.
    Made {
        /// Name of the surface.
        name: String,
        /// Points along an edge, 8 to 2048.
        side: usize,
        /// Distance between points, 0.005 to 1 mm.
        step_mm: f64,
        /// Number of the piece.
        piece: u64,
    },
    /// A grey picture. Light is high.
    Picture {
        /// PNG, JPEG or BMP, 8 or 16 bits.
        file: PathBuf,
        /// Distance between pixels, 0.001 to 100 mm.
        step_mm: f64,
        /// Height of white above black, 0 to 1000 mm.
        height_mm: f64,
    },
}
