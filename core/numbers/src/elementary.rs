//! Elementary functions with the same bits everywhere.
//!
//! The standard library calls the system's C library for these. Its results differ between systems and,
//! in one of a thousand cases, on a CPU without fused multiply-add: glibc has a version for each.
//! Signals use the functions here, which are plain arithmetic. Clippy refuses the standard library's in
//! every crate that makes signals.

use std::ops::Mul;

use num_complex::Complex;

/// The complex number with a size and an angle in rad.
pub fn polar<T: Elementary + Mul<Output = T>>(size: T, angle: T) -> Complex<T> {
    let (sine, cosine) = angle.sine_cosine();
    Complex::new(size * cosine, size * sine)
}

/// The size of a complex number.
pub fn size<T: Elementary>(z: Complex<T>) -> T {
    z.re.hypotenuse(z.im)
}

/// `(cos, sin)` of any finite phase in turns, to 1e-15, by a Taylor series on an eighth of a turn: every
/// machine gives the same bits.
#[inline]
pub fn unit_circle(turns: f64) -> (f64, f64) {
    const COS: [f64; 8] = inverse_factorials(2);
    const SIN: [f64; 8] = inverse_factorials(3);
    let quarters = turns * 4.0;
    // Adding and subtracting 1.5 * 2^52 rounds to the nearest integer and leaves it in the low bits.
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

/// `-1 / n!, 1 / (n + 2)!, -1 / (n + 4)! ..`
const fn inverse_factorials(n: u64) -> [f64; 8] {
    let mut all = [0.0; 8];
    let (mut factorial, mut k, mut i) = (1u64, 1, 0);
    while i < 8 {
        while k < n + 2 * i as u64 {
            k += 1;
            factorial *= k;
        }
        all[i] = (if i % 2 == 0 { -1.0 } else { 1.0 }) / factorial as f64;
        i += 1;
    }
    all
}

macro_rules! elementary {
    ($($(#[$doc:meta])* $name:ident $(($arg:ident))? = $double:path, $single:path;)*) => {
        /// Elementary functions of a real number, each to about one unit in the last place.
        pub trait Elementary: Copy {
            /// Sine and cosine of an angle in rad.
            #[must_use]
            fn sine_cosine(self) -> (Self, Self);
            $($(#[$doc])* #[must_use] fn $name(self $(, $arg: Self)?) -> Self;)*
        }

        impl Elementary for f64 {
            #[inline]
            fn sine_cosine(self) -> (Self, Self) {
                libm::sincos(self)
            }
            $(#[inline] fn $name(self $(, $arg: Self)?) -> Self { $double(self $(, $arg)?) })*
        }

        impl Elementary for f32 {
            #[inline]
            fn sine_cosine(self) -> (Self, Self) {
                libm::sincosf(self)
            }
            $(#[inline] fn $name(self $(, $arg: Self)?) -> Self { $single(self $(, $arg)?) })*
        }
    };
}

elementary! {
    /// Sine of an angle in rad.
    sine = libm::sin, libm::sinf;
    /// Cosine of an angle in rad.
    cosine = libm::cos, libm::cosf;
    /// Tangent of an angle in rad.
    tangent = libm::tan, libm::tanf;
    /// Angle in rad whose sine this is.
    arc_sine = libm::asin, libm::asinf;
    /// Angle in rad whose cosine this is.
    arc_cosine = libm::acos, libm::acosf;
    /// Angle in rad of the point with this ordinate and the abscissa `x`.
    arc_tangent(x) = libm::atan2, libm::atan2f;
    /// Hyperbolic tangent.
    hyperbolic_tangent = libm::tanh, libm::tanhf;
    /// `e` to the power of this.
    exp_e = libm::exp, libm::expf;
    /// 2 to the power of this.
    exp_2 = libm::exp2, libm::exp2f;
    /// `e` to the power of this, less 1; exact near 0.
    exp_less_1 = libm::expm1, libm::expm1f;
    /// Natural logarithm.
    log_e = libm::log, libm::logf;
    /// Natural logarithm of 1 and this; exact near 0.
    log_1_plus = libm::log1p, libm::log1pf;
    /// Logarithm to the base 2.
    log_2 = libm::log2, libm::log2f;
    /// Logarithm to the base 10.
    log_10 = libm::log10, libm::log10f;
    /// This to the power of `y`.
    power(y) = libm::pow, libm::powf;
    /// Length of the hypotenuse over two legs.
    hypotenuse(leg) = libm::hypot, libm::hypotf;
    /// Cube root.
    cube_root = libm::cbrt, libm::cbrtf;
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Both in parts of the last place of the larger.
    fn apart(a: f64, b: f64) -> f64 {
        (a - b).abs() / (a.abs().max(b.abs()) * f64::EPSILON).max(f64::MIN_POSITIVE)
    }

    #[test]
    fn elementary_functions_match_the_c_library() {
        type Pair = (&'static str, fn(f64) -> f64, fn(f64) -> f64);
        let pairs: [Pair; 16] = [
            ("sine", Elementary::sine, f64::sin),
            ("cosine", Elementary::cosine, f64::cos),
            ("sine of both", |x| x.sine_cosine().0, f64::sin),
            ("tangent", Elementary::tangent, f64::tan),
            ("arc sine", |x| (x / 20.0).arc_sine(), |x| (x / 20.0).asin()),
            ("arc cosine", |x| (x / 20.0).arc_cosine(), |x| (x / 20.0).acos()),
            ("arc tangent", |x| x.arc_tangent(0.7), |x| x.atan2(0.7)),
            ("hyperbolic tangent", Elementary::hyperbolic_tangent, f64::tanh),
            ("exp", Elementary::exp_e, f64::exp),
            ("exp 2", Elementary::exp_2, f64::exp2),
            ("exp less 1", Elementary::exp_less_1, f64::exp_m1),
            ("log", |x| x.abs().log_e(), |x| x.abs().ln()),
            ("log 10", |x| x.abs().log_10(), |x| x.abs().log10()),
            ("power", |x| x.abs().power(1.3), |x| x.abs().powf(1.3)),
            ("hypotenuse", |x| x.hypotenuse(0.7), |x| x.hypot(0.7)),
            ("cube root", Elementary::cube_root, f64::cbrt),
        ];
        for i in -4000..4000 {
            let x = f64::from(i) * 0.004_37 + 1e-4;
            for (name, ours, theirs) in pairs {
                let off = apart(ours(x), theirs(x));
                assert!(off <= 2.0, "{name} of {x}: {off} parts of the last place");
            }
        }
        assert!((3.0_f32.power(2.0), 4.0_f32.hypotenuse(3.0), 1000.0_f32.log_10()) == (9.0, 5.0, 3.0));
    }

    #[test]
    fn unit_circle_is_exact_on_quarter_turns() {
        for (turns, want) in [(0.0, (1.0, 0.0)), (0.5, (-1.0, 0.0)), (-0.25, (0.0, -1.0))] {
            assert_eq!(unit_circle(turns), want);
        }
    }
}
