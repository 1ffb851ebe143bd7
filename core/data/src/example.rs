use std::path::PathBuf;

use asperity_dsp::frame::BINS;
use asperity_texture::picture::Image;

use crate::history::HISTORY;

/// One instant of a stroke: the network's input and its target.
#[derive(Clone, Debug, PartialEq)]
pub struct Example {
    /// Forces in N, oldest first, 2 ms apart.
    pub force: [f32; HISTORY],
    /// 10 vx, then 10 vy, in mm/s, oldest first, as the chain measures them.
    pub velocity: [f32; 2 * HISTORY],
    /// Amplitudes in m/s^2 of the next 0.1 s of acceleration at 10, 20, .. 1000 Hz: `2 |sum w x| / sum
    /// w`, `w` Hann's window.
    pub magnitudes: [f32; BINS],
    /// Magnitudes of another signal of the same touch, if there is one: of a made stroke at another
    /// place, of a recorded one the 0.1 s behind. Their difference shows how random magnitudes are.
    pub other: Option<[f32; BINS]>,
}

/// Kind of an example's magnitudes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Truth {
    /// Of one signal: random about their mean.
    Draws,
    /// Root mean squares in closed form.
    Rms,
}

/// One instant of a stroke, with statistics of its targets.
#[derive(Clone, Debug, PartialEq)]
pub struct Expectation {
    /// The network's input, and the magnitudes of one signal.
    pub example: Example,
    /// Mean magnitudes over places.
    pub mean: [f32; BINS],
    /// Root mean square magnitudes over places.
    pub rms: [f32; BINS],
    /// Variance of a frame's power (the sum of squared magnitudes) over places, relative to its squared
    /// mean. `None` with fewer than two places, or where nothing is felt.
    pub variance: Option<f32>,
}

/// Data to train on, and data held apart to judge by.
#[derive(Clone, Debug, PartialEq)]
pub struct Parts<T> {
    /// To train on.
    pub train: Vec<T>,
    /// To judge by: other places and strokes.
    pub held: Vec<T>,
}

impl<T> Default for Parts<T> {
    fn default() -> Self {
        Self { train: Vec::new(), held: Vec::new() }
    }
}

/// A picture's file, and a remark about it.
pub type Note = (PathBuf, String);

/// A material: its looks to a tactile sensor and its feel.
#[derive(Clone, Debug, PartialEq)]
pub struct Subject {
    /// Name, unique in its set.
    pub name: String,
    /// Description in a sentence.
    pub description: String,
    /// Family, if known.
    pub family: Option<String>,
    /// Tactile images.
    pub images: Parts<Image>,
    /// Width of an image on the material \[mm\], if known.
    pub image_mm: Option<f64>,
    /// Strokes.
    pub examples: Parts<Example>,
    /// Kind of the examples' magnitudes.
    pub truth: Truth,
    /// Remarks about the pictures, in order.
    pub notes: Vec<Note>,
}
