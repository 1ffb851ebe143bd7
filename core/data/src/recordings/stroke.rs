use std::f64::consts::{FRAC_1_SQRT_2, PI};
use std::ops::Range;

use asperity_diagnostics::Diagnostic;
use asperity_dsp::filter::Section;
use asperity_dsp::frame::WINDOW_S;

use super::Recording;
use crate::example::Example;
use crate::felt::Felt;
use crate::frames::Spectrometer;
use crate::history::{HISTORY, RATE_HZ, Recorder, STIFFNESS_N_PER_MM};

/// Ticks until the chain's filter has settled: five time constants, plus the history.
const WARM_UP: usize = 30 + HISTORY;
/// Ticks between examples: 20 ms.
const EVERY: usize = 10;
/// Corner of the high-pass against gravity, in Hz.
const HIGH_PASS_HZ: f64 = 5.0;
/// Time to each side of a sample over which motion is averaged to a speed, in seconds.
const AROUND_S: f64 = 0.01;
/// Shortest stroke in seconds.
const MIN_DURATION_S: f64 = 0.5;

/// A recorded stroke: channels of one rate and one length.
#[derive(Clone, Debug, PartialEq)]
pub struct Recorded {
    /// Sampling rate in Hz: 1 to 10 kHz, within a clock's tolerance.
    pub rate_hz: f64,
    /// Normal force in N.
    pub force_n: Vec<f64>,
    /// Place along the surface in mm.
    place_mm: [Vec<f64>; 2],
    /// Whether the directions of the places are known. From a speed alone they go along x.
    pub(super) directed: bool,
    /// Speed along the surface in mm/s. From velocities or places it is the length of their mean change
    /// over 20 ms, so that noise of single samples does not count.
    pub speed_mm_s: Vec<f64>,
    /// Acceleration of the tool in m/s^2 by axes, one to three.
    pub acceleration_m_s2: Vec<Vec<f64>>,
    /// Columns of its file that nobody reads.
    pub ignored: Vec<String>,
}

/// An example and its time.
pub(super) struct Timed {
    pub(super) example: Example,
    /// Time of its newest history sample and the start of its frame, in seconds from the stroke's beginning.
    at_s: f64,
}

impl Timed {
    /// Time of its first sample, and the end of its frame.
    pub(super) fn span_s(&self) -> Range<f64> {
        self.at_s - HISTORY as f64 / RATE_HZ..self.at_s + WINDOW_S
    }
}

impl Recorded {
    /// A stroke with its places, and with its speed if they do not tell it.
    pub(super) fn new(
        rate_hz: f64,
        force_n: Vec<f64>,
        place_mm: [Vec<f64>; 2],
        speed_mm_s: Option<Vec<f64>>,
        acceleration_m_s2: Vec<Vec<f64>>,
    ) -> Result<Self, Diagnostic> {
        let duration_s = force_n.len() as f64 / rate_hz;
        if duration_s < MIN_DURATION_S {
            return Err(Diagnostic::new(format!("a stroke of {duration_s:.3} s"))
                .help(format!("{MIN_DURATION_S} s at least")));
        }
        let around = (AROUND_S * rate_hz).round() as usize;
        let speed = |n: usize| {
            let (from, to) = (n.saturating_sub(around), (n + around).min(force_n.len() - 1));
            let [x, y] = place_mm.each_ref().map(|axis| axis[to] - axis[from]);
            x.hypot(y) * rate_hz / (to - from).max(1) as f64
        };
        let directed = speed_mm_s.is_none();
        let speed_mm_s = speed_mm_s.unwrap_or_else(|| (0..force_n.len()).map(speed).collect());
        let ignored = Vec::new();
        Ok(Self { rate_hz, force_n, place_mm, directed, speed_mm_s, acceleration_m_s2, ignored })
    }

    pub(super) fn duration_s(&self) -> f64 {
        self.force_n.len() as f64 / self.rate_hz
    }

