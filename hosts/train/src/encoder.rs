//! From a tactile image to a material's vector: the image encoder, and the heads on top of it.

use asperity_numbers::Random;
use asperity_texture::VECTOR_LEN;
use asperity_texture::picture::{IMAGE, Image};
use burn::module::{Module, Param};
use burn::tensor::activation::relu;
use burn::tensor::module::{conv2d, max_pool2d};
use burn::tensor::ops::{ConvOptions, MaxPoolOptions};
use burn::tensor::{Device, Tensor, TensorData};

use serde::{Deserialize, Serialize};

use crate::layer::{Layer, Weights, all_relu, initial, layers, numbers, relu_between, rows};

/// Features of an image: 256 channels of 5 x 7.
pub(crate) const FEATURES: usize = 256 * 5 * 7;
/// Numbers of an image for the image encoder: channels, rows, columns.
pub(crate) const PIXELS: usize = 3 * IMAGE[0] * IMAGE[1];

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, Serialize, Deserialize)]
pub(crate) enum Preset {
    /// The sizes of Heravi et al. 2024: AlexNet's convolutions, heads of 4096 and 512.
    Paper,
    /// The same interfaces, small enough to ship and to train on two cores.
    Compact,
}

impl Preset {
    pub(crate) fn channels(self) -> [usize; 5] {
        match self {
            Self::Paper => [64, 192, 384, 256, 256],
            Self::Compact => [24, 64, 96, 96, 256],
        }
    }

    /// Widths between the features and a head's output.
    pub(crate) fn hidden(self) -> [usize; 2] {
        match self {
            Self::Paper => [4096, 512],
            Self::Compact => [192, 512],
        }
    }
}

/// Geometry of a convolution: edge of the kernel, stride both ways, rows and columns of zeros around the
/// image, and whether [pooling](POOL) follows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Geometry {
    pub kernel: usize,
    pub stride: usize,
    pub padding: usize,
    pub pooled: bool,
}

/// AlexNet's convolutions (Krizhevsky 2014, "One weird trick for parallelizing convolutional neural
/// networks", in torchvision's version).
pub(crate) const GEOMETRY: [Geometry; 5] = [
    Geometry { kernel: 11, stride: 4, padding: 2, pooled: true },
    Geometry { kernel: 5, stride: 1, padding: 2, pooled: true },
    Geometry { kernel: 3, stride: 1, padding: 1, pooled: false },
    Geometry { kernel: 3, stride: 1, padding: 1, pooled: false },
    Geometry { kernel: 3, stride: 1, padding: 1, pooled: true },
];
pub(crate) const POOL: (usize, usize) = (3, 2);
/// Scale and offset of pixels of 0 to 1: x' = scale (x - offset).
pub(crate) const PIXEL_SCALE: (f32, f32) = (4.0, 0.4);

/// A convolution's weights, of \[out, in, kernel, kernel\].
#[derive(Module, Debug)]
struct Convolution {
    weight: Param<Tensor<4>>,
    bias: Param<Tensor<1>>,
}

/// The convolutions, from \[n, 3, 192, 256\] to \[n, 8960\].
#[derive(Module, Debug)]
pub(crate) struct ImageEncoder {
    convolutions: Vec<Convolution>,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Kernel {
    /// Out, in, rows, columns.
    pub shape: [usize; 4],
    /// The last index fastest.
    pub weight: Vec<f32>,
    /// \[out\].
    pub bias: Vec<f32>,
}

impl ImageEncoder {
    pub(crate) fn new(preset: Preset, random: &mut Random, device: &Device) -> Self {
        let channels = preset.channels();
        let inputs = [3, channels[0], channels[1], channels[2], channels[3]];
        let convolution = |((geometry, inputs), outputs): ((Geometry, usize), usize)| {
            let (edge, sources) = (geometry.kernel, inputs * geometry.kernel * geometry.kernel);
            let weight = initial(outputs * sources, sources, 1.0, random);
            let weight = TensorData::new(weight, [outputs, inputs, edge, edge]);
            Convolution {
                weight: Param::from_tensor(Tensor::from_data(weight, device)),
                bias: Param::from_tensor(Tensor::zeros([outputs], device)),
            }
        };
        Self { convolutions: GEOMETRY.into_iter().zip(inputs).zip(channels).map(convolution).collect() }
    }

    /// Features \[n, 8960\] of [scaled](PIXEL_SCALE) images \[n, 3, 192, 256\].
    pub(crate) fn forward(&self, images: Tensor<4>) -> Tensor<2> {
        let x = self.convolutions.iter().zip(GEOMETRY).fold(images, |x, (convolution, g)| {
            let options = ConvOptions::new([g.stride; 2], [g.padding; 2], [1; 2], 1);
            let x = relu(conv2d(x, convolution.weight.val(), Some(convolution.bias.val()), options));
            if g.pooled {
                max_pool2d(x, MaxPoolOptions::new([POOL.0; 2]).with_stride([POOL.1; 2]))
            } else {
                x
            }
        });
        x.flatten(1, 3)
    }

