//! Plans of transforms, made once for each length and shared by all kernels of the process.

use realfft::{ComplexToReal, FftNum, RealFftPlanner, RealToComplex};
use std::sync::{Arc, LazyLock, Mutex, PoisonError};

/// Longer transforms than this are planned anew, and forgotten with the kernel that uses them: their tables
/// take megabytes.
const KEPT: usize = 1 << 16;

type Planner<T> = LazyLock<Mutex<RealFftPlanner<T>>>;

/// A float whose plans are kept.
pub trait Plans: FftNum {
    /// Runs something with the planner that all share. Takes a lock, and plans: not for the tick thread.
    fn with_planner<R>(f: impl FnOnce(&mut RealFftPlanner<Self>) -> R) -> R;
}

macro_rules! plans {
    ($($t:ty),*) => {$(
        impl Plans for $t {
            fn with_planner<R>(f: impl FnOnce(&mut RealFftPlanner<Self>) -> R) -> R {
                static SHARED: Planner<$t> = LazyLock::new(|| Mutex::new(RealFftPlanner::new()));
                // What a planner was at when a thread panicked is a plan less.
                f(&mut SHARED.lock().unwrap_or_else(PoisonError::into_inner))
            }
        }
    )*};
}

plans!(f32, f64);

/// From `len` samples to `len / 2 + 1` bins, unscaled.
pub fn forward<T: Plans>(len: usize) -> Arc<dyn RealToComplex<T>> {
    if len > KEPT {
        RealFftPlanner::new().plan_fft_forward(len)
    } else {
        T::with_planner(|p| p.plan_fft_forward(len))
    }
}

/// From `len / 2 + 1` bins to `len` samples, unscaled.
pub fn inverse<T: Plans>(len: usize) -> Arc<dyn ComplexToReal<T>> {
    if len > KEPT {
        RealFftPlanner::new().plan_fft_inverse(len)
    } else {
        T::with_planner(|p| p.plan_fft_inverse(len))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plans_of_one_length_are_one_and_long_ones_are_not_kept() {
        let (a, b) = (forward::<f32>(250), forward::<f32>(250));
        assert!(Arc::ptr_eq(&a, &b));
        assert!(Arc::ptr_eq(&inverse::<f64>(250), &inverse::<f64>(250)));
        assert!(!Arc::ptr_eq(&a, &forward::<f32>(252)));
        let long = Arc::downgrade(&forward::<f32>(2 * KEPT));
        assert!(long.upgrade().is_none(), "it went with whoever used it");
    }

    #[test]
    fn plans_can_be_asked_for_by_many_threads_at_once() {
        let plans: Vec<_> = (0..8)
            .map(|_| std::thread::spawn(|| (1..200).map(forward::<f32>).fold(None, |_, plan| Some(plan))))
            .collect();
        let plans: Vec<_> = plans.into_iter().map(|p| p.join().unwrap().unwrap()).collect();
        assert!(plans.iter().all(|p| Arc::ptr_eq(p, &plans[0])));
    }
}
