use std::path::PathBuf;

use asperity_dsp::frame::BINS;
use asperity_texture::picture::Image;

use crate::history::HISTORY;

/// One instant of a stroke: what the network is given and what it should answer.
#[derive(Clone, Debug, PartialEq)]
pub struct Example {
    /// Forces in N, oldest first, 2 ms apart.
    pub force: [f32; HISTORY],
    /// 10 vx, then 10 vy, in mm/s, oldest first, as the chain measures them.
    pub velocity: [f32; 2 * HISTORY],
    /// Amplitudes in m/s^2 of the next 0.1 s of acceleration at 10, 20, .. 1000 Hz: `2 |sum w x| / sum w`,
    /// `w` Hann's window.
    pub magnitudes: [f32; BINS],
    /// Those of another signal of the same touch, if there is one: of a made stroke at another place, of a
    /// recorded one the 0.1 s behind it. How much both differ says how random magnitudes are.
    pub other: Option<[f32; BINS]>,
}

/// What the magnitudes of examples are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Truth {
    /// Those of one signal: random about their mean.
    Draws,
    /// Root mean squares, known in closed form.
    Rms,
}

/// One instant of a stroke, and what is known of what should be answered there.
#[derive(Clone, Debug, PartialEq)]
pub struct Expectation {
    /// What the network is given, and the magnitudes of one signal.
    pub example: Example,
    /// Mean magnitudes over places.
    pub mean: [f32; BINS],
    /// Root mean square magnitudes over places.
    pub rms: [f32; BINS],
    /// Variance over places of a frame's power, the sum of its squared magnitudes, over its squared mean.
    /// `None` where there are no two places, or nothing is felt.
    pub variance: Option<f32>,
}

/// What is trained on, and what is held apart to judge by.
#[derive(Clone, Debug, PartialEq)]
pub struct Parts<T> {
    /// To train on.
    pub train: Vec<T>,
    /// To judge by: other places, other strokes.
    pub held: Vec<T>,
}

impl<T> Default for Parts<T> {
    fn default() -> Self {
        Self { train: Vec::new(), held: Vec::new() }
    }
}

/// A picture's file, and what was done to it or is wrong with it.
pub type Note = (PathBuf, String);

/// A material: how it looks to a tactile sensor and how it feels.
#[derive(Clone, Debug, PartialEq)]
pub struct Subject {
    /// Its name; no other of its set has it.
    pub name: String,
    /// What it is, in a sentence.
    pub description: String,
    /// Its family, if it is known.
    pub family: Option<String>,
    /// Tactile images.
    pub images: Parts<Image>,
    /// Strokes.
    pub examples: Parts<Example>,
    /// What the examples' magnitudes are.
    pub truth: Truth,
    /// What was done to pictures that were read, or is wrong with them, in order.
    pub notes: Vec<Note>,
}
