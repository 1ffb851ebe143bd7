//! What a camera behind a gel sees of a surface that is pressed into it: a tactile image, as a GelSight takes it.
//!
//! # The model
//!
//! A soft gel with an opaque skin is pressed onto a surface until so much of the surface's height distribution has gone in, as its `reach` says. Where
//! it touches, the skin takes the surface's shape; where it spans a valley it hangs as the gel's stiffness lets it. Both come from blurring the
//! pressed relief with Gaussians from wide to narrow, each time restoring what touches, the way of Si and Yuan 2022 ("Taxim: an example-based simulation
//! model for GelSight tactile sensors"). Three lights, red, green and blue, stand around the gel, 120 degrees apart and low, so that colour tells
//! the skin's slope (Yuan, Dong, Adelson 2017, "GelSight: high-resolution robot tactile sensors for estimating geometry and
//! force"). A channel is
//!
//! ```text
//! I = ambient + light max(0, n . l) (1 - fall r^2) + noise,   n = (-g_x, -g_y, 1) / |..|
//! ```
//!
//! with a camera's blur, its noise (shot and read), and 8 bits.

mod camera;
mod gel;
mod read;
#[cfg(test)]
mod read_tests;

pub use camera::{Camera, IMAGE, Image};
pub use gel::{Press, indentation};
pub use read::{MAX_PIXELS, MIN_SIDE, Picture, read};
