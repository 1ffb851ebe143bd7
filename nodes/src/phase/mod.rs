//! Phase retrieval: from magnitudes to spectra.

mod spsi;

pub use spsi::Spsi;
