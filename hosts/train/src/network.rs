//! The network of Heravi et al. 2024, at its layer sizes, for training.

use asperity_world::material::{BINS, Random, VECTOR_LEN};
use burn::module::{Module, Param};
use burn::tensor::activation::relu;
use burn::tensor::{Device, Tensor, TensorData};

use asperity_dataset::HISTORY;

/// Widths of the force branch, its input first.
pub(crate) const FORCE: [usize; 4] = [HISTORY, 10, 10, 10];
/// Widths of the speed branch, its input first.
pub(crate) const SPEED: [usize; 5] = [2 * HISTORY, 20, 20, 20, 10];
/// Widths of the action branch, whose input is force and speed.
pub(crate) const ACTION: [usize; 5] = [20, 400, 300, 200, 100];
/// Widths of the predictor, whose input is texture and action.
pub(crate) const PREDICTOR: [usize; 6] = [VECTOR_LEN + 100, 300, 300, 200, 100, BINS];

/// A fully connected layer, `x W + b`, `W` of \[in, out\].
#[derive(Module, Debug)]
pub(crate) struct Layer {
    weight: Param<Tensor<2>>,
    bias: Param<Tensor<1>>,
}

/// A layer's numbers.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Weights {
    /// Inputs.
    pub inputs: usize,
    /// Outputs.
    pub outputs: usize,
    /// \[in, out\], row by row.
    pub weight: Vec<f32>,
    /// \[out\].
    pub bias: Vec<f32>,
}

/// The network. It works on inputs scaled by [`Scaling`]; output is m/s^2 before the last ReLU.
#[derive(Module, Debug)]
pub(crate) struct Network {
    force: Vec<Layer>,
    speed: Vec<Layer>,
    action: Vec<Layer>,
    predictor: Vec<Layer>,
}

/// The network's numbers, for export.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct NetworkWeights {
    /// Force branch.
    pub force: Vec<Weights>,
    /// Speed branch.
    pub speed: Vec<Weights>,
    /// Action branch.
    pub action: Vec<Weights>,
    /// Predictor.
    pub predictor: Vec<Weights>,
}

impl Layer {
    /// He's uniform initialisation (2015), from our own generator so that a seed means the same everywhere.
    fn new(inputs: usize, outputs: usize, gain: f64, random: &mut Random, device: &Device) -> Self {
        let bound = gain * (6.0 / inputs as f64).sqrt();
        let weight: Vec<f32> = (0..inputs * outputs).map(|_| random.range(-bound, bound) as f32).collect();
        Self {
            weight: Param::from_tensor(Tensor::from_data(TensorData::new(weight, [inputs, outputs]), device)),
            bias: Param::from_tensor(Tensor::zeros([outputs], device)),
        }
    }

    fn forward(&self, x: Tensor<2>) -> Tensor<2> {
        x.matmul(self.weight.val()) + self.bias.val().unsqueeze()
    }

    fn weights(&self) -> Weights {
        let [inputs, outputs] = self.weight.val().dims();
        Weights {
            inputs,
            outputs,
            weight: self.weight.val().into_data().iter::<f32>().collect(),
            bias: self.bias.val().into_data().iter::<f32>().collect(),
        }
    }
}

fn layers(widths: &[usize], random: &mut Random, device: &Device) -> Vec<Layer> {
    widths.windows(2).map(|w| Layer::new(w[0], w[1], 1.0, random, device)).collect()
}

fn all_relu(layers: &[Layer], x: Tensor<2>) -> Tensor<2> {
    layers.iter().fold(x, |x, layer| relu(layer.forward(x)))
}

impl Network {
    /// A network to be trained.
    pub(crate) fn new(seed: u64, device: &Device) -> Self {
        let mut random = Random::new(seed);
        let force = layers(&FORCE, &mut random, device);
        let speed = layers(&SPEED, &mut random, device);
        let action = layers(&ACTION, &mut random, device);
        let [hidden @ .., outputs] = PREDICTOR;
        let mut predictor = layers(&hidden, &mut random, device);
        // Magnitudes are small numbers: begin with small answers.
        predictor.push(Layer::new(hidden[hidden.len() - 1], outputs, 0.02, &mut random, device));
        Self { force, speed, action, predictor }
    }

    /// Magnitudes before the last ReLU, \[n, 100\], from scaled inputs \[n, 10\], \[n, 20\] and \[n, 256\].
    pub(crate) fn forward(&self, force: Tensor<2>, speed: Tensor<2>, texture: Tensor<2>) -> Tensor<2> {
        let force = all_relu(&self.force, force);
        let speed = all_relu(&self.speed, speed);
        let action = all_relu(&self.action, Tensor::cat(vec![force, speed], 1));
        let x = Tensor::cat(vec![texture, action], 1);
        match self.predictor.split_last() {
            Some((last, hidden)) => last.forward(all_relu(hidden, x)),
            None => x,
        }
    }

