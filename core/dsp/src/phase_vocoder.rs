//! Each bin as an oscillator at its own centre frequency: the phase vocoder's synthesis without its
//! analysis.
//!
//! With magnitudes alone the plain phase vocoder (J. L. Flanagan, R. M. Golden, "Phase Vocoder", Bell
//! Syst. Tech. J. 45, 1966) can only integrate each bin's centre frequency. Phases are computed in integers
//! from a frame's absolute first sample, so nothing drifts and a missing frame changes nothing after it.
//!
//! The start phases remain to be chosen. After overlap-add and analysis bin `k` holds `A_k - (A_(k-1)
//! e^ia + A_(k+1) e^ib) / 2`, up to a factor: with equal neighbours the magnitude beats with their sum. It
//! beats least where the second difference of the start phases is half a turn: `k^2 / 4` turns. An additional
//! `k^2 / (2 K)`, for `K` bins, spreads the energy over the window (M. R. Schroeder, IEEE Trans. Inf. Theory
//! 16, 1970). On a smooth spectrum the crest factor falls from 9.9 to 3.2.
//!
//! Steady magnitudes come back 10 log10(2/3) = -1.76 dB too quiet: overlap-add with two Hann windows scales
//! every oscillator by 2/3, and each is seen in three bins with the squares 1/4, 1, 1/4. [`Level::Keep`]
//! compensates that. Figures of all methods are in `docs/explanation/accuracy.md`.

use crate::float::phasor;
use crate::magnitude::{largest_of, take};
use crate::{Complex, Float, Framing, Level, Refused, random};
use asperity_numbers::unit_circle;

/// Phases of the oscillators at sample 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StartPhase {
    /// All 0; the energy of a window is concentrated at one instant.
    Zero,
    /// Uniform, a function of the seed and the bin.
    Random,
    /// `k^2 (1/4 + 1/(2K))` turns; magnitudes beat least, and the energy spreads over the window.
    Quadratic,
}

impl StartPhase {
    /// Start phase of bin `k` of `bins` in turns.
    pub(crate) fn turns(self, k: usize, bins: usize, seed: u64) -> f64 {
        match self {
            Self::Zero => 0.0,
            Self::Random => random::uniform(seed, 0, k as u64),
            Self::Quadratic => {
                // Below 2^40, so exact where it matters; a fraction of a turn is kept.
                let square = (k * k) as f64;
                (square / 4.0).fract() + (square / (2 * bins.max(1)) as f64).fract()
            }
        }
    }
}

/// Phase retrieval that integrates bin-centre frequencies, for frames of one layout. It has no state.
#[derive(Debug)]
pub struct PhaseVocoder<T> {
    /// `N` points on the unit circle.
    circle: Vec<Complex<T>>,
    /// Start phases, times the gain of the level.
    start: Vec<Complex<T>>,
    mags: Vec<T>,
}

impl<T: Float> PhaseVocoder<T> {
    /// Computes the tables. The factor of [`Level::Keep`] holds for three frames a window or more.
    pub fn new(framing: Framing, start: StartPhase, level: Level, seed: u64) -> Result<Self, Refused> {
        framing.check()?;
        let (n, bins) = (framing.fft_len, framing.bins);
        let gain = match level {
            Level::Plain => 1.0,
            Level::Keep => 1.5f64.sqrt(),
        };
        let start = (0..bins).map(|k| {
            let turns = start.turns(k, bins, seed);
            // Only a phase of 0 or half a turn can be heard at 0 and at half the rate.
            let real = k == 0 || 2 * k == n;
            let (cos, sin) = unit_circle(if real { (2.0 * turns).round() / 2.0 } else { turns });
            Complex::new(T::of(gain * cos), T::of(gain * sin))
        });
        Ok(Self {
            start: start.collect(),
            circle: (0..n).map(|i| phasor(i as f64 / n as f64)).collect(),
            mags: vec![T::zero(); bins],
        })
    }

    /// Number of bins in a frame.
    pub fn bins(&self) -> usize {
        self.mags.len()
    }

    /// Computes phases, counted from its first sample, for the frame that starts at `start`. `out[k]` gets
    /// `magnitudes[k]` in the same unit, times the gain of the level. Returns the number of magnitudes that
    /// are NaN, infinite or negative; they count as 0, as missing ones do.
    pub fn process<P: Float>(&mut self, start: u64, magnitudes: &[P], out: &mut [Complex<P>]) -> usize {
        // Rounding and the level must not take the largest of values beyond what is finite.
        let bad = take(magnitudes, 0.5 * largest_of::<P, T>(), &mut self.mags);
        let n = self.circle.len();
        // Below N, which is at most 2^20.
        let advance = (start % n as u64) as usize;
        let mut at = 0;
        out.fill(Complex::default());
        for ((out, &mag), &start) in out.iter_mut().zip(&self.mags).zip(&self.start) {
            let turned = self.circle[at] * start;
            *out = Complex::new((turned.re * mag).to(), (turned.im * mag).to());
            at += advance;
            if at >= n {
                at -= n;
            }
        }
        bad
    }
}

#[cfg(test)]
mod tests;
