use asperity_data::{Example, Expectation, HISTORY, Subject};
use asperity_dsp::frame::BINS;
use asperity_numbers::Random;
use asperity_texture::{Answer, Choice, Library, Model, Precision, Range, Runner, hold_magnitudes};
use serde::Serialize;

use super::average;
use crate::Failure;
use crate::data::Reach;
use crate::loss::Target;

/// Least true magnitude of a judged bin [m/s^2].
pub(crate) const AUDIBLE_M_S2: f64 = 0.01;
/// Largest distance of a judged bin below the frame's largest [dB].
pub(crate) const RANGE_DB: f64 = 40.0;
const SMOOTH: usize = 20;

/// Mean errors of one material's magnitudes in dB, over the judged bins of all frames.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(crate) struct Score {
    pub material: String,
    /// Judged bins; without any the other figures are invalid.
    pub bins: usize,
    /// The model: mean of |error|.
    pub model_db: f64,
    /// |error| that nine of ten of the model's bins stay within.
    pub p90_db: f64,
    /// Mean of the model's error with its sign.
    pub bias_db: f64,
    /// Always the material's mean spectrum over its training touches.
    pub constant_db: f64,
    /// The training touch nearest in force and speed.
    pub nearest_db: f64,
    /// The mean of the twenty nearest.
    pub smooth_db: f64,
    /// Two signals of the same touch at two places, if there are two.
    pub floor_db: Option<f64>,
}

impl Score {
    /// Whether the model beats the constant, the nearest touch, and the mean of the twenty nearest.
    pub(crate) fn beats(&self) -> [bool; 3] {
        [self.constant_db, self.nearest_db, self.smooth_db].map(|db| self.model_db < db)
    }
}

/// Scatter of magnitudes, true and answered.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct Scatter {
    /// Mean over root mean square magnitude.
    pub ratio: f64,
    pub ratio_answered: f64,
    /// Variance of a frame's power over its squared mean.
    pub variance: f64,
    pub variance_answered: f64,
}

struct Touched {
    range: Range,
    runner: Runner,
}

impl Touched {
    fn new(network: &Model, vector: &[f32]) -> Result<Self, Failure> {
        let runner = network.runner(&[vector], Precision::F32, Choice::Auto)?;
        Ok(Self { range: Range::new(network.trained()), runner })
    }

    /// Magnitudes in m/s^2 after the forces and velocities of an example, clamped to the trained range.
    fn after(&mut self, example: &Example) -> Result<[f32; BINS], Failure> {
        let mut held = [0.0; BINS];
        hold_magnitudes(&self.answer(example)?.magnitudes, &mut held);
        Ok(held)
    }

    /// Magnitudes and their scatter.
    fn answer(&mut self, example: &Example) -> Result<Answer, Failure> {
        let (mut force, mut velocity) = ([0.0; HISTORY], [0.0; 2 * HISTORY]);
        self.range.forces(&example.force.map(f64::from), &mut force);
        self.range.velocities(&example.velocity.map(f64::from), &mut velocity);
        let mut answer = Answer::default();
        self.runner
            .answer(0, &force, &velocity, &mut answer)
            .map_err(|e| Failure::Model(format!("the written network does not run: {e}")))?;
        Ok(answer)
    }
}

pub(crate) struct Judged {
    frames: Vec<(Expectation, [Option<f64>; BINS])>,
}

fn decibels(x: f64) -> f64 {
    20.0 * x.max(1e-4).log10()
}

impl Judged {
    pub(crate) fn of(expectations: Vec<Expectation>, target: Target) -> Self {
        let frame = |e: Expectation| {
            let truth = match target {
                Target::Mean => e.mean,
                Target::Rms => e.rms,
            }
            .map(f64::from);
            let loudest = truth.iter().copied().fold(0.0, f64::max);
            let least = AUDIBLE_M_S2.max(loudest * 10f64.powf(-RANGE_DB / 20.0));
            (e, truth.map(|x| (x >= least).then(|| decibels(x))))
        };
        Self { frames: expectations.into_iter().map(frame).collect() }
    }

    /// Power of a network's answers over the true one, over all frames, in dB; none for silence.
    pub(crate) fn level_db(&self, network: &Model, vector: &[f32]) -> Result<Option<f64>, Failure> {
        let mut answered = 0.0;
        let mut touched = Touched::new(network, vector)?;
        for (e, _) in &self.frames {
            answered += power(&touched.after(&e.example)?);
        }
        Ok(self.over_truth(answered))
    }