    /// The numbers.
    pub(crate) fn weights(&self) -> NetworkWeights {
        let all = |layers: &[Layer]| layers.iter().map(Layer::weights).collect();
        NetworkWeights {
            force: all(&self.force),
            speed: all(&self.speed),
            action: all(&self.action),
            predictor: all(&self.predictor),
        }
    }
}

/// How inputs are scaled before the network: x' = scale (x - offset).
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Scaling {
    /// Offset of each texture entry: its mean over the library.
    pub texture_offset: Vec<f32>,
    /// Scale of texture entries: one over their common deviation.
    pub texture_scale: f32,
}

/// Scale and offset of forces: to about -1.2..1.2.
pub(crate) const FORCE_SCALE: (f32, f32) = (1.0 / 1.5, 1.75);
/// Scale of velocities: to about -3..3. No offset, as directions are equal.
pub(crate) const SPEED_SCALE: f32 = 0.01;

impl Scaling {
    /// The scaling for a library's vectors.
    pub(crate) fn of(vectors: &[&[f32; VECTOR_LEN]]) -> Self {
        let n = vectors.len().max(1) as f32;
        let texture_offset: Vec<f32> =
            (0..VECTOR_LEN).map(|i| vectors.iter().map(|v| v[i]).sum::<f32>() / n).collect();
        let squares: f32 = vectors
            .iter()
            .flat_map(|v| v.iter().zip(&texture_offset))
            .map(|(x, mean)| (x - mean).powi(2))
            .sum();
        let deviation = (squares / (n * VECTOR_LEN as f32)).sqrt();
        Self { texture_offset, texture_scale: if deviation > 0.0 { 1.0 / deviation } else { 1.0 } }
    }

    /// Folds the scaling into the weights of the layers that read inputs, so that they take N, mm/s and library
    /// vectors as they are.
    pub(crate) fn fold_into(&self, network: &mut NetworkWeights) {
        let (scale, offset) = FORCE_SCALE;
        if let Some(first) = network.force.first_mut() {
            first.fold(|_| (scale, offset), HISTORY);
        }
        if let Some(first) = network.speed.first_mut() {
            first.fold(|_| (SPEED_SCALE, 0.0), 2 * HISTORY);
        }
        if let Some(first) = network.predictor.first_mut() {
            first.fold(|i| (self.texture_scale, self.texture_offset[i]), VECTOR_LEN);
        }
    }
}

impl Weights {
    /// Takes x' = scale (x - offset) of the first `n` inputs into the weights.
    fn fold(&mut self, scaling: impl Fn(usize) -> (f32, f32), n: usize) {
        for (i, row) in self.weight.chunks_exact_mut(self.outputs).take(n).enumerate() {
            let (scale, offset) = scaling(i);
            for (w, b) in row.iter_mut().zip(&mut self.bias) {
                *w *= scale;
                *b -= *w * offset;
            }
        }
    }
}

impl NetworkWeights {
    /// All layers in order of execution.
    pub(crate) fn layers(&self) -> impl Iterator<Item = &Weights> {
        self.force.iter().chain(&self.speed).chain(&self.action).chain(&self.predictor)
    }

    /// Multiplications and additions of one evaluation.
    pub(crate) fn multiply_adds(&self) -> usize {
        self.layers().map(|l| l.weight.len()).sum()
    }

    /// Weights and biases.
    pub(crate) fn parameters(&self) -> usize {
        self.layers().map(|l| l.weight.len() + l.bias.len()).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_layer_sizes_are_the_papers() {
        let weights = Network::new(1, &Device::flex()).weights();
        assert_eq!(weights.multiply_adds(), 496_500);
        // with the texture's part of the predictor's first layer folded into its bias
        assert_eq!(weights.multiply_adds() - VECTOR_LEN * 300, 419_700);
    }

    #[test]
    fn a_seed_gives_the_same_network_again() {
        let device = Device::flex();
        assert_eq!(Network::new(3, &device).weights(), Network::new(3, &device).weights());
        assert_ne!(Network::new(3, &device).weights(), Network::new(4, &device).weights());
    }

    #[test]
    fn folding_the_scaling_changes_no_answer() {
        let mut layer = Weights { inputs: 2, outputs: 1, weight: vec![3.0, -2.0], bias: vec![0.5] };
        let answer = |l: &Weights, x: [f32; 2]| l.bias[0] + x[0] * l.weight[0] + x[1] * l.weight[1];
        let scaled = answer(&layer, [0.25 * (7.0 - 1.0), 5.0]);
        layer.fold(|_| (0.25, 1.0), 1);
        assert_eq!(answer(&layer, [7.0, 5.0]), scaled);
    }
}
