//! Settings of [`SampleCommit`](super::SampleCommit).

use crate::{Framing, FramingError};
use thiserror::Error;

/// Amount of work and time of emission.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Frames of a pass, 1 or more: the newest, and others spread over those that reach past the last
    /// emitted sample.
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

/// Reason why [`Settings`] or their framing are refused.
#[derive(Clone, Copy, Debug, Eq, Error, PartialEq)]
#[non_exhaustive]
pub enum SettingsError {
    /// The framing is refused.
    #[error(transparent)]
    Framing(#[from] FramingError),
    /// No frames or no passes, or more than [`MAX_WORK`] of one of them.
    #[error("frames and passes are 1 to {}", MAX_WORK)]
    Work,
    /// The momentum is not in [0, 1).
    #[error("the momentum is not in [0, 1)")]
    Momentum,
    /// Emission after the end of the newest frame, or more than ten windows before its start.
    #[error("samples can be emitted from the end of a window to ten windows before it")]
    Emission,
}

/// Most frames in a pass, and most passes for a frame.
pub const MAX_WORK: usize = 100;

impl Settings {
    /// Checks the settings that do not depend on the framing.
    pub(super) fn check(&self) -> Result<(), SettingsError> {
        if [self.frames, self.passes].iter().any(|&n| n == 0 || n > MAX_WORK) {
            return Err(SettingsError::Work);
        }
        if !(0.0..1.0).contains(&self.momentum) {
            return Err(SettingsError::Momentum);
        }
        Ok(())
    }

    /// `floor(emission * hop)` in samples, rounded towards 0.
    ///
    /// # Errors
    /// [`SettingsError::Emission`].
    pub fn delay(&self, framing: &Framing) -> Result<i64, SettingsError> {
        let samples =
            i64::try_from(framing.start(u64::from(self.emission.unsigned_abs()))).unwrap_or(i64::MAX);
        let n = framing.fft_len as i64;
        let delay = if self.emission < 0 { -samples } else { samples };
        if delay > -n && delay <= 10 * n { Ok(delay) } else { Err(SettingsError::Emission) }
    }
}
