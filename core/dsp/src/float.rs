//! The two sample types.

use crate::lanes::Lanes;
use crate::plans::Plans;
use asperity_state::{Keep, State};
use std::ops::{AddAssign, MulAssign, SubAssign};

/// `f32` or `f64`: what every kernel here is generic over.
pub trait Float: Default + PartialOrd + AddAssign + SubAssign + MulAssign + Keep + Lanes + Plans {
    /// Largest finite value.
    const MAX: Self;
    /// The nearest value to `x`.
    fn of(x: f64) -> Self;
    /// This value, exactly.
    fn f64(self) -> f64;
    /// The nearest value of another width; beyond its range, infinite.
    #[inline]
    #[must_use]
    fn to<U: Float>(self) -> U {
        U::of(self.f64())
    }
    /// Square root.
    #[must_use]
    fn root(self) -> Self;
}

impl Float for f32 {
    const MAX: Self = f32::MAX;
    #[inline]
    #[expect(clippy::cast_possible_truncation, reason = "rounding is what this is for")]
    fn of(x: f64) -> Self {
        x as f32
    }
    #[inline]
    fn f64(self) -> f64 {
        f64::from(self)
    }
    #[inline]
    fn root(self) -> Self {
        self.sqrt()
    }
}

impl Float for f64 {
    const MAX: Self = f64::MAX;
    #[inline]
    fn of(x: f64) -> Self {
        x
    }
    #[inline]
    fn f64(self) -> f64 {
        self
    }
    #[inline]
    fn root(self) -> Self {
        self.sqrt()
    }
}

/// Keeps values in double precision whatever their own, so that a kernel of either width goes on from what one of the other
/// remembers. In single precision a value beyond its range becomes infinite.
pub(crate) fn keep_wide<T: Float>(values: &mut [T], state: &mut State<'_>) {
    let mut len = values.len();
    state.keep(&mut len);
    state.require(len == values.len());
    let mut wide = [0.0; 64];
    for chunk in values.chunks_mut(64) {
        let wide = &mut wide[..chunk.len()];
        for (to, from) in wide.iter_mut().zip(chunk.iter()) {
            *to = from.f64();
        }
        f64::keep_each(wide, state);
        if state.restores() && !state.failed() {
            for (to, from) in chunk.iter_mut().zip(wide) {
                *to = T::of(*from);
            }
        }
    }
}

/// `(cos, sin)` of a phase in turns, any finite value, to 1e-15.
///
/// A Taylor series on an eighth of a turn: no library call, so the same bits on every machine.
#[inline]
pub(crate) fn unit_circle(turns: f64) -> (f64, f64) {
    const COS: [f64; 8] = [
        -1.0 / 2.0,
        1.0 / 24.0,
        -1.0 / 720.0,
        1.0 / 40_320.0,
        -1.0 / 3_628_800.0,
        1.0 / 479_001_600.0,
        -1.0 / 87_178_291_200.0,
        1.0 / 20_922_789_888_000.0,
    ];
    const SIN: [f64; 8] = [
        -1.0 / 6.0,
        1.0 / 120.0,
        -1.0 / 5_040.0,
        1.0 / 362_880.0,
        -1.0 / 39_916_800.0,
        1.0 / 6_227_020_800.0,
        -1.0 / 1_307_674_368_000.0,
        1.0 / 355_687_428_096_000.0,
    ];
    let quarters = turns * 4.0;
    // Adding and taking away 1.5 * 2^52 rounds to the nearest integer and leaves it in the low bits.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    let shifted = quarters + ROUND;
    let x = (quarters - (shifted - ROUND)) * std::f64::consts::FRAC_PI_2;
    let x2 = x * x;
    let series = |c: &[f64; 8]| {
        let x4 = x2 * x2;
        let low = (c[0] + c[1] * x2) + (c[2] + c[3] * x2) * x4;
        let high = (c[4] + c[5] * x2) + (c[6] + c[7] * x2) * x4;
        low + high * (x4 * x4)
    };
    let cos = 1.0 + x2 * series(&COS);
    let sin = x + x * x2 * series(&SIN);
    match shifted.to_bits() & 3 {
        0 => (cos, sin),
        1 => (-sin, cos),
        2 => (-cos, -sin),
        _ => (sin, -cos),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unit_circle_is_the_libm_sine_and_cosine() {
        for i in -4000..4000 {
            let t = f64::from(i) * 0.001_37 + 1e-4;
            let (c, s) = unit_circle(t);
            let (es, ec) = (std::f64::consts::TAU * t).sin_cos();
            assert!((c - ec).abs() < 2e-14 && (s - es).abs() < 2e-14, "{t}");
        }
        assert_eq!(unit_circle(0.0), (1.0, 0.0));
        assert_eq!(unit_circle(0.5), (-1.0, 0.0));
        assert_eq!(unit_circle(-0.25), (0.0, -1.0));
    }
}
