//! Phase retrieval of whole signals by iteration: the reference for causal methods.
//!
//! A spectrogram with the wanted magnitudes and some phases is transformed into a signal and back, and its
//! phases are replaced by the result's (D. Griffin, J. Lim, "Signal Estimation from Modified Short-Time
//! Fourier Transform", IEEE Trans. ASSP 32(2), 1984). The signal is the weighted least-squares one, eq. 6
//! there, so the distance to the magnitudes never grows. The fast variant extrapolates each result by
//! `alpha` times the last step (N. Perraudin, P. Balazs, P. Sondergaard, "A Fast Griffin-Lim Algorithm",
//! WASPAA 2013): `t_n = P1 P2 c_(n-1)`, `c_n = t_n + alpha (t_n - t_(n-1))`, where `P2` imposes the
//! magnitudes and `P1` consistency. `alpha = 0` is the original. Figures are in
//! `docs/explanation/accuracy.md`.

use crate::float::phasor;
use crate::magnitude::take;
use crate::window::hann;
use crate::{Complex, Float, Framing, Refused, Stft, random};
use asperity_fft::Transform;

/// Phases before the first iteration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// Independent and uniform, a function of the seed.
    Random(u64),
    /// All 0 at the first sample of each frame.
    Zero,
}

/// Settings of the iteration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Passes over the whole signal.
    pub iterations: usize,
    /// Extrapolation of each step: 0 is Griffin-Lim, 0.99 fast Griffin-Lim. Values above 1 diverge.
    pub alpha: f64,
    /// Phases before the first iteration.
    pub start: Start,
}

impl Default for Options {
    /// 100 iterations of fast Griffin-Lim from random phases.
    fn default() -> Self {
        Self { iterations: 100, alpha: 0.99, start: Start::Random(1) }
    }
}

/// Signal for given magnitudes.
#[derive(Clone, Debug, PartialEq)]
pub struct Reconstruction<T> {
    /// Samples from the first of frame 0 to the last of the last frame.
    pub signal: Vec<T>,
    /// Number of magnitudes that were NaN, infinite or negative, and counted as 0.
    pub bad_magnitudes: usize,
}

/// Finds a signal whose frames have these magnitudes, as nearly as possible.
///
/// `magnitudes` holds frame after frame of `framing.bins` amplitudes, `2 |sum w x| / sum w` in the unit of
/// the signal; values missing in the last frame are 0. `progress` is called after each iteration with the
/// number done. Memory: two complex values a magnitude, and the signal. Time: two transforms a frame and
/// iteration.
pub fn griffin_lim<T: Float>(
    magnitudes: &[T],
    framing: Framing,
    options: Options,
    mut progress: impl FnMut(usize),
) -> Result<Reconstruction<T>, Refused> {
    framing.check()?;
    let frames = magnitudes.len().div_ceil(framing.bins);
    let mut mags = vec![T::zero(); frames * framing.bins];
    // The sum of these magnitudes must be finite.
    let most = T::MAX.f64() / (8.0 * (framing.bins + 1) as f64);
    let bad_magnitudes = take(magnitudes, most, &mut mags);
    let top = mags.iter().fold(T::zero(), |a, &b| if b > a { b } else { a });
    if top <= T::zero() {
        let signal = vec![T::zero(); length(&framing, frames)];
        return Ok(Reconstruction { signal, bad_magnitudes });
    }
    // With the largest at 1 no square overflows, in any unit.
    for m in &mut mags {
        *m = *m / top;
    }
    let mut plan = Plan::new(framing, mags);
    let mut bins = plan.start(options.start);
    let mut before: Vec<Complex<T>> = Vec::new();
    let alpha = T::of(options.alpha);
    for i in 0..options.iterations {
        plan.synthesise(&bins);
        plan.analyse(|at, found| {
            // The first step has no predecessor.
            let last = before.get(at).copied().unwrap_or(found);
            bins[at] = found + (found - last) * alpha;
            if let Some(last) = before.get_mut(at) {
                *last = found;
            } else {
                before.push(found);
            }
        });
        progress(i + 1);
    }
    plan.synthesise(&bins);
    let signal = plan.signal.into_iter().map(|y| y * top).collect();
    Ok(Reconstruction { signal, bad_magnitudes })
}

