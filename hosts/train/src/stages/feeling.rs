//! Stage two: texture encoder and tick network.

use asperity_data::{Example, HISTORY, Subject, Truth};
use asperity_dsp::frame::BINS;
use asperity_numbers::Random;
use asperity_texture::VECTOR_LEN;
use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};

use super::naming::dropout;
use super::{Kin, Looks, name_loss, random};
use crate::Failure;
use crate::arguments::Settings;
use crate::data::Data;
use crate::descent::{Losses, Stage};
use crate::encoder::{FEATURES, Head};
use crate::layer::rows;
use crate::loss::{Aim, RAYLEIGH, Scales, Scattered, Target, foreseen, square_of_noise, two_of};
use crate::network::{Network, Scaling};

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
        let centres = (0..classes * VECTOR_LEN).map(spread).collect();
        let centres = Param::from_tensor(rows(centres, VECTOR_LEN, device));
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

#[derive(Clone, Copy, Debug)]
pub(crate) struct Touching {
    pub groups: usize,
    pub each: usize,
    pub seed: u64,
    pub target: Target,
    pub aim: Aim,
    pub scaling: Scaling,
}

impl Touching {
    pub(crate) fn of(settings: &Settings, data: &Data) -> Self {
        Self {
            groups: settings.feeling_groups as usize,
            each: settings.feeling_each as usize,
            seed: settings.seed,
            target: settings.target,
            aim: settings.error,
            scaling: Scaling::of(data.reach),
        }
    }
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
#[derive(Default)]
struct Touches {
    force: Vec<f32>,
    speed: Vec<f32>,
    target: Vec<f32>,
    weight: Vec<f32>,
    /// Magnitudes and powers of two signals; 0 without two signals.
    two: [Vec<f32>; 2],
    powers: [Vec<f32>; 2],
}

impl<'a> Felt<'a> {
    fn new(subjects: &'a [Subject], settings: Touching) -> Self {
        let scales = subjects.iter().map(|s| Scales::of(&s.examples.train, settings.aim)).collect();
        Self { subjects, scales, settings }
    }

    /// Touches of the settings' number of materials: their indices and examples.
    fn draw(&self, random: &mut Random) -> (Vec<usize>, Touches) {
        let Touching { groups, each, .. } = self.settings;
        let mut touches = Touches::default();
        let classes: Vec<usize> = (0..groups).map(|_| random.below(self.subjects.len())).collect();
        for number in &classes {
            let (subject, scales) = (&self.subjects[*number], &self.scales[*number]);
            for _ in 0..each {
                let example = &subject.examples.train[random.below(subject.examples.train.len())];
                if random.chance(SILENT) {
                    touches.push(&silent(example, random), Truth::Rms, self.settings, scales);
                    continue;
                }
                let mut example = example.clone();
                if let Some(other) = &mut example.other
                    && random.chance(0.5)
                {
                    std::mem::swap(&mut example.magnitudes, other);
                }
                touches.push(&example, subject.truth, self.settings, scales);
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
pub(crate) fn feel(
    stage: &Stage<'_>,
    learner: Learner,
    subjects: &[Subject],
    (looks, kin, naming_weight): (&Looks, Option<&Kin>, f64),
    settings: Touching,
    device: &Device,
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
        loss + name_loss(learner.scores(vectors), classes.split_at(groups), kin, device) * naming_weight
    };
    stage.descend(learner, draw, loss)
}

/// End of stage two: trains only the network, from fixed vectors \[subject\]\[n, 256\].
pub(crate) fn settle(
    stage: &Stage<'_>,
    network: Network,
    subjects: &[Subject],
    vectors: &[Vec<f32>],
    settings: Touching,
    device: &Device,
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
    stage.descend(network, draw, loss)
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
mod tests {
    use asperity_data::Parts;
    use burn::module::Module as _;

    use super::*;
    use crate::descent::{Begun, Stop};
    use crate::encoder::Preset;
    use crate::layer::numbers;
    use crate::stages::Namer;

    /// Three materials, two looks of each: 8960 numbers a look.
    fn looks() -> Looks {
        let random = &mut Random::new(3);
        let mut some = || (0..2 * FEATURES).map(|_| random.range(0.0, 1.7) as f32).collect::<Vec<_>>();
        let seen = (0..3).map(|_| some()).collect();
        Looks { seen, strange: (0..3).map(|_| some()).collect(), scale: 1.0 }
    }

    fn learner(looks: &Looks, device: &Device) -> Learner {
        Learner::new(&Namer::new(Preset::Compact, 3, 1, device).classifier, looks, 1, device)
    }

    #[test]
    fn scores_differ_by_sharpness_times_squared_distances() {
        let device = Device::flex();
        let learner = learner(&looks(), &device);
        let centres = numbers(learner.centres.val());
        let vector: Vec<f32> = (0..VECTOR_LEN).map(|i| (i % 7) as f32 * 0.1).collect();
        let scores = numbers(learner.scores(rows(vector.clone(), VECTOR_LEN, &device)));
        let squared = |class: usize| -> f64 {
            let centre = &centres[class * VECTOR_LEN..][..VECTOR_LEN];
            centre.iter().zip(&vector).map(|(c, x)| f64::from(c - x).powi(2)).sum()
        };
        for class in 1..3 {
            let wanted = -f64::from(SHARPNESS) * (squared(class) - squared(0));
            let found = f64::from(scores[class] - scores[0]);
            assert!(wanted.abs() > 0.01 && (found - wanted).abs() < 1e-4, "{class}: {found}, not {wanted}");
        }
    }

    #[test]
    fn zero_name_weight_leaves_only_vibration_loss() {
        let device = Device::flex().autodiff();
        let looks = looks();
        let example = Example {
            force: [1.0; HISTORY],
            velocity: [50.0; 2 * HISTORY],
            magnitudes: std::array::from_fn(|bin| 1.0 + (bin % 5) as f32),
            other: None,
        };
        let subject = |name: &str| Subject {
            name: name.into(),
            description: String::new(),
            family: Some(if name == "a" { "x" } else { "y" }.into()),
            images: Parts::default(),
            image_mm: None,
            examples: Parts { train: vec![example.clone()], held: Vec::new() },
            truth: Truth::Rms,
            notes: Vec::new(),
        };
        let subjects = ["a", "b", "c"].map(subject);
        let kin = Kin::of(subjects.iter().map(|s| s.family.as_deref()));
        let scaling = Scaling { force: (1.0, 0.0), speed: 0.01 };
        let (target, aim) = (Target::Rms, Aim::Relative);
        let settings = Touching { groups: 3, each: 2, seed: 1, target, aim, scaling };
        let moved = |naming_weight: f64| {
            let (folder, stop, begun) = (tempfile::tempdir().unwrap(), &Stop::default(), Begun::default());
            let (name, steps, learning_rate, second_decay) = ("feeling", 3, 1e-3, 0.99);
            let stage =
                Stage { name, steps, learning_rate, second_decay, folder: folder.path(), begun, stop };
            let begun = learner(&looks, &device);
            let before = numbers(begun.valid().centres.val());
            let beside = (&looks, kin.as_ref(), naming_weight);
            let (done, losses) = feel(&stage, begun, &subjects, beside, settings, &device).unwrap();
            (before != numbers(done.valid().centres.val()), losses)
        };
        let (moves, alone) = moved(0.0);
        assert!(!moves, "centres are of names only");
        let (moves, both) = moved(0.2);
        assert!(moves && both != alone);
    }
}
