//! Peaks, tracked from frame to frame.

use super::segment::Voice;
use crate::spsi::peak::{self, Peak};
use crate::window::hann_lobe;
use crate::{Float, random};
use asperity_state::{Keep, State};

/// Most bins that a partial moves in a hop; a farther peak is another partial.
const REACH: f64 = 1.0;

/// A sinusoid at the end of a segment.
#[derive(Clone, Copy, Debug, Default)]
struct Partial {
    /// Frequency in bins.
    freq: f64,
    amp: f64,
    turns: f64,
}

impl Keep for Partial {
    fn keep(&mut self, state: &mut State<'_>) {
        state.keep(&mut self.freq).keep(&mut self.amp).keep(&mut self.turns);
    }
}

/// A bank of one oscillator a peak.
#[derive(Debug)]
pub(super) struct Tracker {
    fft_len: usize,
    seed: u64,
    last_is_nyquist: bool,
    /// Sorted by frequency.
    partials: Vec<Partial>,
    found: Vec<Partial>,
    /// Each bin's phase less that of its centre frequency, in turns: the start phase of a new partial there.
    turns: Vec<f64>,
}

impl Tracker {
    pub(super) fn new(fft_len: usize, bins: usize, seed: u64) -> Self {
        let most = bins / 2 + 1;
        let mut new = Self {
            fft_len,
            seed,
            last_is_nyquist: fft_len.is_multiple_of(2) && bins == fft_len / 2 + 1,
            partials: Vec::with_capacity(most),
            found: Vec::with_capacity(most),
            turns: vec![0.0; bins],
        };
        new.reset();
        new
    }

    pub(super) fn reset(&mut self) {
        self.partials.clear();
        for (k, t) in self.turns.iter_mut().enumerate() {
            *t = random::uniform(self.seed, 0, k as u64);
        }
    }

    /// Saves or restores every partial and the start phases.
    pub(super) fn state(&mut self, state: &mut State<'_>, most: f64) {
        state.keep_list(&mut self.partials).keep(&mut self.turns);
        let bins = self.turns.len() as f64;
        let fits = |p: &Partial| {
            (0.0..bins).contains(&p.freq) && (0.0..=most).contains(&p.amp) && (0.0..=1.0).contains(&p.turns)
        };
        state.require(self.partials.iter().all(fits) && self.turns.iter().all(|t| t.abs() <= 1.0));
    }

    /// Phase of a bin's centre frequency at a sample, in [0, 1) turns.
    fn clock(&self, bin: usize, sample: u64) -> f64 {
        let n = self.fft_len as u64;
        // bin < 2^20 and the remainder < N <= 2^20, so the product is exact.
        (bin as u64 * (sample % n) % n) as f64 / n as f64
    }

    /// Adds the voices from sample `from` on, for `len` samples, until `target` is reached. `peaks` is
    /// scratch.
    pub(super) fn run_on<T: Float>(
        &mut self,
        target: &[T],
        peaks: &mut Vec<Peak<T>>,
        from: u64,
        len: usize,
        voices: &mut Vec<Voice>,
    ) {
        peak::find(target, self.last_is_nyquist, peaks);
        self.found.clear();
        for p in peaks.iter() {
            let offset = offset(target, p);
            let freq = p.bin as f64 + offset;
            self.found.push(Partial { freq, amp: amplitude(target, p, offset), turns: 0.0 });
        }
        self.go_on(peaks, from, len, voices);
        // A partial without a peak fades out.
        for p in self.partials.iter().filter(|p| p.amp > 0.0) {
            voices.push(Voice { turns: p.turns, freqs: (p.freq, p.freq), amps: (p.amp, 0.0) });
        }
        self.remember(from.saturating_add(len as u64));
        std::mem::swap(&mut self.partials, &mut self.found);
    }

