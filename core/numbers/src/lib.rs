//! Numbers that are the same on every CPU: elementary functions, random numbers, and floating-point
//! control.

pub mod denormals;
mod elementary;
mod generator;
pub mod random;

pub use elementary::{Elementary, polar, size, unit_circle};
pub use generator::Random;
