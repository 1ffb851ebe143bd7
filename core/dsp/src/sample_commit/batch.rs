//! Projection of several frames at once.

use super::project::{Call, TINY};
use crate::lanes::{Fft, LANES, Lane, Point};
use crate::{Complex, Float, Isa, float::phasor};

/// As many frames as there are lanes, of one even length.
#[derive(Debug)]
pub(super) struct Batch<T> {
    job: Job<T>,
    run: Run<T>,
}

/// The projection, compiled for an instruction set.
type Run<T> = fn(&mut Job<T>, Call<'_, T>);

/// Data of a projection, for every instruction set.
#[derive(Debug)]
struct Job<T> {
    /// Samples at even positions as real parts, at odd positions as imaginary parts; after the projection the
    /// other way round.
    fft: Fft<T>,
    /// `e^(-2 pi i k / n)` up to a quarter of the length `n`.
    turns: Vec<Complex<T>>,
    hint: Vec<Complex<T>>,
    window: Vec<T>,
    half_window: Vec<T>,
    /// Wanted magnitudes.
    mags: Vec<Lane<T>>,
}

impl<T: Float> Batch<T> {
    /// Returns none if the length is odd or has a large prime factor.
    pub(super) fn new(window: &[T], bins: usize, hint: &[Complex<T>]) -> Option<Self> {
        let fft_len = window.len();
        let half = fft_len.is_multiple_of(2).then_some(fft_len / 2)?;
        let turn = |k: usize| phasor(-(k as f64) / fft_len as f64);
        let job = Job {
            fft: Fft::new(half)?,
            turns: (0..=half / 2).map(turn).collect(),
            hint: hint.to_vec(),
            half_window: window.iter().map(|&w| w * T::of(0.5)).collect(),
            window: window.to_vec(),
            mags: vec![Lane::default(); bins],
        };
        Some(Self { job, run: compiled(Isa::best()) })
    }

    /// Projects all frames of a call at once.
    pub(super) fn project(&mut self, call: Call<'_, T>) {
        for (lane, (_, magnitudes)) in call.frames.iter().enumerate().take(LANES) {
            for (to, &m) in self.job.mags.iter_mut().zip(*magnitudes) {
                to.0[lane] = m;
            }
        }
        (self.run)(&mut self.job, call);
    }
}

/// Returns the projection compiled for an instruction set.
fn compiled<T: Float>(isa: Isa) -> Run<T> {
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx512f,avx512vl")]
    fn avx512<T: Float>(job: &mut Job<T>, call: Call<'_, T>) {
        job.project(call);
    }
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn avx2<T: Float>(job: &mut Job<T>, call: Call<'_, T>) {
        job.project(call);
    }
    match isa {
        // SAFETY: this CPU has it.
        #[cfg(target_arch = "x86_64")]
        Isa::Avx512 if isa.is_available() => |job, call| unsafe { avx512(job, call) },
        // SAFETY: this CPU has it.
        #[cfg(target_arch = "x86_64")]
        Isa::Avx2 if isa.is_available() => |job, call| unsafe { avx2(job, call) },
        _ => |job, call| job.project(call),
    }
}

impl<T: Float> Job<T> {
    #[inline(always)]
    fn project(&mut self, call: Call<'_, T>) {
        let frames = &call.frames[..call.frames.len().min(LANES)];
        for (i, (point, w)) in self.fft.points.iter_mut().zip(self.half_window.as_chunks::<2>().0).enumerate()
        {
            for (lane, (at, _)) in frames.iter().enumerate() {
                let x = &call.z[at + 2 * i..][..2];
                (point.re.0[lane], point.im.0[lane]) = (x[0] * w[0], x[1] * w[1]);
            }
        }
        self.fft.run();
        self.impose(call.turn);
        self.fft.run();
        self.add_to(call.sum, frames, call.from);
    }

    /// Adds each lane's frame, times the window, to the samples from `from` on. The order of additions is
    /// that of blocks of as many samples as there are lanes.
    #[inline(always)]
    fn add_to(&self, sum: &mut [T], frames: &[(usize, &[T])], from: usize) {
        let n = self.window.len();
        let whole = n - n % LANES;
        let blocks =
            (0..whole).step_by(LANES).map(|i| (i, LANES)).chain((whole..n).step_by(2).map(|i| (i, 2)));
        for (start, len) in blocks {
            for (lane, (at, _)) in frames.iter().enumerate() {
                for i in start..start + len {
                    let Point { re, im } = &self.fft.points[i / 2];
                    let y = if i % 2 == 0 { im.0[lane] } else { re.0[lane] } * self.window[i];
                    if at + i >= from {
                        sum[at + i] += y;
                    }
                }
            }
        }
    }

    /// Goes from the transform of sample pairs to the bins, imposes the magnitudes, and goes back, with real
    /// and imaginary parts exchanged, so that the next transform is the inverse one.
    ///
    /// With `Z` the transform of `x_2n + i x_2n+1`, and `E` and `O` those of even and odd samples: `X_k = E +
    /// e^(-2 pi i k / n) O`, where `2 E = Z_k + conj Z_(h-k)`, `2 i O = Z_k - conj Z_(h-k)` and `h = n / 2`.
    /// The same holds with `-k`. The factors 1/2 are in the window.
    #[inline(always)]
    fn impose(&mut self, turn: Complex<T>) {
        let Self { turns, hint, fft: Fft { points, .. }, mags, .. } = self;
        let len = points.len();
        // Bin 0 and half the rate are real.
        let real = |x: Lane<T>, bin: usize| match (mags.get(bin), hint.get(bin)) {
            (Some(m), Some(h)) => give(Point { re: x + x, im: Lane::default() }, *m, *h).re,
            _ => Lane::default(),
        };
        let Point { re: a, im: b } = points[0];
        let (first, last) = (real(a + b, 0), real(a - b, len));
        points[0] = Point { re: first - last, im: first + last };
        for (((k, &w), m), h) in turns.iter().enumerate().zip(mags.iter()).zip(hint.iter()).skip(1) {
            let other = len - k;
            let (a, b) = (points[k], points[other]);
            let even = a.conj_plus(b);
            let odd = Point { re: a.im + b.im, im: b.re - a.re }.turned(w);
            let y = give(even + odd, *m, *h).turned(turn);
            let (mut even_out, mut odd_out) = (y, y);
            if let (Some(m), Some(h)) = (mags.get(other), hint.get(other)) {
                let y = Point { re: even.re - odd.re, im: odd.im - even.im };
                let y = give(y, *m, *h).turned(turn);
                even_out = even_out.conj_plus(y);
                odd_out = Point { re: odd_out.re - y.re, im: odd_out.im + y.im };
            }
            let odd_out = odd_out.turned(w.conj());
            points[k] = Point { re: even_out.im + odd_out.re, im: even_out.re - odd_out.im };
            // The conjugates of both.
            points[other] = Point { re: odd_out.re - even_out.im, im: even_out.re + odd_out.im };
        }
        // In the remaining pairs neither bin is carried.
        if let Some(last) = len.checked_sub(mags.len()) {
            points.get_mut(mags.len()..=last).unwrap_or_default().fill(Point::default());
        }
    }
}

/// Gives a bin the magnitude `m` and keeps its phase.
#[inline(always)]
fn give<T: Float>(x: Point<T>, m: Lane<T>, hint: Complex<T>) -> Point<T> {
    let re = x.re + Lane::all(hint.re) * m;
    let im = x.im + Lane::all(hint.im) * m;
    let square = re * re + im * im + Lane::all(T::of(TINY));
    Point { re, im }.scaled(m / square.root())
}

#[cfg(test)]
#[path = "batch_tests.rs"]
mod tests;
