//! Phase gradient heap integration, frame by frame, without a graph.

use asperity_numbers::Elementary as _;
use std::collections::BinaryHeap;
use std::f64::consts::TAU;

use asperity_sdk::{Complex, State, random};

/// `gamma / length^2` of the Hann window: it is approximated by the Gaussian `exp(-pi t^2 / gamma)` (Z.
/// Prusa, P. Balazs, P. L. Sondergaard, "A Noniterative Method for Reconstruction of Phase From STFT
/// Magnitude", IEEE/ACM Trans. ASLP 25(5), 2017). Least squares on the window itself give 0.2583, on
/// windows of unit energy 0.2489.
pub const HANN_GAMMA: f64 = 0.25645;

/// Frames held: the next one, the one being processed, and two before it.
const FRAMES: usize = 4;

/// One frame of magnitudes.
#[derive(Clone, Debug)]
struct Content {
    mags: Vec<f32>,
    /// Natural logarithms of `mags`.
    logs: Vec<f32>,
    /// Largest of `mags`.
    top: f32,
    /// Samples since the start of the last frame.
    advance: u32,
    /// Frequency of each bin, in bins, once phases are known.
    freq: Vec<f32>,
}

impl Content {
    fn new(bins: usize) -> Self {
        let zero = vec![0.0; bins];
        Self { mags: zero.clone(), logs: zero.clone(), top: 0.0, advance: 0, freq: zero }
    }

    /// Copies magnitudes, with invalid ones as 0, and returns the number of invalid ones.
    fn take(&mut self, magnitudes: &[f32], advance: u32) -> usize {
        let mut bad = 0;
        let given = magnitudes.iter().copied().chain(std::iter::repeat(0.0));
        for (mag, from) in self.mags.iter_mut().zip(given) {
            let good = (0.0..=f32::MAX).contains(&from);
            *mag = if good { from } else { 0.0 };
            bad += usize::from(!good);
        }
        self.advance = advance;
        self.derive();
        bad
    }

    fn derive(&mut self) {
        self.top = self.mags.iter().copied().fold(0.0, f32::max);
        for (log, mag) in self.logs.iter_mut().zip(&self.mags) {
            *log = mag.log_e();
        }
    }
}

/// Phase retrieval by heap integration, for Hann-windowed frames of one length.
///
/// Frames are first [`push`](Self::push)ed, then phases are [found](Self::find) for the newest or the one
/// before it.
#[derive(Debug)]
pub struct HeapIntegration {
    length: u32,
    tolerance: f32,
    seed: u64,
    /// Newest first.
    frames: [Content; FRAMES],
    /// Number of valid `frames`.
    filled: usize,
    /// Phase at the window's centre in turns, in [0, 1), of the last processed frame.
    turns: Vec<f64>,
    /// Phase difference between neighbouring bins in turns, from the slope of the logarithm along time.
    delay: Vec<f32>,
    /// Bins without a phase yet.
    todo: Vec<bool>,
    heap: BinaryHeap<u64>,
}

/// Flag of a heap entry, above its magnitude: the largest entry is popped first.
const REACHED: u64 = 1 << 63;
/// The entry is a bin of the processed frame, not of the one before.
const PRESENT: u64 = 1 << 31;

fn entry(mag: f32, bin: usize) -> u64 {
    // Bits of positive floats have the order of the floats.
    u64::from(mag.to_bits()) << 32 | bin as u64
}

impl HeapIntegration {
    /// For frames of `bins` magnitudes, from bin 0, of a transform of `length` samples. Bins under
    /// `tolerance` times the largest get a random phase.
    pub fn new(length: u32, bins: usize, tolerance: f64, seed: u64) -> Self {
        Self {
            length: length.max(1),
            tolerance: tolerance as f32,
            seed,
            frames: std::array::from_fn(|_| Content::new(bins)),
            filled: 0,
            turns: vec![0.0; bins],
            delay: vec![0.0; bins],
            todo: vec![false; bins],
            heap: BinaryHeap::with_capacity(3 * bins),
        }
    }

