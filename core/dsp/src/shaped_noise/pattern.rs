//! Ridges and bumps of a texture.

use crate::Complex;
use crate::float::phasor;
use asperity_numbers::Elementary as _;
use asperity_state::{Keep, State};

/// Most waves of a pattern.
pub const WAVES: usize = 2;
/// Harmonics of a wave that are given. Those above have weight 1 and are otherwise like the last.
pub const HARMONICS: usize = 32;
/// Numbers of a wave: its vector, then weight, share and phase of each harmonic.
const WAVE_LEN: usize = 2 + 3 * HARMONICS;
/// Numbers of the bumps.
const EVENTS_LEN: usize = 6;
/// Numbers of a pattern; see [`Pattern::read`].
pub const PATTERN_LEN: usize = EVENTS_LEN + WAVES * WAVE_LEN;

/// Largest exponent of speed.
const MOST_EXPONENT: f64 = 2.0;
/// Largest anisotropy: bumps 14 times as long as wide.
const MOST_ANISOTROPY: f64 = 0.99;
/// Reference speed of spacings, and the speeds beyond which they stay constant, in mm/s.
const SPEED_MM_S: f64 = 100.0;
const SPEEDS_MM_S: (f64, f64) = (10.0, 1000.0);

/// Bumps along a stroke.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Events {
    /// Mean distance between bumps in mm, for a hand at 100 mm/s. None: one bump at each ridge of the
    /// wave that the hand crosses faster.
    pub spacing_mm: Option<f64>,
    /// Exponent with which the distance grows with speed.
    pub spacing_exponent: f64,
    /// Bumps of a grain are ellipses. A hand at the angle t to x meets them in proportion to their
    /// width across its way, the root of `1 + a cos 2t + b sin 2t`.
    pub anisotropy: [f64; 2],
    /// Standard deviation of the distance over its mean; for bumps at ridges, of the position over the
    /// pitch.
    pub interval_cv: f64,
    /// Standard deviation of the height over its mean.
    pub height_cv: f64,
}

impl Events {
    /// Mean distance between bumps in mm, for a hand at this velocity in mm/s.
    pub fn spacing_at(&self, [x, y]: [f64; 2]) -> Option<f64> {
        let speed = x.hypotenuse(y);
        let over = speed.clamp(SPEEDS_MM_S.0, SPEEDS_MM_S.1) / SPEED_MM_S;
        let [a, b] = self.anisotropy;
        // cos 2t and sin 2t of the direction; both are 0 at rest.
        let square = (speed * speed).max(f64::MIN_POSITIVE);
        let width = 1.0 + a * (x * x - y * y) / square + b * 2.0 * x * y / square;
        self.spacing_mm.map(|mm| mm * over.power(self.spacing_exponent) / width.sqrt())
    }
}

#[cfg(test)]
impl Events {
    /// Bumps that depend neither on speed nor on direction.
    pub(crate) fn plain(spacing_mm: Option<f64>, interval_cv: f64, height_cv: f64) -> Self {
        Self { spacing_mm, spacing_exponent: 0.0, anisotropy: [0.0; 2], interval_cv, height_cv }
    }
}

/// Ridges that repeat with position.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wave {
    /// Wave vector in 1/mm.
    pub per_mm: [f64; 2],
    /// Power of each harmonic relative to the frame's power around it, 0 to 10. The total stays the frame's.
    pub weights: [f64; HARMONICS],
    /// Share of the power around each harmonic that repeats, 0 to 1.
    pub shares: [f64; HARMONICS],
    /// `e^(j phase)` of each harmonic.
    pub turns: [Complex<f64>; HARMONICS],
}

/// Waves and bumps. Without both the texture is noise.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pattern {
    /// Waves.
    pub waves: [Option<Wave>; WAVES],
    /// Bumps.
    pub events: Option<Events>,
}

