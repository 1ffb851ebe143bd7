use std::f64::consts::PI;
use std::ops::Range;

use asperity_diagnostics::Diagnostic;
use asperity_dsp::filter::{FilterError, Section};
use asperity_dsp::frame::WINDOW_S;

use super::{Recorded, Recording};
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

/// Motion of the tool along the surface, in mm and mm/s.
pub(super) enum Motion {
    Velocity([Vec<f64>; 2]),
    Place([Vec<f64>; 2]),
    Speed(Vec<f64>),
}

/// A recorded stroke: channels of one rate and one length.
pub(super) struct Stroke {
    rate_hz: f64,
    force: Vec<f64>,
    motion: Motion,
    acceleration: Vec<Vec<f64>>,
}

/// An example and its time.
pub(super) struct Timed {
    pub(super) example: Example,
    /// Time of its newest history sample and the start of its frame, in seconds from the stroke's
    /// beginning.
    at_s: f64,
}

impl Timed {
    /// Time of its first sample.
    pub(super) fn begin_s(&self) -> f64 {
        self.at_s - HISTORY as f64 / RATE_HZ
    }

    /// End of its frame.
    pub(super) fn end_s(&self) -> f64 {
        self.at_s + WINDOW_S
    }
}

impl Stroke {
    /// A stroke.
    pub(super) fn new(
        rate_hz: f64,
        force: Vec<f64>,
        motion: Motion,
        acceleration: Vec<Vec<f64>>,
    ) -> Result<Self, Diagnostic> {
        let stroke = Self { rate_hz, force, motion, acceleration };
        if stroke.duration_s() < MIN_DURATION_S {
            return Err(Diagnostic::new(format!("a stroke of {:.3} s", stroke.duration_s()))
                .help(format!("{MIN_DURATION_S} s at least")));
        }
        Ok(stroke)
    }

    /// Length in seconds.
    pub(super) fn duration_s(&self) -> f64 {
        self.force.len() as f64 / self.rate_hz
    }

    /// Whether the path is known.
    pub(super) fn has_places(&self) -> bool {
        !matches!(self.motion, Motion::Speed(_))
    }

    /// The stroke with its motion as a speed.
    pub(super) fn recorded(self) -> Recorded {
        let (count, around) = (self.force.len(), (AROUND_S * self.rate_hz).round() as usize);
        // Way between two samples, in mm.
        let length = |moved: &dyn Fn(usize, usize) -> [f64; 2]| -> Vec<f64> {
            let speed = |n: usize| {
                let (from, to) = (n.saturating_sub(around), (n + around).min(count - 1));
                let [x, y] = moved(from, to);
                x.hypot(y) * self.rate_hz / (to - from).max(1) as f64
            };
            (0..count).map(speed).collect()
        };
        let speed_mm_s = match self.motion {
            Motion::Speed(speed) => speed,
            Motion::Place(axes) => length(&|from, to| axes.each_ref().map(|axis| axis[to] - axis[from])),
            Motion::Velocity(axes) => {
                // Trapezoidal sums from the first sample.
                let places = axes.map(|axis| {
                    let mut place = 0.0;
                    let next = |pair: &[f64]| {
                        place += 0.5 * (pair[0] + pair[1]) / self.rate_hz;
                        place
                    };
                    let rest: Vec<f64> = axis.windows(2).map(next).collect();
                    [vec![0.0], rest].concat()
                });
                length(&|from, to| places.each_ref().map(|axis| axis[to] - axis[from]))
            }
        };
        Recorded {
            rate_hz: self.rate_hz,
            force_n: self.force,
            speed_mm_s,
            acceleration_m_s2: self.acceleration,
        }
    }

    /// A path that a graph can play, and what was felt.
    pub(super) fn recording(self) -> Result<Recording, FilterError> {
        let acceleration_m_s2 = self.without_gravity()?;
        let mut position_mm = Vec::new();
        let mut place = [0.0; 2];
        for tick in (0..).take_while(|tick| self.sample(*tick) < self.force.len()) {
            self.advance(&mut place, tick);
            let force = self.mean(&self.force, tick).max(0.0);
            position_mm.push([place[0], place[1], -force / STIFFNESS_N_PER_MM]);
        }
        Ok(Recording { position_mm, felt: Felt { rate_hz: self.rate_hz, acceleration_m_s2 } })
    }

    /// The sample at a tick.
    fn sample(&self, tick: usize) -> usize {
        (tick as f64 * self.rate_hz / RATE_HZ) as usize
    }

    /// Mean of a channel over the tick that ends at `tick`, that sample included.
    fn mean(&self, channel: &[f64], tick: usize) -> f64 {
        let first = tick.checked_sub(1).map_or(0, |before| self.sample(before) + 1);
        let part = channel.get(first..=self.sample(tick)).unwrap_or_default();
        part.iter().sum::<f64>() / part.len().max(1) as f64
    }

    /// All examples of the stroke.
    pub(super) fn examples(&self) -> Result<Vec<Timed>, Diagnostic> {
        let acceleration = self.without_gravity().map_err(|e| Diagnostic::new(e.to_string()))?;
        let mut recorder = Recorder::default();
        let mut spectrometer = Spectrometer::new(self.rate_hz);
        let mut place = [0.0; 2];
        let mut examples = Vec::new();
        for tick in 0.. {
            let start = self.sample(tick);
            let frame = start..start + spectrometer.length();
            if frame.end > self.force.len() {
                break;
            }
            self.advance(&mut place, tick);
            let history = recorder.observe(place, self.mean(&self.force, tick).max(0.0));
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
            let mut velocity = history.velocity;
            if matches!(self.motion, Motion::Speed(_)) {
                turn(&mut velocity, examples.len());
            }
            let example = Example { force: history.force, velocity, magnitudes, other };
            examples.push(Timed { example, at_s: tick as f64 / RATE_HZ });
        }
        Ok(examples)
    }

    /// Moves a place in mm on by a tick. The chain measures places and derives velocities.
    fn advance(&self, place: &mut [f64; 2], tick: usize) {
        match &self.motion {
            Motion::Place(axes) => {
                let at = tick as f64 * self.rate_hz / RATE_HZ;
                let (sample, part) = (at as usize, at.fract());
                *place = axes.each_ref().map(|a| {
                    let here = a.get(sample).copied().unwrap_or_default();
                    here + part * (a.get(sample + 1).copied().unwrap_or(here) - here)
                });
            }
            Motion::Velocity(axes) => {
                for (place, axis) in place.iter_mut().zip(axes) {
                    *place += self.mean(axis, tick) / RATE_HZ;
                }
            }
            Motion::Speed(speed) => place[0] += self.mean(speed, tick) / RATE_HZ,
        }
    }

    fn without_gravity(&self) -> Result<Vec<Vec<f64>>, FilterError> {
        let filter = Section::high_pass(HIGH_PASS_HZ, std::f64::consts::FRAC_1_SQRT_2)
            .bilinear(self.rate_hz, HIGH_PASS_HZ)?;
        let mut axes = self.acceleration.clone();
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
