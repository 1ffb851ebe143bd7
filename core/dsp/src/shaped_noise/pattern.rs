//! What is known of how a texture repeats: ridges and bumps.

use crate::Complex;
use crate::float::unit_circle;

/// Most waves.
pub const WAVES: usize = 2;
/// Harmonics of a wave that are told; those above are like the last.
pub const HARMONICS: usize = 16;
/// Numbers of a wave: its vector, then share and phase of each harmonic.
const WAVE_LEN: usize = 2 + 2 * HARMONICS;
/// Numbers of a pattern, as [`Pattern::read`] takes them.
pub const PATTERN_LEN: usize = 3 + WAVES * WAVE_LEN;

/// Bumps along a stroke.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Events {
    /// Mean way from one to the next in mm.
    pub spacing_mm: f64,
    /// Standard deviation of that over the mean.
    pub interval_cv: f64,
    /// Standard deviation of their heights over the mean.
    pub height_cv: f64,
}

/// Ridges that repeat with place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wave {
    /// Wave vector in 1/mm.
    pub per_mm: [f64; 2],
    /// Parts of the power around each harmonic that repeat, 0 to 1.
    pub shares: [f64; HARMONICS],
    /// `e^(j phase)` of each.
    pub turns: [Complex<f64>; HARMONICS],
}

/// Waves and bumps; without either the texture is noise.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pattern {
    /// Waves.
    pub waves: [Option<Wave>; WAVES],
    /// Bumps.
    pub events: Option<Events>,
}

impl Pattern {
    /// Reads [`PATTERN_LEN`] numbers: way between bumps in mm (0: no bumps), deviations of that and of heights over their means, then of each wave the vector in 1/mm
    /// (0, 0: no wave), and of each harmonic share and phase in rad. Numbers that are missing, not finite or out of range count as 0.
    pub fn read(numbers: &[f64]) -> Self {
        let number = |at: usize, most: f64| {
            numbers.get(at).copied().filter(|x| x.is_finite()).map_or(0.0, |x| x.clamp(-most, most))
        };
        let spacing_mm = number(0, 1e3);
        let events = (spacing_mm >= 0.01).then(|| Events {
            spacing_mm,
            interval_cv: number(1, 4.0).max(0.0),
            height_cv: number(2, 10.0).max(0.0),
        });
        let wave = |w: usize| {
            let from = 3 + w * WAVE_LEN;
            let per_mm = [number(from, 100.0), number(from + 1, 100.0)];
            let phase = |h: usize| {
                let (cos, sin) = unit_circle(number(from + 3 + 2 * h, 1e3) / std::f64::consts::TAU);
                Complex::new(cos, sin)
            };
            (per_mm[0].hypot(per_mm[1]) >= 1e-3).then(|| Wave {
                per_mm,
                shares: std::array::from_fn(|h| number(from + 2 + 2 * h, 1.0).max(0.0)),
                turns: std::array::from_fn(phase),
            })
        };
        Self { waves: std::array::from_fn(wave), events }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_out_of_range_are_no_pattern() {
        assert_eq!(Pattern::read(&[]), Pattern::default());
        assert_eq!(Pattern::read(&[f64::NAN; PATTERN_LEN]), Pattern::default());
        assert_eq!(Pattern::read(&[-1.0; 3]), Pattern::default());
        let mut numbers = [0.0; PATTERN_LEN];
        (numbers[0], numbers[1], numbers[3], numbers[5]) = (0.5, 99.0, 0.4, 2.0);
        let pattern = Pattern::read(&numbers);
        assert_eq!(pattern.events, Some(Events { spacing_mm: 0.5, interval_cv: 4.0, height_cv: 0.0 }));
        assert_eq!(pattern.waves[0].map(|w| (w.per_mm, w.shares[0])), Some(([0.4, 0.0], 1.0)));
        assert_eq!(pattern.waves[1], None);
    }
}
