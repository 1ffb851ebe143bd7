//! Limits that nothing lifts: graphs change while they play, devices are lost, runs follow each other or
//! share an actuator, and graphs say of themselves what is not so. A coil of the tests' own is given what the
//! device was given, and judges it.

mod between_runs;
mod machine;
mod swaps;
