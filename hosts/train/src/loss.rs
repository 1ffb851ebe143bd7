//! Targets of the network and losses of its answers.

use asperity_data::{Example, HISTORY, Truth};
use asperity_dsp::frame::BINS;
use burn::tensor::Tensor;

use crate::network::Answers;
use serde::{Deserialize, Serialize};

/// Target of the network for a random texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, Serialize, Deserialize)]
pub(crate) enum Target {
    /// Mean magnitudes, as in the paper: the least squared error. A signal of them is too quiet, by
    /// 1.05 dB for one axis of a Gaussian signal.
    Mean,
    /// Root mean square magnitudes, for a signal of the right power.
    Rms,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, Serialize, Deserialize)]
pub(crate) enum Aim {
    /// In m/s^2, as in the paper: loud materials dominate.
    Euclidean,
    /// Relative to the material's touches of about the same force and speed: all count alike.
    Relative,
}

/// Magnitude in m/s^2 below which errors stop being relative. It is a quarter of each bin's magnitude if
/// fifty bins together are at a fingertip's best threshold.
const FLOOR_M_S2: f32 = 0.0005;

/// Mean over root mean square of a Rayleigh distributed magnitude: sqrt(pi / 4).
pub(crate) const RAYLEIGH: f32 = 0.886_226_9;

impl Target {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Mean => "mean",
            Self::Rms => "rms",
        }
    }

    pub(crate) fn other(self) -> Self {
        match self {
            Self::Mean => Self::Rms,
            Self::Rms => Self::Mean,
        }
    }

    /// A magnitude of an example for this target.
    pub(crate) fn of(self, magnitude: f32, truth: Truth) -> f32 {
        match (self, truth) {
            (Self::Mean, Truth::Rms) => RAYLEIGH * magnitude,
            _ => magnitude,
        }
    }

    /// Loss of answers `y` (0 or more) against magnitudes `m`, both \[n, 100\], each times its
    /// `weight`.
    ///
    /// Its derivative is `a(y) (y - m)` for the mean and `a(y) (y^2 - m^2)` for the root mean square,
    /// with any `a(y) > 0`. So its least value is at the target. [`Aim::Euclidean`] has `a = 1`: half
    /// the squared error, and `|y|^3 / 3 - m^2 y`. [`Aim::Relative`] has `1 / (y + s)^2` and `1 / (y +
    /// s)^3`. For `s = 0` these are the likelihoods of an exponentially distributed magnitude and of a
    /// Gaussian signal (the Itakura-Saito distance). An error in decibels then counts the same at any
    /// level, and far too large answers pull no harder than slightly too large ones. For true silence
    /// the loss is `sqrt(1 + y^2)`, which keeps pulling, unlike a likelihood.
    pub(crate) fn loss(self, aim: Aim, answer: Tensor<2>, target: Tensor<2>, weight: Tensor<2>) -> Tensor<1> {
        const S: f32 = SOFT;
        let (y, m) = (answer * weight.clone(), target * weight);
        let u = y.clone() + S;
        let felt = match (self, aim) {
            (Self::Mean, Aim::Euclidean) => return ((y - m).powi_scalar(2) / 2.0).mean(),
            (Self::Rms, Aim::Euclidean) => {
                return (y.clone().powi_scalar(3) / 3.0 - m.powi_scalar(2) * y).mean();
            }
            (Self::Mean, Aim::Relative) => u.clone().log() + (m.clone() + S) / u,
            (Self::Rms, Aim::Relative) => {
                let square = u.clone().powi_scalar(2) * 2.0;
                let rest = (m.clone().powi_scalar(2) - S * S) / square;
                u.clone().log() + u.recip() * (2.0 * S) + rest
            }
        };
        let silence = (y.powi_scalar(2) + 1.0).sqrt();
        let silent = m.equal_scalar(0.0).float();
        (felt.clone() + silent * (silence - felt)).mean()
    }
}

/// Part of a touch's usual magnitudes added to an answer before the comparison with a draw.
const FORESEEN_SOFT: f32 = 0.03;

/// Magnitudes with their power limited to 10 times the answer's.
///
/// A turn of the hand within the next 0.1 s is not visible in the last 20 ms. On glass it is a thousand
/// times as strong as a steady hand; one such touch in twenty would make nearly all of the mean power.
/// The limit holds up to one such touch in ten. Of noise only one magnitude in 20 000 exceeds 10 times
/// the mean power, so its answer stays.
pub(crate) fn foreseen(magnitudes: Tensor<2>, answer: &Tensor<2>, weight: &Tensor<2>) -> Tensor<2> {
    let level = answer.clone().detach() + weight.clone().recip() * FORESEEN_SOFT;
    magnitudes.min_pair(level * MOST_POWER.sqrt())
}

