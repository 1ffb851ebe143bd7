//! One oscillator a bin, with a phase that wanders.

use super::segment::Voice;
use crate::phase_vocoder::StartPhase;
use crate::{Float, random};
use asperity_state::State;

/// Bins between two random phases; between them phases are interpolated.
const SPACING: usize = 4;

/// Range of a random phase in turns.
const TURNS: f64 = 2.0;

/// A bank of one oscillator a bin.
#[derive(Debug)]
pub(super) struct Noise {
    fft_len: usize,
    seed: u64,
    /// Samples between two draws of a phase.
    interval: u64,
    /// Offset of each random phase in its interval at sample 0.
    offsets: Vec<u64>,
    /// Amplitudes reached so far.
    amps: Vec<f64>,
    /// Start phase of each bin in turns.
    start: Vec<f64>,
    /// Random phases at the two ends of a segment, in turns.
    ends: Vec<(f64, f64)>,
}

impl Noise {
    pub(super) fn new(fft_len: usize, bins: usize, seed: u64) -> Self {
        let interval = (fft_len as u64 * 5 / 2).max(1);
        let wandering = bins.div_ceil(SPACING) + 1;
        // Each draws at instants of its own.
        let offset = |i| random::uniform(seed, u64::MAX, i as u64) * interval as f64;
        Self {
            fft_len,
            seed,
            interval,
            offsets: (0..wandering).map(|i| offset(i) as u64).collect(),
            amps: vec![0.0; bins],
            start: (0..bins).map(|k| StartPhase::Quadratic.turns(k, bins, seed)).collect(),
            ends: vec![(0.0, 0.0); wandering],
        }
    }

    pub(super) fn reset(&mut self) {
        self.amps.fill(0.0);
    }

    /// Saves or restores amplitudes; the rest follows from seed and sample number.
    pub(super) fn state(&mut self, state: &mut State<'_>, most: f64) {
        state.keep(&mut self.amps);
        state.require(self.amps.iter().all(|a| (0.0..=most).contains(a)));
    }

    /// Random phase number `i` at a sample, in turns.
    fn wander(&self, i: usize, sample: u64) -> f64 {
        let at = sample.saturating_add(self.offsets[i]);
        let (cell, part) = (at / self.interval, (at % self.interval) as f64 / self.interval as f64);
        let draw = |cell| TURNS * random::uniform(self.seed, cell, i as u64);
        let (a, b) = (draw(cell), draw(cell + 1));
        a + (b - a) * part
    }

    /// Adds the voices from sample `from` on, for `len` samples, until `target` is reached.
    pub(super) fn run_on<T: Float>(&mut self, target: &[T], from: u64, len: usize, voices: &mut Vec<Voice>) {
        for i in 0..self.ends.len() {
            self.ends[i] = (self.wander(i, from), self.wander(i, from.saturating_add(len as u64)));
        }
        let n = self.fft_len as u64;
        let (n_real, len) = (n as f64, len as f64);
        let level = (2.0f64 / 3.0).sqrt();
        for (k, ((amp, &mag), &start)) in self.amps.iter_mut().zip(target).zip(&self.start).enumerate() {
            let amps = (*amp, level * mag.f64());
            *amp = amps.1;
            if amps == (0.0, 0.0) {
                continue;
            }
            let (i, part) = (k / SPACING, (k % SPACING) as f64 / SPACING as f64);
            let (a, b) = (self.ends[i], self.ends[i + 1]);
            let (first, last) = (a.0 + (b.0 - a.0) * part, a.1 + (b.1 - a.1) * part);
            // k < 2^19 and the rest of a division by N <= 2^20, so the product is exact.
            let turned = (k as u64 * (from % n) % n) as f64 / n_real;
            let freq = k as f64 + (last - first) * n_real / len;
            voices.push(Voice { turns: turned + start + first, freqs: (freq, freq), amps });
        }
    }
}
