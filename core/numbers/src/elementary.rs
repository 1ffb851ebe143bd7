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

/// Elementary functions of a real number, each to about one unit in the last place.
pub trait Elementary: Copy {
    /// Sine of an angle in rad.
    #[must_use]
    fn sine(self) -> Self;
    /// Cosine of an angle in rad.
    #[must_use]
    fn cosine(self) -> Self;
    /// Sine and cosine of an angle in rad.
    #[must_use]
    fn sine_cosine(self) -> (Self, Self);
    /// Tangent of an angle in rad.
    #[must_use]
    fn tangent(self) -> Self;
    /// Angle in rad whose sine this is.
    #[must_use]
    fn arc_sine(self) -> Self;
    /// Angle in rad whose cosine this is.
    #[must_use]
    fn arc_cosine(self) -> Self;
    /// Angle in rad of the point with this ordinate and the abscissa `x`.
    #[must_use]
    fn arc_tangent(self, x: Self) -> Self;
    /// Hyperbolic tangent.
    #[must_use]
    fn hyperbolic_tangent(self) -> Self;
    /// `e` to the power of this.
    #[must_use]
    fn exp_e(self) -> Self;
    /// 2 to the power of this.
    #[must_use]
    fn exp_2(self) -> Self;
    /// `e` to the power of this, less 1; exact near 0.
    #[must_use]
    fn exp_less_1(self) -> Self;
    /// Natural logarithm.
    #[must_use]
    fn log_e(self) -> Self;
    /// Natural logarithm of 1 and this; exact near 0.
    #[must_use]
    fn log_1_plus(self) -> Self;
    /// Logarithm to the base 2.
    #[must_use]
    fn log_2(self) -> Self;
    /// Logarithm to the base 10.
    #[must_use]
    fn log_10(self) -> Self;
    /// This to the power of `y`.
    #[must_use]
    fn power(self, y: Self) -> Self;
    /// Length of the hypotenuse over two legs.
    #[must_use]
    fn hypotenuse(self, leg: Self) -> Self;
    /// Cube root.
    #[must_use]
    fn cube_root(self) -> Self;
}

macro_rules! elementary {
    ($t:ty { $($name:ident $(($arg:ident))? = $f:path),* $(,)? } $both:path) => {
        impl Elementary for $t {
            $(#[inline]
            fn $name(self $(, $arg: Self)?) -> Self {
                $f(self $(, $arg)?)
            })*
            #[inline]
            fn sine_cosine(self) -> (Self, Self) {
                $both(self)
            }
        }
    };
}

elementary!(f64 {
    sine = libm::sin,
    cosine = libm::cos,
    tangent = libm::tan,
    arc_sine = libm::asin,
    arc_cosine = libm::acos,
    arc_tangent(x) = libm::atan2,
    hyperbolic_tangent = libm::tanh,
    exp_e = libm::exp,
    exp_2 = libm::exp2,
    exp_less_1 = libm::expm1,
    log_e = libm::log,
    log_1_plus = libm::log1p,
    log_2 = libm::log2,
    log_10 = libm::log10,
    power(y) = libm::pow,
    hypotenuse(leg) = libm::hypot,
    cube_root = libm::cbrt,
} libm::sincos);

elementary!(f32 {
    sine = libm::sinf,
    cosine = libm::cosf,
    tangent = libm::tanf,
    arc_sine = libm::asinf,
    arc_cosine = libm::acosf,
    arc_tangent(x) = libm::atan2f,
    hyperbolic_tangent = libm::tanhf,
    exp_e = libm::expf,
    exp_2 = libm::exp2f,
    exp_less_1 = libm::expm1f,
    log_e = libm::logf,
    log_1_plus = libm::log1pf,
    log_2 = libm::log2f,
    log_10 = libm::log10f,
    power(y) = libm::powf,
    hypotenuse(leg) = libm::hypotf,
    cube_root = libm::cbrtf,
} libm::sincosf);

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
}
