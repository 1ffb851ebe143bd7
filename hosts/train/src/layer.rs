//! Fully connected layers, and helpers of all layers.

use std::ops::Range;

use asperity_numbers::Random;
use burn::module::{Module, Param};
use burn::tensor::activation::relu;
use burn::tensor::{Device, Tensor, TensorData};

/// A fully connected layer, `x W + b`, `W` of \[in, out\].
#[derive(Module, Debug)]
pub(crate) struct Layer {
    weight: Param<Tensor<2>>,
    bias: Param<Tensor<1>>,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Weights {
    pub inputs: usize,
    pub outputs: usize,
    /// \[in, out\], row by row.
    pub weight: Vec<f32>,
    /// \[out\].
    pub bias: Vec<f32>,
}

/// Random weights of He's uniform initialisation (He, Zhang, Ren, Sun 2015) for `inputs` inputs, times
/// `gain`. They come from our own generator, so a seed means the same everywhere.
pub(crate) fn initial(count: usize, inputs: usize, gain: f64, random: &mut Random) -> Vec<f32> {
    let bound = gain * (6.0 / inputs as f64).sqrt();
    (0..count).map(|_| random.range(-bound, bound) as f32).collect()
}

impl Layer {
    pub(crate) fn new(
        inputs: usize,
        outputs: usize,
        gain: f64,
        random: &mut Random,
        device: &Device,
    ) -> Self {
        let weight = initial(inputs * outputs, inputs, gain, random);
        Self::of(&Weights { inputs, outputs, weight, bias: vec![0.0; outputs] }, device)
    }

    /// A trainable layer of these weights.
    pub(crate) fn of(weights: &Weights, device: &Device) -> Self {
        let Weights { outputs, weight, bias, .. } = weights;
        let bias = TensorData::new(bias.clone(), [*outputs]);
        Self {
            weight: Param::from_tensor(rows(weight.clone(), *outputs, device)),
            bias: Param::from_tensor(Tensor::from_data(bias, device)),
        }
    }

    pub(crate) fn forward(&self, x: Tensor<2>) -> Tensor<2> {
        x.matmul(self.weight.val()) + self.bias.val().unsqueeze()
    }

    pub(crate) fn weights(&self) -> Weights {
        let [inputs, outputs] = self.weight.val().dims();
        Weights { inputs, outputs, weight: numbers(self.weight.val()), bias: numbers(self.bias.val()) }
    }
}

/// Numbers as rows of a width.
pub(crate) fn rows(numbers: Vec<f32>, width: usize, device: &Device) -> Tensor<2> {
    let count = numbers.len() / width;
    Tensor::from_data(TensorData::new(numbers, [count, width]), device)
}

/// All numbers of a tensor with the last index fastest.
pub(crate) fn numbers<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().iter::<f32>().collect()
}

/// Consecutive layers of these widths, the input's first.
pub(crate) fn layers(widths: &[usize], random: &mut Random, device: &Device) -> Vec<Layer> {
    widths.windows(2).map(|w| Layer::new(w[0], w[1], 1.0, random, device)).collect()
}

pub(crate) fn all_relu(layers: &[Layer], x: Tensor<2>) -> Tensor<2> {
    layers.iter().fold(x, |x, layer| relu(layer.forward(x)))
}

pub(crate) fn relu_between(layers: &[Layer], x: Tensor<2>) -> Tensor<2> {
    match layers.split_last() {
        Some((last, hidden)) => last.forward(all_relu(hidden, x)),
        None => x,
    }
}

impl Weights {
    pub(crate) fn columns(&self, columns: Range<usize>) -> Self {
        let rows = self.weight.chunks_exact(self.outputs);
        Self {
            inputs: self.inputs,
            outputs: columns.len(),
            weight: rows.flat_map(|row| &row[columns.clone()]).copied().collect(),
            bias: self.bias[columns.clone()].to_vec(),
        }
    }

    /// Folds x' = scale (x - offset) of the first `n` inputs into the weights.
    pub(crate) fn fold(&mut self, (scale, offset): (f32, f32), n: usize) {
        for row in self.weight.chunks_exact_mut(self.outputs).take(n) {
            for (w, b) in row.iter_mut().zip(&mut self.bias) {
                *w *= scale;
                *b -= *w * offset;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_keep_their_weights_and_biases() {
        let layer = Weights {
            inputs: 2,
            outputs: 3,
            weight: (0..6u8).map(f32::from).collect(),
            bias: vec![7.0, 8.0, 9.0],
        };
        let some = layer.columns(1..3);
        assert_eq!((some.inputs, some.outputs), (2, 2));
        assert_eq!((some.weight, some.bias), (vec![1.0, 2.0, 4.0, 5.0], vec![8.0, 9.0]));
    }

    #[test]
    fn folding_the_scaling_changes_no_answer() {
        let mut layer = Weights { inputs: 2, outputs: 1, weight: vec![3.0, -2.0], bias: vec![0.5] };
        let answer = |l: &Weights, x: [f32; 2]| l.bias[0] + x[0] * l.weight[0] + x[1] * l.weight[1];
        let scaled = answer(&layer, [0.25 * (7.0 - 1.0), 5.0]);
        layer.fold((0.25, 1.0), 1);
        assert_eq!(answer(&layer, [7.0, 5.0]), scaled);
    }
}
