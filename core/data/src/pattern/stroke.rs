//! Strokes and their steady passages.

use super::figures::{Figures, keep, spectrum, wave};
use super::{BINS, Network, WINDOW};
use crate::frames::Spectrometer;
use num_complex::Complex64;

/// Sampling rate of all strokes here.
pub const RATE_HZ: f64 = 2500.0;
/// Time between places in s, and samples in it.
pub(super) const TICK_S: f64 = 0.002;
pub(super) const TICK: usize = (RATE_HZ * TICK_S) as usize;

/// Band to search for waves, in Hz.
const BAND_HZ: (f64, f64) = (5.0, 1000.0);
/// Ticks over which speed is measured: 50 ms.
const SPEED_TICKS: usize = 25;
/// Slowest passage in mm/s.
const SLOWEST_MM_S: f64 = 10.0;
/// Largest change of a passage's speed, as a part of its first speed.
const STEADY: f64 = 0.3;
/// Parts of a passage for which a network is asked.
const LOOKS: usize = 8;
/// Shortest passage in ticks: 1 s.
const SHORTEST: usize = 500;

/// A stroke: acceleration at [`RATE_HZ`] and places every 2 ms.
#[derive(Clone, Debug, PartialEq)]
pub struct Stroke {
    acceleration_m_s2: Vec<Vec<f64>>,
    place_mm: Vec<[f64; 2]>,
}

impl Stroke {
    /// From axes of acceleration in m/s^2 at any rate, and the place along the surface in mm at a time
    /// in seconds from the first sample.
    pub fn new(rate_hz: f64, axes: &[&[f64]], place_mm: impl Fn(f64) -> [f64; 2]) -> Self {
        let count = axes.iter().map(|axis| axis.len()).min().unwrap_or(0);
        let seconds = count as f64 / rate_hz;
        let ticks = (seconds / TICK_S + 1e-6) as usize;
        if ticks < SPEED_TICKS {
            return Self { acceleration_m_s2: Vec::new(), place_mm: Vec::new() };
        }
        // A whole number of ticks: then a Fourier transform of another length is the same signal at
        // another rate.
        let used = ((ticks as f64 * TICK_S * rate_hz).round() as usize).min(count);
        let resampled = |axis: &&[f64]| {
            let mut bins = spectrum(&axis[..used]);
            let scale = (ticks * TICK) as f64 / used as f64;
            bins.iter_mut().for_each(|bin| *bin *= scale);
            wave(&bins, ticks * TICK)
        };
        Self {
            acceleration_m_s2: axes.iter().map(resampled).collect(),
            place_mm: (0..ticks).map(|tick| place_mm(tick as f64 * TICK_S)).collect(),
        }
    }

    /// Passages at a steady speed for a second or more.
    pub(super) fn passages(&self) -> Vec<Passage> {
        let speed = |tick: usize| {
            let [from, to] = [tick, tick + SPEED_TICKS].map(|t| self.place_mm[t]);
            (to[0] - from[0]).hypot(to[1] - from[1]) / (SPEED_TICKS as f64 * TICK_S)
        };
        let end = self.place_mm.len().saturating_sub(SPEED_TICKS);
        let (mut from, mut passages) = (0, Vec::new());
        while from < end {
            let first = speed(from);
            let steady = |tick: &usize| (speed(*tick) - first).abs() <= STEADY * first;
            let to = (from..end).take_while(steady).last().unwrap_or(from) + 1;
            if first >= SLOWEST_MM_S && to - from >= SHORTEST {
                // The rest behind the last speed has it too.
                let to = if to == end { self.place_mm.len() } else { to };
                passages.extend(self.passage(from, to));
                from = to;
            } else {
                // Speeds near a turn make bad beginnings: go on a little.
                from += SPEED_TICKS;
            }
        }
        passages
    }

