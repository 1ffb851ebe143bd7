//! A new random phase for every bin of every frame: the baseline of all other methods.
//!
//! The phase is a function of the seed, the frame number and the bin, so skipping a frame changes no later
//! one. Frames overlap `N / H` times (`N` the window, `H` the hop, in samples) and add up in power, where a
//! consistent stream adds up in amplitude. So overlap-add returns `H / N` of the energy of the magnitudes: of
//! each frame's power `V` there remains `V / sum w^2 = V 8 H / (3 N)`, where a stationary signal of these
//! magnitudes has `8/3 V`. At 50 frames a window that is -17 dB. [`Level::Keep`] scales by `sqrt(N / H)`,
//! which is exact in the mean for three frames a window or more. The output is then Gaussian noise whose
//! spectrum the window smears once more.

use crate::magnitude::{largest_of, take};
use crate::{Complex, Float, Framing, Level, Refused, random};
use asperity_numbers::unit_circle;

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
    pub fn new(framing: Framing, level: Level, seed: u64) -> Result<Self, Refused> {
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

    /// Draws phases for frame number `frame`. `out[k]` gets `magnitudes[k]` in the same unit, times the gain
    /// of the level; bin 0 and Nyquist get a random sign. Returns the number of magnitudes that are NaN,
    /// infinite or negative; they count as 0, as missing ones do.
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
