//! Projection of one frame: the nearest frame with the wanted magnitudes.

use super::batch::Batch;
use crate::plans::Transform;
use crate::window::hann;
use crate::{Complex, Float, Framing, float::unit_circle};

/// Relative size of the start phase in a bin. It matters only where the signal so far is silent.
const HINT: f64 = 1e-6;

/// Below any square that counts; avoids 0 / 0.
pub(super) const TINY: f64 = 1e-36;

/// Fewer frames than this are transformed one by one, which takes half the time of a batch.
const FEW: usize = 2;

/// Frames to project, and the sum to which they are added.
pub(super) struct Call<'a, T> {
    /// The signal so far.
    pub z: &'a [T],
    /// Frames by their position in `z`, with the wanted magnitudes; at most as many as there are lanes.
    pub frames: &'a [(usize, &'a [T])],
    /// First sample that is changed.
    pub from: usize,
    /// Sum of the projected frames, each windowed; as long as `z`.
    pub sum: &'a mut [T],
    /// Factor of all bins but the real ones.
    pub turn: Complex<T>,
}

/// Transforms of one length, with window and buffers.
#[derive(Debug)]
pub(super) struct Projector<T> {
    transform: Transform<T>,
    window: Vec<T>,
    square: Vec<T>,
    /// Start phase of each bin, times [`HINT`] and the transform's length.
    hint: Vec<Complex<T>>,
    /// Transform of many frames at once, where that is faster.
    batch: Option<Batch<T>>,
}

impl<T: Float> Projector<T> {
    pub(super) fn new(framing: &Framing, seed: u64) -> Self {
        let n = framing.fft_len;
        let window = hann::<f64>(n);
        let hint = hint(framing, seed);
        let plain: Vec<T> = window.iter().map(|&w| T::of(w)).collect();
        Self {
            batch: Batch::new(&plain, framing.bins, &hint),
            transform: Transform::new(n),
            square: window.iter().map(|w| T::of(w * w)).collect(),
            window: plain,
            hint,
        }
    }

    pub(super) fn square(&self) -> &[T] {
        &self.square
    }

    /// Gives each bin of each frame its wanted magnitude, keeps its phase, and adds the samples to the sum.
    pub(super) fn project(&mut self, call: Call<'_, T>) {
        if let Some(batch) = self.batch.as_mut().filter(|_| call.frames.len() >= FEW) {
            return batch.project(call);
        }
        let n = self.window.len();
        for (at, mags) in call.frames {
            let skip = call.from.saturating_sub(*at);
            self.project_one(&call.z[*at..at + n], mags, call.turn);
            let part = self.transform.time[skip..].iter().zip(&self.window[skip..]);
            call.sum[at + skip..at + n].iter_mut().zip(part).for_each(|(to, (&y, &w))| *to += y * w);
        }
    }

    /// Projects one frame. `magnitudes` are a quarter of its amplitudes: the unscaled inverse transform then
    /// gives the windowed signal.
    fn project_one(&mut self, samples: &[T], magnitudes: &[T], turn: Complex<T>) {
        for ((to, &x), &w) in self.transform.time.iter_mut().zip(samples).zip(&self.window) {
            *to = x * w;
        }
        self.transform.forward();
        let Transform { time, bins, .. } = &mut self.transform;
        impose(bins, magnitudes, &self.hint);
        let complex = bins.len() - usize::from(time.len().is_multiple_of(2));
        bins[1.min(complex)..complex].iter_mut().for_each(|x| *x = *x * turn);
        self.transform.inverse();
    }
}

/// Gives each bin its magnitude; bins without one become 0.
fn impose<T: Float>(spectrum: &mut [Complex<T>], magnitudes: &[T], hint: &[Complex<T>]) {
    let tiny = T::of(TINY);
    let bins = magnitudes.len().min(spectrum.len());
    let (carried, above) = spectrum.split_at_mut(bins);
    for ((x, &m), &h) in carried.iter_mut().zip(magnitudes).zip(hint) {
        let (re, im) = (x.re + h.re * m, x.im + h.im * m);
        let factor = m / (re * re + im * im + tiny).root();
        *x = Complex::new(re * factor, im * factor);
    }
    above.fill(Complex::default());
}

/// Start phases whose group delay sweeps the middle half of the window (M. R. Schroeder, "Synthesis of
/// low-peak-factor signals and binary sequences with low autocorrelation", IEEE Trans. Inf. Theory 16(1),
/// 1970). Bin 0 is real. The sweep starts from its phase, a quarter of a turn behind, as in a struck
/// resonance: where the phases above disagree with its sign, the frozen samples keep them so for seconds.
fn hint<T: Float>(framing: &Framing, seed: u64) -> Vec<Complex<T>> {
    let (n, bins) = (framing.fft_len, framing.bins);
    let mut turns = if crate::random::uniform(seed, 0, 0) < 0.5 { 0.0 } else { 0.5 };
    let all = (0..bins).map(|k| {
        let (cos, sin) =
            if 2 * k == n { (if turns < 0.5 { 1.0 } else { -1.0 }, 0.0) } else { unit_circle(turns) };
        turns -= 0.25 + 0.5 * (k + 1) as f64 / bins as f64 + if k == 0 { 0.25 } else { 0.0 };
        turns -= turns.floor();
        let scale = HINT * n as f64;
        Complex::new(T::of(cos * scale), T::of(sin * scale))
    });
    all.collect()
}
