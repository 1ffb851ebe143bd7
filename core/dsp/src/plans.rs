//! Transforms of real signals, planned once for each length and shared by all kernels of the process.
//!
//! Only rustfft's plain plans are used, because its vector plans round differently. 250 samples take
//! 0.7 us instead of 0.3 (2 cores of a virtual Intel Xeon), and every CPU gives the same bits. For
//! several frames at once the crate has a transform of its own that is fast and exact to the bit.

use crate::Complex;
use crate::float::unit_circle;
use realfft::num_traits::Zero;
use realfft::{ComplexToReal, FftError, FftNum, RealToComplex};
use rustfft::{Fft, FftPlannerScalar};
use std::collections::HashMap;
use std::sync::{Arc, LazyLock, Mutex, PoisonError};

/// Longest transform whose plan is kept. Longer plans have tables of megabytes and are dropped with
/// their kernel.
const KEPT: usize = 1 << 16;

/// Cache of complex plans and of the real plans made from them.
pub struct Planner<T: FftNum> {
    complex: FftPlannerScalar<T>,
    forward: HashMap<usize, Arc<dyn RealToComplex<T>>>,
    inverse: HashMap<usize, Arc<dyn ComplexToReal<T>>>,
}

impl<T: FftNum> Planner<T> {
    fn new() -> Self {
        Self { complex: FftPlannerScalar::new(), forward: HashMap::new(), inverse: HashMap::new() }
    }

    fn forward(&mut self, len: usize) -> Arc<dyn RealToComplex<T>> {
        let Self { complex, forward, .. } = self;
        let plan = || Arc::new(Forward(Real::new(len, |n| complex.plan_fft_forward(n)))) as _;
        Arc::clone(forward.entry(len).or_insert_with(plan))
    }

    fn inverse(&mut self, len: usize) -> Arc<dyn ComplexToReal<T>> {
        let Self { complex, inverse, .. } = self;
        let plan = || Arc::new(Inverse(Real::new(len, |n| complex.plan_fft_inverse(n)))) as _;
        Arc::clone(inverse.entry(len).or_insert_with(plan))
    }
}

/// Float type with a shared planner.
pub trait Plans: FftNum {
    /// Calls `f` with the shared planner. It takes a lock and plans: do not call it on the tick thread.
    fn with_planner<R>(f: impl FnOnce(&mut Planner<Self>) -> R) -> R;
}

macro_rules! plans {
    ($($t:ty),*) => {$(
        impl Plans for $t {
            fn with_planner<R>(f: impl FnOnce(&mut Planner<Self>) -> R) -> R {
                static SHARED: LazyLock<Mutex<Planner<$t>>> = LazyLock::new(|| Mutex::new(Planner::new()));
                // A thread that panicked leaves a planner that lacks a plan at most.
                f(&mut SHARED.lock().unwrap_or_else(PoisonError::into_inner))
            }
        }
    )*};
}

plans!(f32, f64);

/// Plans a transform from `len` samples to `len / 2 + 1` bins, unscaled.
pub fn forward<T: Plans>(len: usize) -> Arc<dyn RealToComplex<T>> {
    if len > KEPT { Planner::new().forward(len) } else { T::with_planner(|p| p.forward(len)) }
}

/// Plans a transform from `len / 2 + 1` bins to `len` samples, unscaled.
pub fn inverse<T: Plans>(len: usize) -> Arc<dyn ComplexToReal<T>> {
    if len > KEPT { Planner::new().inverse(len) } else { T::with_planner(|p| p.inverse(len)) }
}

/// Plans a transform of `len` complex numbers, unscaled. The plan is not kept.
pub fn complex<T: FftNum>(len: usize, forward: bool) -> Arc<dyn Fft<T>> {
    let mut planner = FftPlannerScalar::new();
    if forward { planner.plan_fft_forward(len) } else { planner.plan_fft_inverse(len) }
}

/// A real transform by a complex one. An even length uses half the length over pairs of samples, an odd
/// one the whole length.
struct Real<T> {
    len: usize,
    inner: Arc<dyn Fft<T>>,
    /// `e^(-2 pi i k / len)` for `k` up to a quarter of an even length.
    turns: Vec<Complex<T>>,
}

