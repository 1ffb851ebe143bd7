//! What stands behind the sound card: what a person says of it once, and what is known of its coils.

mod coils;
mod file;

pub use coils::{Ceiling, Coils};
pub use file::{Machine, default_path};
