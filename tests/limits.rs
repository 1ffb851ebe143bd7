//! Limits that nothing lifts: graphs change while they play, devices are lost, runs follow each other or
//! share an actuator, and graphs say of themselves what is not so. A coil of the tests' own is given what the
//! device was given, and judges it.

#[path = "limits/between_runs.rs"]
mod between_runs;
#[path = "common/coil.rs"]
mod coil;
mod common;
#[path = "limits/machine.rs"]
mod machine;
#[path = "common/stage.rs"]
mod stage;
#[path = "limits/swaps.rs"]
mod swaps;