const RATIO_WEIGHT: f32 = 0.5;
const VARIANCE_WEIGHT: f32 = 0.05;
/// Part of a touch's usual magnitudes whose power is added to both powers of a quotient, so
/// near-silence does not scatter.
const POWER_SOFT: f32 = 0.1;
/// Largest power of a frame over the mean. Larger frames count as this: by its square a single hit
/// would outweigh thousands of others.
const MOST_POWER: f32 = 10.0;

/// Two signals of each touch, to learn the scatter of magnitudes.
pub(crate) struct Scattered {
    /// Magnitudes of both, \[n, 100\] each; 0 without two signals.
    pub magnitudes: [Tensor<2>; 2],
    /// Power of both, \[n, 1\] each; 0 without two signals.
    pub powers: [Tensor<2>; 2],
    /// Inverse of a touch's usual magnitudes, \[n, 100\].
    pub weight: Tensor<2>,
}

impl Scattered {
    /// Loss of ratios and variances, an addition to that of magnitudes `y`, which it takes as
    /// constants.
    ///
    /// Two draws `a` and `b` of one touch have the product `E[a b] = E[a]^2` for any answer. So an
    /// error of `y` does not count as scatter.
    ///
    /// A ratio `r` has the loss `r^4 s / 2 - r^2 a b` with `s = (a^2 + b^2) / 2`, both over `y^2`. Its
    /// least is at `r^2 = E[a b] / E[s]`. A variance `v` has the loss `v^2 p q / 2 - v (p - q)^2 / 2`
    /// for two powers `p` and `q` over that of `y`, each at most 10. Its least is at the variance of
    /// the power over its squared mean.
    pub(crate) fn loss(self, answers: Answers) -> Tensor<1> {
        let y = answers.magnitudes.detach();
        let usual = self.weight.clone().recip();
        let level = y.clone().powi_scalar(2) + usual.clone().powi_scalar(2) * (POWER_SOFT * POWER_SOFT);
        let [a, b] = self.magnitudes.map(|m| foreseen(m, &y, &self.weight));
        let product = a.clone() * b.clone() / level.clone();
        let square = (a.powi_scalar(2) + b.powi_scalar(2)) / level / 2.0;
        let squared = answers.ratio.powi_scalar(2);
        let ratio = squared.clone().powi_scalar(2) * square / 2.0 - squared * product;

        let power = |m: Tensor<2>| m.powi_scalar(2).sum_dim(1);
        let level = power(y) + power(usual) * (POWER_SOFT * POWER_SOFT);
        let [p, q] = self.powers.map(|p| (p / level.clone()).clamp_max(MOST_POWER));
        let apart = (p.clone() - q.clone()).powi_scalar(2) / 2.0;
        let variance = answers.variance.clone().powi_scalar(2) * p * q / 2.0 - answers.variance * apart;
        ratio.mean() * RATIO_WEIGHT + variance.mean() * VARIANCE_WEIGHT
    }
}

/// Two values with a mean product of `mean^2` and a mean square of 1.
pub(crate) fn two_of(mean: f32) -> [f32; 2] {
    let (sum, difference) = ((0.5 * (1.0 + mean * mean)).sqrt(), (0.5 * (1.0 - mean * mean)).max(0.0).sqrt());
    [sum + difference, sum - difference]
}

/// Mean square of a frame's power over its squared mean, for a Gaussian signal with these root mean
/// square magnitudes.
///
/// Hann's window correlates a bin with the next by 2/3 and with the one after by 1/6. Covariances of
/// powers are the squares of these times both powers.
pub(crate) fn square_of_noise(rms: &[f32; BINS]) -> f32 {
    let powers = rms.map(|m| f64::from(m).powi(2));
    let sum: f64 = powers.iter().sum();
    if sum == 0.0 {
        return 0.0;
    }
    let products = |apart: usize| powers.iter().zip(&powers[apart..]).map(|(a, b)| a * b).sum::<f64>();
    let variance = products(0) + 2.0 * (4.0 / 9.0 * products(1) + products(2) / 36.0);
    (1.0 + variance / (sum * sum)) as f32
}

/// Part of a touch's usual level added to a relative answer before the division: decibels stop counting
/// below it.
const SOFT: f32 = 0.1;

