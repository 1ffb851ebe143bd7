//! Fade of an audio output while its node fails: out from its last good sample, and back in.

/// Fade of one audio output.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fade {
    /// Change of a gain per sample.
    step: f32,
    /// Last emitted sample.
    last: f32,
    /// Sample that fades out.
    held: f32,
    held_gain: f32,
    /// Gain of the node's own output.
    gain: f32,
}

impl Fade {
    /// Makes a fade of `samples`, at least one.
    pub(crate) fn new(samples: f32) -> Self {
        Self { step: 1.0 / samples.max(1.0), last: 0.0, held: 0.0, held_gain: 0.0, gain: 1.0 }
    }

    /// Whether a fade is in progress.
    pub(crate) fn active(&self) -> bool {
        self.gain < 1.0 || self.held_gain > 0.0
    }

    /// Processes a good tick.
    pub(crate) fn pass(&mut self, samples: &mut [f32]) {
        if self.active() {
            for x in samples.iter_mut() {
                self.gain = (self.gain + self.step).min(1.0);
                self.held_gain = (self.held_gain - self.step).max(0.0);
                *x = *x * self.gain + self.held * self.held_gain;
            }
        }
        if let Some(x) = samples.last() {
            self.last = *x;
        }
    }

    /// Processes a tick of a failing node. Returns whether only silence is left.
    pub(crate) fn fault(&mut self, samples: &mut [f32]) -> bool {
        if self.gain > 0.0 {
            (self.held, self.held_gain, self.gain) = (self.last, 1.0, 0.0);
        }
        let silent = self.held_gain == 0.0 || self.held == 0.0;
        for x in samples.iter_mut() {
            self.held_gain = (self.held_gain - self.step).max(0.0);
            *x = self.held * self.held_gain;
        }
        if let Some(x) = samples.last() {
            self.last = *x;
        }
        silent
    }

    /// Processes a tick of sleep: a fade in progress ends.
    pub(crate) fn sleep(&mut self) {
        (self.last, self.held, self.held_gain) = (0.0, 0.0, 0.0);
    }

    /// Returns to the initial state.
    pub(crate) fn reset(&mut self) {
        *self = Self { step: self.step, last: 0.0, held: 0.0, held_gain: 0.0, gain: 1.0 };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fault_fades_from_the_last_good_sample_and_back() {
        let mut fade = Fade::new(10.0);
        let mut out = vec![];
        for tick in 0..8 {
            let mut x = [1.0_f32; 4];
            if (2..5).contains(&tick) {
                x = [f32::NAN; 4];
                fade.fault(&mut x);
            } else {
                fade.pass(&mut x);
            }
            out.extend(x);
        }
        assert!(out.windows(2).all(|w| (w[1] - w[0]).abs() < 0.1001), "{out:?}");
        assert_eq!((out[7], out[19], out[31]), (1.0, 0.0, 1.0));
    }
}
