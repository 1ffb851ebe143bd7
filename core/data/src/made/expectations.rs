use asperity_dsp::frame::BINS;
use asperity_numbers::Random;
use asperity_surfaces::stylus::{SAMPLE_HZ, Tool};
use asperity_surfaces::topography::MadeSurface;

use super::strokes::{Drawn, along, examples};
use super::{GRID, Settings};
use crate::example::{Example, Expectation};
use crate::frames::Spectrometer;

/// Statistics of strokes that were never trained on, over the pieces that are held apart: each of
/// `strokes` is made at `places` places of each piece. All surfaces get the same strokes.
pub fn expectations(
    surface: &MadeSurface,
    settings: &Settings,
    strokes: &[Drawn],
    places: usize,
) -> Vec<Expectation> {
    let [train, held] = settings.pieces;
    let mut spectrometer = Spectrometer::new(f64::from(SAMPLE_HZ));
    let mut sums: Vec<Vec<Sum>> = strokes.iter().map(|_| Vec::new()).collect();
    for number in train..train + held {
        let seed = settings.piece(number);
        let envelope = Tool::PEN.track(&surface.patch(GRID, seed), &surface.contact);
        let random = &mut Random::new(seed ^ 0xe49e_c7ed);
        for (drawn, sums) in strokes.iter().zip(&mut sums) {
            for _ in 0..places {
                let length = envelope.length_mm();
                let place = [random.range(0.0, length), random.range(0.0, length)];
                let samples = (drawn.exact.duration_s() * f64::from(SAMPLE_HZ)) as usize;
                let felt = along(&envelope, surface.contact, samples, |n| drawn.hand(n), place);
                let here = examples(drawn, &felt, &mut spectrometer);
                if sums.is_empty() {
                    sums.extend(here.into_iter().map(Sum::new));
                } else {
                    sums.iter_mut().zip(here).for_each(|(sum, example)| sum.add(&example));
                }
            }
        }
    }
    sums.into_iter().flatten().map(Sum::expectation).collect()
}

/// Magnitudes of one instant, summed over places.
struct Sum {
    example: Example,
    count: f64,
    magnitudes: [f64; BINS],
    powers: [f64; BINS],
    /// Squared powers of whole frames.
    square: f64,
}

impl Sum {
    fn new(example: Example) -> Self {
        let magnitudes = example.magnitudes.map(f64::from);
        let powers = magnitudes.map(|m| m * m);
        Self { count: 1.0, square: powers.iter().sum::<f64>().powi(2), magnitudes, powers, example }
    }

    fn add(&mut self, example: &Example) {
        self.example.other = Some(example.magnitudes);
        self.count += 1.0;
        self.square += example.magnitudes.iter().map(|m| f64::from(*m).powi(2)).sum::<f64>().powi(2);
        for (k, m) in example.magnitudes.map(f64::from).into_iter().enumerate() {
            self.magnitudes[k] += m;
            self.powers[k] += m * m;
        }
    }

    fn expectation(self) -> Expectation {
        let mean = self.powers.iter().sum::<f64>() / self.count;
        // Unbiased: one place has no variance.
        let variance = (self.square / self.count - mean * mean) * self.count / (self.count - 1.0);
        let known = self.count > 1.0 && mean > 0.0;
        Expectation {
            variance: known.then(|| (variance / (mean * mean)).max(0.0) as f32),
            mean: self.magnitudes.map(|sum| (sum / self.count) as f32),
            rms: self.powers.map(|sum| (sum / self.count).sqrt() as f32),
            example: self.example,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::history::HISTORY;

    #[test]
    fn powers_of_1_and_3_have_a_variance_of_one_half() {
        let example = |power: f32| Example {
            force: [1.0; HISTORY],
            velocity: [50.0; 2 * HISTORY],
            magnitudes: [(power / BINS as f32).sqrt(); BINS],
            other: None,
        };
        let mut sum = Sum::new(example(1.0));
        sum.add(&example(3.0));
        // The mean is 2. The squared distances from it sum to 2 over one degree of freedom.
        let variance = sum.expectation().variance.unwrap();
        assert!((variance - 0.5).abs() < 1e-5, "{variance}");
        assert_eq!(Sum::new(example(1.0)).expectation().variance, None);
    }
}