/// A scratch buffer in two.
type Halves<'a, T> = (&'a mut [Complex<T>], &'a mut [Complex<T>]);

/// With `Z` the transform of `x_2n + i x_2n+1` and `h = len / 2`: `X_k = E + e^(-2 pi i k / len) O`,
/// where `2 E = Z_k + conj Z_(h-k)` and `2 i O = Z_k - conj Z_(h-k)`. `X_(h-k)` is the conjugate of `E
/// - e^(-2 pi i k / len) O`.
struct Forward<T>(Real<T>);

/// The inverse, scaled by two: `Z_k = X_k + conj X_(h-k) + i e^(2 pi i k / len) (X_k - conj X_(h-k))`.
struct Inverse<T>(Real<T>);

impl<T: FftNum> Real<T> {
    fn new(len: usize, plan: impl FnOnce(usize) -> Arc<dyn Fft<T>>) -> Self {
        if !len.is_multiple_of(2) {
            return Self { len, inner: plan(len), turns: Vec::new() };
        }
        let turn = |k: usize| {
            let (cos, sin) = unit_circle(-(k as f64) / len as f64);
            // Every float has a value near any other's.
            let of = |x| T::from_f64(x).unwrap_or_else(T::zero);
            Complex::new(of(cos), of(sin))
        };
        Self { len, inner: plan(len / 2), turns: (0..=len / 4).map(turn).collect() }
    }

    fn is_even(&self) -> bool {
        self.len.is_multiple_of(2)
    }

    fn bins(&self) -> usize {
        self.len / 2 + 1
    }

    fn scratch(&self) -> usize {
        self.inner.len() + self.inner.get_inplace_scratch_len()
    }

    /// Splits the scratch into the buffer and the scratch of the inner transform.
    fn buffers<'a>(&self, scratch: &'a mut [Complex<T>]) -> Result<Halves<'a, T>, FftError> {
        let refused = FftError::ScratchBuffer(self.scratch(), scratch.len());
        scratch.get_mut(..self.scratch()).map(|s| s.split_at_mut(self.inner.len())).ok_or(refused)
    }
}

impl<T: FftNum> RealToComplex<T> for Forward<T> {
    fn process(&self, input: &mut [T], output: &mut [Complex<T>]) -> Result<(), FftError> {
        self.process_with_scratch(input, output, &mut self.make_scratch_vec())
    }

    fn process_with_scratch(
        &self,
        input: &mut [T],
        output: &mut [Complex<T>],
        scratch: &mut [Complex<T>],
    ) -> Result<(), FftError> {
        let it = &self.0;
        if input.len() != it.len {
            return Err(FftError::InputBuffer(it.len, input.len()));
        }
        if output.len() != it.bins() {
            return Err(FftError::OutputBuffer(it.bins(), output.len()));
        }
        let (z, rest) = it.buffers(scratch)?;
        if !it.is_even() {
            z.iter_mut().zip(input).for_each(|(z, x)| *z = Complex::new(*x, T::zero()));
            it.inner.process_with_scratch(z, rest);
            output.iter_mut().zip(z).for_each(|(y, z)| *y = *z);
            output[0].im = T::zero();
            return Ok(());
        }
        let last = output.len() - 1;
        if z.is_empty() {
            output.fill(Complex::zero());
            return Ok(());
        }
        z.iter_mut().zip(input.as_chunks::<2>().0).for_each(|(z, [a, b])| *z = Complex::new(*a, *b));
        it.inner.process_with_scratch(z, rest);
        let half = T::one() / (T::one() + T::one());
        // Bin 0 and half the rate are real.
        output[0] = Complex::new(z[0].re + z[0].im, T::zero());
        output[last] = Complex::new(z[0].re - z[0].im, T::zero());
        for (k, turn) in it.turns.iter().enumerate().skip(1) {
            let (a, b) = (z[k], z[last - k].conj());
            let (even, odd) = ((a + b) * half, (a - b) * half);
            // The odd part over i, turned.
            let odd = Complex::new(odd.im, -odd.re) * turn;
            output[k] = even + odd;
            output[last - k] = (even - odd).conj();
        }
        Ok(())
    }

