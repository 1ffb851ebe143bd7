//! Hard cases, one file a family. Each says in a line what is hard and what must hold, and has a mutant: a broken variant that must fail it.

#[path = "../common/mod.rs"]
mod common;
#[path = "../common/counting.rs"]
mod counting;
#[path = "../common/stage.rs"]
mod stage;

mod faults;
mod files;