impl Pattern {
    /// Reads [`PATTERN_LEN`] numbers. Numbers that are missing or not finite count as 0; others are
    /// limited to their range.
    ///
    /// * Bumps: distance in mm (0: no bumps; -1: at the ridges of the wave that is crossed faster),
    ///   exponent of speed, relative deviations of distance and height, and the anisotropy (2 numbers).
    /// * Each wave: the vector in 1/mm (0, 0: no wave), then weight, share and phase in rad of each
    ///   harmonic.
    pub fn read(numbers: &[f64]) -> Self {
        let number = |at: usize, most: f64| {
            numbers.get(at).copied().filter(|x| x.is_finite()).map_or(0.0, |x| x.clamp(-most, most))
        };
        let spacing_mm = number(0, 1e3);
        let anisotropy = [number(4, 1.0), number(5, 1.0)];
        let shorter = (MOST_ANISOTROPY / anisotropy[0].hypotenuse(anisotropy[1])).min(1.0);
        let at_ridges = spacing_mm <= -1.0;
        let events = (at_ridges || spacing_mm >= 0.01).then(|| Events {
            spacing_mm: (!at_ridges).then_some(spacing_mm),
            spacing_exponent: number(1, MOST_EXPONENT),
            interval_cv: number(2, 4.0).max(0.0),
            height_cv: number(3, 10.0).max(0.0),
            anisotropy: anisotropy.map(|x| x * shorter),
        });
        let wave = |w: usize| {
            let from = EVENTS_LEN + w * WAVE_LEN;
            let per_mm = [number(from, 100.0), number(from + 1, 100.0)];
            let phase = |h: usize| phasor(number(from + 4 + 3 * h, 1e3) / std::f64::consts::TAU);
            (per_mm[0].hypotenuse(per_mm[1]) >= 1e-3).then(|| Wave {
                per_mm,
                weights: std::array::from_fn(|h| number(from + 2 + 3 * h, 10.0).max(0.0)),
                shares: std::array::from_fn(|h| number(from + 3 + 3 * h, 1.0).max(0.0)),
                turns: std::array::from_fn(phase),
            })
        };
        let waves = std::array::from_fn(wave);
        Self { waves, events: events.filter(|e| e.spacing_mm.is_some() || waves[0].is_some()) }
    }
}

impl Keep for Pattern {
    fn keep(&mut self, state: &mut State<'_>) {
        state.keep(&mut self.waves).keep(&mut self.events);
        state.require(self.waves.iter().flatten().all(|wave| wave.per_mm != [0.0; 2]));
    }
}

impl Keep for Events {
    fn keep(&mut self, state: &mut State<'_>) {
        state.keep(&mut self.spacing_mm).keep(&mut self.spacing_exponent).keep(&mut self.anisotropy);
        state.keep(&mut self.interval_cv).keep(&mut self.height_cv);
        let distances = [self.spacing_mm.unwrap_or(1.0), self.interval_cv, self.height_cv];
        state.require(distances.iter().all(|x| (0.0..=1e3).contains(x)));
        state.require(self.spacing_mm.is_none_or(|spacing| spacing > 0.0));
        state.require(self.spacing_exponent.abs() <= MOST_EXPONENT);
        state.require(self.anisotropy[0].hypotenuse(self.anisotropy[1]) < 1.0);
    }
}

impl Keep for Wave {
    fn keep(&mut self, state: &mut State<'_>) {
        state.keep(&mut self.per_mm).keep(&mut self.weights);
        state.keep(&mut self.shares).keep(&mut self.turns);
        let turns = self.turns.iter().flat_map(|turn| [turn.re, turn.im]);
        state.require(turns.chain(self.per_mm).all(|x| x.abs() <= 1e3));
        state.require(self.weights.iter().all(|x| (0.0..=10.0).contains(x)));
        state.require(self.shares.iter().all(|x| (0.0..=1.0).contains(x)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_out_of_range_are_no_pattern() {
        assert_eq!(Pattern::read(&[]), Pattern::default());
        assert_eq!(Pattern::read(&[f64::NAN; PATTERN_LEN]), Pattern::default());
        assert_eq!(Pattern::read(&[-1.0; EVENTS_LEN]), Pattern::default());
        let mut numbers = [0.0; PATTERN_LEN];
        (numbers[0], numbers[1], numbers[2]) = (0.5, -9.0, 99.0);
        (numbers[4], numbers[5]) = (0.0, 9.0);
        (numbers[6], numbers[8], numbers[9]) = (0.4, 19.0, 2.0);
        let pattern = Pattern::read(&numbers);
        let events = Events {
            spacing_mm: Some(0.5),
            spacing_exponent: -2.0,
            anisotropy: [0.0, 0.99],
            interval_cv: 4.0,
            height_cv: 0.0,
        };
        assert_eq!(pattern.events, Some(events));
        assert_eq!(
            pattern.waves[0].map(|w| (w.per_mm, w.weights[0], w.shares[0])),
            Some(([0.4, 0.0], 10.0, 1.0))
        );
        assert_eq!(pattern.waves[1], None);
    }
}
