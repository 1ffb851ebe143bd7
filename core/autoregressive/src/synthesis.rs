use std::sync::Arc;

use asperity_state::State;

use super::ladder::Ladder;
use super::{Filter, MAX_ORDER, Texture};
use asperity_numbers::Random;

/// A tail below this is over. It ends before samples are denormal.
const TINY: f64 = 1e-30;

/// The acceleration of a touched texture: noise through the current filter. However fast speed and force
/// change, its deviation never exceeds the largest of the filters that it went through. Noise is indexed by
/// sample number from the seed. Only [`new`](Self::new) allocates.
#[derive(Clone, Debug)]
pub struct Synthesis {
    texture: Arc<Texture>,
    seed: u64,
    filter: Filter,
    ladder: Ladder,
    /// States of the ladder.
    states: [f64; MAX_ORDER],
}

impl Synthesis {
    /// A silent signal of a texture.
    pub fn new(texture: Arc<Texture>, seed: u64) -> Self {
        let filter = texture.silence();
        Self { texture, seed, filter, ladder: Ladder::SILENT, states: [0.0; MAX_ORDER] }
    }

    /// The texture.
    pub fn texture(&self) -> &Texture {
        &self.texture
    }

    /// Moves to a speed in mm/s and a force in N. If either is not above 0 the signal dies away.
    ///
    /// The current sound goes on through the new filter, as loud as it was.
    pub fn touch(&mut self, speed_mm_s: f64, force_n: f64) {
        self.texture.fill(speed_mm_s, force_n, &mut self.filter);
        self.ladder.set(&self.filter);
    }

    /// Renders the samples in m/s^2 from number `first` on, at the texture's rate.
    pub fn process(&mut self, first: u64, out: &mut [f32]) {
        for (i, out) in out.iter_mut().enumerate() {
            let noise =
                if self.ladder.level() > 0.0 { noise(self.seed, first.wrapping_add(i as u64)) } else { 0.0 };
            *out = self.ladder.step(noise, &mut self.states) as f32;
        }
        self.settle();
    }

    /// Clears the signal's memory.
    pub fn reset(&mut self) {
        self.states.fill(0.0);
    }

    /// State of the signal.
    pub fn state(&mut self, state: &mut State<'_>) {
        state.keep(&mut self.states);
        if state.restores() {
            let finite = self.settle();
            state.require(finite);
        }
    }

    /// Ends a tail that is over, or a state that is not finite. False for the latter.
    fn settle(&mut self) -> bool {
        let largest = self.states.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        let finite = self.states.iter().all(|x| x.is_finite());
        if !finite || largest < TINY {
            self.reset();
        }
        finite
    }
}

/// Normal noise of deviation 1, by sample number.
fn noise(seed: u64, sample: u64) -> f64 {
    Random::new(seed ^ Random::new(sample).bits()).normal()
}

#[cfg(test)]
#[path = "tests.rs"]
mod tests;
