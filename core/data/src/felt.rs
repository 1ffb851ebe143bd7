//! Acceleration of a tool along a stroke, to compare renderings with.

use asperity_diagnostics::Diagnostic;
use asperity_motion::{Cursor, Stroke, StrokeParams, Trajectory};
use asperity_surfaces::stylus::SAMPLE_HZ;

use crate::history::STIFFNESS_N_PER_MM;

/// Longest stroke in seconds.
pub const LONGEST_S: f64 = 600.0;
/// Shortest stroke in seconds.
pub const SHORTEST_S: f64 = 0.1;
/// Time in seconds over which recorded places are averaged, three times.
const AVERAGED_S: f64 = 0.016;

/// Acceleration of the tool along a stroke, from its first sample.
#[derive(Clone, Debug, PartialEq)]
pub struct Felt {
    /// Sampling rate in Hz.
    pub rate_hz: f64,
    /// Acceleration in m/s^2 by axes: one to three, of one length. One signal must carry the sum of
    /// their powers.
    pub acceleration_m_s2: Vec<Vec<f64>>,
}

impl Felt {
    /// The axes.
    pub fn axes(&self) -> Vec<&[f64]> {
        self.acceleration_m_s2.iter().map(Vec::as_slice).collect()
    }

    /// Length in seconds.
    pub fn duration_s(&self) -> f64 {
        let samples = self.acceleration_m_s2.iter().map(Vec::len).min().unwrap_or(0);
        samples as f64 / self.rate_hz
    }
}

/// A hand's path along a stroke: x, y, z in mm at [`SAMPLE_HZ`], z up, the surface at z = 0. Below it
/// the hand presses with 0.5 N/mm.
///
/// These are true places, not a sensor's readings. Jumps by a sensor's step of 0.055 mm would strike
/// the tool at every step.
#[derive(Clone, Debug, PartialEq)]
pub struct Hand {
    position_mm: Vec<[f64; 3]>,
}

impl Hand {
    /// From exact places over time in seconds.
    ///
    /// # Errors
    /// A duration outside 0.1 to 600 s; a place that is not finite.
    pub fn new(duration_s: f64, mut at: impl FnMut(f64) -> [f64; 3]) -> Result<Self, Diagnostic> {
        if !(SHORTEST_S..=LONGEST_S).contains(&duration_s) {
            return Err(Diagnostic::new(format!("a stroke of {duration_s} s"))
                .help(format!("{SHORTEST_S} to {LONGEST_S} s")));
        }
        let rate_hz = f64::from(SAMPLE_HZ);
        let samples = (duration_s * rate_hz).round() as usize;
        let position_mm: Vec<[f64; 3]> = (0..=samples).map(|i| at(i as f64 / rate_hz)).collect();
        if let Some(at) = position_mm.iter().position(|place| place.iter().any(|x| !x.is_finite())) {
            let seconds = at as f64 / rate_hz;
            return Err(Diagnostic::new(format!("a place at {seconds} s that is not finite")));
        }
        Ok(Self { position_mm })
    }

    /// A made stroke without the sensor's step.
    ///
    /// # Errors
    /// A bad parameter of the stroke; a duration of more than 600 s.
    pub fn stroke(params: &StrokeParams) -> Result<Self, Diagnostic> {
        let stroke = Stroke::new(StrokeParams { quantum_mm: 0.0, ..params.clone() })?;
        Self::new(stroke.duration_s(), |t| stroke.sample(t).position)
    }

    /// A recorded stroke with its sensor's steps averaged out: over 16 ms around each moment, three
    /// times, a window with a standard deviation of 8 ms. It takes 0.3 dB of a swing of 5 Hz, 1.1 dB at
    /// 10 Hz. Of steps of 0.055 mm at 500 Hz, each 27.5 mm/s, it leaves 0.4 mm/s.
    ///
    /// # Errors
    /// A duration outside 0.1 to 600 s.
    pub fn trajectory(trajectory: &Trajectory) -> Result<Self, Diagnostic> {
        let mut cursor = Cursor::default();
        let mut hand =
            Self::new(trajectory.duration_s(), |t| trajectory.sample_from(&mut cursor, t).position)?;
        hand.smooth();
        Ok(hand)
    }

