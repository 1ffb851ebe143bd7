use std::path::Path;

use asperity_data::{Example, HISTORY};
use asperity_dsp::frame::BINS;
use asperity_texture::{Answer, Choice, Model, Precision, Range, Runner, hold_magnitudes};

use crate::failure::Failure;

/// A written texture network, run as the node runs it.
pub(crate) struct Network(Model);

/// A network with one vector.
pub(super) struct Touched {
    range: Range,
    runner: Runner,
}

impl Network {
    /// Loads a file.
    ///
    /// # Errors
    /// As [`Model::load`].
    pub(crate) fn read(path: &Path) -> Result<Self, Failure> {
        Ok(Self(Model::load(path)?))
    }

    /// Whether it answers the scatter of magnitudes.
    pub(super) fn answers_scatter(&self) -> bool {
        self.0.answers_scatter()
    }

    /// The network for a vector.
    ///
    /// # Errors
    /// A vector that is not finite or has another length.
    pub(super) fn with(&self, vector: &[f32]) -> Result<Touched, Failure> {
        let runner = self.0.runner(&[vector], Precision::F32, Choice::Auto)?;
        Ok(Touched { range: Range::new(self.0.trained()), runner })
    }
}

impl Touched {
    /// Magnitudes in m/s^2 after the forces and velocities of an example, clamped to the trained range.
    ///
    /// # Errors
    /// A network that fails to run.
    pub(super) fn after(&mut self, example: &Example) -> Result<[f32; BINS], Failure> {
        let mut held = [0.0; BINS];
        hold_magnitudes(&self.answer(example)?.magnitudes, &mut held);
        Ok(held)
    }

    /// Magnitudes and their scatter.
    ///
    /// # Errors
    /// A network that fails to run.
    pub(super) fn answer(&mut self, example: &Example) -> Result<Answer, Failure> {
        let (mut force, mut velocity) = ([0.0; HISTORY], [0.0; 2 * HISTORY]);
        self.range.forces(&example.force.map(f64::from), &mut force);
        self.range.velocities(&example.velocity.map(f64::from), &mut velocity);
        let mut answer = Answer::default();
        self.runner
            .answer(0, &force, &velocity, &mut answer)
            .map_err(|e| Failure::Model(format!("the written network does not run: {e}")))?;
        Ok(answer)
    }
}
