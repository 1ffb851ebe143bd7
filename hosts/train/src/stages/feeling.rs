//! Stage two: texture encoder and tick network.

use asperity_data::{Example, HISTORY, Subject, Truth};
use asperity_dsp::frame::BINS;
use asperity_numbers::Random;
use asperity_texture::VECTOR_LEN;
use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor, TensorData};

use super::kin::{Kin, naming_loss};
use super::looks::Looks;
use super::naming::STRANGE_WEIGHT;
use super::random;
use super::sight::dropout;
use crate::descent::{Losses, Progress, Stage};
use crate::encoder::{FEATURES, Head};
use crate::failure::Failure;
use crate::loss::{Aim, RAYLEIGH, Scales, Scattered, Target, foreseen, square_of_noise, two_of};
use crate::network::{Network, Scaling};

/// Texture encoder and tick network.
#[derive(Module, Debug)]
pub(crate) struct Feeler {
    pub(crate) texture: Head,
    pub(crate) network: Network,
}

/// A [`Feeler`] and the centre of each material's vectors.
#[derive(Module, Debug)]
pub(crate) struct Learner {
    pub(crate) feeler: Feeler,
    /// \[classes, 256\].
    centres: Param<Tensor<2>>,
}

/// Fall of a vector's score for a material with each squared unit of distance from the material's
/// centre.
const SHARPNESS: f32 = 1.0;

impl Learner {
    /// A learner with initial weights. Its texture encoder is the classifier of stage one up to the
    /// last layer, so it already separates materials.
    pub(crate) fn new(classifier: &Head, looks: &Looks, seed: u64, device: &Device) -> Self {
        let random = &mut random(seed, 2, usize::MAX);
        let texture = Head::texture(classifier, (&looks.seen, looks.scale), random, device);
        let network = Network::new(random, device);
        let spread = |_| 0.1 * random.normal() as f32;
        let classes = looks.seen.len();
        let centres = TensorData::new((0..classes * VECTOR_LEN).map(spread).collect(), [classes, VECTOR_LEN]);
        let centres = Param::from_tensor(Tensor::from_data(centres, device));
        Self { feeler: Feeler { texture, network }, centres }
    }

    /// Scores \[n, classes\] of vectors: minus [`SHARPNESS`] times the squared distance, up to a term
    /// common to all classes.
    fn scores(&self, vectors: Tensor<2>) -> Tensor<2> {
        let centres = self.centres.val();
        let squares: Tensor<2> = centres.clone().powi_scalar(2).sum_dim(1).transpose();
        (vectors.matmul(centres.transpose()) * 2.0 - squares) * SHARPNESS
    }
}

/// A random row of `width` numbers.
fn drawn<'a>(rows: &'a [f32], width: usize, random: &mut Random) -> &'a [f32] {
    let row = random.below(rows.len() / width);
    &rows[row * width..(row + 1) * width]
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
    /// Target.
    pub target: Target,
    /// Weighting of errors.
    pub aim: Aim,
    /// Scaling of forces and velocities.
    pub scaling: Scaling,
}

/// Share of silent touches: force without speed, or speed without force.
const SILENT: f64 = 0.08;

/// Felt magnitudes and the weights of their errors.
struct Felt<'a> {
    subjects: &'a [Subject],
    scales: Vec<Scales>,
    settings: Touching,
}

/// Examples of one batch: \[groups * each, ..\].
struct Touches {
    force: Vec<f32>,
    speed: Vec<f32>,
    target: Vec<f32>,
    weight: Vec<f32>,
    /// Magnitudes and powers of two signals; 0 without two signals.
    two: [Vec<f32>; 2],
    powers: [Vec<f32>; 2],
}

fn rows(numbers: Vec<f32>, width: usize, device: &Device) -> Tensor<2> {
    let count = numbers.len() / width;
    Tensor::from_data(TensorData::new(numbers, [count, width]), device)
}

