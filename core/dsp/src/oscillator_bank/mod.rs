//! Oscillators whose amplitudes follow the magnitudes: straight from frames to samples, without a window.
//!
//! Between two frames every amplitude changes linearly. So a change of magnitude is heard within one
//! hop, where overlap-add needs half a window. Phases are always continuous: a partial that ends fades
//! out over a hop, a new one fades in, and a missing frame fades all out. (The smearing of the analysis
//! window in time remains.)
//!
//! Frame `n` arrives when its first sample is due. Its amplitudes are approached from that sample on and
//! reached a hop later; they describe the window's centre. So the output is `N/2` samples less one hop
//! early.
//!
//! [`Partials::Tracked`]: every maximum of a frame is a sinusoid (R. J. McAulay, T. F. Quatieri, "Speech
//! Analysis/Synthesis Based on a Sinusoidal Representation", IEEE Trans. ASSP 34(4), 1986). Its frequency
//! follows from the larger neighbour, its amplitude from the energy of three bins, which keeps the level of
//! a chirp. Peaks of successive frames that are each other's nearest, less than a bin apart, are one
//! partial. A new one starts with the phase of its bin, as if the last partial near it had continued at the
//! bin's centre frequency.
//!
//! [`Partials::Noise`]: one oscillator a bin, near the bin's centre frequency. Each is seen in three bins,
//! so amplitudes are scaled by `sqrt(2/3)`. Their phases are those of [`crate::phase_vocoder`], where
//! magnitudes beat least, plus a slow random walk. Every fourth bin draws an independent uniform phase of up
//! to two turns every 2.5 windows (4 Hz for 0.1 s); phases between are interpolated in time and frequency.
//! So neighbours keep their phase relations over a window, while over longer times nothing repeats. All of
//! it is a function of seed and sample number.
//!
//! Smooth magnitudes that belong to no signal have few maxima: there `Tracked` is too quiet and tonal, and
//! `Noise` is right. Figures are in `docs/explanation/accuracy.md`.

mod noise;
mod segment;
mod tracked;

use crate::float::keep_wide;
use crate::magnitude::take;
use crate::spsi::peak::Peak;
use crate::{Float, Framing, Refused};
use asperity_state::State;
use noise::Noise;
use segment::{Renderer, Voice};
use tracked::Tracker;

/// Meaning of an oscillator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Partials {
    /// A peak of the magnitudes, followed from frame to frame.
    Tracked,
    /// A bin, as narrow-band noise.
    Noise,
}

#[derive(Debug)]
enum Source {
    Tracked(Box<Tracker>),
    Noise(Box<Noise>),
}

/// Turns a stream of magnitude frames into samples, a hop at a time, when the first of the hop is asked for.
#[derive(Debug)]
pub struct OscillatorBank<T> {
    framing: Framing,
    source: Source,
    renderer: Renderer<T>,
    voices: Vec<Voice>,
    peaks: Vec<Peak<T>>,
    /// Samples from one frame to the next, made when the first is due.
    segment: Vec<T>,
    /// Number of due samples in the segment, and of those emitted.
    len: usize,
    used: usize,
    /// First sample that is not emitted yet.
    next: u64,
    /// Number and first sample of the next frame.
    pending: Option<(u64, u64)>,
    target: Vec<T>,
    /// Whether the segment sounds.
    loud: bool,
    /// Whether a voice sounds at its end.
    sounding: bool,
}

impl<T: Float> OscillatorBank<T> {
    /// Makes the bank for a layout. `seed` determines start phases and noise.
    pub fn new(framing: Framing, partials: Partials, seed: u64) -> Result<Self, Refused> {
        framing.check()?;
        let bins = framing.bins;
        let (period, frames) = framing.period();
        // A ramp is up to two hops long.
        let most = usize::try_from(2 * (period / frames + 1)).unwrap_or(usize::MAX);
        let source = match partials {
            Partials::Tracked => Source::Tracked(Box::new(Tracker::new(framing.fft_len, bins, seed))),
            Partials::Noise => Source::Noise(Box::new(Noise::new(framing.fft_len, bins, seed))),
        };
        // Tracked: a peak every other bin at most, and as many of the last frame may fade out.
        let voices = bins + 2;
        Ok(Self {
            framing,
            source,
            renderer: Renderer::new(framing.fft_len),
            voices: Vec::with_capacity(voices),
            peaks: Vec::with_capacity(bins / 2 + 1),
            segment: vec![T::zero(); most],
            len: 0,
            used: 0,
            next: 0,
            pending: None,
            target: vec![T::zero(); bins],
            loud: false,
            sounding: false,
        })
    }

    /// Layout of the frames.
    pub fn framing(&self) -> Framing {
        self.framing
    }

    /// First sample that is not emitted yet.
    pub fn position(&self) -> u64 {
        self.next
    }

    /// Forgets all frames; the next sample to be emitted is `start`. The output then depends only on
    /// seed, frames and sample numbers.
    pub fn reset(&mut self, start: u64) {
        (self.len, self.used, self.next) = (0, 0, start);
        (self.pending, self.loud, self.sounding) = (None, false, false);
        match &mut self.source {
            Source::Tracked(tracker) => tracker.reset(),
            Source::Noise(noise) => noise.reset(),
        }
    }

