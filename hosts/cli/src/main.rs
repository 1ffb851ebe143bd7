//! The `asperity` program.
fn main() {}
