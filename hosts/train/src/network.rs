//! The tick network: that of Heravi et al. 2024, with a wider branch for speed and logarithms in the
//! last layer.

use asperity_data::HISTORY;
use asperity_dsp::frame::BINS;
use asperity_numbers::Random;
use asperity_texture::VECTOR_LEN;
use burn::module::Module;
use burn::tensor::{Device, Tensor};

use crate::data::Reach;
use crate::layer::{Layer, Weights, all_relu, layers};
use crate::loss::RAYLEIGH;

/// Widths of the force branch, its input first.
const FORCE: [usize; 4] = [HISTORY, 10, 10, 10];
/// Widths of the speed branch, its input first.
const SPEED: [usize; 5] = [2 * HISTORY, 96, 80, 40, 20];
/// Preferred directions of the units in the speed branch's first layer.
const DIRECTIONS: usize = 16;
/// Thresholds of these units in mm/s. Spectra of round bumps fall by 10 dB within a few mm/s at low
/// speed and hardly change at high speed. They are for data up to 300 mm/s, and scale with other
/// ranges.
const FROM_MM_S: [f64; 6] = [0.0, 8.0, 18.0, 35.0, 70.0, 140.0];
/// Widths of the action branch, whose input is force and speed.
const ACTION: [usize; 5] = [30, 400, 300, 200, 100];
/// Widths of the predictor up to its last layer. Its input is texture and action.
const PREDICTOR: [usize; 5] = [VECTOR_LEN + 100, 300, 300, 200, 100];

/// Scaling of the network's inputs: x' = scale (x - offset).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Scaling {
    /// Scale and offset of forces: to about -1.2 .. 1.2.
    pub force: (f32, f32),
    /// Scale of velocities: to -3 .. 3. It has no offset, as directions are equal.
    pub speed: f32,
}

impl Scaling {
    pub(crate) fn of(reach: Reach) -> Self {
        let (force, speed) = (reach.force_n as f32, reach.speed_mm_s as f32);
        Self { force: (7.0 / 3.0 / force, 0.5 * force), speed: 3.0 / speed }
    }
}

/// First answer for all magnitudes [m/s^2].
const FIRST: f32 = 0.05;
const MOST_LOG: f32 = 30.0;

/// The network, from scaled forces and velocities to m/s^2.
///
/// Its last layer gives logarithms of magnitudes. Spectra fall by 10 dB from bin to bin and from speed
/// to speed, and a sum of positive parts is seldom right at small values.
#[derive(Module, Debug)]
pub(crate) struct Network {
    force: Vec<Layer>,
    speed: Vec<Layer>,
    action: Vec<Layer>,
    predictor: Vec<Layer>,
    magnitudes: Layer,
    scatter: Layer,
}

/// Answers for n touches; ratio and variance are before the last ReLU.
pub(crate) struct Answers {
    /// Magnitudes in m/s^2, \[n, 100\].
    pub magnitudes: Tensor<2>,
    /// Mean over root mean square of each magnitude, \[n, 100\].
    pub ratio: Tensor<2>,
    /// Normalised variance of a frame's power, \[n, 1\].
    pub variance: Tensor<2>,
}

/// Weights for export, with inputs in N and mm/s.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct NetworkWeights {
    pub force: Vec<Weights>,
    pub speed: Vec<Weights>,
    pub action: Vec<Weights>,
    pub predictor: Vec<Weights>,
    /// Last layer, of the magnitudes' logarithms.
    pub magnitudes: Weights,
    pub ratio: Weights,
    pub variance: Weights,
}

impl Network {
    pub(crate) fn new(random: &mut Random, device: &Device) -> Self {
        let force = layers(&FORCE, random, device);
        let mut speed = layers(&SPEED, random, device);
        speed[0] = Layer::of(&compass(), device);
        let action = layers(&ACTION, random, device);
        let predictor = layers(&PREDICTOR, random, device);
        let width = PREDICTOR[PREDICTOR.len() - 1];
        // Magnitudes are small, so answers start small.
        let mut magnitudes = Layer::new(width, BINS, 0.02, random, device).weights();
        magnitudes.bias.fill(FIRST.ln());
        let magnitudes = Layer::of(&magnitudes, device);
        // Answers start with noise of about ten independent bins.
        let bias = [vec![RAYLEIGH; BINS], vec![0.1]].concat();
        let (inputs, outputs) = (width, bias.len());
        let weights = Weights { inputs, outputs, weight: vec![0.0; inputs * outputs], bias };
        Self { force, speed, action, predictor, magnitudes, scatter: Layer::of(&weights, device) }
    }

    /// Answers for scaled inputs \[n, 10\] and \[n, 20\], and vectors \[n, 256\].
    pub(crate) fn forward(&self, force: Tensor<2>, speed: Tensor<2>, texture: Tensor<2>) -> Answers {
        let force = all_relu(&self.force, force);
        let speed = all_relu(&self.speed, speed);
        let action = all_relu(&self.action, Tensor::cat(vec![force, speed], 1));
        let hidden = all_relu(&self.predictor, Tensor::cat(vec![texture, action], 1));
        let scatter = self.scatter.forward(hidden.clone());
        Answers {
            magnitudes: self.magnitudes.forward(hidden).clamp(-MOST_LOG, MOST_LOG).exp(),
            ratio: scatter.clone().narrow(1, 0, BINS),
            variance: scatter.narrow(1, BINS, 1),
        }
    }

