//! Numbers that are the same on every CPU: elementary functions, random numbers, and the state of the
//! floating-point unit.

pub mod denormals;
mod elementary;
mod generator;
pub mod random;

pub use elementary::{Elementary, polar, size};
pub use generator::Random;
