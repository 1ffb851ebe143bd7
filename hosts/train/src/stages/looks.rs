use asperity_data::Subject;
use asperity_texture::picture::Image;
use burn::tensor::Device;

use super::kin::Kin;
use super::random;
use super::sight::strange;
use crate::encoder::{ImageEncoder, features};
use crate::progress::Teller;

/// Images for stage two after the image encoder is frozen: [`FEATURES`](crate::encoder::FEATURES)
/// numbers of each, all times `scale`.
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
    /// Features of subjects' training images.
    pub(crate) fn of(
        encoder: &ImageEncoder,
        subjects: &[Subject],
        (kin, seed): (Option<&Kin>, u64),
        device: &Device,
    ) -> Self {
        let mut teller = Teller::new("features", subjects.len());
        let (mut seen, mut other) = (Vec::new(), Vec::new());
        for (number, subject) in subjects.iter().enumerate() {
            let images: Vec<&Image> = subject.images.train.iter().collect();
            seen.push(features(encoder, &images, device));
            if kin.is_some() {
                let random = &mut random(seed, 3, number);
                let made: Vec<Image> =
                    images.iter().step_by(STRANGE_EVERY).map(|image| strange(image, random)).collect();
                other.push(features(encoder, &made.iter().collect::<Vec<_>>(), device));
            }
            teller.tell(number + 1, "subjects");
        }
        let all = || seen.iter().flatten();
        let mean_square = all().map(|x| f64::from(*x).powi(2)).sum::<f64>() / all().count().max(1) as f64;
        let scale = if mean_square > 0.0 { mean_square.sqrt().recip() as f32 } else { 1.0 };
        seen.iter_mut().chain(&mut other).flatten().for_each(|x| *x *= scale);
        Self { seen, strange: other, scale }
    }
}
