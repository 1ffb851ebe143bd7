//! The physics: what a pen feels of the same stroke over several places of the same surface, or what a tool
//! felt when the stroke was recorded.

use std::collections::HashMap;

use asperity_accuracy::accuracy::{AccuracyError, Rhythm, Spectrogram};

use crate::stroke::{Known, Stroke};

/// What is kept of what a tool felt, once or several times, to hold a rendered signal against.
#[derive(Clone, Debug, Default)]
pub struct Truth {
    /// Short-time powers.
    pub spectrograms: Vec<Spectrogram>,
    /// Rhythms along the principal axis; none of a signal of less than 0.5 s.
    pub rhythms: Vec<Rhythm>,
}

impl Truth {
    /// Adds what was felt along some axes in m/s^2.
    ///
    /// # Errors
    /// A signal of which there is no spectrogram.
    pub fn add(&mut self, axes: &[&[f64]], rate_hz: f64) -> Result<(), AccuracyError> {
        self.spectrograms.push(Spectrogram::new(axes, rate_hz)?);
        self.rhythms.extend(Rhythm::new(axes, rate_hz));
        Ok(())
    }
}

/// Truths by number of the stroke, material and draw.
#[derive(Debug, Default)]
pub(crate) struct Truths(HashMap<(usize, String, u64), Truth>);

impl Truths {
    /// Adds that of a draw.
    pub(crate) fn insert(&mut self, stroke: usize, material: &str, draw: u64, truth: Truth) {
        self.0.insert((stroke, material.to_owned(), draw), truth);
    }

    /// What there is of a stroke over a material: what was recorded is the same in each draw.
    pub(crate) fn get<'a>(
        &'a self,
        (number, stroke): (usize, &'a Stroke),
        material: Option<&str>,
        draw: u64,
    ) -> Option<&'a Truth> {
        match &stroke.known {
            Known::Felt(felt) => Some(felt),
            Known::Hand(_) => self.0.get(&(number, material?.to_owned(), draw)),
        }
    }
}
