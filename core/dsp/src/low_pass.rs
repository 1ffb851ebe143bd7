//! A low-pass whose corner may change from sample to sample.

use asperity_numbers::Elementary as _;
use std::f64::consts::{PI, SQRT_2};

use asperity_state::State;

/// State below this is set to 0. It is far below any signal and far above denormal numbers.
const TINY: f64 = 1e-30;

/// A second-order Butterworth low-pass in state-variable form (Zavalishin, The Art of VA Filter Design, 2018,
/// chapter 4). At a fixed corner it is the bilinear transform of the analog filter, exact at the corner.
///
/// Its state is the output and the output's slope, independent of the corner. So a constant input stays
/// constant while the corner moves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LowPass {
    /// Slope of the output over the corner, and the output.
    state: [f64; 2],
}

/// Corner argument `tan(pi hz / rate)` of [`LowPass::step`], with the corner limited to 0.499 of the rate.
#[inline]
pub fn corner(hz: f64, rate_hz: f64) -> f64 {
    (PI * (hz / rate_hz).min(0.499)).tangent()
}

/// Corner \[Hz\] of a velocity low-pass that opens with speed: smooth for slow motion, prompt for fast motion
/// (after the 1 euro filter of Casiez, Roussel and Vogel, CHI 2012). From `cutoff_hz` at rest each mm/s adds
/// `hz_per_mm_s`, summed in squares, up to a tenth of the rate: a position that is read a tick late then
/// changes the speed by `2 pi / 10 e^(-pi/4)` of it, 29 %.
#[inline]
pub fn opened_hz(cutoff_hz: f64, hz_per_mm_s: f64, speed_mm_s: f64, rate_hz: f64) -> f64 {
    cutoff_hz.hypotenuse(hz_per_mm_s * speed_mm_s).min(rate_hz / 10.0).max(cutoff_hz)
}

impl LowPass {
    /// Filters one sample. The caller also calls [`LowPass::settle`] now and then.
    #[inline(always)]
    pub fn step(&mut self, x: f64, corner: f64) -> f64 {
        let [slope, level] = self.state;
        let mid = (slope + corner * (x - level)) / (1.0 + corner * (corner + SQRT_2));
        let y = level + corner * mid;
        self.state = [2.0 * mid - slope, 2.0 * y - level];
        y
    }

    /// Filters `steps` equal samples at the cost of a few, up to rounding: multiplies the distance of the
    /// state from its limit by a power of the filter's matrix, by repeated squaring.
    pub fn hold(&mut self, x: f64, corner: f64, steps: u64) {
        let column = |state: [f64; 2]| {
            let mut of = Self { state };
            of.step(0.0, corner);
            of.state
        };
        let ([p, r], [q, t]) = (column([1.0, 0.0]), column([0.0, 1.0]));
        let mut power = [[p, q], [r, t]];
        let mut apart = [self.state[0], self.state[1] - x];
        let mut left = steps;
        while left > 0 {
            let [[p, q], [r, t]] = power;
            if left % 2 == 1 {
                apart = [p * apart[0] + q * apart[1], r * apart[0] + t * apart[1]];
            }
            power = [[p * p + q * r, q * (p + t)], [r * (p + t), q * r + t * t]];
            left /= 2;
        }
        if steps > 0 {
            self.state = [apart[0], apart[1] + x];
        }
    }

    /// Sets a decayed state to 0 before it becomes denormal, and resets a state that is not finite.
    /// Returns false when the state was not finite.
    pub fn settle(&mut self) -> bool {
        let finite = self.state.iter().all(|s| s.is_finite());
        if !finite {
            *self = Self::default();
        }
        self.settle_below(TINY);
        finite
    }

    /// Sets a state below `least` to 0, for a slow filter whose input is at rest.
    pub fn settle_below(&mut self, least: f64) {
        if self.state.iter().all(|s| s.abs() < least) {
            *self = Self::default();
        }
    }

    /// Sets the state to that of a constant input `x`.
    pub fn reset_to(&mut self, x: f64) {
        self.state = [0.0, x];
        self.settle();
    }

    /// Saves or restores the state. A filter of another corner can continue from it.
    pub fn state(&mut self, state: &mut State<'_>) {
        state.keep(&mut self.state);
        if state.restores() {
            let finite = self.settle();
            state.require(finite);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::filter::Section;

    const RATE_HZ: f64 = 500.0;

    #[test]
    fn low_pass_at_a_fixed_corner_is_bilinear() {
        for hz in [0.5, 20.0, 80.0, 220.0] {
            let mut other = Section::butterworth_low_pass(hz).bilinear(RATE_HZ, hz).unwrap();
            let mut it = LowPass::default();
            for n in 0..400 {
                let x = f64::from(n * n % 17) - 8.0;
                let (a, b) = (it.step(x, corner(hz, RATE_HZ)), other.step(x));
                assert!((a - b).abs() < 1e-12, "{hz} Hz, sample {n}: {a} {b}");
            }
        }
    }

    #[test]
    fn constant_stays_constant_while_the_corner_moves() {
        let mut it = LowPass::default();
        it.reset_to(3.0);
        for n in 0..1000 {
            let y = it.step(3.0, corner(1.0 + f64::from(n * 37 % 211), RATE_HZ));
            assert!((y - 3.0).abs() < 1e-12, "{y}");
        }
    }

    #[test]
    fn corner_opens_to_a_tenth_of_the_rate() {
        let opened = |speed| opened_hz(20.0, 1.0, speed, RATE_HZ);
        assert_eq!([opened(0.0), opened(15.0), opened(48.0), opened(300.0)], [20.0, 25.0, 50.0, 50.0]);
        assert_eq!(opened_hz(80.0, 1.0, 300.0, RATE_HZ), 80.0);
        assert_eq!(opened_hz(20.0, 0.0, 300.0, RATE_HZ), 20.0);
    }

    #[test]
    fn held_input_equals_as_many_steps() {
        for hz in [0.01, 1.0, 20.0, 220.0] {
            let at = corner(hz, RATE_HZ);
            for steps in [0, 1, 2, 7, 64, 500, 12_345] {
                let mut stepped = LowPass { state: [40.0, -7.0] };
                let mut held = stepped;
                (0..steps).for_each(|_| _ = stepped.step(2.0, at));
                held.hold(2.0, at, steps);
                for (a, b) in stepped.state.iter().zip(held.state) {
                    assert!((a - b).abs() < 1e-9, "{hz} Hz, {steps}: {a} {b}");
                }
            }
            // Nor does it end, or leave the numbers.
            let mut held = LowPass { state: [40.0, -7.0] };
            held.hold(3.0, at, u64::MAX);
            assert!((held.step(3.0, at) - 3.0).abs() < 1e-9);
        }
    }

    #[test]
    fn state_that_is_not_finite_is_reset_and_a_tail_ends() {
        let mut it = LowPass::default();
        it.step(f64::NAN, corner(20.0, RATE_HZ));
        assert!(!it.settle());
        assert_eq!(it, LowPass::default());
        it.reset_to(1.0);
        for _ in 0..1000 {
            it.step(0.0, corner(20.0, RATE_HZ));
            it.settle();
        }
        assert_eq!(it, LowPass::default());
    }
}
