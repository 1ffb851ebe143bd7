//! What a texture model is trained on and judged by: tactile images of materials, and pairs of what a hand
//! did and what it felt.
//!
//! All sources give the same [`Subject`]s. An [`Example`] is what the chain measures of a stroke at one
//! instant, the last ten forces and velocities 2 ms apart, and the magnitudes of the 0.1 s of acceleration
//! that begin there.
//!
//! What is rendered of a stroke is held against what a tool [felt] along it: simulated over a piece of a
//! [made surface](made::Ground), or [recorded](recordings::recording).

mod example;
pub mod felt;
mod folder;
#[cfg(test)]
mod folder_testing;
mod frames;
pub mod hatt;
mod history;
pub mod made;
pub mod pattern;
pub mod recordings;
pub mod wav;

pub use example::{Example, Expectation, Note, Parts, Subject, Truth};
pub use frames::Spectrometer;
pub use history::{HISTORY, History, MAX_FORCE_N, MAX_SPEED_MM_S, RATE_HZ, Recorder};
