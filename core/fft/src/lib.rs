//! Transforms of real signals, planned once for each length and shared by all kernels of the process.
//!
//! rustfft's planner is generic: each crate that names it compiles every algorithm of it anew, for a
//! minute. It is compiled here alone, by [`Real`].
//!
//! Only rustfft's plain plans are used, because its vector plans round differently: 250 samples take 0.7 us
//! instead of 0.3, and every CPU gives the same bits.

use asperity_numbers::unit_circle;
pub use num_complex::Complex;
pub use rustfft::Fft;
use rustfft::num_traits::Zero;
use rustfft::{FftNum, FftPlannerScalar};
use std::any::{Any, TypeId};
use std::collections::HashMap;
use std::sync::{Arc, LazyLock, Mutex, PoisonError};

/// Longest transform whose plan is kept. Longer plans have tables of megabytes and are dropped with
/// their kernel.
const KEPT: usize = 1 << 16;

/// Plans of both directions for a real signal. An even length uses a complex transform of half the length
/// over pairs of samples.
pub struct Plan<T> {
    len: usize,
    forward: Arc<dyn Fft<T>>,
    inverse: Arc<dyn Fft<T>>,
    /// `e^(-2 pi i k / len)` for `k` up to a quarter of an even length.
    turns: Vec<Complex<T>>,
}

/// Plans of the process by type and length.
type Shared = HashMap<(TypeId, usize), Arc<dyn Any + Send + Sync>>;
static SHARED: LazyLock<Mutex<Shared>> = LazyLock::new(Mutex::default);

/// A plan of the process, under a lock: not for the tick thread.
fn plan<T: Real>(len: usize) -> Arc<Plan<T>> {
    let new = || Arc::new(Plan::new(len));
    if len > KEPT {
        return new();
    }
    // A thread that panicked leaves a table that lacks a plan at most.
    let mut shared = SHARED.lock().unwrap_or_else(PoisonError::into_inner);
    let plan = shared.entry((TypeId::of::<T>(), len)).or_insert_with(|| new());
    // The key tells the type.
    Arc::clone(plan).downcast().unwrap_or_else(|_| new())
}

/// The `len / 2 + 1` bins of `len` samples, unscaled.
pub fn spectrum<T: Real>(samples: Vec<T>) -> Vec<Complex<T>> {
    let mut transform = Transform::new(samples.len());
    transform.time = samples;
    transform.forward();
    transform.bins
}

/// The `len` samples of the first bins of a spectrum, unscaled. Missing bins are 0.
pub fn signal<T: Real>(bins: impl IntoIterator<Item = Complex<T>>, len: usize) -> Vec<T> {
    let mut transform = Transform::new(len);
    transform.bins.iter_mut().zip(bins).for_each(|(to, bin)| *to = bin);
    transform.inverse();
    transform.time
}

/// A number that transforms take: `f32` or `f64`.
pub trait Real: FftNum {
    /// Plans a transform of `len` complex numbers, unscaled. The plan is not kept.
    fn complex(len: usize, forward: bool) -> Arc<dyn Fft<Self>>;
}

macro_rules! real {
    ($($t:ty),*) => {$(
        impl Real for $t {
            // Inlined, it would be compiled in the crate that calls it.
            #[inline(never)]
            fn complex(len: usize, forward: bool) -> Arc<dyn Fft<Self>> {
                let mut planner = FftPlannerScalar::new();
                if forward { planner.plan_fft_forward(len) } else { planner.plan_fft_inverse(len) }
            }
        }
    )*};
}

real!(f32, f64);

impl<T: Real> Plan<T> {
    fn new(len: usize) -> Self {
        let even = len.is_multiple_of(2);
        let inner = if even { len / 2 } else { len };
        let turn = |k: usize| {
            let (cos, sin) = unit_circle(-(k as f64) / len as f64);
            // Every float has a value near any other's.
            let of = |x| T::from_f64(x).unwrap_or_else(T::zero);
            Complex::new(of(cos), of(sin))
        };
        Self {
            len,
            forward: T::complex(inner, true),
            inverse: T::complex(inner, false),
            turns: if even { (0..=len / 4).map(turn).collect() } else { Vec::new() },
        }
    }

    /// Length of a buffer for both directions.
    fn scratch(&self) -> usize {
        let rest = [&self.forward, &self.inverse].map(|inner| inner.get_inplace_scratch_len());
        self.forward.len() + rest[0].max(rest[1])
    }
    /// With `Z` the transform of `x_2n + i x_2n+1` and `h = len / 2`: `X_k = E + e^(-2 pi i k / len) O`,
    /// where `2 E = Z_k + conj Z_(h-k)` and `2 i O = Z_k - conj Z_(h-k)`. `X_(h-k)` is the conjugate of `E
    /// - e^(-2 pi i k / len) O`.
    fn forward(&self, time: &[T], bins: &mut [Complex<T>], scratch: &mut [Complex<T>]) {
        let (z, rest) = scratch.split_at_mut(self.forward.len());
        if !self.len.is_multiple_of(2) {
            z.iter_mut().zip(time).for_each(|(z, x)| *z = Complex::new(*x, T::zero()));
            self.forward.process_with_scratch(z, rest);
            bins.iter_mut().zip(z).for_each(|(y, z)| *y = *z);
            bins[0].im = T::zero();
            return;
        }
        let last = bins.len() - 1;
        if z.is_empty() {
            return bins.fill(Complex::zero());
        }
        z.iter_mut().zip(time.as_chunks::<2>().0).for_each(|(z, [a, b])| *z = Complex::new(*a, *b));
        self.forward.process_with_scratch(z, rest);
        let half = T::one() / (T::one() + T::one());
        // Bin 0 and half the rate are real.
        bins[0] = Complex::new(z[0].re + z[0].im, T::zero());
        bins[last] = Complex::new(z[0].re - z[0].im, T::zero());
        for (k, turn) in self.turns.iter().enumerate().skip(1) {
            let (a, b) = (z[k], z[last - k].conj());
            let (even, odd) = ((a + b) * half, (a - b) * half);
            // The odd part over i, turned.
            let odd = Complex::new(odd.im, -odd.re) * turn;
            bins[k] = even + odd;
            bins[last - k] = (even - odd).conj();
        }
    }

