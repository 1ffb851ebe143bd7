//! Projection of frames, one or several at once: the nearest frame with the wanted magnitudes.

use crate::float::phasor;
use crate::lanes::{Fft, LANES, Lane, Portable, Simd, Work, turned};
use crate::window::hann;
use crate::{Complex, Float, Framing, Isa};
use asperity_fft::Transform;
use asperity_numbers::unit_circle;

/// Relative size of the start phase in a bin. It matters only where the signal so far is silent.
const HINT: f64 = 1e-6;

/// Below any square that counts; avoids 0 / 0.
const TINY: f64 = 1e-36;

/// Fewer frames than this are transformed one by one, which takes half the time of a batch.
const FEW: usize = 2;

/// Frames to project, and the sum to which they are added.
pub struct Call<'a, T> {
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

/// As many frames as there are lanes, of one even length.
#[derive(Debug)]
struct Batch<T> {
    job: Job<T>,
    run: Run<T>,
}

/// The projection, compiled for an instruction set.
type Run<T> = fn(&mut Job<T>, Call<'_, T>);

/// Data of a projection, for every instruction set.
#[derive(Debug)]
pub struct Job<T> {
    fft: Fft<T>,
    /// `e^(-2 pi i k / n)` up to a quarter of the length `n`.
    turns: Vec<Complex<T>>,
    hint: Vec<Complex<T>>,
    window: Vec<T>,
    half_window: Vec<T>,
    /// Samples at even positions as real parts, at odd positions as imaginary parts.
    work: Work<T>,
    /// Wanted magnitudes.
    mags: Vec<Lane<T>>,
}

impl<T: Float> Batch<T> {
    /// Returns none if the length is odd or has a large prime factor.
    fn new(window: &[T], bins: usize, hint: &[Complex<T>]) -> Option<Self> {
        let fft_len = window.len();
        let half = fft_len.is_multiple_of(2).then_some(fft_len / 2)?;
        let turn = |k: usize| phasor(-(k as f64) / fft_len as f64);
        let job = Job {
            fft: Fft::new(half)?,
            turns: (0..=half / 2).map(turn).collect(),
            hint: hint.to_vec(),
            half_window: window.iter().map(|&w| w * T::of(0.5)).collect(),
            window: window.to_vec(),
            work: Work::new(half),
            mags: vec![[T::zero(); LANES]; bins],
        };
        Some(Self { job, run: T::projection(Isa::best()) })
    }

    /// Projects all frames of a call at once.
    fn project(&mut self, call: Call<'_, T>) {
        for (lane, (_, magnitudes)) in call.frames.iter().enumerate().take(LANES) {
            for (to, &m) in self.job.mags.iter_mut().zip(*magnitudes) {
                to[lane] = m;
            }
        }
        (self.run)(&mut self.job, call);
    }
}

/// A float type with the projection. It is large, and compiled here alone: a generic function would be
/// compiled in each crate that names it.
pub trait Project: Sized {
    /// The projection compiled for an instruction set.
    fn projection(isa: Isa) -> Run<Self>;
}

macro_rules! project {
    ($($t:ty),*) => {$(
        impl Project for $t {
            // Inlined, it would be compiled in the crate that calls it.
            #[inline(never)]
            fn projection(isa: Isa) -> Run<Self> {
                compiled(isa)
            }
        }
    )*};
}

project!(f32, f64);

fn portable<T: Float>(job: &mut Job<T>, call: Call<'_, T>) {
    job.project(Portable, call);
}

/// Returns the projection compiled for an instruction set.
#[cfg(target_arch = "x86_64")]
fn compiled<T: Float>(isa: Isa) -> Run<T> {
    // AVX-512 has twice as many registers for the same vectors.
    #[target_feature(enable = "avx512f,avx512vl")]
    fn avx512<T: Float>(job: &mut Job<T>, call: Call<'_, T>) {
        // SAFETY: this function is called only where there is more than AVX.
        job.project(unsafe { T::avx() }, call);
    }
    #[target_feature(enable = "avx2")]
    fn avx2<T: Float>(job: &mut Job<T>, call: Call<'_, T>) {
        // SAFETY: this function is called only where there is AVX.
        job.project(unsafe { T::avx() }, call);
    }
    match isa {
        // SAFETY: this CPU has it.
        Isa::Avx512 if isa.is_available() => |job, call| unsafe { avx512(job, call) },
        // SAFETY: this CPU has it.
        Isa::Avx2 if isa.is_available() => |job, call| unsafe { avx2(job, call) },
        _ => portable,
    }
}

#[cfg(not(target_arch = "x86_64"))]
fn compiled<T: Float>(_: Isa) -> Run<T> {
    portable
}

impl<T: Float> Job<T> {
    #[inline(always)]
    fn project<S: Simd<T>>(&mut self, s: S, call: Call<'_, T>) {
        let frames = &call.frames[..call.frames.len().min(LANES)];
        self.load(s, call.z, frames);
        self.fft.run(s, &mut self.work, false);
        self.impose(s, call.turn);
        self.fft.run(s, &mut self.work, true);
        self.add_to(s, call.sum, frames, call.from);
    }

    /// Loads each frame into a lane, times half the window.
    #[inline(always)]
    fn load<S: Simd<T>>(&mut self, s: S, z: &[T], frames: &[(usize, &[T])]) {
        let Work { re, im, .. } = &mut self.work;
        let (windows, rest) = self.half_window.as_chunks::<LANES>();
        let (re, re_rest) = re.as_chunks_mut::<{ LANES / 2 }>();
        let (im, im_rest) = im.as_chunks_mut::<{ LANES / 2 }>();
        let zero = s.splat(T::zero());
        for (i, ((window, re), im)) in windows.iter().zip(re).zip(im).enumerate() {
            let window = s.load(window);
            let mut rows = [zero; LANES];
            for (row, (at, _)) in rows.iter_mut().zip(frames) {
                if let Some(x) = z[at + LANES * i..].first_chunk() {
                    *row = s.mul(s.load(x), window);
                }
            }
            let columns = s.transpose(rows);
            for (j, (re, im)) in re.iter_mut().zip(im).enumerate() {
                s.store(columns[2 * j], re);
                s.store(columns[2 * j + 1], im);
            }
        }
        let done = self.half_window.len() - rest.len();
        let pairs = re_rest.iter_mut().zip(im_rest).zip(rest.as_chunks::<2>().0);
        for (i, ((re, im), w)) in pairs.enumerate() {
            for (lane, (at, _)) in frames.iter().enumerate() {
                let x = &z[at + done + 2 * i..][..2];
                (re[lane], im[lane]) = (x[0] * w[0], x[1] * w[1]);
            }
        }
    }

    /// Adds each lane's frame, times the window, to the samples from `from` on.
    #[inline(always)]
    fn add_to<S: Simd<T>>(&self, s: S, sum: &mut [T], frames: &[(usize, &[T])], from: usize) {
        let Work { re, im, .. } = &self.work;
        let (windows, rest) = self.window.as_chunks::<LANES>();
        let (re, re_rest) = re.as_chunks::<{ LANES / 2 }>();
        let (im, im_rest) = im.as_chunks::<{ LANES / 2 }>();
        let zero = s.splat(T::zero());
        for (i, ((window, re), im)) in windows.iter().zip(re).zip(im).enumerate() {
            let mut columns = [zero; LANES];
            for (j, (re, im)) in re.iter().zip(im).enumerate() {
                (columns[2 * j], columns[2 * j + 1]) = (s.load(re), s.load(im));
            }
            let window = s.load(window);
            let rows = s.transpose(columns);
            for (row, (at, _)) in rows.into_iter().zip(frames) {
                let at = at + LANES * i;
                let Some(to) = sum[at..].first_chunk_mut() else { continue };
                let row = s.add(s.load(to), s.mul(row, window));
                if at >= from {
                    s.store(row, to);
                } else if at + LANES > from {
                    let mut all = [T::zero(); LANES];
                    s.store(row, &mut all);
                    to[from - at..].copy_from_slice(&all[from - at..]);
                }
            }
        }
        let done = self.window.len() - rest.len();
        let pairs = re_rest.iter().zip(im_rest).zip(rest.as_chunks::<2>().0);
        for (i, ((re, im), w)) in pairs.enumerate() {
            for (lane, (at, _)) in frames.iter().enumerate() {
                let at = at + done + 2 * i;
                for (at, y) in [(at, re[lane] * w[0]), (at + 1, im[lane] * w[1])] {
                    if at >= from {
                        sum[at] += y;
                    }
                }
            }
        }
    }

    /// Goes from the transform of sample pairs to the bins, imposes the magnitudes, and goes back.
    ///
    /// With `Z` the transform of `x_2n + i x_2n+1`, and `E` and `O` those of even and odd samples: `X_k
    /// = E + e^(-2 pi i k / n) O`, where `2 E = Z_k + conj Z_(h-k)`, `2 i O = Z_k - conj Z_(h-k)` and
    /// `h = n / 2`. The same holds with `-k`. The factors 1/2 are in the window.
    #[inline(always)]
    fn impose<S: Simd<T>>(&mut self, s: S, turn: Complex<T>) {
        let Self { turns, hint, work: Work { re, im, .. }, mags, .. } = self;
        let len = re.len();
        let zero = s.splat(T::zero());
        // Bin 0 and half the rate are real.
        let (a, b) = (s.load(&re[0]), s.load(&im[0]));
        let (sum, side) = (s.add(a, b), s.sub(a, b));
        let (mut first, mut last) = (zero, zero);
        if let (Some(m), Some(h)) = (mags.first(), hint.first()) {
            first = give(s, (s.add(sum, sum), zero), m, *h).0;
        }
        if let (Some(m), Some(h)) = (mags.get(len), hint.get(len)) {
            last = give(s, (s.add(side, side), zero), m, *h).0;
        }
        s.store(s.add(first, last), &mut re[0]);
        s.store(s.sub(first, last), &mut im[0]);
        for (((k, &w), m), h) in turns.iter().enumerate().zip(mags.iter()).zip(hint.iter()).skip(1) {
            let other = len - k;
            let a = (s.load(&re[k]), s.load(&im[k]));
            let b = (s.load(&re[other]), s.load(&im[other]));
            let even = (s.add(a.0, b.0), s.sub(a.1, b.1));
            let odd = turned(s, (s.add(a.1, b.1), s.sub(b.0, a.0)), w);
            let y = give(s, (s.add(even.0, odd.0), s.add(even.1, odd.1)), m, *h);
            let y = turned(s, y, turn);
            let (mut even_out, mut odd_out) = (y, y);
            if let (Some(m), Some(h)) = (mags.get(other), hint.get(other)) {
                let y = give(s, (s.sub(even.0, odd.0), s.sub(odd.1, even.1)), m, *h);
                let y = turned(s, y, turn);
                even_out = (s.add(even_out.0, y.0), s.sub(even_out.1, y.1));
                odd_out = (s.sub(odd_out.0, y.0), s.add(odd_out.1, y.1));
            }
            let odd_out = turned(s, odd_out, w.conj());
            s.store(s.sub(even_out.0, odd_out.1), &mut re[k]);
            s.store(s.add(even_out.1, odd_out.0), &mut im[k]);
            // The conjugates of both.
            s.store(s.add(even_out.0, odd_out.1), &mut re[other]);
            s.store(s.sub(odd_out.0, even_out.1), &mut im[other]);
        }
        // In the remaining pairs neither bin is carried.
        if let Some(last) = len.checked_sub(mags.len()) {
            for part in [re, im] {
                part.get_mut(mags.len()..=last).unwrap_or_default().fill([T::zero(); LANES]);
            }
        }
    }
}

/// Gives a bin the magnitude `m` and keeps its phase.
#[inline(always)]
fn give<T: Float, S: Simd<T>>(
    s: S,
    x: (S::Vector, S::Vector),
    m: &Lane<T>,
    hint: Complex<T>,
) -> (S::Vector, S::Vector) {
    let m = s.load(m);
    let re = s.add(x.0, s.mul(s.splat(hint.re), m));
    let im = s.add(x.1, s.mul(s.splat(hint.im), m));
    let square = s.add(s.add(s.mul(re, re), s.mul(im, im)), s.splat(T::of(TINY)));
    let factor = s.div(m, s.root(square));
    (s.mul(re, factor), s.mul(im, factor))
}

#[cfg(test)]
#[path = "project_tests.rs"]
mod tests;
