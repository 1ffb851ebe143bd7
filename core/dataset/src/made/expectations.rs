use asperity_source::Diagnostic;
use asperity_world::material::{BINS, Random};
use asperity_world::stylus::{SAMPLE_HZ, Tool};
use asperity_world::topography::MadeSurface;

use super::strokes::{Drawn, accelerations, examples};
use super::{GRID, Settings};
use crate::example::{Example, Expectation};
use crate::frames::Spectrometer;

/// What strokes that were never trained on feel like, at many places of the pieces that are held apart: each of `strokes` is made at `places`
/// places of each piece. The strokes are the same for all surfaces.
///
/// # Errors
/// None in practice: the chain's filter has a fixed design.
pub fn expectations(
    surface: &MadeSurface,
    settings: &Settings,
    strokes: &[Drawn],
    places: usize,
) -> Result<Vec<Expectation>, Diagnostic> {
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
                let felt = accelerations(&envelope, surface.contact, drawn, place);
                let mut here = Vec::new();
                examples(drawn, &felt, &mut spectrometer, &mut here)?;
                if sums.is_empty() {
                    sums.extend(here.into_iter().map(Sum::new));
                } else {
                    sums.iter_mut().zip(here).for_each(|(sum, example)| sum.add(&example));
                }
            }
        }
    }
    Ok(sums.into_iter().flatten().map(Sum::expectation).collect())
}

/// Magnitudes of one instant, summed over places.
struct Sum {
    example: Example,
    other: Option<[f32; BINS]>,
    count: f64,
    magnitudes: [f64; BINS],
    powers: [f64; BINS],
}

impl Sum {
    fn new(example: Example) -> Self {
        let m = example.magnitudes.map(f64::from);
        Self { other: None, count: 1.0, magnitudes: m, powers: m.map(|m| m * m), example }
    }

    fn add(&mut self, example: &Example) {
        self.other = Some(example.magnitudes);
        self.count += 1.0;
        for (k, m) in example.magnitudes.map(f64::from).into_iter().enumerate() {
            self.magnitudes[k] += m;
            self.powers[k] += m * m;
        }
    }

    fn expectation(self) -> Expectation {
        Expectation {
            mean: self.magnitudes.map(|sum| (sum / self.count) as f32),
            rms: self.powers.map(|sum| (sum / self.count).sqrt() as f32),
            other: self.other,
            example: self.example,
        }
    }
}
