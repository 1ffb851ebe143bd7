//! Texture: what was done, and what vibration follows.

mod action_history;
#[cfg(test)]
mod tests;
mod texture_network;

pub use action_history::ActionHistory;
pub use texture_network::TextureNetwork;
