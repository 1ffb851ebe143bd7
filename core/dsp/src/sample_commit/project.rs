//! One frame's projection: the nearest frame that has the wanted magnitudes.

use crate::window::hann;
use crate::{Complex, Float, Framing, float::unit_circle};
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};
use std::sync::Arc;

/// How much of a magnitude, relative, has the start phase: it decides only where the signal so far says nothing.
const HINT: f64 = 1e-6;

/// Transforms of one length, their window and buffers.
pub(super) struct Projector<T> {
    forward: Arc<dyn RealToComplex<T>>,
    inverse: Arc<dyn ComplexToReal<T>>,
    window: Vec<T>,
    square: Vec<T>,
    frame: Vec<T>,
    spectrum: Vec<Complex<T>>,
    forward_scratch: Vec<Complex<T>>,
    inverse_scratch: Vec<Complex<T>>,
    /// A phase for each bin, times [`HINT`] and the transform's length.
    hint: Vec<Complex<T>>,
}

impl<T: Float> Projector<T> {
    pub(super) fn new(framing: &Framing, seed: u64) -> Self {
        let n = framing.fft_len;
        let mut planner = RealFftPlanner::<T>::new();
        let (forward, inverse) = (planner.plan_fft_forward(n), planner.plan_fft_inverse(n));
        let window = hann::<f64>(n);
        Self {
            frame: forward.make_input_vec(),
            spectrum: forward.make_output_vec(),
            forward_scratch: forward.make_scratch_vec(),
            inverse_scratch: inverse.make_scratch_vec(),
            square: window.iter().map(|w| T::of(w * w)).collect(),
            window: window.into_iter().map(T::of).collect(),
            hint: hint(framing, seed),
            forward,
            inverse,
        }
    }

    /// The window times itself.
    pub(super) fn square(&self) -> &[T] {
        &self.square
    }

    /// Windows the samples, gives each bin the magnitude that is wanted and keeps its phase. `magnitudes` are a quarter of the
    /// amplitudes that a frame has: the inverse transform, which does not divide, then gives the windowed signal.
    pub(super) fn project(&mut self, samples: &[T], magnitudes: &[T]) {
        for ((to, &x), &w) in self.frame.iter_mut().zip(samples).zip(&self.window) {
            *to = x * w;
        }
        // Lengths are the plans' own and the two real bins are real, so there is nothing they can refuse.
        let done =
            self.forward.process_with_scratch(&mut self.frame, &mut self.spectrum, &mut self.forward_scratch);
        debug_assert!(done.is_ok());
        impose(&mut self.spectrum, magnitudes, &self.hint);
        let done =
            self.inverse.process_with_scratch(&mut self.spectrum, &mut self.frame, &mut self.inverse_scratch);
        debug_assert!(done.is_ok());
    }

    /// Adds the window times the projected frame, but for its first `skip` samples.
    pub(super) fn add_to(&self, sum: &mut [T], skip: usize) {
        for ((to, &y), &w) in sum.iter_mut().zip(&self.frame[skip..]).zip(&self.window[skip..]) {
            *to += y * w;
        }
    }
}

/// Gives each bin its magnitude; bins without one become 0.
fn impose<T: Float>(spectrum: &mut [Complex<T>], magnitudes: &[T], hint: &[Complex<T>]) {
    // Below any square that counts, and keeps 0 / 0 from being NaN.
    let tiny = T::of(1e-36);
    let bins = magnitudes.len().min(spectrum.len());
    let (carried, above) = spectrum.split_at_mut(bins);
    for ((x, &m), &h) in carried.iter_mut().zip(magnitudes).zip(hint) {
        let (re, im) = (x.re + h.re * m, x.im + h.im * m);
        let factor = m / (re * re + im * im + tiny).root();
        *x = Complex::new(re * factor, im * factor);
    }
    above.fill(Complex::default());
}

/// Start phases whose group delay sweeps the middle half of the window (M. R. Schroeder, "Synthesis of low-peak-factor
/// signals and binary sequences with low autocorrelation", IEEE Trans. Inf. Theory 16(1), 1970): neighbours agree, as the
/// bins of one sinusoid do, and a flat spectrum is no click.
fn hint<T: Float>(framing: &Framing, seed: u64) -> Vec<Complex<T>> {
    let (n, bins) = (framing.fft_len, framing.bins);
    let mut turns = crate::random::uniform(seed, 0, 0);
    let all = (0..bins).map(|k| {
        turns -= 0.25 + 0.5 * k as f64 / bins as f64;
        turns -= turns.floor();
        let (cos, sin) = if k == 0 || 2 * k == n {
            (if turns < 0.5 { 1.0 } else { -1.0 }, 0.0)
        } else {
            unit_circle(turns)
        };
        let scale = HINT * n as f64;
        Complex::new(T::of(cos * scale), T::of(sin * scale))
    });
    all.collect()
}
