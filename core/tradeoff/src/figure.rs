//! The figures of accuracy: each by itself, never mixed into one number.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// A figure of accuracy. `docs/accuracy.md` says how each is found and where it comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Figure {
    /// Similarity of what can be felt of the spectra, against the physics: 0 to 1.
    Perceptual,
    /// Root mean square error of the envelope's modulation in five bands, 2 to 50 Hz, against the physics
    /// \[dB\].
    Modulation,
    /// Root mean square error of the long-term spectrum over 20 to 1000 Hz, against the physics \[dB\].
    Spectrum,
    /// Root mean square error of the energies in nine bands, against the physics \[dB\].
    Bands,
    /// Mean size of the error of the level, against the physics \[dB\].
    Level,
    /// Difference of the largest autocorrelation of envelope or wave, against the physics: 0 to 1.
    Repetition,
    /// Size of the error of the wave's kurtosis, against the physics \[dB\].
    Kurtosis,
    /// Size of the difference of the deviation of level, against the physics \[dB\].
    Steadiness,
    /// Difference of the lag at which a grating repeats from its pitch over the speed \[ms\].
    Pitch,
    /// Spectral convergence, against the magnitudes from which phase was retrieved \[dB\].
    Convergence,
    /// Error of the wave, against the same setting in double precision \[dB\].
    Precision,
}

impl Figure {
    /// All of them.
    pub const ALL: [Self; 11] = [
        Self::Perceptual,
        Self::Modulation,
        Self::Spectrum,
        Self::Bands,
        Self::Level,
        Self::Repetition,
        Self::Kurtosis,
        Self::Steadiness,
        Self::Pitch,
        Self::Convergence,
        Self::Precision,
    ];

    /// Its name in files and on command lines.
    pub fn name(self) -> &'static str {
        match self {
            Self::Perceptual => "perceptual",
            Self::Modulation => "modulation",
            Self::Spectrum => "spectrum",
            Self::Bands => "bands",
            Self::Level => "level",
            Self::Repetition => "repetition",
            Self::Kurtosis => "kurtosis",
            Self::Steadiness => "steadiness",
            Self::Pitch => "pitch",
            Self::Convergence => "convergence",
            Self::Precision => "precision",
        }
    }

    /// What it is, as the heading of a picture.
    pub fn title(self) -> &'static str {
        match self {
            Self::Perceptual => "perceptual similarity to the physics",
            Self::Modulation => "modulation error of the envelope against the physics",
            Self::Spectrum => "long-term spectrum error against the physics",
            Self::Bands => "nine-band energy error against the physics",
            Self::Level => "level error against the physics",
            Self::Repetition => "repetition error against the physics",
            Self::Kurtosis => "kurtosis error against the physics",
            Self::Steadiness => "error of the deviation of level against the physics",
            Self::Pitch => "error of the lag at which a grating repeats",
            Self::Convergence => "spectral convergence against the target magnitudes",
            Self::Precision => "error against the same setting in f64",
        }
    }

    /// Its unit; empty for a number that has none.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Perceptual | Self::Repetition => "",
            Self::Pitch => "ms",
            _ => "dB",
        }
    }

    /// Decimals that are worth writing.
    pub fn decimals(self) -> usize {
        match self {
            Self::Perceptual | Self::Repetition => 3,
            Self::Precision => 0,
            _ => 2,
        }
    }

    /// Whether more is better.
    pub fn more_is_better(self) -> bool {
        self == Self::Perceptual
    }

    /// Whether it is against the physics, of which a setting only has some where the graph's materials are
    /// known.
    pub fn of_the_whole(self) -> bool {
        !matches!(self, Self::Convergence | Self::Precision)
    }

    /// How much better `a` is than `b`: above 0 where it is.
    pub fn gain(self, a: f64, b: f64) -> f64 {
        if self.more_is_better() { a - b } else { b - a }
    }

    /// Difference in its unit from which on two signals clearly feel different, where that is known
    /// (docs/accuracy.md, "How much is much").
    pub fn clearly(self) -> Option<f64> {
        match self {
            Self::Spectrum | Self::Bands | Self::Level => Some(6.0),
            // Pulses of twice the depth are 6 dB in one of five bands: 6 dB over the root of 5 in all.
            Self::Modulation => Some(2.7),
            _ => None,
        }
    }

    /// A figure by its name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|f| f.name() == name)
    }
}

/// Figures that are known.
pub type Figures = BTreeMap<Figure, f64>;

/// The mean of each figure over those that have it.
pub(crate) fn mean<'a>(all: impl Iterator<Item = &'a Figures> + Clone) -> Figures {
    let of = |figure: Figure| {
        let (sum, count) = all
            .clone()
            .filter_map(|f| f.get(&figure))
            .fold((0.0, 0.0), |(sum, count), x| (sum + x, count + 1.0));
        (count > 0.0).then(|| (figure, sum / count))
    };
    Figure::ALL.into_iter().filter_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_back_and_the_mean_is_over_those_that_are_known() {
        for figure in Figure::ALL {
            assert_eq!(Figure::from_name(figure.name()), Some(figure));
            let json = serde_json::to_string(&figure).unwrap();
            assert_eq!(json, format!("{:?}", figure.name()));
        }
        let a = Figures::from([(Figure::Level, 1.0), (Figure::Bands, 4.0)]);
        let b = Figures::from([(Figure::Level, 2.0)]);
        let mean = mean([&a, &b].into_iter());
        assert_eq!(mean, Figures::from([(Figure::Level, 1.5), (Figure::Bands, 4.0)]));
    }

    #[test]
    fn better_is_more_of_a_similarity_and_less_of_an_error() {
        assert!(Figure::Perceptual.gain(0.9, 0.8) > 0.0);
        assert!(Figure::Level.gain(0.9, 0.8) < 0.0);
    }
}