    /// Takes frame number `frame`, whose first sample is `start`: amplitudes `2 |sum w x| / sum w` from bin
    /// 0.
    ///
    /// It replaces a pending frame that has not started. A frame after its first sample is played late, and
    /// so are those that follow it without a gap. Magnitudes that are NaN, infinite or negative count as 0,
    /// as missing ones do; their number is returned.
    pub fn add_frame<P: Float>(&mut self, frame: u64, start: u64, magnitudes: &[P]) -> usize {
        if self.pending.is_some_and(|(_, due)| due <= self.next) && self.used == self.len {
            self.begin();
        }
        self.pending = Some((frame, start));
        take(magnitudes, self.most(), &mut self.target)
    }

    /// Largest allowed magnitude: the sum of all stays finite in single precision.
    fn most(&self) -> f64 {
        f64::from(f32::MAX) / (8 * (self.framing.bins + 1)) as f64
    }

    /// Saves or restores the samples up to the next frame, that frame, and every oscillator. A bank that
    /// refuses a state is reset.
    pub fn state(&mut self, state: &mut State<'_>) {
        let (mut fft_len, mut tracked) = (self.framing.fft_len, matches!(self.source, Source::Tracked(_)));
        let same = (fft_len, tracked);
        state.keep(&mut fft_len).keep(&mut tracked);
        state.require(same == (fft_len, tracked));
        keep_wide(&mut self.segment, state);
        state.keep(&mut self.len).keep(&mut self.used).keep(&mut self.next).keep(&mut self.pending);
        keep_wide(&mut self.target, state);
        state.keep(&mut self.loud).keep(&mut self.sounding);
        // A peak's amplitude is less than twice its magnitude.
        let (most, most_amp) = (T::of(self.most()), 2.0 * self.most());
        match &mut self.source {
            Source::Tracked(tracker) => tracker.state(state, most_amp),
            Source::Noise(noise) => noise.state(state, most_amp),
        }
        state.require(self.used <= self.len && self.len <= self.segment.len());
        state.require(self.segment.iter().all(|y| y.finite()));
        state.require(self.target.iter().all(|&m| m >= T::zero() && m <= most));
        if state.failed() && state.restores() {
            self.reset(0);
        }
    }

    /// Writes the samples `start .. start + out.len()`, in order; any other `start` forgets all frames but
    /// the pending one. Returns whether anything sounds in them or is still to come; else they are exactly
    /// 0.
    pub fn emit<P: Float>(&mut self, start: u64, out: &mut [P]) -> bool {
        if start != self.next {
            let pending = self.pending;
            self.reset(start);
            self.pending = pending;
        }
        let (mut out, mut sounded) = (out, false);
        while !out.is_empty() {
            let plays = self.used < self.len || self.begin();
            let count = match self.pending {
                _ if plays => self.len - self.used,
                Some((_, due)) => usize::try_from(due - self.next).unwrap_or(usize::MAX),
                None => usize::MAX,
            };
            let (now, later) = out.split_at_mut(count.min(out.len()));
            if plays {
                now.iter_mut().zip(&self.segment[self.used..]).for_each(|(to, from)| *to = from.to());
                self.used += now.len();
                sounded |= self.loud;
            } else {
                now.fill(P::zero());
            }
            self.next = self.next.saturating_add(now.len() as u64);
            out = later;
        }
        sounded || self.sounding || self.pending.is_some() || (self.used < self.len && self.loud)
    }

    /// Makes the samples up to the next frame; returns false during silence.
    fn begin(&mut self) -> bool {
        let from = self.next;
        let hop = |frame: u64| {
            self.framing.start(frame.saturating_add(1)).saturating_sub(self.framing.start(frame))
        };
        let end = match self.pending {
            // During silence a frame waits for its time. A sounding bank moves to it at once if it is
            // due within a hop.
            Some((frame, start)) if start <= from || (self.sounding && start - from < hop(frame)) => {
                self.pending = None;
                // A ramp is a hop long. So a late frame, and those that follow in step, stay late.
                let due = start.max(from).saturating_add(hop(frame));
                due.min(from.saturating_add(self.segment.len() as u64))
            }
            _ if self.sounding => {
                self.target.fill(T::zero());
                let (period, frames) = self.framing.period();
                from.saturating_add(period / frames)
            }
            _ => return false,
        };
        self.len =
            usize::try_from(end.saturating_sub(from)).unwrap_or(usize::MAX).clamp(1, self.segment.len());
        self.used = 0;
        self.voices.clear();
        match &mut self.source {
            Source::Tracked(tracker) => {
                tracker.run_on(&self.target, &mut self.peaks, from, self.len, &mut self.voices);
            }
            Source::Noise(noise) => noise.run_on(&self.target, from, self.len, &mut self.voices),
        }
        self.loud = !self.voices.is_empty();
        self.sounding = self.voices.iter().any(|v| v.amps.1 > 0.0);
        let segment = &mut self.segment[..self.len];
        segment.fill(T::zero());
        self.renderer.add(&self.voices, segment);
        true
    }
}

#[cfg(test)]
mod tests;