    pub(crate) fn kernels(&self) -> Vec<Kernel> {
        let kernel = |c: &Convolution| Kernel {
            shape: c.weight.val().dims(),
            weight: numbers(c.weight.val()),
            bias: numbers(c.bias.val()),
        };
        self.convolutions.iter().map(kernel).collect()
    }
}

/// Layers from features to something else, ReLU between.
#[derive(Module, Debug)]
pub(crate) struct Head {
    pub(crate) layers: Vec<Layer>,
}

impl Head {
    pub(crate) fn classifier(preset: Preset, classes: usize, random: &mut Random, device: &Device) -> Self {
        let [first, second] = preset.hidden();
        let mut layers = layers(&[FEATURES, first, second], random, device);
        // Small last weights start with no preference.
        layers.push(Layer::new(second, classes, 0.1, random, device));
        Self { layers }
    }

    /// The texture encoder for features times `scale`. It starts as the classifier up to its last
    /// layer, with vector components of about 1 for the `features` \[n, 8960\] of each list.
    pub(crate) fn texture(
        classifier: &Self,
        (features, scale): (&[Vec<f32>], f32),
        random: &mut Random,
        device: &Device,
    ) -> Self {
        let mut weights: Vec<Weights> = classifier.layers.iter().map(Layer::weights).collect();
        weights.pop();
        weights[0].fold((scale.recip(), 0.0), FEATURES);
        let hidden: Vec<Layer> = weights.iter().map(|w| Layer::of(w, device)).collect();
        let plain: Vec<Layer> = weights.iter().map(|w| Layer::of(w, &Device::flex())).collect();
        let squares = |features: &Vec<f32>| {
            let answers = numbers(all_relu(&plain, rows(features.clone(), FEATURES, &Device::flex())));
            answers.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>() / answers.len().max(1) as f64
        };
        let mean_square = features.iter().map(squares).sum::<f64>() / features.len().max(1) as f64;
        let gain = if mean_square > 0.0 { (2.0 * mean_square).sqrt().recip() } else { 1.0 };
        let width = weights.last().map_or(FEATURES, |w| w.outputs);
        let mut layers = hidden;
        layers.push(Layer::new(width, VECTOR_LEN, gain, random, device));
        Self { layers }
    }

    /// \[n, outputs\] of features \[n, 8960\].
    pub(crate) fn forward(&self, features: Tensor<2>) -> Tensor<2> {
        relu_between(&self.layers, features)
    }

    /// Weights for unscaled features and answers times `gain`, with `scale` folded in.
    pub(crate) fn weights(&self, scale: f32, gain: f32) -> Vec<Weights> {
        let mut weights: Vec<Weights> = self.layers.iter().map(Layer::weights).collect();
        weights[0].fold((scale, 0.0), FEATURES);
        let last = weights.len() - 1;
        let Weights { weight, bias, .. } = &mut weights[last];
        weight.iter_mut().chain(bias).for_each(|w| *w *= gain);
        weights
    }
}

/// An image for the encoder: channels, rows, columns, [scaled](PIXEL_SCALE), each channel first times a
/// gain.
pub(crate) fn planes(image: &Image, gain: [f32; 3], out: &mut Vec<f32>) {
    let (scale, offset) = PIXEL_SCALE;
    for (channel, gain) in gain.into_iter().enumerate() {
        let pixels = image.pixels.iter().skip(channel).step_by(3);
        out.extend(pixels.map(|p| scale * (gain * f32::from(*p) / 255.0 - offset)));
    }
}

/// Features of images in order, computed in batches.
pub(crate) fn features(encoder: &ImageEncoder, images: &[&Image], device: &Device) -> Vec<f32> {
    const AT_ONCE: usize = 16;
    let mut all = Vec::with_capacity(images.len() * FEATURES);
    for some in images.chunks(AT_ONCE) {
        let mut pixels = Vec::with_capacity(some.len() * PIXELS);
        some.iter().for_each(|image| planes(image, [1.0; 3], &mut pixels));
        let data = TensorData::new(pixels, [some.len(), 3, IMAGE[0], IMAGE[1]]);
        all.extend(numbers(encoder.forward(Tensor::from_data(data, device))));
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_presets_make_8960_numbers_and_paper_is_alexnet() {
        let (device, random) = (Device::flex(), &mut Random::new(1));
        let image = Image { size: IMAGE, pixels: (0..PIXELS).map(|i| (i % 251) as u8).collect() };
        for preset in [Preset::Paper, Preset::Compact] {
            let encoder = ImageEncoder::new(preset, random, &device);
            assert_eq!(features(&encoder, &[&image], &device).len(), FEATURES);
        }
        let kernels = ImageEncoder::new(Preset::Paper, random, &device).kernels();
        let parameters: usize = kernels.iter().map(|k| k.weight.len() + k.bias.len()).sum();
        // The published sum for AlexNet's features.
        assert_eq!(parameters, 2_469_696);
    }

    #[test]
    fn planes_are_channels_one_after_the_other() {
        let image = Image { size: IMAGE, pixels: [255, 0, 51].repeat(IMAGE[0] * IMAGE[1]) };
        let mut out = Vec::new();
        planes(&image, [1.0, 1.0, 2.0], &mut out);
        let plane = IMAGE[0] * IMAGE[1];
        assert_eq!([out[0], out[plane], out[2 * plane], out[3 * plane - 1]], [2.4, -1.6, 0.0, 0.0]);
    }
}
