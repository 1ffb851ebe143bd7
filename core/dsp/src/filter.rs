//! Recursive filters of first and second order, designed in the s-domain and run with f64 state.
//!
//! A [`Section`] is a transfer function in s. [`Section::bilinear`] turns it into a [`Biquad`]. Its state is
//! f64 for every sample type: with poles at 20 Hz and a rate of 48 kHz, 1 + a1 + a2 is 7e-6. An f32 state
//! would leave two digits of the pass band.
use asperity_numbers::{Elementary as _, polar};
use asperity_state::State;
use std::f64::consts::{FRAC_1_SQRT_2, PI, TAU};

pub use crate::Refused as FilterError;
use crate::refuse;

pub use num_complex::Complex64;

/// Sample type of a filter. The arithmetic in between is f64.
pub trait Sample: Copy {
    /// Converts to f64, exactly.
    fn widen(self) -> f64;
    /// Converts from f64. A finite value beyond the type's range becomes its largest finite value.
    fn narrow(x: f64) -> Self;
}

impl Sample for f64 {
    fn widen(self) -> f64 {
        self
    }
    fn narrow(x: f64) -> Self {
        x
    }
}

impl Sample for f32 {
    fn widen(self) -> f64 {
        f64::from(self)
    }
    fn narrow(x: f64) -> Self {
        if x.is_finite() { x.clamp(f64::from(f32::MIN), f64::from(f32::MAX)) as f32 } else { x as f32 }
    }
}

/// A transfer function `(n0 s^2 + n1 s + n2) / (d0 s^2 + d1 s + d2)` in s \[rad/s\], highest power first.
///
/// `d0 = 0` is a section of first order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Section {
    /// Numerator, highest power first.
    pub num: [f64; 3],
    /// Denominator, highest power first.
    pub den: [f64; 3],
}

impl Section {
    /// A second-order Butterworth low-pass; its gain at `cutoff_hz` is -3.01 dB.
    pub fn butterworth_low_pass(cutoff_hz: f64) -> Self {
        Self::low_pass(cutoff_hz, FRAC_1_SQRT_2)
    }

    /// A second-order low-pass `w^2 / (s^2 + 2 zeta w s + w^2)` with gain 1 at DC.
    pub fn low_pass(cutoff_hz: f64, zeta: f64) -> Self {
        let w = TAU * cutoff_hz;
        Self { num: [0.0, 0.0, w * w], den: [1.0, 2.0 * zeta * w, w * w] }
    }

    /// A second-order high-pass `s^2 / (s^2 + 2 zeta w s + w^2)` with gain 1 at the top.
    pub fn high_pass(cutoff_hz: f64, zeta: f64) -> Self {
        let w = TAU * cutoff_hz;
        Self { num: [1.0, 0.0, 0.0], den: [1.0, 2.0 * zeta * w, w * w] }
    }

    /// Multiplies the numerator by `gain`.
    #[must_use]
    pub fn scaled(self, gain: f64) -> Self {
        Self { num: self.num.map(|n| n * gain), den: self.den }
    }

    /// Frequency response H(j 2 pi hz) in continuous time.
    pub fn response(&self, hz: f64) -> Complex64 {
        let s = Complex64::new(0.0, TAU * hz);
        let at = |p: [f64; 3]| (s * p[0] + p[1]) * s + p[2];
        at(self.num) / at(self.den)
    }

    /// Applies the bilinear transform `s = c (z - 1) / (z + 1)`, `c = w / tan(w / 2 rate)`, `w = 2 pi
    /// exact_hz`: at `exact_hz` the discrete filter has the gain and phase of the continuous one. With 0 only
    /// DC is exact.
    ///
    /// # Errors
    /// Values that are not finite, `exact_hz` outside 0 to half the rate, an improper or unstable section.
    pub fn bilinear(&self, rate_hz: f64, exact_hz: f64) -> Result<Biquad, FilterError> {
        let finite = self.num.iter().chain(&self.den).chain([&rate_hz, &exact_hz]).all(|x| x.is_finite());
        if !finite || rate_hz <= 0.0 {
            return refuse("a filter needs finite coefficients and a positive rate");
        }
        if !(0.0..rate_hz / 2.0).contains(&exact_hz) {
            return refuse(format!("{exact_hz} Hz is not between 0 and half the rate of {rate_hz} Hz"));
        }
        // Second order is stable when all coefficients have one sign.
        let [d0, d1, d2] = self.den;
        let stable = if d0 == 0.0 { d1 * d2 > 0.0 } else { d0 * d1 > 0.0 && d0 * d2 > 0.0 };
        if d0 == 0.0 && self.num[0] != 0.0 {
            return refuse("the numerator's order is above the denominator's");
        }
        if !stable {
            return refuse("a pole is not in the left half plane");
        }
        let c = if exact_hz == 0.0 {
            2.0 * rate_hz
        } else {
            TAU * exact_hz / (PI * exact_hz / rate_hz).tangent()
        };
        // A first-order section must not get the pole and zero at z = -1 of the general form.
        let map = |[p, q, r]: [f64; 3]| {
            if d0 == 0.0 {
                [q * c + r, r - q * c, 0.0]
            } else {
                [(p * c + q) * c + r, 2.0 * (r - p * c * c), (p * c - q) * c + r]
            }
        };
        let (b, a) = (map(self.num), map(self.den));
        Biquad::new(b.map(|x| x / a[0]), [a[1] / a[0], a[2] / a[0]])
    }
}

