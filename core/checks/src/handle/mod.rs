//! A device that pushes back, and the hand on it, simulated: exactly between two moments at which a force changes.

mod device;
mod exponential;
mod servo;

pub(crate) use device::{Device, Hand, Handle};
pub(crate) use servo::Loop;
