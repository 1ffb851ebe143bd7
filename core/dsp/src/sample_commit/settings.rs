//! Settings of [`SampleCommit`](super::SampleCommit).

use crate::{Framing, Refused, refuse};

/// Amount of work and time of emission.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Frames of a pass, 1 or more: the newest, and others spread over those that reach past the last sample.
    pub frames: usize,
    /// Passes for each new frame, 1 or more.
    pub passes: usize,
    /// Extrapolation of a pass in the direction of the one before, in [0, 1).
    pub momentum: f64,
    /// Time of emission in frames. 0: at the start of the newest frame. Negative: inside it (-25 is its
    /// centre at 50 frames a window). Positive: before its start.
    pub emission: i32,
}

impl Default for Settings {
    fn default() -> Self {
        Self { frames: 5, passes: 5, momentum: 0.9, emission: -20 }
    }
}

/// Most frames in a pass, and most passes for a frame.
pub const MAX_WORK: usize = 100;

impl Settings {
    /// Checks the settings that do not depend on the framing.
    pub(super) fn check(&self) -> Result<(), Refused> {
        if [self.frames, self.passes].iter().any(|&n| n == 0 || n > MAX_WORK) {
            return refuse(format!("frames and passes are 1 to {MAX_WORK}"));
        }
        if !(0.0..1.0).contains(&self.momentum) {
            return refuse("the momentum is not in [0, 1)");
        }
        Ok(())
    }
    /// `floor(emission * hop)` in samples, rounded towards 0. Emission is refused after the end of the newest
    /// frame, and more than ten windows before its start.
    pub fn delay(&self, framing: &Framing) -> Result<i64, Refused> {
        let samples = framing.start(u64::from(self.emission.unsigned_abs()));
        let samples = i64::try_from(samples).unwrap_or(i64::MAX);
        let n = framing.fft_len as i64;
        let delay = if self.emission < 0 { -samples } else { samples };
        if delay <= -n || delay > 10 * n {
            return refuse("samples can be emitted from the end of a window to ten windows before it");
        }
        Ok(delay)
    }
}
