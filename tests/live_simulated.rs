//! The engine over cpal's custom host: what a card plays is what the graph gives, sample by sample, whatever the card is like
//! and whatever goes wrong with it.

mod common;
#[path = "live_simulated/exact.rs"]
mod exact;
#[path = "live_simulated/faults.rs"]
mod faults;
#[path = "live_simulated/inputs.rs"]
mod inputs;
#[path = "common/stage.rs"]
mod stage;
#[path = "live_simulated/swaps.rs"]
mod swaps;
