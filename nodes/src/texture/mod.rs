//! Texture: what was done, and what vibration follows.

mod action_history;
mod scatter;
#[cfg(test)]
mod tests;
mod texture_network;

use crate::precision::Precise;

pub use action_history::ActionHistory;
/// `scatter` in either precision.
pub type Scatter = Precise<scatter::Scatter<f32>, scatter::Scatter<f64>>;
pub use texture_network::TextureNetwork;
