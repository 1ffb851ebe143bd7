//! Single and double precision.

use crate::Complex;
use crate::lanes::Lanes;
use crate::sample_commit::Project;
use asperity_fft::Real;
use asperity_numbers::{Elementary as _, unit_circle};
use asperity_state::{Keep, State};
use std::ops::{AddAssign, MulAssign, SubAssign};

/// Sample type of all kernels: `f32` or `f64`.
pub trait Float:
    Default + PartialOrd + AddAssign + SubAssign + MulAssign + Keep + Lanes + Project + Real
{
    /// Largest finite value.
    const MAX: Self;
    /// The nearest value to `x`.
    fn of(x: f64) -> Self;
    /// This value, exactly.
    fn f64(self) -> f64;
    /// Converts to the nearest value of another type; beyond its range that is infinite.
    #[must_use]
    fn to<U: Float>(self) -> U {
        U::of(self.f64())
    }
    /// Whether it is neither NaN nor infinite.
    #[inline]
    fn finite(self) -> bool {
        self >= -Self::MAX && self <= Self::MAX
    }
    /// The nearest value from `-most` to `most`; NaN stays NaN.
    #[inline]
    #[must_use]
    fn limited(self, most: Self) -> Self {
        if self > most {
            most
        } else if self < -most {
            -most
        } else {
            self
        }
    }
    /// Square root.
    #[must_use]
    fn root(self) -> Self;
    /// Natural logarithm of a positive normal number, to a few units in the last place.
    #[must_use]
    fn natural_log(self) -> Self;
    /// Exponential function, to a few units in the last place, of an argument clamped to -80 .. 80.
    #[must_use]
    fn exponential(self) -> Self;
    /// Cosine and sine of a phase in rad, up to some hundred turns, to a few units in the last place of 1.
    #[must_use]
    fn cos_sin(self) -> (Self, Self);
}

impl Float for f32 {
    const MAX: Self = f32::MAX;
    #[inline]
    #[expect(clippy::cast_possible_truncation, reason = "the conversion rounds on purpose")]
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
    /// `ln m` is the series of `2 artanh((m - 1) / (m + 1))`, plain arithmetic that is vectorised.
    #[inline]
    fn natural_log(self) -> Self {
        // Chooses the exponent so that the rest lies between sqrt(1/2) and sqrt(2).
        let shifted = self.to_bits().wrapping_sub(std::f32::consts::FRAC_1_SQRT_2.to_bits());
        let exponent = (shifted as i32) >> 23;
        let m = f32::from_bits(self.to_bits().wrapping_sub((exponent as u32) << 23));
        let s = (m - 1.0) / (m + 1.0);
        let s2 = s * s;
        let series = 2.0 + s2 * (2.0 / 3.0 + s2 * (2.0 / 5.0 + s2 * (2.0 / 7.0 + s2 * (2.0 / 9.0))));
        exponent as f32 * std::f32::consts::LN_2 + s * series
    }
    /// Computes `2^n e^x` with `|x| < ln(2) / 2`, by Taylor's series.
    #[inline]
    fn exponential(self) -> Self {
        // Adding and subtracting 1.5 * 2^23 rounds to the nearest integer and leaves it in the low bits.
        const ROUND: f32 = 12_582_912.0;
        let held = self.clamp(-80.0, 80.0);
        let shifted = held * std::f32::consts::LOG2_E + ROUND;
        let n = shifted - ROUND;
        // ln 2 in two parts; the first times n is exact.
        let x = (held - n * 0.693_359_4) - n * -2.121_944_4e-4;
        let series = 1.0 / 6.0 + x * (1.0 / 24.0 + x * (1.0 / 120.0 + x * (1.0 / 720.0 + x / 5040.0)));
        let series = 1.0 + x * (1.0 + x * (0.5 + x * series));
        f32::from_bits(series.to_bits().wrapping_add((shifted.to_bits() << 23) & 0xff80_0000))
    }
    /// Evaluates Taylor's series on an eighth of a turn, without a branch.
    #[inline]
    fn cos_sin(self) -> (Self, Self) {
        // As in `exponential`.
        const ROUND: f32 = 12_582_912.0;
        let shifted = self * std::f32::consts::FRAC_2_PI + ROUND;
        let quarters = shifted - ROUND;
        // A quarter of a turn in two parts; the first times `quarters` is exact.
        let x = (self - quarters * 1.570_312_5) - quarters * 4.838_268e-4;
        let x2 = x * x;
        let cos = 1.0 + x2 * (-0.5 + x2 * (1.0 / 24.0 + x2 * (-1.0 / 720.0 + x2 / 40_320.0)));
        let sin = x + x * x2 * (-1.0 / 6.0 + x2 * (1.0 / 120.0 + x2 * (-1.0 / 5040.0)));
        let quarter = shifted.to_bits();
        let (a, b) = if quarter & 1 == 0 { (cos, sin) } else { (sin, cos) };
        // The cosine is negative in quarters 1 and 2, the sine in 2 and 3.
        let cos_sign = ((quarter >> 1) ^ quarter) & 1;
        let sin_sign = (quarter >> 1) & 1;
        (f32::from_bits(a.to_bits() ^ (cos_sign << 31)), f32::from_bits(b.to_bits() ^ (sin_sign << 31)))
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
    #[inline]
    fn natural_log(self) -> Self {
        self.log_e()
    }
    #[inline]
    fn exponential(self) -> Self {
        self.clamp(-80.0, 80.0).exp_e()
    }
    #[inline]
    fn cos_sin(self) -> (Self, Self) {
        unit_circle(self * (0.5 * std::f64::consts::FRAC_1_PI))
    }
}

/// Keeps values in double precision, so that a kernel of either precision continues from the other's state.
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

/// `e^(2 pi i turns)`.
#[inline]
pub(crate) fn phasor<T: Float>(turns: f64) -> Complex<T> {
    let (cos, sin) = unit_circle(turns);
    Complex::new(T::of(cos), T::of(sin))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn single_logarithm_and_exponential_match_libm() {
        for i in -20_000..20_000 {
            let x = i as f32 * 0.003_9;
            let off = (x.exponential() / x.exp() - 1.0).abs();
            assert!(off < 4e-7 * (1.0 + x.abs() * 0.3), "exp {x}: {off}");
            let y = x.exp();
            let off = (y.natural_log() - y.ln()).abs();
            assert!(off <= 2e-7 * y.ln().abs().max(1.0), "ln {y}: {off}");
        }
        assert_eq!((1.0_f32.natural_log(), 0.0_f32.exponential()), (0.0, 1.0));
    }

    #[test]
    fn cosine_and_sine_match_libm_in_both_widths() {
        for i in -40_000..40_000 {
            let x = f64::from(i) * 0.001_37 + 1e-4;
            let (c, s) = x.cos_sin();
            assert!((c - x.cos()).abs() < 2e-14 && (s - x.sin()).abs() < 2e-14, "{x}");
            let narrow = x as f32;
            let (c, s) = narrow.cos_sin();
            let off = (f64::from(c) - f64::from(narrow).cos()).abs();
            let off = off.max((f64::from(s) - f64::from(narrow).sin()).abs());
            assert!(off < 5e-6, "{x}: {off}");
        }
    }
}