/// Touches count as equally fast up to this speed in mm/s, and above it within thirds of an octave.
/// Spectra of round bumps fall by 6 dB a bin, so a few mm/s make 10 dB.
const SLOWEST_MM_S: f32 = 5.0;
const SPEEDS: usize = 20;
/// Edges of force in N; touches between two edges count as equally strong.
const FORCES_N: [f32; 3] = [0.01, 0.5, 1.2];
/// A touch is steady if the tip stayed on the surface and its speed changed at most this much over the
/// history: in mm/s, and as a part.
const STEADY: (f32, f32) = (3.0, 0.03);
const CELLS: usize = 2 * SPEEDS * (FORCES_N.len() + 1);

/// Part of a material's own level added to a touch's level. Otherwise near-silent touches would
/// outweigh the others, and the network would learn silence first and nothing more.
const OWN_LEVEL: f32 = 0.02;

/// Part of the mean over all bins added to a bin's level: a bin 40 dB below the others is not felt.
const CELL_LEVEL: f32 = 0.01;

/// Weights of a material's errors: the inverse of its touches' mean magnitude at about the same speed
/// and force, steady or not.
pub(crate) struct Scales {
    cells: Vec<[f32; BINS]>,
}

fn cell(example: &Example) -> usize {
    let newest = HISTORY - 1;
    let speed_at = |i: usize| example.velocity[i].hypot(example.velocity[HISTORY + i]);
    let speed = speed_at(newest);
    // A smooth surface is silent under a steady hand but not at a turn.
    let changes = (speed - speed_at(0)).abs() > STEADY.0 + STEADY.1 * speed;
    let moves = usize::from(changes || example.force.iter().any(|f| *f < FORCES_N[0]));
    let thirds = 3.0 * (speed / SLOWEST_MM_S).max(0.5).log2();
    let fast = ((thirds + 1.0).max(0.0) as usize).min(SPEEDS - 1);
    let strong = FORCES_N.iter().take_while(|edge| example.force[newest] >= **edge).count();
    2 * (fast * (FORCES_N.len() + 1) + strong) + moves
}

impl Scales {
    pub(crate) fn of(examples: &[Example], aim: Aim) -> Self {
        if aim == Aim::Euclidean {
            return Self { cells: vec![[1.0; BINS]; CELLS] };
        }
        let mut cells = vec![[0.0_f32; BINS]; CELLS];
        let mut counts = [0_usize; CELLS];
        for example in examples {
            let cell = cell(example);
            counts[cell] += 1;
            cells[cell].iter_mut().zip(example.magnitudes).for_each(|(sum, m)| *sum += m);
        }
        let own: [f32; BINS] = std::array::from_fn(|k| {
            cells.iter().map(|cell| cell[k]).sum::<f32>() / examples.len().max(1) as f32
        });
        for (cell, count) in cells.iter_mut().zip(counts) {
            let mean = cell.map(|sum| sum / count.max(1) as f32);
            let level = mean.iter().sum::<f32>() / BINS as f32;
            let usual: [f32; BINS] =
                std::array::from_fn(|k| mean[k] + CELL_LEVEL * level + OWN_LEVEL * own[k] + FLOOR_M_S2);
            // Neighbouring bins are nearly equal, and a missing pitch may come later. Slopes are
            // straight in decibels.
            *cell = std::array::from_fn(|k| {
                let some = &usual[k.saturating_sub(2)..(k + 3).min(BINS)];
                (-some.iter().map(|m| m.ln()).sum::<f32>() / some.len() as f32).exp()
            });
        }
        Self { cells }
    }

