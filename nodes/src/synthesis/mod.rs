//! Synthesis: spectra to a signal, and a signal to another rate.

mod overlap_add;
mod resample;

pub use overlap_add::OverlapAdd;
pub use resample::Resample;
