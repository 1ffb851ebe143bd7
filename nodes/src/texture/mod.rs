//! Texture: from the motion of the hand to the vibration that follows.

mod action_history;
mod scatter;
#[cfg(test)]
mod tests;
mod texture_network;

pub use action_history::ActionHistory;
pub use scatter::Scatter;
pub use texture_network::TextureNetwork;
