//! Vectors of eight lanes for each instruction set.

use crate::Float;

/// Lanes of a vector: one AVX register in single precision.
pub(crate) const LANES: usize = 8;

/// One number in each lane.
pub(crate) type Lane<T> = [T; LANES];

/// An instruction set. A value of such a type exists only where the CPU supports it. Every operation
/// acts on all lanes alike and rounds to nearest.
pub trait Simd<T>: Copy {
    /// One number in each lane, in registers.
    type Vector: Copy;
    /// The same number in all lanes.
    fn splat(self, x: T) -> Self::Vector;
    /// Reads from memory.
    fn load(self, from: &[T; LANES]) -> Self::Vector;
    /// Writes to memory.
    fn store(self, x: Self::Vector, to: &mut [T; LANES]);
    /// `a + b`.
    fn add(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// `a - b`.
    fn sub(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// `a * b`.
    fn mul(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// `a / b`.
    fn div(self, a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// Square root.
    fn root(self, a: Self::Vector) -> Self::Vector;
    /// Transposes rows and columns.
    fn transpose(self, rows: [Self::Vector; LANES]) -> [Self::Vector; LANES];
}

/// Plain code, for every CPU.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Portable;

#[inline(always)]
fn each<T>(f: impl Fn(usize) -> T) -> Lane<T> {
    [f(0), f(1), f(2), f(3), f(4), f(5), f(6), f(7)]
}

macro_rules! each_lane {
    ($($name:ident $op:tt),*) => {$(
        #[inline(always)]
        fn $name(self, a: Lane<T>, b: Lane<T>) -> Lane<T> {
            each(|i| a[i] $op b[i])
        }
    )*};
}

impl<T: Float> Simd<T> for Portable {
    type Vector = Lane<T>;
    #[inline(always)]
    fn splat(self, x: T) -> Lane<T> {
        [x; LANES]
    }
    #[inline(always)]
    fn load(self, from: &Lane<T>) -> Lane<T> {
        *from
    }
    #[inline(always)]
    fn store(self, x: Lane<T>, to: &mut Lane<T>) {
        *to = x;
    }
    each_lane!(add +, sub -, mul *, div /);
    #[inline(always)]
    fn root(self, a: Lane<T>) -> Lane<T> {
        each(|i| a[i].root())
    }
    #[inline(always)]
    fn transpose(self, rows: [Lane<T>; LANES]) -> [Lane<T>; LANES] {
        each(|i| each(|j| rows[j][i]))
    }
}

/// A float type with vectors.
#[cfg(target_arch = "x86_64")]
pub trait Lanes: Sized {
    /// Vectors on a CPU with AVX.
    type Avx: Simd<Self>;
    /// # Safety
    /// The CPU has AVX.
    unsafe fn avx() -> Self::Avx;
}

/// A float type with vectors.
#[cfg(not(target_arch = "x86_64"))]
pub trait Lanes {}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::{LANES, Lanes, Simd};
    use std::arch::x86_64::*;

    /// x86-64 with AVX.
    #[derive(Clone, Copy, Debug)]
    pub struct Avx(());

    macro_rules! lanes {
        ($($t:ty),*) => {$(
            impl Lanes for $t {
                type Avx = Avx;
                #[inline(always)]
                unsafe fn avx() -> Avx {
                    Avx(())
                }
            }
        )*};
    }

    lanes!(f32, f64);

    // Each operation is inlined into a function compiled for AVX, where it is one instruction a register.

    /// Operations on one register of eight `f32`.
    macro_rules! in_one {
        ($($name:ident($($x:ident),+) $f:ident),*) => {$(
            #[inline(always)]
            fn $name(self, $($x: __m256),+) -> __m256 {
                // SAFETY: whoever has an `Avx` found AVX on this CPU.
                unsafe { $f($($x),+) }
            }
        )*};
    }

    /// Operations on two registers of four `f64`.
    macro_rules! in_two {
        ($($name:ident($($x:ident),+) $f:ident),*) => {$(
            #[inline(always)]
            fn $name(self, $($x: Self::Vector),+) -> Self::Vector {
                // SAFETY: whoever has an `Avx` found AVX on this CPU.
                unsafe { ($f($($x.0),+), $f($($x.1),+)) }
            }
        )*};
    }

    /// Transposes four rows.
    #[inline(always)]
    fn four([a, b, c, d]: [__m256d; 4]) -> [__m256d; 4] {
        // SAFETY: called with vectors that an `Avx` loaded.
        unsafe {
            let (ab, ab2) = (_mm256_unpacklo_pd(a, b), _mm256_unpackhi_pd(a, b));
            let (cd, cd2) = (_mm256_unpacklo_pd(c, d), _mm256_unpackhi_pd(c, d));
            [
                _mm256_permute2f128_pd::<0x20>(ab, cd),
                _mm256_permute2f128_pd::<0x20>(ab2, cd2),
                _mm256_permute2f128_pd::<0x31>(ab, cd),
                _mm256_permute2f128_pd::<0x31>(ab2, cd2),
            ]
        }
    }

    impl Simd<f32> for Avx {
        type Vector = __m256;
        #[inline(always)]
        fn splat(self, x: f32) -> __m256 {
            // SAFETY: whoever has an `Avx` found AVX on this CPU.
            unsafe { _mm256_set1_ps(x) }
        }
        #[inline(always)]
        fn load(self, from: &[f32; LANES]) -> __m256 {
            // SAFETY: as above; eight floats, of which no alignment is asked.
            unsafe { _mm256_loadu_ps(from.as_ptr()) }
        }
        #[inline(always)]
        fn store(self, x: __m256, to: &mut [f32; LANES]) {
            // SAFETY: as above.
            unsafe { _mm256_storeu_ps(to.as_mut_ptr(), x) }
        }
        in_one!(add(a, b) _mm256_add_ps, sub(a, b) _mm256_sub_ps, mul(a, b) _mm256_mul_ps,
            div(a, b) _mm256_div_ps);
        in_one!(root(a) _mm256_sqrt_ps);
        #[inline(always)]
        fn transpose(self, [a, b, c, d, e, f, g, h]: [__m256; LANES]) -> [__m256; LANES] {
            // In each half of the registers blocks of four by four, then the halves.
            // SAFETY: as above.
            unsafe {
                let (ab, cd) = (_mm256_unpacklo_ps(a, b), _mm256_unpacklo_ps(c, d));
                let (ef, gh) = (_mm256_unpacklo_ps(e, f), _mm256_unpacklo_ps(g, h));
                let (ab2, cd2) = (_mm256_unpackhi_ps(a, b), _mm256_unpackhi_ps(c, d));
                let (ef2, gh2) = (_mm256_unpackhi_ps(e, f), _mm256_unpackhi_ps(g, h));
                let (p, q) = (_mm256_shuffle_ps::<0x44>(ab, cd), _mm256_shuffle_ps::<0xee>(ab, cd));
                let (r, s) = (_mm256_shuffle_ps::<0x44>(ab2, cd2), _mm256_shuffle_ps::<0xee>(ab2, cd2));
                let (t, u) = (_mm256_shuffle_ps::<0x44>(ef, gh), _mm256_shuffle_ps::<0xee>(ef, gh));
                let (v, w) = (_mm256_shuffle_ps::<0x44>(ef2, gh2), _mm256_shuffle_ps::<0xee>(ef2, gh2));
                [
                    _mm256_permute2f128_ps::<0x20>(p, t),
                    _mm256_permute2f128_ps::<0x20>(q, u),
                    _mm256_permute2f128_ps::<0x20>(r, v),
                    _mm256_permute2f128_ps::<0x20>(s, w),
                    _mm256_permute2f128_ps::<0x31>(p, t),
                    _mm256_permute2f128_ps::<0x31>(q, u),
                    _mm256_permute2f128_ps::<0x31>(r, v),
                    _mm256_permute2f128_ps::<0x31>(s, w),
                ]
            }
        }
    }

    impl Simd<f64> for Avx {
        type Vector = (__m256d, __m256d);
        #[inline(always)]
        fn splat(self, x: f64) -> Self::Vector {
            // SAFETY: as above.
            let four = unsafe { _mm256_set1_pd(x) };
            (four, four)
        }
        #[inline(always)]
        fn load(self, from: &[f64; LANES]) -> Self::Vector {
            // SAFETY: as above; twice four doubles.
            unsafe { (_mm256_loadu_pd(from.as_ptr()), _mm256_loadu_pd(from.as_ptr().add(4))) }
        }
        #[inline(always)]
        fn store(self, x: Self::Vector, to: &mut [f64; LANES]) {
            // SAFETY: as above.
            unsafe {
                _mm256_storeu_pd(to.as_mut_ptr(), x.0);
                _mm256_storeu_pd(to.as_mut_ptr().add(4), x.1);
            }
        }
        in_two!(add(a, b) _mm256_add_pd, sub(a, b) _mm256_sub_pd, mul(a, b) _mm256_mul_pd,
            div(a, b) _mm256_div_pd);
        in_two!(root(a) _mm256_sqrt_pd);
        #[inline(always)]
        fn transpose(self, rows: [Self::Vector; LANES]) -> [Self::Vector; LANES] {
            let [a, b, c, d, e, f, g, h] = rows;
            let (p, q) = (four([a.0, b.0, c.0, d.0]), four([e.0, f.0, g.0, h.0]));
            let (r, s) = (four([a.1, b.1, c.1, d.1]), four([e.1, f.1, g.1, h.1]));
            [
                (p[0], q[0]),
                (p[1], q[1]),
                (p[2], q[2]),
                (p[3], q[3]),
                (r[0], s[0]),
                (r[1], s[1]),
                (r[2], s[2]),
                (r[3], s[3]),
            ]
        }
    }
}

#[cfg(not(target_arch = "x86_64"))]
impl Lanes for f32 {}
#[cfg(not(target_arch = "x86_64"))]
impl Lanes for f64 {}