impl<'a> Felt<'a> {
    fn new(subjects: &'a [Subject], settings: Touching) -> Self {
        let scales = subjects.iter().map(|s| Scales::of(&s.examples.train, settings.aim)).collect();
        Self { subjects, scales, settings }
    }

    /// Touches of the settings' number of materials: their indices and examples.
    fn draw(&self, random: &mut Random) -> (Vec<usize>, Touches) {
        let Touching { groups, each, .. } = self.settings;
        let count = groups * each;
        let mut touches = Touches {
            force: Vec::with_capacity(count * HISTORY),
            speed: Vec::with_capacity(count * 2 * HISTORY),
            target: Vec::with_capacity(count * BINS),
            weight: Vec::with_capacity(count * BINS),
            two: [0, 1].map(|_| Vec::with_capacity(count * BINS)),
            powers: [0, 1].map(|_| Vec::with_capacity(count)),
        };
        let classes: Vec<usize> = (0..groups).map(|_| random.below(self.subjects.len())).collect();
        for number in &classes {
            let (subject, scales) = (&self.subjects[*number], &self.scales[*number]);
            for _ in 0..each {
                let example = &subject.examples.train[random.below(subject.examples.train.len())];
                if random.chance(SILENT) {
                    touches.push(&silent(example, random), Truth::Rms, self.settings, scales);
                } else {
                    let swapped = example.other.filter(|_| random.chance(0.5)).map(|other| Example {
                        magnitudes: other,
                        other: Some(example.magnitudes),
                        ..example.clone()
                    });
                    let example = swapped.as_ref().unwrap_or(example);
                    touches.push(example, subject.truth, self.settings, scales);
                }
            }
        }
        (classes, touches)
    }

    /// The network's loss, from vectors \[groups, 256\].
    fn loss(&self, network: &Network, vectors: Tensor<2>, t: Touches, device: &Device) -> Tensor<1> {
        let Touching { groups, each, target, aim, .. } = self.settings;
        let vectors = vectors.unsqueeze_dim::<3>(1).repeat_dim(1, each).reshape([groups * each, VECTOR_LEN]);
        let answers =
            network.forward(rows(t.force, HISTORY, device), rows(t.speed, 2 * HISTORY, device), vectors);
        let weight = rows(t.weight, BINS, device);
        let mut magnitudes = rows(t.target, BINS, device);
        if aim == Aim::Relative {
            magnitudes = foreseen(magnitudes, &answers.magnitudes, &weight);
        }
        let loss = target.loss(aim, answers.magnitudes.clone(), magnitudes, weight.clone());
        if target == Target::Mean {
            return loss;
        }
        let magnitudes = t.two.map(|two| rows(two, BINS, device));
        let powers = t.powers.map(|powers| rows(powers, 1, device));
        loss + Scattered { magnitudes, powers, weight }.loss(answers)
    }
}

/// Stage two: trains texture encoder and network to predict a touch's vibration. With `naming_weight`
/// the encoder also brings images of one material close together, and strange ones close to their
/// family.
///
/// # Errors
/// As [`Stage::descend`].
pub(crate) fn feel(
    stage: &Stage<'_>,
    learner: Learner,
    subjects: &[Subject],
    (looks, kin, naming_weight): (&Looks, Option<&Kin>, f64),
    settings: Touching,
    device: &Device,
    report: impl FnMut(&Progress),
) -> Result<(Learner, Losses), Failure> {
    let felt = Felt::new(subjects, settings);
    let groups = settings.groups;
    let kin = kin.filter(|_| naming_weight > 0.0);
    let strangers = kin.map_or(0, |_| groups.div_ceil(2));
    let draw = |step: usize| {
        let random = &mut random(settings.seed, 2, step);
        let (mut classes, touches) = felt.draw(random);
        let mut features = dropout(groups + strangers, random);
        classes.extend((0..strangers).map(|_| random.below(subjects.len())));
        for (number, (class, row)) in classes.iter().zip(features.chunks_exact_mut(FEATURES)).enumerate() {
            let of = if number < groups { &looks.seen[*class] } else { &looks.strange[*class] };
            row.iter_mut().zip(drawn(of, FEATURES, random)).for_each(|(kept, x)| *kept *= x);
        }
        (classes, features, touches)
    };
    let loss = |learner: &Learner, (classes, features, touches): (Vec<usize>, Vec<f32>, Touches)| {
        let vectors = learner.feeler.texture.forward(rows(features, FEATURES, device));
        let seen = vectors.clone().narrow(0, 0, groups);
        let loss = felt.loss(&learner.feeler.network, seen, touches, device);
        if naming_weight == 0.0 {
            return loss;
        }
        let scores = learner.scores(vectors);
        let (named, strange) = classes.split_at(groups);
        let mut naming = naming_loss(scores.clone().narrow(0, 0, groups), named, device);
        if let Some(kin) = kin {
            naming = naming + kin.loss(scores.narrow(0, groups, strangers), strange, device) * STRANGE_WEIGHT;
        }
        loss + naming * naming_weight
    };
    stage.descend(learner, draw, loss, report)
}