/// A filter `(b0 + b1 z^-1 + b2 z^-2) / (1 + a1 z^-1 + a2 z^-2)`, transposed direct form II, f64 state.
///
/// ```
/// use asperity_dsp::filter::Section;
/// # fn main() -> Result<(), asperity_dsp::filter::FilterError> {
/// let mut smooth = Section::butterworth_low_pass(20.0).bilinear(500.0, 20.0)?;
/// let first = smooth.step(1.0);
/// assert!((first - 0.013359200027856505).abs() < 1e-15);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Biquad {
    b: [f64; 3],
    a: [f64; 2],
    s: [f64; 2],
}

/// State below this is set to 0. It is far below any signal and far above the denormals of f32 and f64.
const TINY: f64 = 1e-30;

impl Biquad {
    /// Makes a filter from its coefficients, with a0 = 1.
    ///
    /// # Errors
    /// Coefficients that are not finite, or a pole on or outside the unit circle.
    pub fn new(b: [f64; 3], a: [f64; 2]) -> Result<Self, FilterError> {
        if !b.iter().chain(&a).all(|x| x.is_finite()) {
            return refuse("a filter needs finite coefficients and a positive rate");
        }
        // The stability triangle of a second-order section.
        if !(a[1].abs() < 1.0 && a[0].abs() < 1.0 + a[1]) {
            return refuse("a pole is not within the unit circle");
        }
        Ok(Self { b, a, s: [0.0; 2] })
    }

    /// Numerator coefficients b0, b1, b2.
    pub fn numerator(&self) -> [f64; 3] {
        self.b
    }

    /// Denominator coefficients a1, a2; a0 is 1.
    pub fn denominator(&self) -> [f64; 2] {
        self.a
    }

    /// Filters one sample. The caller also calls [`Biquad::settle`] once a tick; [`Biquad::process`]
    /// does so itself.
    #[inline(always)]
    pub fn step(&mut self, x: f64) -> f64 {
        let y = self.b[0] * x + self.s[0];
        self.s[0] = self.b[1] * x - self.a[0] * y + self.s[1];
        self.s[1] = self.b[2] * x - self.a[1] * y;
        y
    }

    /// Filters `input` into `output`, up to the length of the shorter one. The length of blocks changes
    /// no sample. A sample that is not finite counts as 0.
    pub fn process<T: Sample>(&mut self, input: &[T], output: &mut [T]) {
        self.run(input.iter().zip(output).map(|(x, y)| (*x, y)));
    }

    /// Filters a block in place; see [`Biquad::process`].
    pub fn process_in_place<T: Sample>(&mut self, samples: &mut [T]) {
        self.run(samples.iter_mut().map(|x| (*x, x)));
    }

    fn run<'a, T: Sample + 'a>(&mut self, samples: impl Iterator<Item = (T, &'a mut T)>) {
        let mut run = *self;
        for (x, y) in samples {
            let x = x.widen();
            *y = T::narrow(run.step(if x.is_finite() { x } else { 0.0 }));
        }
        self.s = run.s;
        self.settle();
    }

    /// Sets a decayed state to 0 before it becomes denormal, and resets a state that is not finite.
    /// Returns false when the state was not finite.
    #[inline]
    pub fn settle(&mut self) -> bool {
        let [p, q] = self.s;
        if !(p.is_finite() && q.is_finite()) {
            self.reset();
            return false;
        }
        if p.abs() < TINY && q.abs() < TINY {
            self.reset();
        }
        true
    }

    /// Whether the state is exactly 0, so that an input of zeros gives zeros.
    pub fn is_at_rest(&self) -> bool {
        self.s.iter().all(|s| s.to_bits() == 0)
    }

    /// Sets the state to 0.
    pub fn reset(&mut self) {
        self.s = [0.0; 2];
    }

    /// Saves or restores the state. A filter with other coefficients can continue from it; its output
    /// then has a transient.
    pub fn state(&mut self, state: &mut State<'_>) {
        state.keep(&mut self.s);
        if state.restores() {
            let finite = self.settle();
            state.require(finite);
        }
    }

    /// Sets the state to that of a constant input `x`, so that no transient follows.
    pub fn reset_to(&mut self, x: f64) {
        let y = x * self.dc_gain();
        self.s[1] = self.b[2] * x - self.a[1] * y;
        self.s[0] = self.b[1] * x - self.a[0] * y + self.s[1];
        self.settle();
    }

    /// Gain for constant input.
    pub fn dc_gain(&self) -> f64 {
        self.b.iter().sum::<f64>() / (1.0 + self.a[0] + self.a[1])
    }

    /// Frequency response H(e^(j 2 pi hz / rate)).
    pub fn response(&self, hz: f64, rate_hz: f64) -> Complex64 {
        let z1 = polar(1.0, -TAU * hz / rate_hz);
        let num = (z1 * self.b[2] + self.b[1]) * z1 + self.b[0];
        num / ((z1 * self.a[1] + self.a[0]) * z1 + 1.0)
    }

    /// Group delay at DC in samples. It is not finite for a filter that passes no DC.
    ///
    /// -d(phase)/dw at w = 0 is `sum k b_k / sum b_k - sum k a_k / sum a_k`.
    pub fn dc_group_delay(&self) -> f64 {
        let ([b0, b1, b2], [a1, a2]) = (self.b, self.a);
        (b1 + 2.0 * b2) / (b0 + b1 + b2) - (a1 + 2.0 * a2) / (1.0 + a1 + a2)
    }
}

#[cfg(test)]
#[path = "filter_tests.rs"]
mod tests;
