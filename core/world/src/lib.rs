//! What the rendered world is made of: strokes, materials, surfaces with a stylus or a gel on them, and the actuator that is driven.

pub mod actuator;
pub mod autoregressive;
pub mod material;
pub mod motion;
pub mod space;
pub mod stylus;
pub mod tactile;
pub mod topography;