    fn get_scratch_len(&self) -> usize {
        self.0.scratch()
    }

    fn len(&self) -> usize {
        self.0.len
    }

    fn make_input_vec(&self) -> Vec<T> {
        vec![T::zero(); self.0.len]
    }

    fn make_output_vec(&self) -> Vec<Complex<T>> {
        vec![Complex::zero(); self.0.bins()]
    }

    fn make_scratch_vec(&self) -> Vec<Complex<T>> {
        vec![Complex::zero(); self.0.scratch()]
    }
}

impl<T: FftNum> ComplexToReal<T> for Inverse<T> {
    fn process(&self, input: &mut [Complex<T>], output: &mut [T]) -> Result<(), FftError> {
        self.process_with_scratch(input, output, &mut self.make_scratch_vec())
    }

    /// An imaginary part in a real bin is ignored, and the result is an error.
    fn process_with_scratch(
        &self,
        input: &mut [Complex<T>],
        output: &mut [T],
        scratch: &mut [Complex<T>],
    ) -> Result<(), FftError> {
        let it = &self.0;
        if input.len() != it.bins() {
            return Err(FftError::InputBuffer(it.bins(), input.len()));
        }
        if output.len() != it.len {
            return Err(FftError::OutputBuffer(it.len, output.len()));
        }
        let (z, rest) = it.buffers(scratch)?;
        let last = input.len() - 1;
        let wrong = |x: Complex<T>| !x.im.is_zero();
        let bad = (wrong(input[0]), it.is_even() && wrong(input[last]));
        if it.is_even() {
            if let Some(z) = z.first_mut() {
                let (a, b) = (input[0].re, input[last].re);
                *z = Complex::new(a + b, a - b);
            }
            for (k, turn) in it.turns.iter().enumerate().skip(1) {
                let (a, b) = (input[k], input[last - k].conj());
                let (even, odd) = (a + b, (a - b) * turn.conj());
                let odd = Complex::new(-odd.im, odd.re);
                z[k] = even + odd;
                z[last - k] = (even - odd).conj();
            }
            it.inner.process_with_scratch(z, rest);
            output.as_chunks_mut::<2>().0.iter_mut().zip(z).for_each(|(x, z)| *x = [z.re, z.im]);
        } else {
            z[0] = Complex::new(input[0].re, T::zero());
            for (k, x) in input.iter().enumerate().skip(1) {
                z[k] = *x;
                z[it.len - k] = x.conj();
            }
            it.inner.process_with_scratch(z, rest);
            output.iter_mut().zip(z).for_each(|(x, z)| *x = z.re);
        }
        if bad == (false, false) { Ok(()) } else { Err(FftError::InputValues(bad.0, bad.1)) }
    }

    fn get_scratch_len(&self) -> usize {
        self.0.scratch()
    }

    fn len(&self) -> usize {
        self.0.len
    }

    fn make_input_vec(&self) -> Vec<Complex<T>> {
        vec![Complex::zero(); self.0.bins()]
    }

    fn make_output_vec(&self) -> Vec<T> {
        vec![T::zero(); self.0.len]
    }

    fn make_scratch_vec(&self) -> Vec<Complex<T>> {
        vec![Complex::zero(); self.0.scratch()]
    }
}

/// Real transforms of one length in both directions, with their buffers.
pub struct Transform<T> {
    forward: Arc<dyn RealToComplex<T>>,
    inverse: Arc<dyn ComplexToReal<T>>,
    /// `len` samples.
    pub time: Vec<T>,
    /// `len / 2 + 1` bins.
    pub bins: Vec<Complex<T>>,
    scratch: Vec<Complex<T>>,
}

impl<T> std::fmt::Debug for Transform<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Transform({})", self.time.len())
    }
}

impl<T: Plans> Transform<T> {
    /// Plans both directions and allocates the buffers.
    pub fn new(len: usize) -> Self {
        let (forward, inverse) = (forward::<T>(len), inverse::<T>(len));
        let scratch = forward.get_scratch_len().max(inverse.get_scratch_len());
        Self {
            time: forward.make_input_vec(),
            bins: forward.make_output_vec(),
            scratch: vec![Complex::zero(); scratch],
            forward,
            inverse,
        }
    }

