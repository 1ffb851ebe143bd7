//! Actuators behind the sound card: the machine's file, and the heat of their coils.

mod coils;
mod file;

pub use coils::{Ceiling, Coils};
pub use file::{Machine, default_path};