    /// Forgets all frames.
    pub fn reset(&mut self) {
        self.filled = 0;
    }

    /// Saves or restores the frames and phases.
    pub fn state(&mut self, state: &mut State<'_>) {
        let mut length = self.length;
        state.keep(&mut length).keep(&mut self.filled).keep(&mut self.turns);
        let mut sane = length == self.length && self.filled <= FRAMES;
        sane &= self.turns.iter().all(|t| (0.0..1.0).contains(t));
        for frame in &mut self.frames {
            state.keep(&mut frame.mags).keep(&mut frame.advance).keep(&mut frame.freq);
            sane &= frame.mags.iter().all(|m| (0.0..=f32::MAX).contains(m));
            sane &= frame.freq.iter().all(|f| f.is_finite());
            if state.restores() {
                frame.derive();
            }
        }
        state.require(sane);
    }

    /// Takes the next frame, `advance` samples after the one before. A magnitude that is NaN, infinite
    /// or negative counts as 0; their number is returned. Missing bins count as 0.
    pub fn push(&mut self, magnitudes: &[f32], advance: u32) -> usize {
        if advance == 0 || advance >= self.length {
            // Frames without a common sample are independent.
            self.filled = 0;
        }
        self.frames.rotate_right(1);
        self.filled = (self.filled + 1).min(FRAMES);
        self.frames[0].take(magnitudes, advance)
    }

    /// Computes phases for the newest frame (`age` 0) or the one before it (1), in the order they came.
    ///
    /// `out[k]` gets the magnitude of bin `k` and a phase counted from the frame's first sample.
    /// `advance` is the number of output samples since the last processed frame; `index` numbers the
    /// random phases.
    pub fn find(&mut self, age: usize, advance: u32, index: u64, out: &mut [Complex<f32>]) {
        let age = age.min(1);
        self.slopes(age);
        self.integrate(age, advance, index);
        out.fill(Complex::default());
        for (k, (out, (&mag, turns))) in
            out.iter_mut().zip(self.frames[age].mags.iter().zip(&mut self.turns)).enumerate()
        {
            *turns -= turns.floor();
            // From the window's centre to its first sample: half a turn a bin.
            let value = if k % 2 == 0 { mag } else { -mag };
            let (sin, cos) = (*turns * TAU).sine_cosine();
            *out = Complex::new(value * cos as f32, value * sin as f32);
        }
    }

    /// Frequencies and delays of a frame from the logarithm of its magnitudes.
    fn slopes(&mut self, age: usize) {
        let around = &self.frames[age.saturating_sub(1)..(age + 3).min(self.filled)];
        let top = around.iter().map(|f| f.top).fold(0.0, f32::max);
        // Below this a slope is one of rounding errors or of silence.
        let floor = (top * self.tolerance).max(f32::MIN_POSITIVE).log_e();
        self.delays(age, floor);
        let Content { logs, freq, .. } = &mut self.frames[age];
        let last = logs.len().saturating_sub(1);
        let scale = (1.0 / (TAU * HANN_GAMMA)) as f32;
        let nyquist = self.length as usize / 2;
        for (k, freq) in freq.iter_mut().enumerate() {
            let at = |k: usize| logs[k].max(floor);
            let slope = match k {
                // A real signal's spectrum is even about 0 and about half the rate.
                0 => 0.0,
                _ if k == last && k == nyquist => 0.0,
                _ if k == last => at(k) - at(k - 1),
                _ => 0.5 * (at(k + 1) - at(k - 1)),
            };
            *freq = k as f32 + slope * scale;
        }
    }

    fn delays(&mut self, age: usize, floor: f32) {
        let [w_next, w_own, w_before, w_older] = self.weights(age);
        let scale = -(HANN_GAMMA / TAU * f64::from(self.length)) as f32;
        let frame = |i: usize| self.frames[i.min(FRAMES - 1)].logs.iter().map(|x| x.max(floor));
        let others = frame(age.saturating_sub(1)).zip(frame(age + 1)).zip(frame(age + 2));
        for ((delay, own), ((next, before), older)) in self.delay.iter_mut().zip(frame(age)).zip(others) {
            let slope = w_next * next + w_own * own + w_before * before + w_older * older;
            *delay = scale * slope;
        }
    }

