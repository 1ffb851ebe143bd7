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
    /// Whether the answer of a trial at a level is correct. A trial's chance depends on seed and number alone.
    pub fn answer(&self, trial: u64, level: f64) -> bool {
        uniform(self.seed, trial) < self.function.probability(level)
    }
}
