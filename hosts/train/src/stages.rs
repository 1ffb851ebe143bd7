//! The two stages: naming the texture, and predicting what it feels like.

use asperity_dataset::{Example, HISTORY, Subject, Truth};
use asperity_world::material::{BINS, Random, VECTOR_LEN};
use asperity_world::tactile::{IMAGE, Image};
use burn::module::Module;
use burn::tensor::activation::log_softmax;
use burn::tensor::{Device, Int, Tensor, TensorData};

use crate::descent::{Losses, Progress, Stage};
use crate::encoder::{FEATURES, Head, ImageEncoder, PIXELS, Preset, features, planes};
use crate::failure::Failure;
use crate::layer::numbers;
use crate::loss::{Aim, Scales, Target};
use crate::network::{Network, Scaling};

/// Random numbers of a step: another seed or step, others.
fn random(seed: u64, stage: u64, step: usize) -> Random {
    let mut mixed = Random::new(seed.wrapping_mul(0x2545_f491_4f6c_dd1d) ^ (stage << 56) ^ step as u64);
    Random::new(mixed.bits())
}

/// Image encoder and classifier.
#[derive(Module, Debug)]
pub(crate) struct Namer {
    pub(crate) encoder: ImageEncoder,
    pub(crate) classifier: Head,
}

impl Namer {
    /// One to be trained to tell `classes`.
    pub(crate) fn new(preset: Preset, classes: usize, seed: u64, device: &Device) -> Self {
        let random = &mut random(seed, 1, usize::MAX);
        let encoder = ImageEncoder::new(preset, random, device);
        Self { encoder, classifier: Head::classifier(preset, classes, random, device) }
    }

    /// The classes that it takes images for.
    pub(crate) fn names<'a>(&self, images: impl Iterator<Item = &'a Image>, device: &Device) -> Vec<usize> {
        let images: Vec<&Image> = images.collect();
        let features = features(&self.encoder, &images, device);
        let features = TensorData::new(features, [images.len(), FEATURES]);
        let scores = self.classifier.forward(Tensor::from_data(features, device));
        scores.argmax(1).into_data().iter::<i64>().map(|class| class as usize).collect()
    }

    /// Part of held-out images that are named rightly, if there are any.
    pub(crate) fn named_rightly(&self, subjects: &[Subject], device: &Device) -> Option<f64> {
        let right = |(class, subject): (usize, &Subject)| {
            let names = self.names(subject.images.held.iter(), device);
            names.into_iter().filter(|named| *named == class).count()
        };
        let count: usize = subjects.iter().map(|s| s.images.held.len()).sum();
        (count > 0).then(|| subjects.iter().enumerate().map(right).sum::<usize>() as f64 / count as f64)
    }
}

/// Stage one: trains a [`Namer`] to name the subjects by their images.
///
/// # Errors
/// As [`Stage::descend`].
pub(crate) fn name(
    stage: &Stage<'_>,
    namer: Namer,
    subjects: &[Subject],
    (batch, seed): (usize, u64),
    device: &Device,
    report: impl FnMut(&Progress),
) -> Result<(Namer, Losses), Failure> {
    let images: Vec<(usize, &Image)> = subjects
        .iter()
        .enumerate()
        .flat_map(|(class, s)| s.images.train.iter().map(move |image| (class, image)))
        .collect();
    let draw = |step: usize| {
        let random = &mut random(seed, 1, step);
        let mut sight = Sight {
            pixels: Vec::with_capacity(batch * PIXELS),
            classes: Vec::with_capacity(batch),
            kept: dropout(batch, random),
        };
        for _ in 0..batch {
            let (class, image) = images[random.below(images.len())];
            let light = random.range(0.9, 1.1);
            let by = SHIFT.map(|most| random.below(2 * most + 1) as isize - most as isize);
            planes(
                &shifted(image, by),
                [0; 3].map(|_| (light * random.range(0.95, 1.05)) as f32),
                &mut sight.pixels,
            );
            sight.classes.push(class as i32);
        }
        sight
    };
    let loss = |namer: &Namer, sight: Sight| {
        let pixels = TensorData::new(sight.pixels, [batch, 3, IMAGE[0], IMAGE[1]]);
        let classes: Tensor<2, Int> = Tensor::from_data(TensorData::new(sight.classes, [batch, 1]), device);
        let kept: Tensor<2> = Tensor::from_data(TensorData::new(sight.kept, [batch, FEATURES]), device);
        let features = namer.encoder.forward(Tensor::from_data(pixels, device)) * kept;
        log_softmax(namer.classifier.forward(features), 1).gather(1, classes).mean().neg()
    };
    stage.descend(namer, draw, loss, report)
}

