//! The physics: what a pen feels of the same stroke over several places of the same surface, or what a tool felt when the stroke was recorded.

use std::collections::HashMap;

use asperity_measure::accuracy::Spectrogram;

use crate::stroke::{Known, Stroke};

/// Truths by number of the stroke, material and draw.
#[derive(Debug, Default)]
pub(crate) struct Truths(HashMap<(usize, String, u64), Vec<Spectrogram>>);

impl Truths {
    /// Adds those of a draw.
    pub(crate) fn insert(&mut self, stroke: usize, material: &str, draw: u64, truths: Vec<Spectrogram>) {
        self.0.insert((stroke, material.to_owned(), draw), truths);
    }

    /// What there is of a stroke over a material: what was recorded is the same in each draw.
    pub(crate) fn get<'a>(
        &'a self,
        (number, stroke): (usize, &'a Stroke),
        material: Option<&str>,
        draw: u64,
    ) -> Option<&'a [Spectrogram]> {
        match &stroke.known {
            Known::Felt(felt) => Some(std::slice::from_ref(felt)),
            Known::Hand(_) => self.0.get(&(number, material?.to_owned(), draw)).map(Vec::as_slice),
        }
    }
}