    /// Computes `bins` from `time`, which may be overwritten. Unscaled.
    pub fn forward(&mut self) {
        // All buffers have the plan's lengths, so it returns no error.
        let done = self.forward.process_with_scratch(&mut self.time, &mut self.bins, &mut self.scratch);
        debug_assert!(done.is_ok());
    }

    /// Computes `time` from `bins`, which may be overwritten. Unscaled. A real signal has no imaginary
    /// part in bin 0 and at Nyquist's frequency; these are set to 0.
    pub fn inverse(&mut self) {
        if let Some(dc) = self.bins.first_mut() {
            dc.im = T::zero();
        }
        if self.time.len().is_multiple_of(2)
            && let Some(nyquist) = self.bins.last_mut()
        {
            nyquist.im = T::zero();
        }
        // All buffers have the plan's lengths and the two bins are real, so it returns no error.
        let done = self.inverse.process_with_scratch(&mut self.bins, &mut self.time, &mut self.scratch);
        debug_assert!(done.is_ok());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::uniform;

    #[test]
    fn plans_are_shared_and_long_ones_are_dropped() {
        let (a, b) = (forward::<f32>(250), forward::<f32>(250));
        assert!(Arc::ptr_eq(&a, &b));
        assert!(Arc::ptr_eq(&inverse::<f64>(250), &inverse::<f64>(250)));
        assert!(!Arc::ptr_eq(&a, &forward::<f32>(252)));
        let long = Arc::downgrade(&forward::<f32>(2 * KEPT));
        assert!(long.upgrade().is_none(), "it went with whoever used it");
    }

    #[test]
    fn plans_are_shared_by_many_threads() {
        let plans: Vec<_> = (0..8)
            .map(|_| std::thread::spawn(|| (1..200).map(forward::<f32>).fold(None, |_, plan| Some(plan))))
            .collect();
        let plans: Vec<_> = plans.into_iter().map(|p| p.join().unwrap().unwrap()).collect();
        assert!(plans.iter().all(|p| Arc::ptr_eq(p, &plans[0])));
    }

    #[test]
    fn real_transforms_match_realfft_at_any_length() {
        let mut planner = realfft::RealFftPlanner::<f64>::new();
        for len in (1..70).chain([100, 125, 250, 251, 800, 1000, 4096]) {
            let signal: Vec<f64> = (0..len).map(|i| uniform(1, 0, i as u64) - 0.5).collect();
            let spectrum = |plan: &dyn RealToComplex<f64>| {
                let mut out = plan.make_output_vec();
                plan.process(&mut signal.clone(), &mut out).unwrap();
                out
            };
            let (ours, theirs) = (spectrum(&*forward(len)), spectrum(&*planner.plan_fft_forward(len)));
            let off = ours.iter().zip(&theirs).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
            assert!(off < 1e-12, "{len}: {off}");
            let mut back = vec![0.0; len];
            inverse(len).process(&mut theirs.clone(), &mut back).unwrap();
            let off = back.iter().zip(&signal).map(|(a, b)| (a / len as f64 - b).abs()).fold(0.0, f64::max);
            assert!(off < 1e-14, "{len}: {off}");
        }
    }

    #[test]
    fn imaginary_part_of_a_real_bin_is_an_error() {
        let plan = inverse::<f64>(8);
        let mut bins = plan.make_input_vec();
        (bins[0], bins[4]) = (Complex::new(1.0, 5.0), Complex::new(1.0, 7.0));
        let mut out = plan.make_output_vec();
        assert!(matches!(plan.process(&mut bins, &mut out), Err(FftError::InputValues(true, true))));
        assert_eq!(out, [2.0, 0.0, 2.0, 0.0, 2.0, 0.0, 2.0, 0.0]);
        assert!(matches!(plan.process(&mut bins, &mut out[1..]), Err(FftError::OutputBuffer(8, 7))));
    }
}