    /// Gives ratio and variance random positive weights.
    #[cfg(test)]
    pub(crate) fn scattered(mut self, random: &mut Random, device: &Device) -> Self {
        let mut weights = self.scatter.weights();
        weights.weight.fill_with(|| random.range(0.0, 5e-3) as f32);
        weights.bias.fill(0.1);
        self.scatter = Layer::of(&weights, device);
        self
    }

    /// Network whose answer for vectors times `scale` is this one's for the vectors.
    pub(crate) fn for_vectors_times(mut self, scale: f32, device: &Device) -> Self {
        let mut first = self.predictor[0].weights();
        first.fold((scale.recip(), 0.0), VECTOR_LEN);
        self.predictor[0] = Layer::of(&first, device);
        self
    }

    /// Weights with the scaling of inputs folded in.
    pub(crate) fn weights(&self, scaling: Scaling) -> NetworkWeights {
        let all = |layers: &[Layer]| -> Vec<Weights> { layers.iter().map(Layer::weights).collect() };
        let (mut force, mut speed) = (all(&self.force), all(&self.speed));
        force[0].fold(scaling.force, HISTORY);
        speed[0].fold((scaling.speed, 0.0), 2 * HISTORY);
        let scatter = self.scatter.weights();
        NetworkWeights {
            force,
            speed,
            action: all(&self.action),
            predictor: all(&self.predictor),
            magnitudes: self.magnitudes.weights(),
            ratio: scatter.columns(0..BINS),
            variance: scatter.columns(BINS..BINS + 1),
        }
    }
}

/// Initial first layer of the speed branch: each unit answers a velocity in one direction above its own
/// threshold.
fn compass() -> Weights {
    let (inputs, outputs) = (SPEED[0], DIRECTIONS * FROM_MM_S.len());
    let (mut weight, mut bias) = (vec![0.0; inputs * outputs], Vec::with_capacity(outputs));
    let scale = f64::from(Scaling::of(Reach::DRAWN).speed);
    for unit in 0..outputs {
        let (direction, from) = (unit / FROM_MM_S.len(), scale * FROM_MM_S[unit % FROM_MM_S.len()]);
        let gain = (from + 0.1).powf(-0.5);
        let (y, x) = (direction as f64 / DIRECTIONS as f64 * std::f64::consts::TAU).sin_cos();
        // Units alternate between the mean of the history and of its latest half.
        let first = if direction % 2 == 0 { 0 } else { HISTORY / 2 };
        for age in first..HISTORY {
            let part = gain / (HISTORY - first) as f64;
            weight[age * outputs + unit] = (part * x) as f32;
            weight[(HISTORY + age) * outputs + unit] = (part * y) as f32;
        }
        bias.push((-gain * from) as f32);
    }
    Weights { inputs, outputs, weight, bias }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layer::{numbers, rows};

    #[test]
    fn a_network_has_512700_weights_and_10100_more_for_scatter() {
        let w = Network::new(&mut Random::new(1), &Device::flex()).weights(Scaling::of(Reach::DRAWN));
        let sizes = |layers: &[Weights]| layers.iter().map(|l| l.weight.len()).sum::<usize>();
        assert_eq!(sizes(&[w.force, w.speed, w.action, w.predictor, vec![w.magnitudes]].concat()), 512_700);
        assert_eq!(sizes(&[w.ratio, w.variance]), 10_100);
    }

    #[test]
    fn speed_units_have_different_thresholds_and_one_direction() {
        let (layer, scale) = (compass(), Scaling::of(Reach::DRAWN).speed);
        assert_eq!((layer.inputs, layer.outputs), (SPEED[0], SPEED[1]));
        let answer = |unit: usize, velocity: [f32; 2]| {
            let weight = |input: usize| layer.weight[input * layer.outputs + unit];
            let sum: f32 = (0..layer.inputs).map(|i| scale * velocity[i / HISTORY] * weight(i)).sum();
            (sum + layer.bias[unit]).max(0.0)
        };
        for (unit, from) in FROM_MM_S.map(|from| from as f32).into_iter().enumerate() {
            assert!(answer(unit, [from + 1.0, 0.0]) > 0.0, "{from}");
            assert!(answer(unit, [from - 1.0, 0.0]) == 0.0 && answer(unit, [-300.0, 0.0]) == 0.0, "{from}");
            // A quarter of a turn further.
            assert!(answer(unit + DIRECTIONS / 4 * FROM_MM_S.len(), [0.0, from + 1.0]) > 0.0, "{from}");
        }
    }

    #[test]
    fn vectors_of_another_size_have_the_same_answer() {
        let (device, random) = (Device::flex(), &mut Random::new(2));
        let mut row = |width: usize, scale: f32| -> Tensor<2> {
            rows((0..width).map(|_| scale * random.range(-1.0, 1.0) as f32).collect(), width, &device)
        };
        let (force, speed, vector) = (row(HISTORY, 1.0), row(2 * HISTORY, 1.0), row(VECTOR_LEN, 6.0));
        let network = Network::new(&mut Random::new(1), &device);
        let other = network.clone().for_vectors_times(0.25, &device);
        let answer = numbers(network.forward(force.clone(), speed.clone(), vector.clone()).magnitudes);
        let scaled = numbers(other.forward(force, speed, vector * 0.25).magnitudes);
        assert!(answer.iter().zip(&scaled).all(|(a, b)| (a - b).abs() < 1e-5), "{answer:?} {scaled:?}");
    }

    #[test]
    fn a_seed_gives_the_same_network_again() {
        let scaling = Scaling::of(Reach::DRAWN);
        let made = |seed| Network::new(&mut Random::new(seed), &Device::flex()).weights(scaling);
        assert_eq!(made(3), made(3));
        assert_ne!(made(3), made(4));
    }
}
