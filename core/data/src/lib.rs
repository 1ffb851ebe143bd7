//! Data to train and judge texture models: tactile images of materials, and strokes with their
//! accelerations.
//!
//! All sources give [`Subject`]s. An [`Example`] is one instant of a stroke as the chain measures it: the
//! last ten forces and velocities, 2 ms apart, and the magnitudes of the 0.1 s of acceleration that begin
//! there.
//!
//! A rendered stroke is compared with the accelerations that a tool [felt] along it: simulated over a piece
//! of a [made surface](made::Ground), or [recorded](recordings::recording).

mod example;
pub mod felt;
mod folder;
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
