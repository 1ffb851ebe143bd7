//! The two stages: naming a texture, and predicting its vibration.

mod feeling;
mod naming;

use asperity_data::Subject;
use asperity_numbers::Random;
use asperity_texture::VECTOR_LEN;
use asperity_texture::picture::Image;
use burn::tensor::activation::{log_softmax, softmax};
use burn::tensor::{Device, Int, Tensor, TensorData};

pub(crate) use feeling::{Learner, Touching, feel, settle};
pub(crate) use naming::{Namer, Naming, name};

use crate::encoder::{FEATURES, Head, ImageEncoder, features};
use crate::files::Teller;
use crate::layer::{numbers, rows};

/// Random numbers of a step, different for each seed and step.
fn random(seed: u64, stage: u64, step: usize) -> Random {
    let mut mixed = Random::new(seed.wrapping_mul(0x2545_f491_4f6c_dd1d) ^ (stage << 56) ^ step as u64);
    Random::new(mixed.bits())
}

/// Vectors \[n, 256\] of features \[n, 8960\].
pub(crate) fn vectors(texture: &Head, features: &[f32], device: &Device) -> Vec<f32> {
    numbers(texture.forward(rows(features.to_vec(), FEATURES, device)))
}

pub(crate) fn mean_vector(vectors: &[f32]) -> [f32; VECTOR_LEN] {
    let mut mean = [0.0; VECTOR_LEN];
    let part = VECTOR_LEN as f32 / vectors.len().max(1) as f32;
    for vector in vectors.chunks_exact(VECTOR_LEN) {
        mean.iter_mut().zip(vector).for_each(|(m, x)| *m += part * x);
    }
    mean
}

/// Classes by family, the recognisable part of unknown surfaces.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Kin {
    of: Vec<usize>,
    families: usize,
}

/// Least probability of a family, so its logarithm is finite.
const LEAST: f32 = 1e-6;
/// Weight of a strange image's family beside an image's name.
const STRANGE_WEIGHT: f32 = 0.5;

impl Kin {
    /// From each class's family; none if a family is missing or there is only one.
    pub(crate) fn of<'a>(families: impl Iterator<Item = Option<&'a str>>) -> Option<Self> {
        let mut names: Vec<&str> = Vec::new();
        let number = |family: Option<&'a str>| {
            let family = family?;
            if !names.contains(&family) {
                names.push(family);
            }
            names.iter().position(|name| *name == family)
        };
        let of = families.map(number).collect::<Option<Vec<_>>>()?;
        (names.len() > 1).then_some(Self { of, families: names.len() })
    }

    /// Minus the logarithm of the probability by scores \[n, classes\] of the right class's whole
    /// family.
    fn loss(&self, scores: Tensor<2>, classes: &[usize], device: &Device) -> Tensor<1> {
        let belongs =
            self.of.iter().flat_map(|of| (0..self.families).map(move |f| f32::from(u8::from(f == *of))));
        let parts = softmax(scores, 1).matmul(rows(belongs.collect(), self.families, device));
        let families = classes.iter().map(|class| self.of[*class]);
        (parts + LEAST).log().gather(1, column(families, device)).mean().neg()
    }
}

/// Loss of scores \[n, classes\] of named images, and of strange ones behind them.
fn name_loss(
    scores: Tensor<2>,
    (named, strange): (&[usize], &[usize]),
    kin: Option<&Kin>,
    device: &Device,
) -> Tensor<1> {
    let named_scores = scores.clone().narrow(0, 0, named.len());
    let loss = naming_loss(named_scores, named, device);
    match kin {
        Some(kin) => {
            let strange_scores = scores.narrow(0, named.len(), strange.len());
            loss + kin.loss(strange_scores, strange, device) * STRANGE_WEIGHT
        }
        None => loss,
    }
}

/// Minus the logarithm of the right class's probability by scores \[n, classes\].
pub(crate) fn naming_loss(scores: Tensor<2>, classes: &[usize], device: &Device) -> Tensor<1> {
    log_softmax(scores, 1).gather(1, column(classes.iter().copied(), device)).mean().neg()
}

fn column(all: impl Iterator<Item = usize>, device: &Device) -> Tensor<2, Int> {
    let all: Vec<i32> = all.map(|n| n as i32).collect();
    let count = all.len();
    Tensor::from_data(TensorData::new(all, [count, 1]), device)
}

/// Images for stage two after the image encoder is frozen: [`FEATURES`] numbers of each, all times
/// `scale`.
#[derive(Debug)]
pub(crate) struct Looks {
    /// Features of training images, \[subject\]\[image, 8960\].
    pub seen: Vec<Vec<f32>>,
    /// Features of training images made strange; empty if families are not known.
    pub strange: Vec<Vec<f32>>,
    /// Factor to a root mean square of 1. A texture encoder may never start to learn from numbers of
    /// another size.
    pub scale: f32,
}

/// Share of training images made strange: one in this many.
const STRANGE_EVERY: usize = 3;

impl Looks {
    pub(crate) fn of(
        encoder: &ImageEncoder,
        subjects: &[Subject],
        (kin, seed): (Option<&Kin>, u64),
        device: &Device,
    ) -> Self {
        let mut teller = Teller::new("features", subjects.len());
        let (mut seen, mut strange) = (Vec::new(), Vec::new());
        for (number, subject) in subjects.iter().enumerate() {
            let images: Vec<&Image> = subject.images.train.iter().collect();
            seen.push(features(encoder, &images, device));
            if kin.is_some() {
                let random = &mut random(seed, 3, number);
                let some = images.iter().step_by(STRANGE_EVERY);
                let made: Vec<Image> = some.map(|image| naming::strange(image, random)).collect();
                strange.push(features(encoder, &made.iter().collect::<Vec<_>>(), device));
            }
            teller.tell(number + 1, "subjects");
        }
        let all = || seen.iter().flatten();
        let mean_square = all().map(|x| f64::from(*x).powi(2)).sum::<f64>() / all().count().max(1) as f64;
        let scale = if mean_square > 0.0 { mean_square.sqrt().recip() as f32 } else { 1.0 };
        seen.iter_mut().chain(&mut strange).flatten().for_each(|x| *x *= scale);
        Self { seen, strange, scale }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_family_has_the_parts_of_all_its_classes() {
        let device = Device::flex();
        let kin = Kin { of: vec![0, 1, 0], families: 2 };
        let parts = [0.5_f32, 0.3, 0.2];
        let scores = || rows(parts.map(f32::ln).to_vec(), 3, &device);
        for (class, part) in [(0, 0.7_f32), (1, 0.3), (2, 0.7)] {
            let loss = kin.loss(scores(), &[class], &device).into_scalar::<f32>();
            assert!((loss + part.ln()).abs() < 1e-4, "{class}: {loss}");
            let loss = naming_loss(scores(), &[class], &device).into_scalar::<f32>();
            assert!((loss + parts[class].ln()).abs() < 1e-5, "{class}: {loss}");
        }
    }

    #[test]
    fn kin_needs_all_families_known_and_more_than_one() {
        let of = |families: &[Option<&'static str>]| Kin::of(families.iter().copied());
        assert_eq!(of(&[Some("a"), Some("b"), Some("a")]), Some(Kin { of: vec![0, 1, 0], families: 2 }));
        assert_eq!(of(&[Some("a"), None]), None);
        assert_eq!(of(&[Some("a"), Some("a")]), None);
    }
}