    /// Adds the voices of all peaks found. Partials that continue get amplitude 0; other peaks are new.
    fn go_on<T>(&mut self, peaks: &[Peak<T>], from: u64, len: usize, voices: &mut Vec<Voice>) {
        let (mut before, mut back) = (0, 0);
        for i in 0..self.found.len() {
            let freq = self.found[i].freq;
            nearest(&self.partials, freq, &mut before);
            let mut voice = None;
            if let Some(old) = self.partials.get_mut(before).filter(|p| (p.freq - freq).abs() < REACH) {
                nearest(&self.found, old.freq, &mut back);
                if back == i && old.amp > 0.0 {
                    let amps = (old.amp, self.found[i].amp);
                    voice = Some(Voice { turns: old.turns, freqs: (old.freq, freq), amps });
                    old.amp = 0.0;
                }
            }
            let voice = voice.unwrap_or_else(|| self.born(peaks.get(i), i, from));
            self.found[i].turns = voice.end_turns(len, self.fft_len);
            voices.push(voice);
        }
    }

    fn born<T>(&self, peak: Option<&Peak<T>>, i: usize, from: u64) -> Voice {
        let Partial { freq, amp, .. } = self.found[i];
        let (bin, real) = peak.map_or((0, true), |p| (p.bin, p.real));
        let turns = self.turns.get(bin).copied().unwrap_or_default() + self.clock(bin, from);
        // Only the sign of a constant is audible.
        let turns = if real { (2.0 * turns).round() / 2.0 } else { turns };
        Voice { turns, freqs: (freq, freq), amps: (0.0, amp) }
    }

    /// Stores each partial's phase in the bins of its main lobe.
    fn remember(&mut self, sample: u64) {
        for i in 0..self.found.len() {
            let p = self.found[i];
            // Offsets are within half a bin, so this is the peak's own bin.
            let bin = p.freq.round() as usize;
            for k in bin.saturating_sub(2)..(bin + 3).min(self.turns.len()) {
                self.turns[k] = p.turns - self.clock(k, sample);
            }
        }
    }
}

/// Moves `at` on to the partial nearest to `freq`; calls come in rising order of frequency.
fn nearest(partials: &[Partial], freq: f64, at: &mut usize) {
    while let Some(next) = partials.get(*at + 1) {
        if (next.freq - freq).abs() >= (partials[*at].freq - freq).abs() {
            break;
        }
        *at += 1;
    }
}

/// Distance from a peak's bin to the sinusoid in bins: the two-point interpolated DFT for the Hann window,
/// with the larger neighbour (T. Grandke, IEEE Trans. Instrum. Meas. 32(2), 1983).
fn offset<T: Float>(mags: &[T], peak: &Peak<T>) -> f64 {
    let at = |k: usize| mags.get(k).map(|m| m.f64());
    let sides = (peak.bin.checked_sub(1).and_then(at), at(peak.bin + 1), at(peak.bin));
    let (Some(left), Some(right), Some(here)) = sides else { return peak.offset };
    if peak.real || left == right {
        return 0.0;
    }
    let r = left.max(right) / here;
    // A neighbour below half of the peak is no lobe of this window.
    let d = ((2.0 * r - 1.0) / (1.0 + r)).clamp(0.0, 0.5);
    if right > left { d } else { -d }
}

/// Amplitude of a sinusoid `offset` bins from a peak's bin, with the energy of the bins around it.
fn amplitude<T: Float>(mags: &[T], peak: &Peak<T>, offset: f64) -> f64 {
    let at = |k: Option<usize>| k.and_then(|k| mags.get(k)).map(|m| m.f64());
    let here = at(Some(peak.bin)).unwrap_or_default();
    let (mut have, mut lobe) = (1.0, hann_lobe(offset).powi(2));
    for (side, v) in [(at(peak.bin.checked_sub(1)), 1.0), (at(Some(peak.bin + 1)), -1.0)] {
        if let Some(side) = side {
            // Relative to the peak, so that no square is out of range.
            have += (side / here).powi(2);
            lobe += hann_lobe(v + offset).powi(2);
        }
    }
    if peak.real {
        // Its own image lies on it: a constant of 1 reads 2, with 1 beside it.
        (have / 5.0).sqrt() * here
    } else {
        (have / lobe).sqrt() * here
    }
}