    fn passage(&self, from: usize, to: usize) -> Option<Passage> {
        let axes: Vec<&[f64]> =
            self.acceleration_m_s2.iter().map(|axis| &axis[from * TICK..to * TICK]).collect();
        let samples = principal(&axes);
        let figures = Figures::of(&samples)?;
        let mut spectrometer = Spectrometer::new(RATE_HZ);
        let mut squares = [0.0; BINS];
        let starts = (0..=samples.len().checked_sub(WINDOW)?).step_by(WINDOW / 2);
        let count = starts.clone().count() as f64;
        for start in starts {
            let frame: Vec<&[f64]> = axes.iter().map(|axis| &axis[start..start + WINDOW]).collect();
            let found = spectrometer.magnitudes(&frame);
            squares[1..].iter_mut().zip(found).for_each(|(sum, m)| *sum += f64::from(m * m) / count);
        }
        let places = self.place_mm[from..to].to_vec();
        let (mut way, mut direction) = (0.0, [0.0; 2]);
        for p in places.windows(2) {
            let [x, y] = [p[1][0] - p[0][0], p[1][1] - p[0][1]];
            let length = x.hypot(y);
            way += length;
            if length > 0.0 {
                direction[0] += (x * x - y * y) / length;
                direction[1] += 2.0 * x * y / length;
            }
        }
        let seconds = (to - from) as f64 * TICK_S;
        Some(Passage {
            samples,
            places,
            magnitudes: squares.map(f64::sqrt),
            figures,
            speed_mm_s: way / seconds,
            direction: direction.map(|sum| sum / way),
            seconds,
        })
    }
}

/// A part of a stroke at a steady speed.
#[derive(Clone, Debug)]
pub(super) struct Passage {
    pub(super) samples: Vec<f64>,
    /// Places every 2 ms, in mm.
    pub(super) places: Vec<[f64; 2]>,
    /// Rms magnitudes of 0, 10, .. 1000 Hz, all axes as one.
    pub(super) magnitudes: [f64; BINS],
    pub(super) figures: Figures,
    pub(super) speed_mm_s: f64,
    /// Means over the way of cos 2t and sin 2t, t the angle to x.
    pub(super) direction: [f64; 2],
    pub(super) seconds: f64,
}

impl Passage {
    /// Rms over the passage of a network's answers.
    pub(super) fn answered(&self, network: &Network<'_>) -> [f64; BINS] {
        let mut squares = [0.0; BINS];
        let ticks = (self.places.len() / LOOKS).max(2);
        let seconds = (ticks - 1) as f64 * TICK_S;
        let looks = self.places.chunks_exact(ticks);
        let count = looks.len().max(1) as f64;
        for places in looks {
            let velocity = [0, 1].map(|i| (places[ticks - 1][i] - places[0][i]) / seconds);
            squares.iter_mut().zip(network(velocity)).for_each(|(sum, m)| *sum += m * m);
        }
        squares.map(|sum| (sum / count).sqrt())
    }
}

/// The signal along the direction of largest variance, within the band.
fn principal(axes: &[&[f64]]) -> Vec<f64> {
    let length = axes.first().map_or(0, |axis| axis.len());
    let mut spectra: Vec<Vec<Complex64>> = axes.iter().map(|axis| spectrum(axis)).collect();
    spectra.iter_mut().for_each(|bins| keep(bins, length, BAND_HZ));
    let product = |a: &[Complex64], b: &[Complex64]| a.iter().zip(b).map(|(a, b)| (a * b.conj()).re).sum();
    let matrix: Vec<Vec<f64>> =
        spectra.iter().map(|a| spectra.iter().map(|b| product(a, b)).collect()).collect();
    // Power iteration from the strongest axis.
    let start = (0..axes.len()).max_by(|a, b| matrix[*a][*a].total_cmp(&matrix[*b][*b])).unwrap_or(0);
    let mut direction: Vec<f64> = (0..axes.len()).map(|axis| f64::from(u8::from(axis == start))).collect();
    for _ in 0..64 {
        let turned: Vec<f64> =
            matrix.iter().map(|row| row.iter().zip(&direction).map(|(m, d)| m * d).sum()).collect();
        let size = turned.iter().map(|x: &f64| x * x).sum::<f64>().sqrt();
        if size > 0.0 {
            direction = turned.iter().map(|x| x / size).collect();
        }
    }
    let mut sum = vec![Complex64::default(); length / 2 + 1];
    for (bins, part) in spectra.iter().zip(&direction) {
        sum.iter_mut().zip(bins).for_each(|(sum, bin)| *sum += bin * part);
    }
    wave(&sum, length)
}
