//! Complex transforms of several frames at once, one in each lane.

use super::{Lane, Simd};
use crate::{Complex, Float, float::phasor};

/// Supported factors of a length.
const RADICES: [usize; 5] = [4, 2, 3, 5, 7];

/// One pass over the data: butterflies of `radix` numbers that lie `groups * stride` apart.
#[derive(Debug)]
struct Stage<T> {
    radix: usize,
    groups: usize,
    stride: usize,
    /// For each group, the factors of all outputs but the first.
    turns: Vec<Complex<T>>,
}

/// A transform plan.
#[derive(Debug)]
pub(crate) struct Fft<T> {
    stages: Vec<Stage<T>>,
}

/// Input and output buffers of a transform.
#[derive(Debug)]
pub(crate) struct Work<T> {
    pub(crate) re: Vec<Lane<T>>,
    pub(crate) im: Vec<Lane<T>>,
    to_re: Vec<Lane<T>>,
    to_im: Vec<Lane<T>>,
}

impl<T: Float> Work<T> {
    pub(crate) fn new(len: usize) -> Self {
        let room = || vec![[T::zero(); super::LANES]; len];
        Self { re: room(), im: room(), to_re: room(), to_im: room() }
    }
}

impl<T: Float> Fft<T> {
    /// Returns none if the length has an unsupported factor.
    pub(crate) fn new(len: usize) -> Option<Self> {
        let mut left = len;
        let mut stages = Vec::new();
        while left > 1 {
            let radix = RADICES.into_iter().find(|r| left.is_multiple_of(*r))?;
            let groups = left / radix;
            let turn = |p: usize, k: usize| phasor(-((p * k % left) as f64) / left as f64);
            let turns = (0..groups).flat_map(|p| (1..radix).map(move |k| turn(p, k)));
            stages.push(Stage { radix, groups, stride: len / left, turns: turns.collect() });
            left = groups;
        }
        (len > 0).then_some(Self { stages })
    }

    /// Computes `sum x_n e^(-2 pi i n k / len)` in every lane, in place. The inverse exchanges real and
    /// imaginary parts, and is unscaled.
    #[inline(always)]
    pub(crate) fn run<S: Simd<T>>(&self, s: S, work: &mut Work<T>, inverse: bool) {
        let Work { re, im, to_re, to_im } = work;
        let (from, to) = if inverse { ((im, re), (to_im, to_re)) } else { ((re, im), (to_re, to_im)) };
        for stage in &self.stages {
            match stage.radix {
                2 => pass::<T, S, 2>(s, stage, (from.0, from.1), (to.0, to.1)),
                3 => pass::<T, S, 3>(s, stage, (from.0, from.1), (to.0, to.1)),
                4 => pass::<T, S, 4>(s, stage, (from.0, from.1), (to.0, to.1)),
                5 => pass::<T, S, 5>(s, stage, (from.0, from.1), (to.0, to.1)),
                _ => pass::<T, S, 7>(s, stage, (from.0, from.1), (to.0, to.1)),
            }
            std::mem::swap(from.0, to.0);
            std::mem::swap(from.1, to.1);
        }
    }
}

/// A complex number in each lane.
type Point<V> = (V, V);

/// Self-sorting, by decimation in frequency (Stockham).
#[inline(always)]
fn pass<T: Float, S: Simd<T>, const R: usize>(
    s: S,
    stage: &Stage<T>,
    from: (&[Lane<T>], &[Lane<T>]),
    to: (&mut [Lane<T>], &mut [Lane<T>]),
) {
    let stride = stage.stride;
    // Inputs of a butterfly are this far apart, its outputs one stride.
    let apart = stage.groups * stride;
    let turns = stage.turns.chunks_exact(R - 1).enumerate();
    if stride == 1 {
        let (re, im) = (parts::<T, R>(from.0, 0, apart, apart), parts::<T, R>(from.1, 0, apart, apart));
        let out = to.0.as_chunks_mut::<R>().0.iter_mut().zip(to.1.as_chunks_mut::<R>().0);
        // There are no more groups than that. Stating it lets the compiler drop bounds checks.
        for ((p, turns), (to_re, to_im)) in turns.zip(out).take(apart) {
            let y = turned_butterfly::<T, S, R>(s, (&re, &im), p, p, turns);
            for (k, y) in y.into_iter().enumerate() {
                s.store(y.0, &mut to_re[k]);
                s.store(y.1, &mut to_im[k]);
            }
        }
        return;
    }
    let out = to.0.chunks_exact_mut(R * stride).zip(to.1.chunks_exact_mut(R * stride));
    for ((p, turns), (to_re, to_im)) in turns.zip(out) {
        let re = parts::<T, R>(from.0, p * stride, apart, stride);
        let im = parts::<T, R>(from.1, p * stride, apart, stride);
        for q in 0..stride {
            let y = turned_butterfly::<T, S, R>(s, (&re, &im), q, p, turns);
            for (k, y) in y.into_iter().enumerate() {
                s.store(y.0, &mut to_re[q + k * stride]);
                s.store(y.1, &mut to_im[q + k * stride]);
            }
        }
    }
}

/// `R` runs of lanes.
type Parts<'a, T, const R: usize> = [&'a [Lane<T>]; R];

