//! Rendering of many oscillators from one frame to the next.

use crate::Float;
use asperity_numbers::unit_circle;

/// Oscillators computed in parallel.
const LANES: usize = 8;

/// Samples made by recurrence before phases are recomputed.
const BLOCK: usize = 128;

/// An oscillator over a segment. Amplitude and frequency change linearly, from the first value at the
/// first sample to the second at the sample after the last.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Voice {
    /// Phase of the cosine at the first sample, in turns.
    pub(super) turns: f64,
    /// Frequencies in bins.
    pub(super) freqs: (f64, f64),
    /// Amplitudes of the cosine.
    pub(super) amps: (f64, f64),
}

impl Voice {
    /// Phase at the end of a segment of `len` samples, in [0, 1) turns.
    pub(super) fn end_turns(&self, len: usize, fft_len: usize) -> f64 {
        let t = self.turns + 0.5 * (self.freqs.0 + self.freqs.1) * len as f64 / fft_len as f64;
        t - t.floor()
    }
}

/// State of some oscillators: phasor, its rotation per sample, the rotation's own rotation, amplitude
/// and its slope.
#[derive(Clone, Copy, Debug)]
struct Group<T> {
    re: [T; LANES],
    im: [T; LANES],
    turn_re: [T; LANES],
    turn_im: [T; LANES],
    bend_re: [T; LANES],
    bend_im: [T; LANES],
    amp: [T; LANES],
    slope: [T; LANES],
}

impl<T: Float> Group<T> {
    fn silent() -> Self {
        let (re, im) = ([T::one(); LANES], [T::zero(); LANES]);
        let (turn_re, turn_im, bend_re, bend_im, amp, slope) = (re, im, re, im, im, im);
        Self { re, im, turn_re, turn_im, bend_re, bend_im, amp, slope }
    }

    /// Puts a voice into a lane, in the state `from` samples into a segment of `len`.
    #[inline]
    fn set(&mut self, lane: usize, v: &Voice, from: usize, len: usize, fft_len: usize) {
        let (t, len, n) = (from as f64, len as f64, fft_len as f64);
        let bend = (v.freqs.1 - v.freqs.0) / len;
        let phase = v.turns + (v.freqs.0 + 0.5 * bend * t) * t / n;
        let (re, im) = unit_circle(phase);
        // From this sample to the next.
        let (turn_re, turn_im) = unit_circle((v.freqs.0 + bend * (t + 0.5)) / n);
        let (bend_re, bend_im) = if bend == 0.0 { (1.0, 0.0) } else { unit_circle(bend / n) };
        let slope = (v.amps.1 - v.amps.0) / len;
        self.re[lane] = T::of(re);
        self.im[lane] = T::of(im);
        self.turn_re[lane] = T::of(turn_re);
        self.turn_im[lane] = T::of(turn_im);
        self.bend_re[lane] = T::of(bend_re);
        self.bend_im[lane] = T::of(bend_im);
        self.amp[lane] = T::of(v.amps.0 + slope * t);
        self.slope[lane] = T::of(slope);
    }

    #[inline]
    #[expect(clippy::needless_range_loop, reason = "one index over many lanes becomes one instruction")]
    /// Adds each lane's samples to `sums`.
    fn run<const BEND: bool>(mut self, sums: &mut [[T; LANES]]) {
        for sum in sums {
            for l in 0..LANES {
                sum[l] += self.amp[l] * self.re[l];
                self.amp[l] += self.slope[l];
                let re = self.re[l] * self.turn_re[l] - self.im[l] * self.turn_im[l];
                self.im[l] = self.re[l] * self.turn_im[l] + self.im[l] * self.turn_re[l];
                self.re[l] = re;
            }
            if BEND {
                for l in 0..LANES {
                    let re = self.turn_re[l] * self.bend_re[l] - self.turn_im[l] * self.bend_im[l];
                    self.turn_im[l] = self.turn_re[l] * self.bend_im[l] + self.turn_im[l] * self.bend_re[l];
                    self.turn_re[l] = re;
                }
            }
        }
    }
}

/// Renders voices.
#[derive(Debug)]
pub(super) struct Renderer<T> {
    fft_len: usize,
    sums: Vec<[T; LANES]>,
}

impl<T: Float> Renderer<T> {
    /// Frequencies are in bins of a transform of `fft_len` samples.
    pub(super) fn new(fft_len: usize) -> Self {
        Self { fft_len, sums: vec![[T::zero(); LANES]; BLOCK] }
    }

    /// Adds all voices to a segment of `out.len()` samples. Phases are computed in double precision every
    /// [`BLOCK`] samples. In between they are rotated in `T`, with an error below 3e-5 of the amplitude.
    pub(super) fn add(&mut self, voices: &[Voice], out: &mut [T]) {
        let len = out.len();
        for (i, block) in out.chunks_mut(BLOCK).enumerate() {
            let sums = &mut self.sums[..block.len()];
            sums.fill([T::zero(); LANES]);
            for some in voices.chunks(LANES) {
                let mut group = Group::silent();
                for (lane, voice) in some.iter().enumerate() {
                    group.set(lane, voice, i * BLOCK, len, self.fft_len);
                }
                if some.iter().all(|v| v.freqs.0 == v.freqs.1) {
                    group.run::<false>(sums);
                } else {
                    group.run::<true>(sums);
                }
            }
            for (y, lanes) in block.iter_mut().zip(sums) {
                *y += lanes.iter().fold(T::zero(), |a, &b| a + b);
            }
        }
    }
}
