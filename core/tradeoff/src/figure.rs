//! Figures of accuracy. Each stands by itself; they are never combined into one number.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// A figure of accuracy. `docs/explanation/accuracy.md` has the formulas and their sources.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Figure {
    /// Perceptual similarity of the spectra to the physics, 0 to 1.
    Perceptual,
    /// RMS error of the envelope's modulation in five bands from 2 to 50 Hz, against the physics \[dB\].
    Modulation,
    /// RMS error of the long-term spectrum over 20 to 1000 Hz, against the physics \[dB\].
    Spectrum,
    /// RMS error of the energies in nine bands, against the physics \[dB\].
    Bands,
    /// Mean absolute error of the level, against the physics \[dB\].
    Level,
    /// Error of the largest autocorrelation of envelope or wave, against the physics, 0 to 1.
    Repetition,
    /// Absolute error of the wave's kurtosis, against the physics \[dB\].
    Kurtosis,
    /// Absolute error of the standard deviation of the level, against the physics \[dB\].
    Steadiness,
    /// Error of the lag at which a grating repeats, against its pitch over the speed \[ms\].
    Pitch,
    /// Spectral convergence, against the magnitudes that phase was retrieved from \[dB\].
    Convergence,
    /// Error of the wave, against the same setting in double precision \[dB\].
    Precision,
}

/// Name, title, unit, decimals, and the difference from which on two signals clearly feel different.
type Facts = (&'static str, &'static str, &'static str, usize, Option<f64>);

/// All figures, in the order of [`Figure`].
const TABLE: [(Figure, Facts); 11] = [
    (Figure::Perceptual, ("perceptual", "perceptual similarity to the physics", "", 3, None)),
    // Pulses of twice the depth are 6 dB in one of five bands: 6 dB over the root of 5 in all.
    (Figure::Modulation, ("modulation", "envelope modulation error against physics", "dB", 2, Some(2.7))),
    (Figure::Spectrum, ("spectrum", "long-term spectrum error against the physics", "dB", 2, Some(6.0))),
    (Figure::Bands, ("bands", "nine-band energy error against the physics", "dB", 2, Some(6.0))),
    (Figure::Level, ("level", "level error against the physics", "dB", 2, Some(6.0))),
    (Figure::Repetition, ("repetition", "repetition error against the physics", "", 3, None)),
    (Figure::Kurtosis, ("kurtosis", "kurtosis error against the physics", "dB", 2, None)),
    (Figure::Steadiness, ("steadiness", "level deviation error against the physics", "dB", 2, None)),
    (Figure::Pitch, ("pitch", "error of the lag at which a grating repeats", "ms", 2, None)),
    (Figure::Convergence, ("convergence", "spectral convergence to the target magnitudes", "dB", 2, None)),
    (Figure::Precision, ("precision", "error against the same setting in f64", "dB", 0, None)),
];

impl Figure {
    /// All figures.
    pub fn all() -> impl DoubleEndedIterator<Item = Self> + Clone {
        TABLE.iter().map(|(figure, _)| *figure)
    }

    fn facts(self) -> Facts {
        TABLE[self as usize].1
    }

    /// Name in files and on command lines.
    pub fn name(self) -> &'static str {
        self.facts().0
    }

    /// Heading of a picture.
    pub fn title(self) -> &'static str {
        self.facts().1
    }

    /// Unit; empty where there is none.
    pub fn unit(self) -> &'static str {
        self.facts().2
    }

    /// Decimals to print.
    pub fn decimals(self) -> usize {
        self.facts().3
    }

    /// Whether a larger value is better.
    pub fn more_is_better(self) -> bool {
        self == Self::Perceptual
    }

    /// Whether it compares with the physics. Settings have it only where the graph's materials are known.
    pub fn against_physics(self) -> bool {
        !matches!(self, Self::Convergence | Self::Precision)
    }

    /// How much better `a` is than `b`: positive where it is better.
    pub fn gain(self, a: f64, b: f64) -> f64 {
        if self.more_is_better() { a - b } else { b - a }
    }

    /// Difference from which on two signals clearly feel different, where that is known
    /// (docs/explanation/accuracy.md, "How much is much").
    pub fn clearly(self) -> Option<f64> {
        self.facts().4
    }

    /// A figure by its name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::all().find(|f| f.name() == name)
    }

    /// A value with the figure's decimals; `-` for none.
    pub(crate) fn shown(self, x: Option<f64>) -> String {
        x.map_or("-".into(), |x| format!("{x:.*}", self.decimals()))
    }

    /// Name and unit.
    pub(crate) fn with_unit(self) -> String {
        format!("{} {}", self.name(), self.unit()).trim_end().to_owned()
    }
}

/// Known figures of a setting.
pub type Figures = BTreeMap<Figure, f64>;

/// Mean of each figure over those that have it.
pub(crate) fn mean<'a>(all: impl Iterator<Item = &'a Figures>) -> Figures {
    let mut sums: BTreeMap<Figure, (f64, f64)> = BTreeMap::new();
    for (figure, x) in all.flatten() {
        let (sum, count) = sums.entry(*figure).or_default();
        (*sum, *count) = (*sum + x, *count + 1.0);
    }
    sums.into_iter().map(|(figure, (sum, count))| (figure, sum / count)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_round_trip_and_the_mean_is_over_known_figures() {
        for (i, figure) in Figure::all().enumerate() {
            assert_eq!(figure as usize, i);
            assert_eq!(Figure::from_name(figure.name()), Some(figure));
            assert_eq!(serde_json::to_string(&figure).unwrap(), format!("{:?}", figure.name()));
            // More similarity or less error.
            assert_eq!(figure.gain(0.9, 0.8) > 0.0, figure == Figure::Perceptual);
        }
        let a = Figures::from([(Figure::Level, 1.0), (Figure::Bands, 4.0)]);
        let b = Figures::from([(Figure::Level, 2.0)]);
        let mean = mean([&a, &b].into_iter());
        assert_eq!(mean, Figures::from([(Figure::Level, 1.5), (Figure::Bands, 4.0)]));
    }
}
