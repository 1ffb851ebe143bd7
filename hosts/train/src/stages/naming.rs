//! Stage one: image encoder and classifier, and training images: shifted, stretched, some features missing.

use asperity_data::Subject;
use asperity_numbers::Random;
use asperity_texture::picture::{IMAGE, Image};
use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};

use super::{Kin, name_loss, random};
use crate::Failure;
use crate::descent::{Losses, Stage};
use crate::encoder::{FEATURES, Head, ImageEncoder, PIXELS, Preset, features, planes};
use crate::layer::rows;

#[derive(Module, Debug)]
pub(crate) struct Namer {
    pub(crate) encoder: ImageEncoder,
    pub(crate) classifier: Head,
}

impl Namer {
    pub(crate) fn new(preset: Preset, classes: usize, seed: u64, device: &Device) -> Self {
        let random = &mut random(seed, 1, usize::MAX);
        let encoder = ImageEncoder::new(preset, random, device);
        Self { encoder, classifier: Head::classifier(preset, classes, random, device) }
    }

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

#[derive(Clone, Copy, Debug)]
pub(crate) struct Naming<'a> {
    pub batch: usize,
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

/// Largest shift of an image in rows and columns.
const SHIFT: [usize; 2] = [12, 16];

/// An image shifted down and to the right; the edge repeats.
fn shifted(image: &Image, [down, right]: [isize; 2]) -> Image {
    let [rows, columns] = image.size;
    let from = |at: usize, by: isize, count: usize| at.saturating_add_signed(-by).min(count - 1);
    let pixels = (0..rows * columns).flat_map(|i| {
        let at = 3 * (from(i / columns, down, rows) * columns + from(i % columns, right, columns));
        [image.pixels[at], image.pixels[at + 1], image.pixels[at + 2]]
    });
    Image { size: image.size, pixels: pixels.collect() }
}

/// Random stretch of an image and of its colours' contrast, for another surface of the family: finer or
/// coarser, flatter or higher.
const STRETCH: [f64; 2] = [0.7, 1.5];
const CONTRAST: [f64; 2] = [0.6, 1.6];

/// An image like one of an unknown surface of the same family.
pub(super) fn strange(image: &Image, random: &mut Random) -> Image {
    let mut within = |[least, most]: [f64; 2]| (least * (most / least).powf(random.unit())) as f32;
    stretched(image, within(STRETCH), within(CONTRAST))
}

/// An image larger by `stretch` about its middle, mirrored beyond its edges, with `contrast` times the
/// colours' distance from their means.
fn stretched(image: &Image, stretch: f32, contrast: f32) -> Image {
    let [rows, columns] = image.size;
    let all = (rows * columns) as f32;
    let mean: [f32; 3] = std::array::from_fn(|channel| {
        image.pixels.iter().skip(channel).step_by(3).map(|p| f32::from(*p)).sum::<f32>() / all
    });
    // Pixels before and after a place of the other image, and the part of the way between them.
    let between = |at: usize, count: usize| {
        let (middle, last) = (0.5 * (count - 1) as f32, (count - 1) as f32);
        let place = (middle + (at as f32 - middle) / stretch).abs();
        let place = (last - (place - last).abs()).clamp(0.0, last);
        let before = place as usize;
        (before, (before + 1).min(count - 1), place - before as f32)
    };
    let across: Vec<_> = (0..columns).map(|column| between(column, columns)).collect();
    let mut pixels = Vec::with_capacity(image.pixels.len());
    for row in 0..rows {
        let (above, below, down) = between(row, rows);
        for (left, right, along) in &across {
            for (channel, mean) in mean.iter().enumerate() {
                let pixel = |row: usize, column: &usize| {
                    f32::from(image.pixels[3 * (row * columns + column) + channel])
                };
                let line = |row| pixel(row, left) + along * (pixel(row, right) - pixel(row, left));
                let here = line(above) + down * (line(below) - line(above));
                // A cast clamps a float to a byte.
                pixels.push((mean + contrast * (here - mean)).round() as u8);
            }
        }
    }
    Image { size: image.size, pixels }
}

/// Dropout of features (Srivastava et al. 2014), as before AlexNet's first full layer: each is 0 or
/// doubled with equal chance.
pub(super) fn dropout(batch: usize, random: &mut Random) -> Vec<f32> {
    let count = batch * FEATURES;
    let words = (0..count.div_ceil(64)).flat_map(|_| {
        let word = random.bits();
        (0..64).map(move |bit| if word >> bit & 1 == 1 { 2.0 } else { 0.0 })
    });
    words.take(count).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shifted_image_repeats_its_edge_outside() {
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

    #[test]
    fn stretched_image_is_coarser_and_mirrored_at_unknown_edges() {
        let image =
            Image { size: [1, 9], pixels: (0..9).flat_map(|i| [10 * i, 100, 200 - 10 * i]).collect() };
        let red = |stretch, contrast| {
            stretched(&image, stretch, contrast).pixels.into_iter().step_by(3).collect::<Vec<u8>>()
        };
        assert_eq!(stretched(&image, 1.0, 1.0), image);
        assert_eq!(red(2.0, 1.0), [20, 25, 30, 35, 40, 45, 50, 55, 60]);
        assert_eq!(red(0.5, 1.0), [40, 20, 0, 20, 40, 60, 80, 60, 40]);
        assert_eq!(red(1.0, 2.0), [0, 0, 0, 20, 40, 60, 80, 100, 120]);
        assert_eq!(red(1.0, 0.5), [20, 25, 30, 35, 40, 45, 50, 55, 60]);
    }
}
