use std::path::Path;
use std::sync::Arc;

use asperity_dataset::{HISTORY, MAX_FORCE_N, MAX_SPEED_MM_S};
use asperity_source::Diagnostic;
use asperity_world::material::BINS;
use asperity_world::tactile::{IMAGE, Image};
use tract_onnx::prelude::*;

use crate::failure::Failure;

/// An ONNX file, loaded by tract.
pub(crate) struct Onnx(Arc<TypedRunnableModel>);

impl Onnx {
    /// Loads a file.
    ///
    /// # Errors
    /// A file that cannot be read, or that tract cannot run.
    pub(crate) fn read(path: &Path) -> Result<Self, Failure> {
        let bytes = std::fs::read(path)
            .map_err(|e| Diagnostic::new(format!("cannot read this file: {e}")).in_file(path))?;
        let model = tract_onnx::onnx()
            .model_for_read(&mut std::io::Cursor::new(bytes))
            .and_then(|m| m.into_optimized())
            .and_then(|m| m.into_runnable())
            .map_err(|e| Failure::model(&e))?;
        Ok(Self(model))
    }

    /// Numbers answered to inputs, each with its shape.
    ///
    /// # Errors
    /// What tract answers.
    fn run(&self, inputs: &[(&[usize], &[f32])]) -> Result<Vec<f32>, Failure> {
        let answer = || -> TractResult<Vec<f32>> {
            let tensor = |(shape, x): &(&[usize], &[f32])| -> TractResult<TValue> {
                Ok(Tensor::from_shape(shape, x)?.into())
            };
            let inputs = inputs.iter().map(tensor).collect::<TractResult<TVec<TValue>>>()?;
            let outputs = self.0.run(inputs)?;
            Ok(outputs[0].to_plain_array_view::<f32>()?.iter().copied().collect())
        };
        answer().map_err(|e| Failure::model(&e))
    }

    /// What it answers to an image.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub(crate) fn look(&self, image: &Image) -> Result<Vec<f32>, Failure> {
        let mut planes = Vec::with_capacity(image.pixels.len());
        for channel in 0..3 {
            planes.extend(image.pixels.iter().skip(channel).step_by(3).map(|p| f32::from(*p) / 255.0));
        }
        self.run(&[(&[1, 3, IMAGE[0], IMAGE[1]], &planes)])
    }

    /// Magnitudes in m/s^2 of forces in N, velocities in mm/s and a vector; inputs are held to the trained range, as the node does it.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub(crate) fn touch(
        &self,
        force: &[f32; HISTORY],
        velocity: &[f32; 2 * HISTORY],
        vector: &[f32],
    ) -> Result<[f32; BINS], Failure> {
        let force = force.map(|f| f.clamp(0.0, MAX_FORCE_N as f32));
        let mut held = *velocity;
        for i in 0..HISTORY {
            let speed = velocity[i].hypot(velocity[HISTORY + i]);
            let gain = (MAX_SPEED_MM_S as f32 / speed.max(1e-6)).min(1.0);
            held[i] *= gain;
            held[HISTORY + i] *= gain;
        }
        let answer =
            self.run(&[(&[1, HISTORY], &force), (&[1, 2 * HISTORY], &held), (&[1, vector.len()], vector)])?;
        answer.try_into().map_err(|_| Failure::Model("the network does not answer 100 magnitudes".to_owned()))
    }
}