    /// Power of the true mean magnitudes over the true one in dB: the level of a perfect network for
    /// means.
    pub(crate) fn mean_level_db(&self) -> Option<f64> {
        self.over_truth(self.frames.iter().map(|(e, _)| power(&e.mean)).sum())
    }

    /// Scatter, true and answered by a network. Ratios are weighted by their bins' true power,
    /// variances by their frames'. None if the truth is not known.
    pub(crate) fn scatter(&self, network: &Model, vector: &[f32]) -> Result<Option<Scatter>, Failure> {
        let mut touched = Touched::new(network, vector)?;
        let (mut sums, mut total) = ([0.0; 4], 0.0);
        for (e, _) in &self.frames {
            let Some(variance) = e.variance else { continue };
            let answer = touched.answer(&e.example)?;
            for (k, rms) in e.rms.map(f64::from).into_iter().enumerate().filter(|(_, rms)| *rms > 0.0) {
                let power = rms * rms;
                total += power;
                let figures = [
                    f64::from(e.mean[k]) / rms,
                    answer.ratio[k].into(),
                    variance.into(),
                    answer.variance.into(),
                ];
                sums.iter_mut().zip(figures).for_each(|(sum, x)| *sum += power * x);
            }
        }
        let [ratio, ratio_answered, variance, variance_answered] = sums.map(|sum| sum / total);
        Ok((total > 1e-12).then_some(Scatter { ratio, ratio_answered, variance, variance_answered }))
    }

    fn over_truth(&self, sum: f64) -> Option<f64> {
        let truth: f64 = self.frames.iter().map(|(e, _)| power(&e.rms)).sum();
        (truth > 1e-12).then(|| 10.0 * (sum.max(1e-12) / truth).log10())
    }
}

fn power(magnitudes: &[f32; BINS]) -> f64 {
    magnitudes.iter().map(|m| f64::from(*m).powi(2)).sum()
}

#[derive(Default)]
struct Errors(Vec<f64>);

impl Errors {
    fn add(&mut self, answer: &[f32; BINS], truth: &[Option<f64>; BINS]) {
        let judged = answer.iter().zip(truth).filter_map(|(a, t)| t.map(|t| decibels(f64::from(*a)) - t));
        self.0.extend(judged);
    }

    /// Their mean size; none if nothing was judged.
    fn mean(&self) -> Option<f64> {
        average(self.0.iter().map(|e| e.abs()))
    }
}

/// A network under test and its target.
pub(crate) struct Judge<'a> {
    pub(crate) network: &'a Model,
    pub(crate) target: Target,
    pub(crate) reach: Reach,
}

impl Judge<'_> {
    /// Mean |error| in dB of the network's answers with a vector; none for silence.
    pub(crate) fn error_db(&self, vector: &[f32], judged: &Judged) -> Result<Option<f64>, Failure> {
        Ok(self.errors(vector, judged)?.mean())
    }

    fn errors(&self, vector: &[f32], judged: &Judged) -> Result<Errors, Failure> {
        let mut errors = Errors::default();
        let mut touched = Touched::new(self.network, vector)?;
        for (e, truth) in &judged.frames {
            errors.add(&touched.after(&e.example)?, truth);
        }
        Ok(errors)
    }

    pub(crate) fn score(&self, subject: &Subject, vector: &[f32], judged: &Judged) -> Result<Score, Failure> {
        let train = &subject.examples.train;
        // The mean, or the root mean square.
        let power = match self.target {
            Target::Mean => 1,
            Target::Rms => 2,
        };
        let average = |of: &mut dyn Iterator<Item = &Example>| {
            let (mut sums, mut count) = ([0.0_f64; BINS], 0.0);
            for example in of {
                count += 1.0;
                let magnitudes = example.magnitudes.map(|m| f64::from(self.target.of(m, subject.truth)));
                sums.iter_mut().zip(magnitudes).for_each(|(sum, m)| *sum += m.powi(power));
            }
            sums.map(|s| (s / count).powf(f64::from(power).recip()) as f32)
        };
        let constant = average(&mut train.iter());
        let mut errors: [Errors; 4] = Default::default();
        for (e, truth) in &judged.frames {
            let action = |example| action(example, self.reach);
            let here = action(&e.example);
            let mut by_distance: Vec<(f64, usize)> =
                train.iter().enumerate().map(|(i, t)| (distance(here, action(t)), i)).collect();
            let near = SMOOTH.min(by_distance.len()).saturating_sub(1);
            by_distance.select_nth_unstable_by(near, |a, b| a.0.total_cmp(&b.0));
            let near = &mut by_distance[..=near];
            near.sort_by(|a, b| a.0.total_cmp(&b.0));
            errors[0].add(&constant, truth);
            let nearest = train[near[0].1].magnitudes.map(|m| self.target.of(m, subject.truth));
            errors[1].add(&nearest, truth);
            errors[2].add(&average(&mut near.iter().map(|(_, i)| &train[*i])), truth);
            if let Some(other) = e.example.other {
                let both = std::array::from_fn(|k| truth[k].map(|_| decibels(f64::from(other[k]))));
                errors[3].add(&e.example.magnitudes, &both);
            }
        }
        let model = self.errors(vector, judged)?;
        let mut sizes: Vec<f64> = model.0.iter().map(|e| e.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let [constant, nearest, smooth, floor] = errors.map(|e| e.mean());
        Ok(Score {
            material: subject.name.clone(),
            bins: sizes.len(),
            model_db: model.mean().unwrap_or_default(),
            p90_db: sizes.get(sizes.len() * 9 / 10).copied().unwrap_or(0.0),
            bias_db: model.0.iter().sum::<f64>() / model.0.len().max(1) as f64,
            constant_db: constant.unwrap_or_default(),
            nearest_db: nearest.unwrap_or_default(),
            smooth_db: smooth.unwrap_or_default(),
            floor_db: floor,
        })
    }
}

