//! Physiological tremor of a held tool.

use asperity_numbers::{Elementary as _, Random};
use std::f64::consts::TAU;

/// Waves of a tremor.
const WAVES: usize = 5;

/// Physiological tremor: on each axis five sinusoids with seeded frequencies in 8 to 12 Hz and seeded
/// phases, a function of time alone. 8 to 12 Hz is the band of the hand's central component (Elble and
/// Randall, 1976).
#[derive(Clone, Debug)]
pub struct Tremor {
    /// Amplitude, angular frequency in rad/s, phase in rad.
    waves: [[(f64, f64, f64); WAVES]; 3],
}

impl Tremor {
    /// A tremor within +-`peak_mm` on each axis (mm, absolute value; 0 is none).
    pub fn new(peak_mm: f64, seed: u64) -> Self {
        let mut random = Random::new(seed);
        let mut unit = || random.unit();
        let waves = [(); 3].map(|()| {
            let raw = [(); WAVES].map(|()| (0.5 + unit(), TAU * (8.0 + 4.0 * unit()), TAU * unit()));
            let sum: f64 = raw.iter().map(|w| w.0).sum();
            raw.map(|(a, w, p)| (a / sum * peak_mm.abs(), w, p))
        });
        Self { waves }
    }

    /// Displacement in mm on x, y, z at `t` seconds.
    pub fn at(&self, t: f64) -> [f64; 3] {
        self.waves.map(|axis| axis.iter().map(|(a, w, p)| a * (w * t + p).sine()).sum())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_stays_within_its_amplitude_and_uses_it() {
        let t = Tremor::new(0.1, 3);
        let mut top: f64 = 0.0;
        for i in 0..100_000 {
            for v in t.at(f64::from(i) * 1e-3) {
                assert!(v.abs() <= 0.1 + 1e-12);
                top = top.max(v.abs());
            }
        }
        assert!(top > 0.07, "{top}");
    }

    #[test]
    fn its_power_lies_between_8_and_12_hz() {
        let t = Tremor::new(0.1, 11);
        // A Hann-windowed DFT over 16 s, by definition.
        let (n, rate) = (1600, 100.0);
        for axis in 0..3 {
            let x: Vec<f64> = (0..n)
                .map(|i| {
                    t.at(f64::from(i) / rate)[axis] * (0.5 - 0.5 * (TAU * f64::from(i) / f64::from(n)).cos())
                })
                .collect();
            let (mut inside, mut all) = (0.0, 0.0);
            for k in 0..n / 2 {
                let (mut re, mut im) = (0.0, 0.0);
                for (i, v) in x.iter().enumerate() {
                    let a = TAU * f64::from(k) * i as f64 / f64::from(n);
                    re += v * a.cos();
                    im += v * a.sin();
                }
                let (p, f) = (re * re + im * im, f64::from(k) * rate / f64::from(n));
                all += p;
                if (7.9..=12.1).contains(&f) {
                    inside += p;
                }
            }
            assert!(inside / all > 0.999, "axis {axis}: {}", inside / all);
        }
    }

    #[test]
    fn axes_and_seeds_differ() {
        let (a, b) = (Tremor::new(1.0, 1).at(0.3), Tremor::new(1.0, 2).at(0.3));
        assert_ne!(a, b);
        assert_ne!(a[0], a[1]);
        assert_eq!(Tremor::new(0.0, 1).at(0.3).map(f64::abs), [0.0; 3]);
    }
}
