//! The baseline of naming: plain statistics of an image, and a linear classifier.

use std::f64::consts::TAU;
use std::sync::Arc;

use asperity_fft::{Complex, Fft, Real as _};
use asperity_texture::picture::{IMAGE, Image};
use burn::module::Module;
use burn::optim::{AdamConfig, GradientsParams};
use burn::tensor::{Device, Tensor};
use rayon::prelude::*;

use crate::layer::{Layer, rows};
use crate::stages::naming_loss;

const SIDE: usize = 192;
/// Rings of spatial frequency, of equal ratio, from one period a side to half the side.
const RINGS: usize = 24;
/// Numbers of an image: mean, deviation and rings of each colour.
const NUMBERS: usize = 3 * (2 + RINGS);
const STEPS: usize = 400;

/// A linear classifier of an image's mean colours, their deviations, and their radial power spectra in dB.
pub(super) struct Statistics {
    layer: Layer,
    mean: [f32; NUMBERS],
    deviation: [f32; NUMBERS],
}

impl Statistics {
    pub(super) fn trained(images: &[(usize, &Image)], classes: usize) -> Self {
        let all = of(images);
        let count = all.len().max(1) as f32;
        let mean: [f32; NUMBERS] = std::array::from_fn(|i| all.iter().map(|x| x[i]).sum::<f32>() / count);
        let deviation = std::array::from_fn(|i| {
            (all.iter().map(|x| (x[i] - mean[i]).powi(2)).sum::<f32>() / count).sqrt().max(1e-6)
        });
        let device = Device::flex().autodiff();
        let random = &mut asperity_numbers::Random::new(1);
        let mut baseline =
            Self { layer: Layer::new(NUMBERS, classes, 0.1, random, &device), mean, deviation };
        let inputs = baseline.scaled(&all, &device);
        let wanted: Vec<usize> = images.iter().map(|(class, _)| *class).collect();
        let mut adam = AdamConfig::new().init();
        for step in 0..STEPS {
            let loss = naming_loss(baseline.layer.forward(inputs.clone()), &wanted, &device);
            let gradients = GradientsParams::from_grads(loss.backward(), &baseline.layer);
            let rate = 0.05 * (1.0 - step as f64 / STEPS as f64) + 1e-4;
            baseline.layer = adam.step(rate, baseline.layer, gradients);
        }
        baseline.layer = baseline.layer.valid();
        baseline
    }

    pub(super) fn names(&self, images: &[(usize, &Image)]) -> Vec<usize> {
        let scores = self.layer.forward(self.scaled(&of(images), &Device::flex()));
        scores.argmax(1).into_data().iter::<i64>().map(|class| class as usize).collect()
    }

    fn scaled(&self, all: &[[f32; NUMBERS]], device: &Device) -> Tensor<2> {
        let scaled = |x: &[f32; NUMBERS]| -> [f32; NUMBERS] {
            std::array::from_fn(|i| (x[i] - self.mean[i]) / self.deviation[i])
        };
        let numbers: Vec<f32> = all.iter().flat_map(scaled).collect();
        rows(numbers, NUMBERS, device)
    }
}

fn of(images: &[(usize, &Image)]) -> Vec<[f32; NUMBERS]> {
    let fft = f32::complex(SIDE, true);
    images.par_iter().map(|(_, image)| numbers_of(image, &fft)).collect()
}

fn numbers_of(image: &Image, fft: &Arc<dyn Fft<f32>>) -> [f32; NUMBERS] {
    let mut all = [0.0; NUMBERS];
    for (channel, out) in all.chunks_exact_mut(2 + RINGS).enumerate() {
        let left = (IMAGE[1] - SIDE) / 2;
        let pixel = |row: usize, column: usize| {
            f32::from(image.pixels[3 * (row * IMAGE[1] + left + column) + channel]) / 255.0
        };
        let square: Vec<f32> = (0..SIDE * SIDE).map(|i| pixel(i / SIDE, i % SIDE)).collect();
        let count = (SIDE * SIDE) as f32;
        let mean = square.iter().sum::<f32>() / count;
        out[0] = mean;
        out[1] = (square.iter().map(|x| (x - mean).powi(2)).sum::<f32>() / count).sqrt();
        out[2..].copy_from_slice(&rings(&square, mean, fft));
    }
    all
}

/// Mean power over rings of spatial frequency in dB, of a square under Hann's window in both
/// directions.
fn rings(square: &[f32], mean: f32, fft: &Arc<dyn Fft<f32>>) -> [f32; RINGS] {
    let window = |i: usize| (0.5 - 0.5 * (TAU * (i as f64 + 0.5) / SIDE as f64).cos()) as f32;
    let mut lines: Vec<Complex<f32>> = square
        .iter()
        .enumerate()
        .map(|(i, x)| Complex::new((x - mean) * window(i / SIDE) * window(i % SIDE), 0.0))
        .collect();
    for _ in 0..2 {
        fft.process(&mut lines);
        lines = (0..SIDE * SIDE).map(|i| lines[(i % SIDE) * SIDE + i / SIDE]).collect();
    }
    let (mut sums, mut counts) = ([0.0_f32; RINGS], [0.0_f32; RINGS]);
    let signed = |i: usize| if i > SIDE / 2 { i as f64 - SIDE as f64 } else { i as f64 };
    for (i, x) in lines.iter().enumerate() {
        let radius = signed(i / SIDE).hypot(signed(i % SIDE));
        let ring = (radius.log2() / (SIDE as f64 / 2.0).log2() * RINGS as f64).floor();
        if radius >= 1.0 && ring < RINGS as f64 {
            sums[ring as usize] += x.norm_sqr();
            counts[ring as usize] += 1.0;
        }
    }
    std::array::from_fn(|r| 10.0 * (sums[r] / counts[r].max(1.0) + 1e-6).log10())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn waves(period: f64, phase: f64) -> Image {
        let value = |i: usize| 128.0 + 60.0 * (TAU * (i % IMAGE[1]) as f64 / period + phase).sin();
        let pixels = (0..IMAGE[0] * IMAGE[1]).flat_map(|i| [value(i) as u8; 3]).collect();
        Image { size: IMAGE, pixels }
    }

    #[test]
    fn waves_of_two_lengths_are_told_apart_at_any_phase() {
        let images: Vec<(usize, Image)> =
            (0..16).map(|i| (i % 2, waves([24.0, 12.0][i % 2], i as f64))).collect();
        let given: Vec<(usize, &Image)> = images.iter().map(|(class, image)| (*class, image)).collect();
        let baseline = Statistics::trained(&given[..8], 2);
        let named = baseline.names(&given[8..]);
        assert_eq!(named, [0, 1, 0, 1, 0, 1, 0, 1]);
    }

    #[test]
    fn a_wave_stands_in_the_ring_of_its_frequency() {
        let fft = f32::complex(SIDE, true);
        let numbers = numbers_of(&waves(24.0, 0.3), &fft);
        let rings = &numbers[2..2 + RINGS];
        let loudest = (0..RINGS).max_by(|a, b| rings[*a].total_cmp(&rings[*b])).unwrap();
        // 8 periods a side: log2 8 of log2 96 rings
        assert_eq!(loudest, (3.0 / 96f64.log2() * RINGS as f64) as usize);
    }
}