    /// Length in seconds.
    pub fn duration_s(&self) -> f64 {
        self.position_mm.len().saturating_sub(1) as f64 / f64::from(SAMPLE_HZ)
    }

    /// Places in mm at [`SAMPLE_HZ`], first and last moment included.
    pub fn position_mm(&self) -> &[[f64; 3]] {
        &self.position_mm
    }

    fn smooth(&mut self) {
        let around = (0.5 * AVERAGED_S * f64::from(SAMPLE_HZ)).round() as usize;
        for axis in 0..3 {
            let mut places: Vec<f64> = self.position_mm.iter().map(|p| p[axis]).collect();
            for _ in 0..3 {
                places = averaged(&places, around);
            }
            self.position_mm.iter_mut().zip(places).for_each(|(p, x)| p[axis] = x);
        }
    }
}

/// Force in N of a hand at a height in mm.
pub(crate) fn force_n(z_mm: f64) -> f64 {
    (-z_mm * STIFFNESS_N_PER_MM).max(0.0)
}

/// Means over `around` values to each side. The first and the last value continue beyond the ends.
fn averaged(values: &[f64], around: usize) -> Vec<f64> {
    let (Some(first), Some(last)) = (values.first(), values.last()) else { return Vec::new() };
    // Sums relative to the first value have the size of the way, not of the place.
    let mut total = 0.0;
    let mut sums = vec![0.0];
    let before = std::iter::repeat_n(first, around);
    let behind = std::iter::repeat_n(last, around);
    sums.extend(before.chain(values).chain(behind).map(|x| {
        total += x - first;
        total
    }));
    let count = 2 * around + 1;
    let mean = |pair: (&f64, &f64)| first + (pair.1 - pair.0) / count as f64;
    sums.iter().zip(sums.iter().skip(count)).map(mean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn mean_over_time_keeps_lines_and_damps_a_swing_as_its_window() {
        let line: Vec<f64> = (0..4000).map(|i| 1e5 + 0.01 * f64::from(i)).collect();
        let mean = averaged(&line, 80);
        assert_eq!(mean.len(), line.len());
        assert!(mean.iter().zip(&line).skip(80).take(3840).all(|(a, b)| (a - b).abs() < 1e-9));
        assert!((mean[0] - line[0] - 0.01 * (80.0 * 81.0 / 2.0) / 161.0).abs() < 1e-9, "ends are held");
        let hz = 10.0;
        let mut hand = Hand::new(2.0, |t| [(TAU * hz * t).sin(), 0.0, 1.0]).unwrap();
        hand.smooth();
        let most = hand.position_mm()[5000..15_000].iter().map(|p| p[0]).fold(0.0, f64::max);
        // The window's transform at 10 Hz, cubed: sin(161 x) / (161 sin x), x = pi 10 / 10000.
        let x = std::f64::consts::PI * hz / 10_000.0;
        let want = ((161.0 * x).sin() / (161.0 * x.sin())).powi(3);
        assert!((most - want).abs() < 1e-6, "{most}, not {want}");
    }

    #[test]
    fn a_stroke_that_cannot_be_is_an_error() {
        for seconds in [f64::NAN, -1.0, 0.0, 0.05, 601.0, f64::INFINITY] {
            assert!(Hand::new(seconds, |_| [0.0; 3]).is_err(), "{seconds}");
        }
        assert!(Hand::new(1.0, |t| [0.0, if t > 0.5 { f64::NAN } else { 0.0 }, 0.0]).is_err());
        assert_eq!(Hand::new(0.5, |_| [0.0; 3]).unwrap().duration_s(), 0.5);
    }
}
