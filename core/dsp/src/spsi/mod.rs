//! Single Pass Spectrogram Inversion: a spectrum for each frame of magnitudes, at once and without
//! iteration.
//!
//! After G. T. Beauregard, M. Harish, L. Wyse, "Single Pass Spectrogram Inversion", IEEE DSP 2015. The peaks
//! of a frame are taken as sinusoids, each continues the phase of its bin one hop ago, and the bins around a
//! peak are locked to it. Differences from the paper:
//!
//! * A peak's distance from its bin is `d = 2 (c - a) / (a + 2 b + c)` for magnitudes `a, b, c` around it.
//!   This is exact for a Hann window (three-point interpolated DFT: D. Agrez, IEEE Trans. Instrum. Meas.
//!   51(2), 2002), where a parabola is off by up to 0.05 bins.
//! * Phase is kept at the window's centre, where all bins of a main lobe agree, so a peak may move over bins.
//! * The frequency over a hop is the mean of its two ends, which is exact for a chirp.
//! * A run of equal bins is one peak at its middle. A peak at bin 0 or Nyquist gets a phase possible in a
//!   real signal.
//! * Far from the peak a bin is treated as a side lobe, with its sign, only where it is as weak as one.
//! * A bin between two peaks gets the phase of the sum of both main lobes.
//!
//! A pure sine is limited by its own image at the negative frequency. Smooth magnitudes that belong to no
//! signal cannot be expressed as one sinusoid a peak. Figures are in `docs/explanation/accuracy.md`.

pub(crate) mod peak;

use crate::float::phasor;
use crate::magnitude::{largest_of, take};
use crate::random::uniform_at;
use crate::{Complex, Float};
use asperity_state::State;
use peak::Peak;

/// Phase retrieval by Single Pass Spectrogram Inversion, for Hann-windowed frames of one length. The state
/// is one phase and one frequency a bin.
#[derive(Debug)]
pub struct Spsi<T> {
    fft_len: usize,
    seed: u64,
    last_is_nyquist: bool,
    /// This frame's magnitudes; invalid ones are 0.
    mags: Vec<T>,
    /// Phase at the window's centre in turns, in [0, 1).
    turns: Vec<f64>,
    /// Frequency in bins over the last frame; negative where there was none.
    freq: Vec<f64>,
    peaks: Vec<Peak<T>>,
    started: bool,
}

impl<T: Float> Spsi<T> {
    /// For frames of `bins` magnitudes, from bin 0, of a transform of `fft_len` samples; at most
    /// `fft_len / 2 + 1`. The start phase of bin `k` is a function of `seed` and `k` alone.
    pub fn new(fft_len: usize, bins: usize, seed: u64) -> Self {
        let mut new = Self {
            fft_len: fft_len.max(1),
            seed,
            last_is_nyquist: fft_len.is_multiple_of(2) && bins == fft_len / 2 + 1,
            mags: vec![T::zero(); bins],
            turns: vec![0.0; bins],
            freq: vec![-1.0; bins],
            // Peaks are at least one bin apart.
            peaks: Vec::with_capacity(bins / 2 + 1),
            started: false,
        };
        new.reset();
        new
    }

    /// Number of bins in a frame.
    pub fn bins(&self) -> usize {
        self.mags.len()
    }

    /// Forgets all frames; the next one starts from the seeded phases.
    pub fn reset(&mut self) {
        for (k, t) in self.turns.iter_mut().enumerate() {
            *t = uniform_at(self.seed, k as u64);
        }
        self.freq.fill(-1.0);
        self.started = false;
    }

    /// Saves or restores phase and frequency of every bin, for one transform length.
    pub fn state(&mut self, state: &mut State<'_>) {
        let mut fft_len = self.fft_len;
        state.keep(&mut fft_len).keep(&mut self.turns).keep(&mut self.freq).keep(&mut self.started);
        let phases = self.turns.iter().all(|t| (0.0..1.0).contains(t));
        state.require(fft_len == self.fft_len && phases && self.freq.iter().all(|f| f.is_finite()));
    }

    /// Computes phases for one frame, counted from its first sample. `out[k]` gets `magnitudes[k]` in the
    /// same unit. `advance` is the number of samples since the start of the last frame; the first frame
    /// after a reset ignores it. Returns the number of magnitudes that are NaN, infinite or negative; they
    /// count as 0, as missing ones do.
    pub fn process<P: Float>(&mut self, magnitudes: &[P], advance: u32, out: &mut [Complex<P>]) -> usize {
        let bad = take(magnitudes, largest_of::<P, T>(), &mut self.mags);
        peak::find(&self.mags, self.last_is_nyquist, &mut self.peaks);
        self.run_on(if self.started { advance } else { 0 });
        self.started = true;
        out.fill(Complex::default());
        self.lock(out);
        bad
    }

    /// Computes each peak's phase from that of its bin `advance` samples ago.
    fn run_on(&mut self, advance: u32) {
        let hop = f64::from(advance) / self.fft_len as f64;
        for p in &mut self.peaks {
            let (Some(&turns), Some(&before)) = (self.turns.get(p.bin), self.freq.get(p.bin)) else {
                continue;
            };
            let freq = p.freq();
            // A chirp moves at most half a bin in a hop; a larger change is another sinusoid.
            let mean =
                if before >= 0.0 && (before - freq).abs() < 0.5 { 0.5 * (before + freq) } else { freq };
            let t = turns + mean * hop;
            p.turns = t - t.floor();
            if p.real {
                p.turns = if (p.turns - 0.5).abs() <= 0.25 { 0.5 } else { 0.0 };
            }
            p.unit = phasor(p.turns);
        }
    }

    /// Spreads each peak's phase over its region.
    fn lock<P: Float>(&mut self, out: &mut [Complex<P>]) {
        let mut first = 0;
        let mut left: Option<&Peak<T>> = None;
        for (i, p) in self.peaks.iter().enumerate() {
            let right = self.peaks.get(i + 1);
            let end = p.end.min(self.mags.len());
            let freq = p.freq();
            for k in first..end {
                let (Some(&mag), Some(out)) = (self.mags.get(k), out.get_mut(k)) else { break };
                if mag <= T::zero() {
                    // A silent bin keeps its own phase, so that the next sound is not one click of
                    // equal phases.
                    self.freq[k] = -1.0;
                    continue;
                }
                let other = if k < p.bin { left } else { right };
                let unit = if k == p.bin { p.unit } else { p.phase_at(k, mag, other) };
                // From the window's centre to its first sample: half a turn a bin.
                let value = if k % 2 == 0 { mag } else { -mag };
                *out = Complex::new((unit.re * value).to(), (unit.im * value).to());
                self.turns[k] = p.turns;
                self.freq[k] = freq;
            }
            first = end;
            left = Some(p);
        }
        if self.peaks.is_empty() {
            self.freq.fill(-1.0);
        }
    }
}

#[cfg(test)]
mod tests;
