//! Psychometric functions.

use std::f64::consts::{FRAC_1_SQRT_2, LN_10, PI};

use asperity_numbers::Elementary;
use serde::{Deserialize, Serialize};

use crate::{require, root};

/// Shape of a psychometric function, as a distribution function F of z (Wichmann and Hill 2001).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Shape {
    /// F = 1 - exp(-exp(z)) (Weibull 1951). z is the slope times the natural logarithm of level over
    /// threshold. F is 63.2 % at the threshold.
    Weibull,
    /// F = 1 / (1 + exp(-z)). z is the slope times the level less the threshold. F is 50 % there.
    Logistic,
    /// F is the normal distribution function of z: the slope, which is one over the standard deviation,
    /// times the level less the threshold. F is 50 % there.
    Gaussian,
}

/// Unit in which stimulus levels are given.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Axis {
    /// The quantity itself, for instance in mm or N.
    Linear,
    /// Logarithm of the quantity to the base 10.
    Log10,
    /// Twenty times the logarithm of the quantity to the base 10 \[dB\].
    Decibel,
}

/// A psychometric function: p(level) = guess + (1 - guess - lapse) F(level).
///
/// A field that does not fit may make results NaN. [`check`](Self::check) names it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Function {
    /// Shape of F.
    pub shape: Shape,
    /// Unit of levels.
    pub axis: Axis,
    /// Level of the threshold; above 0 for a Weibull function on a linear axis.
    pub threshold: f64,
    /// Steepness, above 0. A Weibull function's has no unit; the others' is in one over the unit of levels.
    pub slope: f64,
    /// Probability of a correct answer without a stimulus, 0 to 1: 1/n with n alternatives.
    pub guess: f64,
    /// Probability of a wrong answer to the strongest stimulus, 0 to 1; guess and lapse sum to less than 1.
    pub lapse: f64,
}

impl Axis {
    /// Quantity of a level.
    pub fn quantity(self, level: f64) -> f64 {
        match self {
            Self::Linear => level,
            Self::Log10 => 10.0.power(level),
            Self::Decibel => 10.0.power(level / 20.0),
        }
    }

    /// Level of a quantity. A logarithm of 0 is minus infinity, of a negative quantity NaN.
    pub fn level(self, quantity: f64) -> f64 {
        match self {
            Self::Linear => quantity,
            Self::Log10 => quantity.log_10(),
            Self::Decibel => 20.0 * quantity.log_10(),
        }
    }
}

impl Shape {
    /// F and 1 - F, each to full precision.
    pub(crate) fn distribution(self, z: f64) -> [f64; 2] {
        match self {
            Self::Weibull => {
                let minus = -z.exp_e();
                [-minus.exp_less_1(), minus.exp_e()]
            }
            Self::Logistic => [1.0 / (1.0 + (-z).exp_e()), 1.0 / (1.0 + z.exp_e())],
            Self::Gaussian => [-z, z].map(|z| libm::erfc(z * FRAC_1_SQRT_2) / 2.0),
        }
    }

    /// Derivative of F.
    pub(crate) fn density(self, z: f64) -> f64 {
        match self {
            Self::Weibull => (z - z.exp_e()).exp_e(),
            Self::Logistic => self.distribution(z).iter().product(),
            Self::Gaussian => (-z * z / 2.0).exp_e() / (2.0 * PI).sqrt(),
        }
    }

    /// z where F has a value between 0 and 1.
    pub(crate) fn quantile(self, f: f64) -> f64 {
        match self {
            Self::Weibull => (-(-f).log_1_plus()).log_e(),
            Self::Logistic => f.log_e() - (-f).log_1_plus(),
            Self::Gaussian => root(-40.0, 40.0, |z| self.distribution(z)[0] - f),
        }
    }

    /// Coordinate of a level; z is the slope times the difference of two.
    pub(crate) fn coordinate(self, axis: Axis, level: f64) -> f64 {
        match (self, axis) {
            (Self::Weibull, Axis::Linear) => level.max(0.0).log_e(),
            (Self::Weibull, Axis::Log10) => level * LN_10,
            (Self::Weibull, Axis::Decibel) => level * (LN_10 / 20.0),
            _ => level,
        }
    }

    /// Level of a coordinate.
    pub(crate) fn level(self, axis: Axis, coordinate: f64) -> f64 {
        match (self, axis) {
            (Self::Weibull, Axis::Linear) => coordinate.exp_e(),
            (Self::Weibull, Axis::Log10) => coordinate / LN_10,
            (Self::Weibull, Axis::Decibel) => coordinate / (LN_10 / 20.0),
            _ => coordinate,
        }
    }
}

impl Function {
    /// An error names the first field that does not fit, and a value that does.
    pub fn check(&self) -> Result<(), String> {
        let Self { shape, axis, threshold, slope, guess, lapse } = *self;
        require(threshold.is_finite(), "threshold", threshold, "a finite number")?;
        let positive = threshold > 0.0 || (shape, axis) != (Shape::Weibull, Axis::Linear);
        require(positive, "threshold", threshold, "a number above 0, for instance 1, or levels in decibels")?;
        require(slope > 0.0 && slope.is_finite(), "slope", slope, "a number above 0, for instance 3.5")?;
        require((0.0..1.0).contains(&guess), "guess", guess, "0 or more and less than 1, for instance 0.5")?;
        require(
            lapse >= 0.0 && guess + lapse < 1.0,
            "lapse",
            lapse,
            "0 or more and less than 1 - `guess`, as 0.02",
        )
    }

