use std::sync::Arc;

use asperity_state::State;

use super::{Filter, MAX_ORDER, Texture};
use crate::material::Random;

/// Below this a tail is nothing; it ends before its samples are denormal.
const TINY: f64 = 1e-30;

/// The acceleration of a texture as it is touched: noise through the filter of the moment.
///
/// Noise is counted by sample number from the seed, so that what is skipped changes nothing of the noise that follows. Only
/// [`new`](Self::new) allocates.
#[derive(Clone, Debug)]
pub struct Synthesis {
    texture: Arc<Texture>,
    seed: u64,
    filter: Filter,
    /// Noise as it was put in, newest first, each at the level of its time.
    noise: [f64; MAX_ORDER],
    /// Samples, newest first.
    samples: [f64; MAX_ORDER],
}

impl Synthesis {
    /// A silent signal of a texture.
    pub fn new(texture: Arc<Texture>, seed: u64) -> Self {
        let filter = texture.silence();
        Self { texture, seed, filter, noise: [0.0; MAX_ORDER], samples: [0.0; MAX_ORDER] }
    }

    /// The texture.
    pub fn texture(&self) -> &Texture {
        &self.texture
    }

    /// Moves on to a speed in mm/s and a force in N; 0, less or not a number is silence, into which the signal dies away.
    ///
    /// What sounded goes on through the new filter. Where that has its resonances elsewhere, and they are sharp, it gets a kick: with those of 6 Hz of
    /// `graphs/models/made_ar/ringing.ron`, from 0.3 to 3 N at once, steps are up to eight times as large as in any steady signal on the way, within 20 ms three
    /// times, within 100 ms 1.2 times. Resonances of 15 Hz and more show none of it.
    pub fn touch(&mut self, speed_mm_s: f64, force_n: f64) {
        self.texture.fill(speed_mm_s, force_n, &mut self.filter);
    }

    /// The samples in m/s^2 from number `first` on, at the texture's rate.
    pub fn process(&mut self, first: u64, out: &mut [f32]) {
        let (p, q) = (self.filter.ar().len(), self.filter.ma().len());
        for (i, out) in out.iter_mut().enumerate() {
            let newest = if self.filter.deviation > 0.0 {
                self.filter.deviation * noise(self.seed, first.wrapping_add(i as u64))
            } else {
                0.0
            };
            let ahead: f64 = self.filter.ma().iter().zip(&self.noise).map(|(b, e)| b * e).sum();
            let back: f64 = self.filter.ar().iter().zip(&self.samples).map(|(a, x)| a * x).sum();
            let sample = self.filter.gain * (newest + ahead) - back;
            push(&mut self.noise, q, newest);
            push(&mut self.samples, p, sample);
            *out = sample as f32;
        }
        self.settle();
    }

    /// Forgets what sounded.
    pub fn reset(&mut self) {
        self.noise.fill(0.0);
        self.samples.fill(0.0);
    }

    /// What is remembered of the signal.
    pub fn state(&mut self, state: &mut State<'_>) {
        state.keep(&mut self.noise).keep(&mut self.samples);
        if state.restores() {
            let finite = self.settle();
            state.require(finite);
        }
    }

    /// Ends a tail that is as good as over, and what is not finite; false for the latter.
    fn settle(&mut self) -> bool {
        let largest = self.samples.iter().chain(&self.noise).fold(0.0, |m: f64, x| m.max(x.abs()));
        let finite = self.samples.iter().chain(&self.noise).all(|x| x.is_finite());
        if !finite || largest < TINY {
            self.reset();
        }
        finite
    }
}

/// Normal noise of deviation 1 by sample number.
fn noise(seed: u64, sample: u64) -> f64 {
    Random::new(seed ^ Random::new(sample).bits()).normal()
}

/// Moves the first `len` one on and puts `newest` before them.
fn push(line: &mut [f64; MAX_ORDER], len: usize, newest: f64) {
    if let Some(line) = line.get_mut(..len)
        && !line.is_empty()
    {
        line.rotate_right(1);
        line[0] = newest;
    }
}

#[cfg(test)]
#[path = "tests.rs"]
mod tests;
