//! Several frames at once, one in each lane of a vector.
//!
//! A transform of one frame of 250 samples has little parallel work: 125 points are five times five times
//! five. Several frames are computed in parallel, without shuffling between lanes. Sums and products have one
//! order and are rounded one by one, so every instruction set gives the same bits. Everything here is inlined
//! into a function that is compiled for an instruction set, where an operation is one instruction a register.

use crate::{Complex, Float, float::phasor};
use std::ops::{Add, Div, Mul, Sub};

/// Lanes of a vector: one AVX register in single precision.
pub(crate) const LANES: usize = 8;

/// One number in each lane.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Lane<T>(pub(crate) [T; LANES]);

#[inline(always)]
fn each<T>(f: impl Fn(usize) -> T) -> Lane<T> {
    Lane([f(0), f(1), f(2), f(3), f(4), f(5), f(6), f(7)])
}

macro_rules! operators {
    ($($operator:ident $name:ident $op:tt),*) => {$(
        impl<T: Float> $operator for Lane<T> {
            type Output = Self;
            #[inline(always)]
            fn $name(self, by: Self) -> Self {
                each(|i| self.0[i] $op by.0[i])
            }
        }
    )*};
}

operators!(Add add +, Sub sub -, Mul mul *, Div div /);

impl<T: Float> Lane<T> {
    /// The same number in all lanes.
    #[inline(always)]
    pub(crate) fn all(x: T) -> Self {
        Self([x; LANES])
    }

    #[inline(always)]
    pub(crate) fn root(self) -> Self {
        each(|i| self.0[i].root())
    }
}

/// A complex number in each lane.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Point<T> {
    pub(crate) re: Lane<T>,
    pub(crate) im: Lane<T>,
}

impl<T: Float> Point<T> {
    /// Times the same factor in all lanes.
    #[inline(always)]
    pub(crate) fn turned(self, by: Complex<T>) -> Self {
        let (c, d) = (Lane::all(by.re), Lane::all(by.im));
        Self { re: self.re * c - self.im * d, im: self.re * d + self.im * c }
    }

    #[inline(always)]
    pub(crate) fn scaled(self, by: Lane<T>) -> Self {
        Self { re: self.re * by, im: self.im * by }
    }

    #[inline(always)]
    pub(crate) fn conj_plus(self, by: Self) -> Self {
        Self { re: self.re + by.re, im: self.im - by.im }
    }

    /// `self - i by` and `self + i by`.
    #[inline(always)]
    fn aside(self, by: Self) -> [Self; 2] {
        let (a, b) = (self, by);
        [Self { re: a.re + b.im, im: a.im - b.re }, Self { re: a.re - b.im, im: a.im + b.re }]
    }
}

impl<T: Float> Add for Point<T> {
    type Output = Self;
    #[inline(always)]
    fn add(self, by: Self) -> Self {
        Self { re: self.re + by.re, im: self.im + by.im }
    }
}

impl<T: Float> Sub for Point<T> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, by: Self) -> Self {
        Self { re: self.re - by.re, im: self.im - by.im }
    }
}

/// One pass over the data: butterflies of `radix` numbers that lie `groups * stride` apart.
#[derive(Debug)]
struct Stage<T> {
    radix: usize,
    groups: usize,
    stride: usize,
    /// For each group, the factors of all outputs but the first.
    turns: Vec<Complex<T>>,
}

/// A plan of transforms of one length, with their buffers.
#[derive(Debug)]
pub(crate) struct Fft<T> {
    stages: Vec<Stage<T>>,
    /// Input and output of a transform.
    pub(crate) points: Vec<Point<T>>,
    room: Vec<Point<T>>,
}

impl<T: Float> Fft<T> {
    /// Returns none if the length has another factor than 2, 3, 5 and 7.
    pub(crate) fn new(len: usize) -> Option<Self> {
        let mut left = len;
        let mut stages = Vec::new();
        while left > 1 {
            let radix = [4, 2, 3, 5, 7].into_iter().find(|r| left.is_multiple_of(*r))?;
            let groups = left / radix;
            let turn = |p: usize, k: usize| phasor(-((p * k % left) as f64) / left as f64);
            let turns = (0..groups).flat_map(|p| (1..radix).map(move |k| turn(p, k)));
            stages.push(Stage { radix, groups, stride: len / left, turns: turns.collect() });
            left = groups;
        }
        let points = vec![Point::default(); len];
        (len > 0).then(|| Self { stages, room: points.clone(), points })
    }

    /// Computes `sum x_n e^(-2 pi i n k / len)` in every lane, in place. Unscaled.
    #[inline(always)]
    pub(crate) fn run(&mut self) {
        let Self { stages, points, room } = self;
        for stage in stages {
            match stage.radix {
                2 => pass::<T, 2>(stage, points, room),
                3 => pass::<T, 3>(stage, points, room),
                4 => pass::<T, 4>(stage, points, room),
                5 => pass::<T, 5>(stage, points, room),
                _ => pass::<T, 7>(stage, points, room),
            }
            std::mem::swap(points, room);
        }
    }
}

/// Self-sorting, by decimation in frequency (Stockham).
#[inline(always)]
fn pass<T: Float, const R: usize>(stage: &Stage<T>, from: &[Point<T>], to: &mut [Point<T>]) {
    let stride = stage.stride;
    // Inputs of a butterfly are this far apart, its outputs one stride.
    let apart = stage.groups * stride;
    for (p, (turns, to)) in stage.turns.chunks_exact(R - 1).zip(to.chunks_exact_mut(R * stride)).enumerate() {
        for q in 0..stride {
            // Loops, because a closure is a function of its own that is not compiled for the instruction set.
            let mut x = [Point::default(); R];
            for (j, x) in x.iter_mut().enumerate() {
                *x = from[p * stride + q + j * apart];
            }
            let y = butterfly(x);
            to[q] = y[0];
            for k in 1..R {
                to[q + k * stride] = if p > 0 { y[k].turned(turns[k - 1]) } else { y[k] };
            }
        }
    }
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
fn butterfly<T: Float, const R: usize>(x: [Point<T>; R]) -> [Point<T>; R] {
    let mut y = x;
    match R {
        2 => (y[0], y[1]) = (x[0] + x[1], x[0] - x[1]),
        4 => {
            let (a, b, c, d) = (x[0] + x[2], x[0] - x[2], x[1] + x[3], x[1] - x[3]);
            (y[0], y[2]) = (a + c, a - c);
            [y[1], y[3]] = b.aside(d);
        }
        _ => {
            // An odd number of points: sums and differences of the pairs symmetric about the first.
            let half = R / 2;
            let (mut sums, mut sides) = (x, x);
            for j in 1..=half {
                (sums[j], sides[j]) = (x[j] + x[R - j], x[j] - x[R - j]);
                y[0] = y[0] + sums[j];
            }
            for k in 1..=half {
                let (mut even, mut odd) = (x[0], x[0]);
                for j in 1..=half {
                    let (cos, sin) = root(j * k % R, R);
                    even = even + sums[j].scaled(Lane::all(T::of(cos)));
                    let side = sides[j].scaled(Lane::all(T::of(sin)));
                    odd = if j == 1 { side } else { odd + side };
                }
                [y[k], y[R - k]] = even.aside(odd);
            }
        }
    }
    y
}

#[cfg(test)]
mod tests;
