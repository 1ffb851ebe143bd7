//! The two stages: naming a texture, and predicting its vibration.

mod feeling;
mod kin;
mod looks;
mod naming;
mod sight;

use asperity_numbers::Random;
use asperity_texture::VECTOR_LEN;
use burn::tensor::{Device, Tensor, TensorData};

pub(crate) use feeling::{Learner, Touching, feel, settle};
pub(crate) use kin::Kin;
pub(crate) use looks::Looks;
pub(crate) use naming::{Namer, Naming, name};

use crate::encoder::{FEATURES, Head};
use crate::layer::numbers;

/// Random numbers of a step, different for each seed and step.
fn random(seed: u64, stage: u64, step: usize) -> Random {
    let mut mixed = Random::new(seed.wrapping_mul(0x2545_f491_4f6c_dd1d) ^ (stage << 56) ^ step as u64);
    Random::new(mixed.bits())
}

/// Vectors \[n, 256\] of features \[n, 8960\].
pub(crate) fn vectors(texture: &Head, features: &[f32], device: &Device) -> Vec<f32> {
    let data = TensorData::new(features.to_vec(), [features.len() / FEATURES, FEATURES]);
    numbers(texture.forward(Tensor::from_data(data, device)))
}

/// The mean of vectors \[n, 256\].
pub(crate) fn mean_vector(vectors: &[f32]) -> [f32; VECTOR_LEN] {
    let mut mean = [0.0; VECTOR_LEN];
    let part = VECTOR_LEN as f32 / vectors.len().max(1) as f32;
    for vector in vectors.chunks_exact(VECTOR_LEN) {
        mean.iter_mut().zip(vector).for_each(|(m, x)| *m += part * x);
    }
    mean
}