    /// A path that a graph can play, and the recorded acceleration.
    pub(super) fn recording(self) -> Result<Recording, Diagnostic> {
        let acceleration_m_s2 = self.without_gravity()?;
        let ticks = (0..).take_while(|tick| self.sample(*tick) < self.force_n.len());
        let position = |tick: usize| {
            let [x, y] = self.place(tick);
            [x, y, -self.force(tick) / STIFFNESS_N_PER_MM]
        };
        let position_mm = ticks.map(position).collect();
        Ok(Recording { position_mm, felt: Felt { rate_hz: self.rate_hz, acceleration_m_s2 } })
    }

    /// The sample at a tick.
    fn sample(&self, tick: usize) -> usize {
        (tick as f64 * self.rate_hz / RATE_HZ) as usize
    }

    /// Mean force over the tick that ends at `tick`, that sample included; none below 0.
    fn force(&self, tick: usize) -> f64 {
        let first = tick.checked_sub(1).map_or(0, |before| self.sample(before) + 1);
        let part = self.force_n.get(first..=self.sample(tick)).unwrap_or_default();
        (part.iter().sum::<f64>() / part.len().max(1) as f64).max(0.0)
    }

    /// Place at a tick. The chain measures places and derives velocities.
    fn place(&self, tick: usize) -> [f64; 2] {
        let at = tick as f64 * self.rate_hz / RATE_HZ;
        let (sample, part) = (at as usize, at.fract());
        self.place_mm.each_ref().map(|axis| {
            let here = axis.get(sample).copied().unwrap_or_default();
            here + part * (axis.get(sample + 1).copied().unwrap_or(here) - here)
        })
    }

    /// All examples of the stroke.
    pub(super) fn examples(&self) -> Result<Vec<Timed>, Diagnostic> {
        let acceleration = self.without_gravity()?;
        let mut recorder = Recorder::default();
        let mut spectrometer = Spectrometer::new(self.rate_hz);
        let mut examples = Vec::new();
        for tick in 0.. {
            let start = self.sample(tick);
            let frame = start..start + spectrometer.length();
            if frame.end > self.force_n.len() {
                break;
            }
            let history = recorder.observe(self.place(tick), self.force(tick));
            if tick < WARM_UP || tick % EVERY != 0 {
                continue;
            }
            let mut frame_at = |frame: Range<usize>| {
                let axes: Option<Vec<&[f64]>> = acceleration.iter().map(|a| a.get(frame.clone())).collect();
                axes.map(|axes| spectrometer.magnitudes(&axes))
            };
            let Some(magnitudes) = frame_at(frame.clone()) else { break };
            // The next frame is another signal of nearly the same touch.
            let other = frame_at(frame.end..2 * frame.end - frame.start);
            let mut example = Example { other, ..history.example(magnitudes) };
            if !self.directed {
                turn(&mut example.velocity, examples.len());
            }
            examples.push(Timed { example, at_s: tick as f64 / RATE_HZ });
        }
        Ok(examples)
    }

    fn without_gravity(&self) -> Result<Vec<Vec<f64>>, Diagnostic> {
        let filter = Section::high_pass(HIGH_PASS_HZ, FRAC_1_SQRT_2).bilinear(self.rate_hz, HIGH_PASS_HZ);
        let filter = filter.map_err(|e| Diagnostic::new(e.to_string()))?;
        let mut axes = self.acceleration_m_s2.clone();
        for axis in &mut axes {
            let mut filter = filter;
            filter.reset_to(axis.first().copied().unwrap_or(0.0));
            filter.process_in_place(axis);
        }
        Ok(axes)
    }
}

/// Turns velocities along x into the direction of an example's number.
fn turn(velocity: &mut [f32; 2 * HISTORY], number: usize) {
    let golden = PI * (3.0 - 5.0f64.sqrt());
    let (sin, cos) = (golden * number as f64).sin_cos();
    let (along, across) = velocity.split_at_mut(HISTORY);
    for (x, y) in along.iter_mut().zip(across) {
        (*x, *y) = ((f64::from(*x) * cos) as f32, (f64::from(*x) * sin) as f32);
    }
}