    /// Probability of a correct answer at a level, 0 to 1.
    pub fn probability(&self, level: f64) -> f64 {
        self.probabilities(level)[0]
    }

    /// Probabilities of a correct and of a wrong answer, each to full precision.
    pub(crate) fn probabilities(&self, level: f64) -> [f64; 2] {
        let of = |level| self.shape.coordinate(self.axis, level);
        let [f, rest] = self.shape.distribution(self.slope * (of(level) - of(self.threshold)));
        let span = 1.0 - self.guess - self.lapse;
        [self.guess + span * f, self.lapse + span * rest]
    }

    /// Level with a probability of a correct answer. None unless it is above `guess` and below 1 - `lapse`.
    pub fn level_at(&self, probability: f64) -> Option<f64> {
        let f = (probability - self.guess) / (1.0 - self.guess - self.lapse);
        (f > 0.0 && f < 1.0).then(|| self.level_of(f))
    }

    /// Level where F has a value between 0 and 1.
    fn level_of(&self, f: f64) -> f64 {
        let middle = self.shape.coordinate(self.axis, self.threshold);
        self.shape.level(self.axis, middle + self.shape.quantile(f) / self.slope)
    }

    /// Point of subjective equality: the level where F is 50 %, free of guesses and lapses.
    pub fn pse(&self) -> f64 {
        self.level_of(0.5)
    }

    /// Just noticeable difference: half the distance between the levels where F is 25 % and 75 %.
    pub fn jnd(&self) -> f64 {
        (self.level_of(0.75) - self.level_of(0.25)) / 2.0
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const YES_NO: Function = Function {
        shape: Shape::Gaussian,
        axis: Axis::Linear,
        threshold: 2.0,
        slope: 0.5,
        guess: 0.0,
        lapse: 0.0,
    };

    #[test]
    fn jnd_is_0_6745_deviations_or_log_3_over_slope() {
        let logistic = Function { shape: Shape::Logistic, ..YES_NO };
        assert!((logistic.jnd() - 3.0_f64.ln() / 0.5).abs() < 1e-12, "{}", logistic.jnd());
        assert!((YES_NO.pse() - 2.0).abs() < 1e-12, "{}", YES_NO.pse());
        assert!((YES_NO.jnd() - 0.674_489_750_196_081_7 * 2.0).abs() < 1e-12, "{}", YES_NO.jnd());
    }

    #[test]
    fn weibull_is_the_same_on_every_axis() {
        let on = |axis: Axis| Function { shape: Shape::Weibull, axis, threshold: axis.level(0.3), ..YES_NO };
        for quantity in [1e-3, 0.2, 0.3, 5.0] {
            let linear = 1.0 - (-(quantity / 0.3_f64).powf(0.5)).exp();
            for axis in [Axis::Linear, Axis::Log10, Axis::Decibel] {
                let p = on(axis).probability(axis.level(quantity));
                assert!((p - linear).abs() < 1e-14, "{axis:?} {quantity}: {p} {linear}");
                assert!((axis.quantity(axis.level(quantity)) / quantity - 1.0).abs() < 1e-14);
            }
        }
        assert_eq!(on(Axis::Linear).probability(-1.0), 0.0);
    }

    #[test]
    fn function_with_bad_field_names_it() {
        let bad = [
            ("threshold", Function { threshold: f64::NAN, ..YES_NO }),
            ("threshold", Function { shape: Shape::Weibull, threshold: 0.0, ..YES_NO }),
            ("slope", Function { slope: 0.0, ..YES_NO }),
            ("guess", Function { guess: 1.0, ..YES_NO }),
            ("lapse", Function { guess: 0.5, lapse: 0.5, ..YES_NO }),
        ];
        for (field, function) in bad {
            let error = function.check().unwrap_err();
            assert!(error.starts_with(&format!("`{field}` is ")) && error.contains(": use "), "{error}");
        }
        assert_eq!(YES_NO.check(), Ok(()));
        assert_eq!((YES_NO.level_at(0.0), YES_NO.level_at(1.0)), (None, None));
    }

    proptest! {
        #[test]
        fn level_at_inverts_probability(
            shape in 0..3_usize, axis in 0..3_usize, threshold in 0.1..5.0, slope in 0.5..5.0,
            guess in 0.0..0.5, f in 0.01..0.99
        ) {
            let shape = [Shape::Weibull, Shape::Logistic, Shape::Gaussian][shape];
            let axis = [Axis::Linear, Axis::Log10, Axis::Decibel][axis];
            let function = Function { shape, axis, threshold, slope, guess, lapse: 0.02 };
            let p = guess + (0.98 - guess) * f;
            let level = function.level_at(p).unwrap();
            prop_assert!((function.probability(level) - p).abs() < 1e-12);
        }
    }
}