/// Images of one batch.
struct Sight {
    pixels: Vec<f32>,
    classes: Vec<i32>,
    /// What features are multiplied by: 0 for half of them.
    kept: Vec<f32>,
}

/// Most that an image is shifted by, in rows and columns.
const SHIFT: [usize; 2] = [12, 16];

/// An image shifted down and to the right; what comes in is the edge.
fn shifted(image: &Image, [down, right]: [isize; 2]) -> Image {
    let [rows, columns] = image.size;
    let from = |at: usize, by: isize, count: usize| at.saturating_add_signed(-by).min(count - 1);
    let pixels = (0..rows * columns).flat_map(|i| {
        let at = 3 * (from(i / columns, down, rows) * columns + from(i % columns, right, columns));
        [image.pixels[at], image.pixels[at + 1], image.pixels[at + 2]]
    });
    Image { size: image.size, pixels: pixels.collect() }
}

/// Dropout of features (Srivastava et al. 2014), as AlexNet has it before its first full layer: each is 0 by chance of a half, or doubled.
fn dropout(batch: usize, random: &mut Random) -> Vec<f32> {
    let count = batch * FEATURES;
    let words = (0..count.div_ceil(64)).flat_map(|_| {
        let word = random.bits();
        (0..64).map(move |bit| if word >> bit & 1 == 1 { 2.0 } else { 0.0 })
    });
    words.take(count).collect()
}

/// Brings features to a root mean square of 1 and returns what they were multiplied by: a texture encoder that begins with numbers of any size may
/// never come to life.
pub(crate) fn to_unit(features: &mut [Vec<f32>]) -> f32 {
    let all = || features.iter().flatten();
    let mean_square = all().map(|x| f64::from(*x).powi(2)).sum::<f64>() / all().count().max(1) as f64;
    let scale = if mean_square > 0.0 { mean_square.sqrt().recip() as f32 } else { 1.0 };
    features.iter_mut().flatten().for_each(|x| *x *= scale);
    scale
}

/// Texture encoder and the network of every tick.
#[derive(Module, Debug)]
pub(crate) struct Feeler {
    pub(crate) texture: Head,
    pub(crate) network: Network,
}

impl Feeler {
    /// One to be trained.
    pub(crate) fn new(preset: Preset, seed: u64, device: &Device) -> Self {
        let random = &mut random(seed, 2, usize::MAX);
        Self { texture: Head::texture(preset, random, device), network: Network::new(random, device) }
    }
}

/// Examples of one batch, and whose they are.
struct Touches {
    /// \[groups, 8960\], or \[groups, 256\] when vectors are fixed.
    looks: Vec<f32>,
    force: Vec<f32>,
    speed: Vec<f32>,
    target: Vec<f32>,
    weight: Vec<f32>,
}

/// How a material looks to stage two: features of its training images, or its vector.
pub(crate) struct Looks<'a> {
    /// \[subject\]\[image, width\].
    pub numbers: &'a [Vec<f32>],
    /// Numbers of an image: 8960, or 256 of a vector.
    pub width: usize,
}

impl Looks<'_> {
    fn draw(&self, subject: usize, random: &mut Random) -> &[f32] {
        let all = &self.numbers[subject];
        let image = random.below(all.len() / self.width);
        &all[image * self.width..(image + 1) * self.width]
    }
}

/// Settings of a stage two.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Touching {
    /// Materials a step.
    pub groups: usize,
    /// Examples of each.
    pub each: usize,
    /// Seed of the examples drawn.
    pub seed: u64,
    /// What is aimed at.
    pub target: Target,
    /// How errors are weighed.
    pub aim: Aim,
    /// What forces and velocities are made.
    pub scaling: Scaling,
}

/// One touch in so many is one of nothing: force without speed, or speed without force.
const SILENT: f64 = 0.06;

