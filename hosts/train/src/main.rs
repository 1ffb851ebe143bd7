//! Trains the shipped network.
fn main() {}