    /// Weights of the next frame, the frame itself, and the two before in the derivative along time, per
    /// sample.
    fn weights(&self, age: usize) -> [f32; 4] {
        let own = self.frames[age].advance as f32;
        let has_before = self.filled > age + 1;
        if age > 0 {
            let next = self.frames[age - 1].advance.max(1) as f32;
            let w = if has_before { 1.0 / (next + own) } else { 1.0 / next };
            return if has_before { [w, 0.0, -w, 0.0] } else { [w, -w, 0.0, 0.0] };
        }
        if self.filled > age + 2 {
            // The parabola through three points, which need not be evenly spaced.
            let (h, g) = (own, self.frames[age + 1].advance as f32);
            return [0.0, (2.0 * h + g) / (h * (h + g)), -(h + g) / (h * g), h / (g * (h + g))];
        }
        if has_before { [0.0, 1.0 / own, -1.0 / own, 0.0] } else { [0.0; 4] }
    }

    /// Integrates phases from the frame before and within the frame, the strongest bins first.
    fn integrate(&mut self, age: usize, advance: u32, index: u64) {
        let (newer, older) = self.frames.split_at(age + 1);
        let (frame, before) = (&newer[age], &older[0]);
        let before_mags: &[f32] = if self.filled > age + 1 { &before.mags } else { &[] };
        let top = before_mags.iter().copied().fold(frame.top, f32::max);
        let least = top * self.tolerance;
        let mut entries = std::mem::take(&mut self.heap).into_vec();
        entries.clear();
        let mut left = 0;
        let first = index.wrapping_mul(frame.mags.len() as u64);
        for (k, (&mag, todo)) in frame.mags.iter().zip(&mut self.todo).enumerate() {
            *todo = mag > least;
            let was = before_mags.get(k).copied().unwrap_or(0.0);
            if *todo {
                left += 1;
                // A bin that no other reaches starts on its own.
                entries.push(entry(mag, k));
            }
            if *todo && was > least {
                entries.push(entry(was, k) | REACHED);
            } else {
                self.turns[k] = random::uniform(self.seed, first.wrapping_add(k as u64));
            }
        }
        self.heap = BinaryHeap::from(entries);
        let per_bin = 0.5 * f64::from(advance) / f64::from(self.length);
        while left > 0 {
            let Some(top) = self.heap.pop() else { break };
            let k = (top & (PRESENT - 1)) as usize;
            if top & PRESENT == 0 {
                if !std::mem::take(&mut self.todo[k]) {
                    continue;
                }
                left -= 1;
                if top & REACHED != 0 {
                    self.turns[k] += per_bin * f64::from(before.freq[k] + frame.freq[k]);
                }
                self.heap.push(entry(frame.mags[k], k) | REACHED | PRESENT);
                continue;
            }
            for (to, sign) in [(k.wrapping_sub(1), -0.5), (k + 1, 0.5)] {
                if self.todo.get(to).is_some_and(|&todo| todo) {
                    self.todo[to] = false;
                    left -= 1;
                    self.turns[to] = self.turns[k] + sign * f64::from(self.delay[k] + self.delay[to]);
                    self.heap.push(entry(frame.mags[to], to) | REACHED | PRESENT);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hann_gamma_is_that_of_the_nearest_gaussian() {
        let n = 1000;
        let time = |i: i32| f64::from(i) / f64::from(n) - 0.5;
        let error = |gamma: f64| -> f64 {
            let off = |t: f64| 0.5 + 0.5 * (TAU * t).cos() - (-std::f64::consts::PI * t * t / gamma).exp();
            (0..n).map(|i| off(time(i)).powi(2)).sum()
        };
        let steps = (0..1000).map(|i| 0.2 + 1e-4 * f64::from(i));
        let best = steps.min_by(|a, b| error(*a).total_cmp(&error(*b))).unwrap();
        assert!((best / HANN_GAMMA - 1.0).abs() < 0.01, "{best}");
    }
}