    pub(crate) fn weights(&self, example: &Example) -> &[f32; BINS] {
        &self.cells[cell(example)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layer::rows;
    use burn::tensor::Device;

    /// Loss of one answer to magnitudes alternating between 1 and 3.
    fn loss(target: Target, aim: Aim, answer: f32) -> f32 {
        let device = Device::flex();
        let row = |x: Vec<f32>| rows(x, 1, &device);
        target.loss(aim, row(vec![answer; 2]), row(vec![1.0, 3.0]), row(vec![1.0; 2])).into_scalar::<f32>()
    }

    #[test]
    fn least_loss_is_at_the_mean_or_the_root_mean_square() {
        for (target, best) in [(Target::Mean, 2.0_f32), (Target::Rms, 5.0_f32.sqrt())] {
            for aim in [Aim::Euclidean, Aim::Relative] {
                let least = loss(target, aim, best);
                for other in [0.0, 0.01, 0.98 * best, 1.02 * best, 3.0 * best, 100.0 * best] {
                    assert!(loss(target, aim, other) > least, "{target:?} {aim:?} {other}");
                }
                // From zero on it leads to the right answer.
                let near = [0.0, 1e-3, 2e-3].map(|y| loss(target, aim, y));
                assert!(near.is_sorted_by(|a, b| a > b), "{target:?} {aim:?} {near:?}");
            }
        }
    }

    /// Derivatives of the loss by one ratio and one variance over all pairs of frames, for answered
    /// magnitudes `answer`.
    fn slopes(pairs: &[[[f32; BINS]; 2]], answer: f32, scatter: [f32; 2]) -> [f32; 2] {
        let (device, n) = (Device::flex().autodiff(), pairs.len());
        let all = |x: f32, width| Tensor::<2>::full([n, width], x, &device);
        let frames = |which: usize| pairs.iter().map(move |pair| pair[which]);
        let magnitudes = [0, 1].map(|which| rows(frames(which).flatten().collect(), BINS, &device));
        let power = |frame: [f32; BINS]| frame.iter().map(|m| m * m).sum::<f32>();
        let powers = [0, 1].map(|which| rows(frames(which).map(power).collect(), 1, &device));
        let scatter = scatter.map(|x| Tensor::<2>::full([1, 1], x, &device).require_grad());
        let [ratio, variance] = scatter.clone().map(|x| x.repeat_dim(0, n));
        let answers = Answers { magnitudes: all(answer, BINS), ratio: ratio.repeat_dim(1, BINS), variance };
        let loss = Scattered { magnitudes, powers, weight: all(1.0, BINS) }.loss(answers);
        let gradients = loss.backward();
        scatter.map(|x| x.grad(&gradients).map_or(0.0, |slope| slope.into_scalar::<f32>()))
    }

    /// Zero of a rising slope within 0.001 to 3.
    fn least(slope: impl Fn(f32) -> f32) -> f32 {
        let (mut low, mut high) = (1e-3_f32, 3.0);
        for _ in 0..20 {
            let middle = 0.5 * (low + high);
            *(if slope(middle) < 0.0 { &mut low } else { &mut high }) = middle;
        }
        low
    }

    /// Pairs of frames of a Rayleigh distribution whose root mean square is 1.
    fn noise() -> Vec<[[f32; BINS]; 2]> {
        let random = &mut asperity_numbers::Random::new(5);
        let mut draw = || (-(1.0 - random.unit()).ln()).sqrt() as f32;
        (0..200).map(|_| [0, 1].map(|_| std::array::from_fn(|_| draw()))).collect()
    }

    #[test]
    fn ratio_is_that_of_the_touch_whatever_is_answered() {
        for answer in [0.6, 1.0, 1.7] {
            for (pairs, wanted) in [(noise(), RAYLEIGH), (vec![[[1.0; BINS]; 2]; 3], 1.0)] {
                let found = least(|ratio| slopes(&pairs, answer, [ratio, 0.1])[0]);
                // The limit lowers the loudest magnitudes a little.
                assert!((found - wanted).abs() < 0.01, "{found}, not {wanted}");
            }
        }
    }

    #[test]
    fn turn_that_nobody_foresees_is_no_scatter() {
        let mut pairs = noise();
        pairs.iter_mut().step_by(50).for_each(|pair| pair[0] = pair[0].map(|m| 30.0 * m));
        let ratio = least(|ratio| slopes(&pairs, 1.0, [ratio, 0.1])[0]);
        assert!((0.82..RAYLEIGH).contains(&ratio), "{ratio}");
    }

    #[test]
    fn variance_is_that_of_the_powers_for_any_answer() {
        // Powers of 0.5 and 1.5, independent of each other: their variance is 1/4 of the squared mean.
        let frame = |power: f32| [power.sqrt(); BINS];
        let pairs: Vec<_> = [[0.5, 0.5], [0.5, 1.5], [1.5, 0.5], [1.5, 1.5]].map(|p| p.map(frame)).into();
        for answer in [0.7, 1.0, 1.5] {
            let variance = least(|v| slopes(&pairs, answer, [1.0, v])[1]);
            assert!((variance - 0.25).abs() < 0.005, "{variance} for {answer}");
        }
        let steady = least(|v| slopes(&[[[1.0; BINS]; 2]], 1.0, [1.0, v])[1]);
        assert!(steady.abs() < 0.005, "{steady}");
    }

    #[test]
    fn loud_frame_counts_as_ten_and_silence_not_at_all() {
        let slope = |power: f32| slopes(&[[[power.sqrt(); BINS], [1.0; BINS]]], 1.0, [1.0, 1.0])[1];
        assert!((slope(1e4) / slope(30.0) - 1.0).abs() < 1e-3, "{} {}", slope(1e4), slope(30.0));
        assert!((1.0..1.5).contains(&(slope(30.0) / slope(9.0))), "{} {}", slope(30.0), slope(9.0));
        assert_eq!(slopes(&[[[0.0; BINS]; 2]], 0.0, [0.2, 3.0]), [0.0; 2]);
    }

    #[test]
    fn rare_event_counts_tenfold_and_noise_once() {
        let device = Device::flex();
        let of = |x: f32| Tensor::<2>::full([1, 1], x, &device);
        let seen = |m: f32, y: f32| foreseen(of(m), &of(y), &of(1.0)).into_scalar::<f32>();
        assert_eq!([seen(3.0, 1.0), seen(0.01, 1.0), seen(0.0, 0.0)], [3.0, 0.01, 0.0]);
        assert!((seen(100.0, 1.0) - 1.03 * 10.0_f32.sqrt()).abs() < 1e-5);
        // The loss leads out of silence.
        assert!(seen(1.0, 0.0) > 0.09);
    }

    #[test]
    fn two_values_have_the_moments_asked_for() {
        for mean in [0.1, RAYLEIGH, 1.0] {
            let [a, b] = two_of(mean);
            assert!((a * b - mean * mean).abs() < 1e-6 && (a * a + b * b - 2.0).abs() < 1e-6, "{a} {b}");
        }
    }

    #[test]
    fn square_of_noise_is_that_of_frames_of_white_noise() {
        let random = &mut asperity_numbers::Random::new(6);
        let mut spectrometer = asperity_data::Spectrometer::new(4000.0);
        let powers: Vec<f64> = (0..4000)
            .map(|_| {
                let frame: Vec<f64> = (0..spectrometer.length()).map(|_| random.normal()).collect();
                spectrometer.magnitudes(&[&frame]).iter().map(|m| f64::from(*m).powi(2)).sum()
            })
            .collect();
        let mean = |x: &mut dyn Iterator<Item = f64>| x.sum::<f64>() / powers.len() as f64;
        let (first, second) = (mean(&mut powers.iter().copied()), mean(&mut powers.iter().map(|p| p * p)));
        let (found, wanted) = (second / first.powi(2) - 1.0, f64::from(square_of_noise(&[3.0; BINS])) - 1.0);
        assert!((found / wanted - 1.0).abs() < 0.1, "{found}, not {wanted}");
        assert_eq!(square_of_noise(&[0.0; BINS]), 0.0);
    }

    #[test]
    fn root_mean_square_has_the_mean_of_a_rayleigh_distribution() {
        let mean = std::f32::consts::FRAC_PI_4.sqrt();
        assert!((Target::Mean.of(1.0, Truth::Rms) - mean).abs() < 1e-6);
        for (target, truth) in
            [(Target::Rms, Truth::Rms), (Target::Rms, Truth::Draws), (Target::Mean, Truth::Draws)]
        {
            assert_eq!(target.of(1.0, truth), 1.0);
        }
    }

    #[test]
    fn silent_touch_weighs_by_floor_and_loud_one_by_level() {
        let example = |speed: f32, magnitude: f32| {
            let mut example = Example {
                force: [1.0; HISTORY],
                velocity: [0.0; 20],
                magnitudes: [magnitude; BINS],
                other: None,
            };
            example.velocity[..HISTORY].fill(speed);
            example
        };
        // Fast now, slow 20 ms ago.
        let mut turning = example(96.0, 40.0);
        turning.velocity[0] = 60.0;
        let touches = [example(95.0, 2.0), example(98.0, 4.0), example(1.0, 0.0), turning];
        let scales = Scales::of(&touches, Aim::Relative);
        let weight = |e: &Example| scales.weights(e)[50];
        let [loud, still] = [example(90.0, 0.0), example(0.0, 0.0)].map(|e| weight(&e));
        // 3 of its cell, and 0.01 of that; 0.02 of the material's 11.5; 0.0005.
        assert!((loud * 3.2605 - 1.0).abs() < 1e-4 && (still * 0.2305 - 1.0).abs() < 1e-4, "{loud} {still}");
        // A moving hand has its own cell.
        assert!((weight(&touches[3]) * 40.6305 - 1.0).abs() < 1e-4);
    }
}