    /// The inverse, scaled by two: `Z_k = X_k + conj X_(h-k) + i e^(2 pi i k / len) (X_k - conj X_(h-k))`.
    fn inverse(&self, bins: &[Complex<T>], time: &mut [T], scratch: &mut [Complex<T>]) {
        let (z, rest) = scratch.split_at_mut(self.inverse.len());
        let last = bins.len() - 1;
        if self.len.is_multiple_of(2) {
            if let Some(z) = z.first_mut() {
                let (a, b) = (bins[0].re, bins[last].re);
                *z = Complex::new(a + b, a - b);
            }
            for (k, turn) in self.turns.iter().enumerate().skip(1) {
                let (a, b) = (bins[k], bins[last - k].conj());
                let (even, odd) = (a + b, (a - b) * turn.conj());
                let odd = Complex::new(-odd.im, odd.re);
                z[k] = even + odd;
                z[last - k] = (even - odd).conj();
            }
            self.inverse.process_with_scratch(z, rest);
            time.as_chunks_mut::<2>().0.iter_mut().zip(z).for_each(|(x, z)| *x = [z.re, z.im]);
        } else {
            z[0] = Complex::new(bins[0].re, T::zero());
            for (k, x) in bins.iter().enumerate().skip(1) {
                z[k] = *x;
                z[self.len - k] = x.conj();
            }
            self.inverse.process_with_scratch(z, rest);
            time.iter_mut().zip(z).for_each(|(x, z)| *x = z.re);
        }
    }
}

/// Real transforms of one length in both directions, with their buffers.
pub struct Transform<T> {
    plan: Arc<Plan<T>>,
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

impl<T: Real> Transform<T> {
    /// Plans both directions and allocates the buffers.
    pub fn new(len: usize) -> Self {
        let plan = plan(len);
        Self {
            time: vec![T::zero(); len],
            bins: vec![Complex::zero(); len / 2 + 1],
            scratch: vec![Complex::zero(); plan.scratch()],
            plan,
        }
    }

    /// Computes `bins` from `time`. Unscaled.
    pub fn forward(&mut self) {
        self.plan.forward(&self.time, &mut self.bins, &mut self.scratch);
    }

    /// Computes `time` from `bins`. Unscaled. A real signal has no imaginary part in bin 0 and at Nyquist's
    /// frequency; these are ignored.
    pub fn inverse(&mut self) {
        self.plan.inverse(&self.bins, &mut self.time, &mut self.scratch);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use asperity_numbers::Random;

    #[test]
    fn plans_are_shared_by_threads_and_long_ones_are_dropped() {
        let plans: Vec<_> = (0..8)
            .map(|_| std::thread::spawn(|| (1..250).map(plan::<f32>).next_back()))
            .map(|thread| thread.join().unwrap().unwrap())
            .collect();
        assert!(plans.iter().all(|p| Arc::ptr_eq(p, &plan(249))));
        assert!(Arc::ptr_eq(&plan::<f64>(250), &plan(250)) && !Arc::ptr_eq(&plan::<f32>(250), &plan(252)));
        let long = Arc::downgrade(&plan::<f32>(2 * KEPT));
        assert!(long.upgrade().is_none(), "it went with whoever used it");
    }

    #[test]
    fn real_transforms_match_realfft_at_any_length() {
        let mut planner = realfft::RealFftPlanner::<f64>::new();
        let mut random = Random::new(1);
        for len in (1..70).chain([100, 125, 250, 251, 800, 1000, 4096]) {
            let samples: Vec<f64> = (0..len).map(|_| random.unit() - 0.5).collect();
            let theirs = planner.plan_fft_forward(len);
            let mut bins = theirs.make_output_vec();
            theirs.process(&mut samples.clone(), &mut bins).unwrap();
            let ours = spectrum(samples.clone());
            let off = ours.iter().zip(&bins).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
            assert!(off < 1e-12, "{len}: {off}");
            let back = signal(bins, len);
            let off = back.iter().zip(&samples).map(|(a, b)| (a / len as f64 - b).abs()).fold(0.0, f64::max);
            assert!(off < 1e-14, "{len}: {off}");
        }
    }

    #[test]
    fn imaginary_part_of_a_real_bin_is_ignored() {
        let bins = [Complex::new(1.0, 5.0), 0.0.into(), 0.0.into(), 0.0.into(), Complex::new(1.0, 7.0)];
        assert_eq!(signal::<f64>(bins, 8), [2.0, 0.0, 2.0, 0.0, 2.0, 0.0, 2.0, 0.0]);
    }
}
