//! A new random phase for every bin of every frame: the baseline of all other methods.
//!
//! The phase is a function of the seed, the frame number and the bin, so skipping a frame changes no
//! later one.
//!
//! Frames overlap `N / H` times (`N` the window, `H` the hop, in samples). With independent phases they
//! add up in power, where a consistent stream adds up in amplitude. So overlap-add returns `H / N` of
//! the energy of the magnitudes: of each frame's power `V` there remains `V / sum w^2 = V 8 H / (3 N)`,
//! where a stationary signal of these magnitudes has `8/3 V`. At 50 frames a window that is -17 dB.
//! [`Level::Keep`] scales by `sqrt(N / H)`, which is exact in the mean for three frames a window or
//! more. The output is then Gaussian noise whose spectrum the window smears once more.
//!
//! Spectral convergence, level and error of the long-term spectrum in dB, on the vectors in
//! `tests/data/phase` ("published" is `random_iid` of `graphs/phase/sc.json`):
//!
//! | vector | `Plain` | `Keep` | published |
//! |---|---|---|---|
//! | sine_off_2500 | -1.0 -17.2 12.0 | -4.9 -0.2 10.8 | -1.1 -16.7 11.6 |
//! | chirp_2500 | -1.1 -16.7 16.9 | -4.6 +0.3 3.0 | -1.0 -17.0 17.0 |
//! | texture_2500 | -1.1 -17.1 17.0 | -5.4 -0.1 1.0 | -1.0 -17.3 17.1 |
//! | two25_2500 | -1.1 -16.9 14.6 | -5.0 +0.1 7.2 | -1.1 -17.2 15.0 |
//! | taps_2500 | -0.9 -18.3 17.3 | -4.6 -1.3 1.9 | -1.2 -15.7 16.7 |
//! | contact_2500 | -1.1 -17.0 16.9 | -5.2 +0.0 0.9 | -1.1 -17.2 16.9 |
//! | nnsmooth_2500 | -1.1 -17.0 16.9 | -6.3 +0.0 1.2 | -1.1 -17.2 17.2 |
//! | texture_48000 | -1.1 -17.1 17.0 | -5.1 -0.1 2.1 | -1.1 -17.1 17.0 |
//! | amchirp_48000 | -1.1 -17.1 16.8 | -5.2 -0.1 3.7 | -1.1 -17.0 16.9 |

use crate::float::unit_circle;
use crate::magnitude::{largest_of, take};
use crate::{Complex, Float, Framing, FramingError, Level, random};

/// Independent uniform phases, for frames of one layout. It has no state.
#[derive(Debug)]
pub struct RandomPhase<T> {
    fft_len: usize,
    gain: T,
    seed: u64,
    mags: Vec<T>,
}

impl<T: Float> RandomPhase<T> {
    /// Makes the kernel for a layout.
    ///
    /// # Errors
    /// The errors of [`Framing::check`].
    pub fn new(framing: Framing, level: Level, seed: u64) -> Result<Self, FramingError> {
        framing.check()?;
        let (samples, frames) = framing.period();
        let gain = match level {
            Level::Plain => 1.0,
            Level::Keep => (framing.fft_len as f64 * frames as f64 / samples as f64).sqrt(),
        };
        Ok(Self { fft_len: framing.fft_len, gain: T::of(gain), seed, mags: vec![T::zero(); framing.bins] })
    }

    /// Number of bins in a frame.
    pub fn bins(&self) -> usize {
        self.mags.len()
    }

    /// Draws phases for frame number `frame`. `out[k]` gets `magnitudes[k]` in the same unit, times the
    /// gain of the level. Bin 0 and Nyquist are real: they get a random sign.
    ///
    /// A magnitude that is NaN, infinite or negative counts as 0; their number is returned. Missing
    /// magnitudes count as 0, those beyond [`bins`](Self::bins) are ignored, and the rest of `out` is
    /// set to 0.
    pub fn process<P: Float>(&mut self, frame: u64, magnitudes: &[P], out: &mut [Complex<P>]) -> usize {
        // Scaling must not take the largest of values beyond what is finite.
        let bad = take(magnitudes, largest_of::<P, T>() / (2.0 * self.gain.f64()), &mut self.mags);
        out.fill(Complex::default());
        for (k, (out, &mag)) in out.iter_mut().zip(&self.mags).enumerate() {
            if mag <= T::zero() {
                continue;
            }
            let turns = random::uniform(self.seed, frame, k as u64);
            let real = k == 0 || 2 * k == self.fft_len;
            let (cos, sin) = unit_circle(if real { 0.5 * f64::from(turns < 0.5) } else { turns });
            let radius = mag * self.gain;
            *out = Complex::new((radius * T::of(cos)).to(), (radius * T::of(sin)).to());
        }
        bad
    }
}

#[cfg(test)]
mod tests;