/// Stage two: trains texture encoder and network, or where looks are vectors the network alone, to say what a touch feels like.
///
/// # Errors
/// As [`Stage::descend`].
pub(crate) fn feel(
    stage: &Stage<'_>,
    feeler: Feeler,
    subjects: &[Subject],
    looks: &Looks<'_>,
    settings: Touching,
    device: &Device,
    report: impl FnMut(&Progress),
) -> Result<(Feeler, Losses), Failure> {
    let Touching { groups, each, seed, target, aim, .. } = settings;
    let scales: Vec<Scales> = subjects.iter().map(|s| Scales::of(&s.examples.train, aim)).collect();
    let count = groups * each;
    let draw = |step: usize| {
        let random = &mut random(seed, 2, step);
        let mut touches = Touches {
            looks: Vec::with_capacity(groups * looks.width),
            force: Vec::with_capacity(count * HISTORY),
            speed: Vec::with_capacity(count * 2 * HISTORY),
            target: Vec::with_capacity(count * BINS),
            weight: Vec::with_capacity(count * BINS),
        };
        for _ in 0..groups {
            let number = random.below(subjects.len());
            touches.looks.extend_from_slice(looks.draw(number, random));
            let subject = &subjects[number];
            for _ in 0..each {
                let example = &subject.examples.train[random.below(subject.examples.train.len())];
                if random.chance(SILENT) {
                    touches.push(&silent(example, random), Truth::Rms, settings, &scales[number]);
                } else {
                    touches.push(example, subject.truth, settings, &scales[number]);
                }
            }
        }
        touches
    };
    let loss = |feeler: &Feeler, t: Touches| {
        let tensor = |numbers: Vec<f32>, rows: usize| -> Tensor<2> {
            let width = numbers.len() / rows;
            Tensor::from_data(TensorData::new(numbers, [rows, width]), device)
        };
        let looks_of = tensor(t.looks, groups);
        let vectors = if looks.width == FEATURES { feeler.texture.forward(looks_of) } else { looks_of };
        let vectors = vectors.unsqueeze_dim::<3>(1).repeat_dim(1, each).reshape([count, VECTOR_LEN]);
        let answer = feeler.network.forward(tensor(t.force, count), tensor(t.speed, count), vectors);
        target.loss(aim, answer, tensor(t.target, count), tensor(t.weight, count))
    };
    stage.descend(feeler, draw, loss, report)
}

impl Touches {
    fn push(&mut self, example: &Example, truth: Truth, settings: Touching, scales: &Scales) {
        let Touching { target, scaling: Scaling { force: (scale, offset), speed }, .. } = settings;
        self.force.extend(example.force.map(|f| scale * (f - offset)));
        self.speed.extend(example.velocity.map(|v| speed * v));
        self.target.extend(example.magnitudes.map(|m| target.of(m, truth)));
        self.weight.extend_from_slice(scales.weights(example));
    }
}

/// A touch like another but without force or without speed: nothing is felt.
fn silent(example: &Example, random: &mut Random) -> Example {
    let mut silent = Example { magnitudes: [0.0; BINS], ..example.clone() };
    if random.chance(0.5) {
        silent.force = [0.0; HISTORY]
    } else {
        silent.velocity = [0.0; 2 * HISTORY]
    }
    silent
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shifted_image_has_its_edge_where_nothing_is_known() {
        let pixels = (0..12).flat_map(|i| [i, i + 100, i + 200]).collect();
        let image = Image { size: [3, 4], pixels };
        let red = |by| shifted(&image, by).pixels.into_iter().step_by(3).collect::<Vec<u8>>();
        assert_eq!(red([0, 0]), [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]);
        assert_eq!(red([1, -2]), [2, 3, 3, 3, 2, 3, 3, 3, 6, 7, 7, 7]);
        assert_eq!(shifted(&image, [-1, 1]).pixels[3..6], [4, 104, 204]);
    }

    #[test]
    fn dropout_takes_half_of_the_features_and_keeps_their_mean() {
        let kept = dropout(3, &mut Random::new(1));
        assert_eq!(kept.len(), 3 * FEATURES);
        let mean = kept.iter().sum::<f32>() / kept.len() as f32;
        assert!((mean - 1.0).abs() < 0.03 && kept.iter().all(|k| *k == 0.0 || *k == 2.0), "{mean}");
    }
}
