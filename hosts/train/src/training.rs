//! The training loop.
//!
//! Targets are the law's expected magnitudes, not magnitudes of drawn signals: squared error on draws would end at
//! the same mean, but a draw is Rayleigh distributed, 5.6 dB of noise that the network would first have to average
//! away, and compressed as below its mean would be another.

use std::sync::mpsc;

use asperity_dsp::filter::FilterError;
use asperity_world::material::{BINS, LawTable, MadeMaterial, Random, VECTOR_LEN, embed};
use burn::optim::{AdamConfig, GradientsParams};
use burn::tensor::{Device, Tensor, TensorData};

use crate::network::{FORCE_SCALE, Network, NetworkWeights, SPEED_SCALE, Scaling};
use asperity_dataset::{HISTORY, Histories, MAX_SPEED_MM_S};

/// Amplitude at which the loss turns from linear to logarithmic [m/s^2]: a third of what a fingertip feels at best.
pub(crate) const FLOOR_M_S2: f32 = 0.005;
/// Silence is trained as this [m/s^2], so that the last ReLU makes it exact.
const BELOW_SILENCE_M_S2: f32 = -0.002;
/// Batches drawn ahead on the second thread.
const AHEAD: usize = 4;

/// What a run is given.
#[derive(Clone, Debug)]
pub(crate) struct Settings {
    /// Steps of the optimiser.
    pub steps: usize,
    /// Histories a step.
    pub batch: usize,
    /// Seed of weights and histories.
    pub seed: u64,
    /// Largest learning rate.
    pub learning_rate: f64,
}

/// Where a run stands after a step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Progress {
    /// Steps done.
    pub step: usize,
    /// Mean loss since the last report.
    pub loss: f64,
}

/// Steps between two reports.
pub(crate) const REPORT_EVERY: usize = 50;

/// Compression under which errors are squared: sign(x) ln(1 + |x| / floor).
pub(crate) fn compressed(x: f32) -> f32 {
    x.signum() * (x.abs() / FLOOR_M_S2).ln_1p()
}

/// The target of an expected magnitude, compressed.
fn target(expected: f32) -> f32 {
    // fades within a tenth of the floor's dB: above 0.01 m/s^2 a target is the expectation to 0.1 %
    compressed(expected + BELOW_SILENCE_M_S2 * (-expected / 0.0015).exp())
}

struct Batch {
    force: Vec<f32>,
    speed: Vec<f32>,
    texture: Vec<f32>,
    target: Vec<f32>,
}

/// Draws batches: a history, a material, the law's answer.
struct Batches {
    histories: Histories,
    tables: Vec<LawTable>,
    textures: Vec<Vec<f32>>,
    random: Random,
}

impl Batches {
    fn new(materials: &[MadeMaterial], scaling: &Scaling, seed: u64) -> Result<Self, FilterError> {
        let texture = |m: &MadeMaterial| {
            let vector = embed(&m.law);
            let scaled = |(x, offset): (&f32, &f32)| scaling.texture_scale * (x - offset);
            vector.iter().zip(&scaling.texture_offset).map(scaled).collect()
        };
        Ok(Self {
            histories: Histories::new()?,
            tables: materials.iter().map(|m| LawTable::new(&m.law, MAX_SPEED_MM_S + 10.0)).collect(),
            textures: materials.iter().map(texture).collect(),
            random: Random::new(seed ^ 0x0005_eed0_fba7_c4e5),
        })
    }

    fn draw(&mut self, n: usize) -> Batch {
        let mut batch = Batch {
            force: Vec::with_capacity(n * HISTORY),
            speed: Vec::with_capacity(n * 2 * HISTORY),
            texture: Vec::with_capacity(n * VECTOR_LEN),
            target: Vec::with_capacity(n * BINS),
        };
        let mut expected = [0.0; BINS];
        for _ in 0..n {
            let history = self.histories.draw(&mut self.random);
            let material = self.random.below(self.tables.len());
            self.tables[material].expected_after(&history.clean, &mut expected);
            batch.force.extend(history.force.map(|f| FORCE_SCALE.0 * (f - FORCE_SCALE.1)));
            batch.speed.extend(history.velocity.map(|v| SPEED_SCALE * v));
            batch.texture.extend_from_slice(&self.textures[material]);
            batch.target.extend(expected.map(target));
        }
        batch
    }
}

/// Learning rate of a step: a linear start, then half a cosine down to a hundredth.
fn learning_rate(settings: &Settings, step: usize) -> f64 {
    let warm_up = (settings.steps / 50).clamp(1, 500);
    if step < warm_up {
        return settings.learning_rate * (step + 1) as f64 / warm_up as f64;
    }
    let part = (step - warm_up) as f64 / (settings.steps - warm_up).max(1) as f64;
    let cosine = 0.5 + 0.5 * (std::f64::consts::PI * part).cos();
    settings.learning_rate * (0.01 + 0.99 * cosine)
}

/// Trains a network on the made materials and returns it with scaling folded in: inputs in N, mm/s and library vectors.
/// The same settings give the same bits on one machine type.
///
/// # Errors
/// None in practice: the chain's filter has a fixed design.
pub(crate) fn train(
    materials: &[MadeMaterial],
    settings: &Settings,
    mut report: impl FnMut(Progress),
) -> Result<NetworkWeights, FilterError> {
    let vectors: Vec<_> = materials.iter().map(|m| embed(&m.law)).collect();
    let scaling = Scaling::of(&vectors.iter().collect::<Vec<_>>());
    let mut batches = Batches::new(materials, &scaling, settings.seed)?;
    let device = Device::flex().autodiff();

    let network = std::thread::scope(|scope| {
        let mut network = Network::new(settings.seed, &device);
        let mut adam = AdamConfig::new().init();
        let (send, receive) = mpsc::sync_channel(AHEAD);
        let (steps, size) = (settings.steps, settings.batch);
        scope.spawn(move || {
            for _ in 0..steps {
                if send.send(batches.draw(size)).is_err() {
                    break;
                }
            }
        });
        let mut losses = 0.0;
        for (step, batch) in receive.iter().enumerate() {
            let tensor = |numbers: Vec<f32>, width: usize| -> Tensor<2> {
                Tensor::from_data(TensorData::new(numbers, [size, width]), &device)
            };
            let answer = network.forward(
                tensor(batch.force, HISTORY),
                tensor(batch.speed, 2 * HISTORY),
                tensor(batch.texture, VECTOR_LEN),
            );
            let compressed = answer.clone().sign() * (answer.abs() / FLOOR_M_S2).log1p();
            let error = compressed - tensor(batch.target, BINS);
            let loss = (error.clone() * error).mean();
            losses += f64::from(loss.clone().into_scalar::<f32>());
            let gradients = GradientsParams::from_grads(loss.backward(), &network);
            network = adam.step(learning_rate(settings, step), network, gradients);
            if (step + 1) % REPORT_EVERY == 0 || step + 1 == settings.steps {
                let since = step % REPORT_EVERY + 1;
                report(Progress { step: step + 1, loss: losses / since as f64 });
                losses = 0.0;
            }
        }
        network
    });

    let mut weights = network.weights();
    scaling.fold_into(&mut weights);
    Ok(weights)
}

#[cfg(test)]
#[path = "training_tests.rs"]
mod tests;