/// End of stage two: trains only the network, from fixed vectors \[subject\]\[n, 256\].
///
/// # Errors
/// As [`Stage::descend`].
pub(crate) fn settle(
    stage: &Stage<'_>,
    network: Network,
    subjects: &[Subject],
    vectors: &[Vec<f32>],
    settings: Touching,
    device: &Device,
    report: impl FnMut(&Progress),
) -> Result<(Network, Losses), Failure> {
    let felt = Felt::new(subjects, settings);
    let draw = |step: usize| {
        let random = &mut random(settings.seed, 4, step);
        let (classes, touches) = felt.draw(random);
        let of =
            classes.iter().flat_map(|class| drawn(&vectors[*class], VECTOR_LEN, random)).copied().collect();
        (of, touches)
    };
    let loss = |network: &Network, (of, touches): (Vec<f32>, Touches)| {
        felt.loss(network, rows(of, VECTOR_LEN, device), touches, device)
    };
    stage.descend(network, draw, loss, report)
}

impl Touches {
    fn push(&mut self, example: &Example, truth: Truth, settings: Touching, scales: &Scales) {
        let Touching { target, scaling: Scaling { force: (scale, offset), speed }, .. } = settings;
        self.force.extend(example.force.map(|f| scale * (f - offset)));
        self.speed.extend(example.velocity.map(|v| speed * v));
        self.target.extend(example.magnitudes.map(|m| target.of(m, truth)));
        let power = |m: &[f32; BINS]| m.iter().map(|m| m * m).sum::<f32>();
        let (two, powers) = match (truth, example.other) {
            (Truth::Draws, Some(other)) => {
                ([example.magnitudes, other], [power(&example.magnitudes), power(&other)])
            }
            (Truth::Draws, None) => ([[0.0; BINS]; 2], [0.0; 2]),
            (Truth::Rms, _) => {
                let rms = &example.magnitudes;
                // Both are 0 in silence.
                let spread = square_of_noise(rms).max(1.0).sqrt();
                let two = two_of(RAYLEIGH).map(|one| rms.map(|m| m * one));
                (two, two_of(spread.recip()).map(|one| power(rms) * one))
            }
        };
        self.two.iter_mut().zip(two).for_each(|(all, two)| all.extend(two));
        self.powers.iter_mut().zip(powers).for_each(|(all, power)| all.push(power));
        self.weight.extend_from_slice(scales.weights(example));
    }
}

/// A copy of a touch without force or without speed: nothing is felt.
fn silent(example: &Example, random: &mut Random) -> Example {
    let mut silent = Example { magnitudes: [0.0; BINS], other: None, ..example.clone() };
    if random.chance(0.5) {
        silent.force = [0.0; HISTORY]
    } else {
        silent.velocity = [0.0; 2 * HISTORY]
    }
    silent
}

#[cfg(test)]
#[path = "feeling_tests.rs"]
mod tests;
