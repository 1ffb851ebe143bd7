//! Simulated participants.

use asperity_numbers::random::uniform;
use serde::{Deserialize, Serialize};

use crate::Function;

/// A simulated participant: answers as its psychometric function says, by chance from a seed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Observer {
    /// True psychometric function.
    pub function: Function,
    /// Seed of the answers.
    pub seed: u64,
}

impl Observer {
    /// Whether the answer of a trial at a level is correct. Its chance depends on seed and trial alone.
    pub fn answer(&self, trial: u64, level: f64) -> bool {
        uniform(self.seed, trial) < self.function.probability(level)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Axis, Shape};

    #[test]
    fn observer_answers_with_the_function_s_probability() {
        let function = Function {
            shape: Shape::Logistic,
            axis: Axis::Linear,
            threshold: 1.0,
            slope: 2.0,
            guess: 0.25,
            lapse: 0.1,
        };
        let observer = Observer { function, seed: 3 };
        for level in [-9.0, 0.5, 1.0, 9.0] {
            let correct = (0..100_000).filter(|trial| observer.answer(*trial, level)).count();
            let off = correct as f64 / 1e5 - function.probability(level);
            assert!(off.abs() < 0.005, "{level}: {off}");
        }
        assert!((0..100).any(|i| observer.answer(i, 1.0) != Observer { seed: 4, ..observer }.answer(i, 1.0)));
    }
}
