//! Stage one: image encoder and classifier.

use asperity_data::Subject;
use asperity_texture::picture::{IMAGE, Image};
use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};

use super::sight::{SHIFT, dropout, shifted, strange};
use super::{Kin, name_loss, random};
use crate::Failure;
use crate::descent::{Losses, Stage};
use crate::encoder::{FEATURES, Head, ImageEncoder, PIXELS, Preset, features, planes};
use crate::layer::rows;

/// Image encoder and classifier.
#[derive(Module, Debug)]
pub(crate) struct Namer {
    pub(crate) encoder: ImageEncoder,
    pub(crate) classifier: Head,
}

impl Namer {
    /// A namer of `classes` with initial weights.
    pub(crate) fn new(preset: Preset, classes: usize, seed: u64, device: &Device) -> Self {
        let random = &mut random(seed, 1, usize::MAX);
        let encoder = ImageEncoder::new(preset, random, device);
        Self { encoder, classifier: Head::classifier(preset, classes, random, device) }
    }

    /// Classes of images by the classifier.
    pub(crate) fn names<'a>(&self, images: impl Iterator<Item = &'a Image>, device: &Device) -> Vec<usize> {
        let images: Vec<&Image> = images.collect();
        let scores =
            self.classifier.forward(rows(features(&self.encoder, &images, device), FEATURES, device));
        scores.argmax(1).into_data().iter::<i64>().map(|class| class as usize).collect()
    }

    /// Part of held-out images named right, if there are any.
    pub(crate) fn named_rightly(&self, subjects: &[Subject], device: &Device) -> Option<f64> {
        let right = |(class, subject): (usize, &Subject)| {
            let names = self.names(subject.images.held.iter(), device);
            names.into_iter().filter(|named| *named == class).count()
        };
        let count: usize = subjects.iter().map(|s| s.images.held.len()).sum();
        (count > 0).then(|| subjects.iter().enumerate().map(right).sum::<usize>() as f64 / count as f64)
    }
}

/// Settings of stage one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Naming<'a> {
    /// Images to name in a step.
    pub batch: usize,
    /// Seed of the images drawn.
    pub seed: u64,
    /// Families, if known: then a quarter as many [strange] images are added, with only their families
    /// to tell.
    pub kin: Option<&'a Kin>,
}

/// Stage one: trains a [`Namer`] to name the subjects by their images, and to tell the families of
/// images that are [strange].
pub(crate) fn name(
    stage: &Stage<'_>,
    namer: Namer,
    subjects: &[Subject],
    settings: Naming<'_>,
    device: &Device,
) -> Result<(Namer, Losses), Failure> {
    let Naming { batch, seed, kin } = settings;
    let all = batch + kin.map_or(0, |_| batch.div_ceil(4));
    let of = |(class, s)| -> Vec<(usize, &Image)> {
        let s: &Subject = s;
        s.images.train.iter().map(|image| (class, image)).collect()
    };
    let images: Vec<(usize, &Image)> = subjects.iter().enumerate().flat_map(of).collect();
    // Pixels, classes, and factors of features: 0 for half of them.
    let draw = |step: usize| {
        let random = &mut random(seed, 1, step);
        let kept = dropout(all, random);
        let (mut pixels, mut classes) = (Vec::with_capacity(all * PIXELS), Vec::with_capacity(all));
        for number in 0..all {
            let (class, image) = images[random.below(images.len())];
            let light = random.range(0.9, 1.1);
            let by = SHIFT.map(|most| random.below(2 * most + 1) as isize - most as isize);
            let mut image = shifted(image, by);
            if number >= batch {
                image = strange(&image, random);
            }
            planes(&image, [0; 3].map(|_| (light * random.range(0.95, 1.05)) as f32), &mut pixels);
            classes.push(class);
        }
        (pixels, classes, kept)
    };
    let loss = |namer: &Namer, (pixels, classes, kept): (Vec<f32>, Vec<usize>, Vec<f32>)| {
        let pixels = TensorData::new(pixels, [all, 3, IMAGE[0], IMAGE[1]]);
        let seen = namer.encoder.forward(Tensor::from_data(pixels, device));
        let scores = namer.classifier.forward(seen * rows(kept, FEATURES, device));
        name_loss(scores, classes.split_at(batch), kin, device)
    };
    stage.descend(namer, draw, loss)
}
