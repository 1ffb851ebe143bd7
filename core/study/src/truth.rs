//! The physics: what a pen feels of the same stroke over several places of the same surface.

use std::collections::HashMap;

use asperity_measure::accuracy::Spectrogram;

/// Truths by number of the stroke, material and draw.
#[derive(Debug, Default)]
pub(crate) struct Truths(HashMap<(usize, String, u64), Vec<Spectrogram>>);

impl Truths {
    /// Adds those of a draw.
    pub(crate) fn insert(&mut self, stroke: usize, material: &str, draw: u64, truths: Vec<Spectrogram>) {
        self.0.insert((stroke, material.to_owned(), draw), truths);
    }

    /// What there is of a stroke over a material.
    pub(crate) fn get(&self, stroke: usize, material: &str, draw: u64) -> Option<&[Spectrogram]> {
        self.0.get(&(stroke, material.to_owned(), draw)).map(Vec::as_slice)
    }
}
