//! Synthesis: spectra to a signal, and a signal to another rate.

mod overlap_add;
mod resample;

use crate::precision::Precise;

/// `overlap_add` in either precision.
pub type OverlapAdd = Precise<overlap_add::OverlapAdd<f32>, overlap_add::OverlapAdd<f64>>;
/// `resample` in either precision.
pub type Resample = Precise<resample::Resample<f32>, resample::Resample<f64>>;
