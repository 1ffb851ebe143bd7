//! What the rendered world is made of: strokes, materials, surfaces with a stylus or a gel on them, what a surface does to a stylus, and the actuator that is driven.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod actuator;
pub mod autoregressive;
pub mod effect;
pub mod material;
pub mod motion;
pub mod scene;
pub mod space;
pub mod stylus;
pub mod tactile;
pub mod topography;
pub mod wav;