fn length(framing: &Framing, frames: usize) -> usize {
    let last = (frames as u64).checked_sub(1).map(|n| framing.start(n));
    last.map_or(0, |start| usize::try_from(start).unwrap_or(usize::MAX).saturating_add(framing.fft_len))
}

/// Transforms in both directions, with their buffers.
struct Plan<T> {
    framing: Framing,
    mags: Vec<T>,
    signal: Vec<T>,
    /// One over the sum of squared windows at each sample.
    gain: Vec<T>,
    /// The synthesis window, times the scale of the inverse transform and of the bins.
    window: Vec<T>,
    stft: Stft<T>,
    inverse: Transform<T>,
}

impl<T: Float> Plan<T> {
    fn new(framing: Framing, mags: Vec<T>) -> Self {
        let n = framing.fft_len;
        let frames = mags.len() / framing.bins;
        let len = length(&framing, frames);
        let window = hann::<f64>(n);
        let scale = framing.bin_scale() / n as f64;
        let mut sum = vec![0.0; len];
        for start in (0..frames).map(|i| framing.start(i as u64) as usize) {
            for (s, w) in sum[start..start + n].iter_mut().zip(&window) {
                *s += w * w;
            }
        }
        // At both ends, which few windows cover, the signal fades instead of amplifying rounding errors.
        let floor = 1e-3 * sum.iter().fold(0.0, |a: f64, &b| a.max(b));
        Self {
            signal: vec![T::zero(); len],
            gain: sum.into_iter().map(|s| T::of(1.0 / s.max(floor))).collect(),
            window: window.into_iter().map(|w| T::of(w * scale)).collect(),
            stft: Stft::new(n),
            inverse: Transform::new(n),
            framing,
            mags,
        }
    }

    /// First sample of each frame.
    fn starts(&self) -> impl Iterator<Item = usize> + use<T> {
        let framing = self.framing;
        (0..self.mags.len() / framing.bins).map(move |i| framing.start(i as u64) as usize)
    }

    fn start(&self, start: Start) -> Vec<Complex<T>> {
        let bins = self.framing.bins;
        let point = |at: usize| match start {
            Start::Zero => Complex::new(T::one(), T::zero()),
            Start::Random(seed) => phasor(random::uniform(seed, (at / bins) as u64, (at % bins) as u64)),
        };
        (0..self.mags.len()).map(point).collect()
    }

    /// Computes the signal nearest to the wanted magnitudes with the phases of `bins`.
    fn synthesise(&mut self, bins: &[Complex<T>]) {
        self.signal.fill(T::zero());
        let k = self.framing.bins;
        for ((start, bins), mags) in self.starts().zip(bins.chunks_exact(k)).zip(self.mags.chunks_exact(k)) {
            self.inverse.bins.fill(Complex::default());
            for ((to, &c), &m) in self.inverse.bins.iter_mut().zip(bins).zip(mags) {
                let square = c.re * c.re + c.im * c.im;
                // A bin of 0 gets phase 0.
                *to = if square > T::zero() { c * (m / square.root()) } else { Complex::new(m, T::zero()) };
            }
            self.inverse.inverse();
            let to = &mut self.signal[start..start + self.framing.fft_len];
            for ((to, &x), &w) in to.iter_mut().zip(&self.inverse.time).zip(&self.window) {
                *to += x * w;
            }
        }
        for (y, &g) in self.signal.iter_mut().zip(&self.gain) {
            *y *= g;
        }
    }

    /// Calls `f` with the signal's own bins, in order.
    fn analyse(&mut self, mut f: impl FnMut(usize, Complex<T>)) {
        let (n, bins) = (self.framing.fft_len, self.framing.bins);
        for (frame, start) in self.starts().enumerate() {
            let found = self.stft.process(&self.signal[start..start + n]).iter().take(bins);
            found.enumerate().for_each(|(k, found)| f(frame * bins + k, *found));
        }
    }
}

#[cfg(test)]
mod tests;