/// `R` runs of `len`, the first at `first` and the others `apart` from each other.
#[inline(always)]
fn parts<T, const R: usize>(all: &[Lane<T>], first: usize, apart: usize, len: usize) -> Parts<'_, T, R> {
    let mut parts: Parts<'_, T, R> = [&[]; R];
    for (j, part) in parts.iter_mut().enumerate() {
        *part = &all[first + j * apart..][..len];
    }
    parts
}

/// The butterfly at position `at` of each part, with the factors of group `p`; group 0 has none.
#[inline(always)]
fn turned_butterfly<T: Float, S: Simd<T>, const R: usize>(
    s: S,
    from: (&Parts<'_, T, R>, &Parts<'_, T, R>),
    at: usize,
    p: usize,
    turns: &[Complex<T>],
) -> [Point<S::Vector>; R] {
    // Loops, because a closure is a function of its own that is not compiled for the instruction set.
    let zero = s.splat(T::zero());
    let mut x = [(zero, zero); R];
    for (j, x) in x.iter_mut().enumerate() {
        *x = (s.load(&from.0[j][at]), s.load(&from.1[j][at]));
    }
    let mut y = butterfly::<T, S, R>(s, x);
    if p > 0 {
        for (y, &turn) in y.iter_mut().skip(1).zip(turns) {
            *y = turned(s, *y, turn);
        }
    }
    y
}

/// `a w`.
#[inline(always)]
pub(crate) fn turned<T: Float, S: Simd<T>>(s: S, a: Point<S::Vector>, w: Complex<T>) -> Point<S::Vector> {
    let (c, d) = (s.splat(w.re), s.splat(w.im));
    (s.sub(s.mul(a.0, c), s.mul(a.1, d)), s.add(s.mul(a.0, d), s.mul(a.1, c)))
}

#[inline(always)]
fn plus<T, S: Simd<T>>(s: S, a: Point<S::Vector>, b: Point<S::Vector>) -> Point<S::Vector> {
    (s.add(a.0, b.0), s.add(a.1, b.1))
}

#[inline(always)]
fn minus<T, S: Simd<T>>(s: S, a: Point<S::Vector>, b: Point<S::Vector>) -> Point<S::Vector> {
    (s.sub(a.0, b.0), s.sub(a.1, b.1))
}

/// `a - i b` and `a + i b`.
#[inline(always)]
fn aside<T, S: Simd<T>>(s: S, a: Point<S::Vector>, b: Point<S::Vector>) -> [Point<S::Vector>; 2] {
    [(s.add(a.0, b.1), s.sub(a.1, b.0)), (s.sub(a.0, b.1), s.add(a.1, b.0))]
}

/// `(cos, sin)` of `2 pi i / r`, for 3, 5 and 7.
#[inline(always)]
fn root(i: usize, r: usize) -> (f64, f64) {
    const THIRD: [(f64, f64); 1] = [(-0.5, 0.8660254037844387)];
    const FIFTH: [(f64, f64); 2] =
        [(0.30901699437494745, 0.9510565162951535), (-0.8090169943749473, 0.5877852522924732)];
    const SEVENTH: [(f64, f64); 3] = [
        (0.6234898018587336, 0.7818314824680298),
        (-0.22252093395631434, 0.9749279121818236),
        (-0.900968867902419, 0.43388373911755823),
    ];
    let (at, sign) = if 2 * i < r { (i, 1.0) } else { (r - i, -1.0) };
    let (cos, sin) = match r {
        3 => THIRD[at - 1],
        5 => FIFTH[at - 1],
        _ => SEVENTH[at - 1],
    };
    (cos, sign * sin)
}

/// Transform of `R` numbers.
#[inline(always)]
fn butterfly<T: Float, S: Simd<T>, const R: usize>(s: S, x: [Point<S::Vector>; R]) -> [Point<S::Vector>; R] {
    let mut y = x;
    match R {
        2 => {
            y[0] = plus(s, x[0], x[1]);
            y[1] = minus(s, x[0], x[1]);
        }
        4 => {
            let (a, b) = (plus(s, x[0], x[2]), minus(s, x[0], x[2]));
            let (c, d) = (plus(s, x[1], x[3]), minus(s, x[1], x[3]));
            y[0] = plus(s, a, c);
            y[2] = minus(s, a, c);
            [y[1], y[3]] = aside(s, b, d);
        }
        _ => {
            // An odd number of points: sums and differences of the pairs symmetric about the first.
            let half = R / 2;
            let (mut sums, mut sides) = (x, x);
            for j in 1..=half {
                sums[j] = plus(s, x[j], x[R - j]);
                sides[j] = minus(s, x[j], x[R - j]);
                y[0] = plus(s, y[0], sums[j]);
            }
            for k in 1..=half {
                let (mut even, mut odd) = (x[0], x[0]);
                for j in 1..=half {
                    let (cos, sin) = root(j * k % R, R);
                    let (c, d) = (s.splat(T::of(cos)), s.splat(T::of(sin)));
                    even = plus(s, even, (s.mul(sums[j].0, c), s.mul(sums[j].1, c)));
                    let side = (s.mul(sides[j].0, d), s.mul(sides[j].1, d));
                    odd = if j == 1 { side } else { plus(s, odd, side) };
                }
                [y[k], y[R - k]] = aside(s, even, odd);
            }
        }
    }
    y
}
