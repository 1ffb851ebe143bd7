//! The engine over cpal's custom host: what a card plays is what the graph gives, sample by sample, whatever
//! the card is like and whatever goes wrong with it.

mod exact;
mod faults;
mod inputs;
mod swaps;