/// Newest force and speed of a touch as parts of their trained ranges, clamped to them.
fn action(example: &Example, reach: Reach) -> (f64, f64) {
    let (vx, vy) = (example.velocity[HISTORY - 1], example.velocity[2 * HISTORY - 1]);
    let (force, speed) = (f64::from(example.force[HISTORY - 1]), f64::from(vx.hypot(vy)));
    ((force / reach.force_n).min(1.0), (speed / reach.speed_mm_s).min(1.0))
}

fn distance(a: (f64, f64), b: (f64, f64)) -> f64 {
    (a.0 - b.0).powi(2) + (a.1 - b.1).powi(2)
}

/// Largest magnitude answered to strokes without force and to forces without speed, over all materials.
pub(crate) fn loudest_silence(network: &Model, library: &Library, reach: Reach) -> Result<f64, Failure> {
    let mut loudest = 0.0_f32;
    for material in library.materials() {
        let mut random = Random::new(77);
        let mut touched = Touched::new(network, material.vector.as_slice())?;
        for case in 0..20 {
            let mut nothing = Example {
                force: [0.0; HISTORY],
                velocity: [0.0; 2 * HISTORY],
                magnitudes: [0.0; BINS],
                other: None,
            };
            if case % 2 == 0 {
                nothing.force = [random.range(0.0, reach.force_n) as f32; HISTORY];
            } else {
                let (size, angle) = (random.range(0.0, reach.speed_mm_s), random.range(0.0, 6.3));
                nothing.velocity[..HISTORY].fill((size * angle.cos()) as f32);
                nothing.velocity[HISTORY..].fill((size * angle.sin()) as f32);
            }
            loudest = touched.after(&nothing)?.into_iter().fold(loudest, f32::max);
        }
    }
    Ok(f64::from(loudest))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn expectation(magnitude: f32) -> Expectation {
        let example = Example {
            force: [1.0; HISTORY],
            velocity: [50.0; 2 * HISTORY],
            magnitudes: [magnitude; BINS],
            other: Some([2.0 * magnitude; BINS]),
        };
        Expectation { mean: [0.9; BINS], rms: [1.0; BINS], variance: Some(0.1), example }
    }

    #[test]
    fn errors_are_decibels_over_what_can_be_felt() {
        let judged = Judged::of(vec![expectation(1.0)], Target::Rms);
        let mut errors = Errors::default();
        errors.add(&[2.0; BINS], &judged.frames[0].1);
        assert_eq!(errors.0.len(), BINS);
        assert!((errors.mean().unwrap() - 6.0206).abs() < 1e-4);
        assert_eq!(Errors::default().mean(), None);
        // 0.9 for 1
        assert!((judged.mean_level_db().unwrap() - 20.0 * 0.9_f64.log10()).abs() < 1e-4);
        let mut quiet = expectation(1.0);
        quiet.rms = [0.001; BINS];
        quiet.rms[4..7].copy_from_slice(&[0.5, 0.011, 0.004]);
        let judged = Judged::of(vec![quiet], Target::Rms);
        let bins: Vec<usize> = (0..BINS).filter(|k| judged.frames[0].1[*k].is_some()).collect();
        assert_eq!(bins, [4, 5]);
        assert_eq!(Judged::of(Vec::new(), Target::Rms).mean_level_db(), None);
    }
}
