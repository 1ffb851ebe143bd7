//! t
pub mod grid;
pub mod kernel;
mod node;

pub use node::GsrtisiLa;

asperity_sdk::export!(GsrtisiLa);
