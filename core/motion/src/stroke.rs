//! Made strokes: line, zigzag and circle.

use asperity_numbers::{Elementary as _, Random};
use std::f64::consts::TAU;

use asperity_diagnostics::Diagnostic;

use super::{Sample, Tremor, quantise};

/// Travelled part of the way, 0 to 1, at the part `s` of the time of a minimum-jerk movement. `s` is clamped
/// to 0..=1.
///
/// T. Flash, N. Hogan, "The coordination of arm movements: an experimentally confirmed mathematical model",
/// J. Neuroscience 5(7), 1985. The movement with the least squared jerk over a distance in a given time is a
/// straight line travelled as 10 s^3 - 15 s^4 + 6 s^5.
pub fn minimum_jerk(s: f64) -> f64 {
    let s = s.clamp(0.0, 1.0);
    s * s * s * (10.0 + s * (6.0 * s - 15.0))
}

/// Integral of [`minimum_jerk`] from 0 to `s`: the way if the *speed* rises so. It is 1/2 at `s` = 1.
fn minimum_jerk_ramp_integral(s: f64) -> f64 {
    let s = s.clamp(0.0, 1.0);
    s.powi(4) * (2.5 + s * (s - 3.0))
}

/// Path of a stroke on the surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Shape {
    /// To and fro along x, in minimum-jerk movements between turns.
    Line,
    /// Like `Line`, but each movement also goes an eighth of the extent along y, and back after eight.
    #[default]
    Zigzag,
    /// Round and round, with smooth start and stop.
    Circle,
}

impl Shape {
    /// Names of the shapes in files and errors.
    pub const NAMES: [&'static str; 3] = ["line", "zigzag", "circle"];

    /// The shape with a name.
    pub fn from_name(name: &str) -> Option<Self> {
        let place = Self::NAMES.iter().position(|known| *known == name)?;
        Some([Self::Line, Self::Zigzag, Self::Circle][place])
    }
}

/// Parameters of a made stroke.
#[derive(Clone, Debug, PartialEq)]
pub struct StrokeParams {
    /// Path on the surface.
    pub shape: Shape,
    /// Length along x, or diameter, in mm, above 0 and at most 1000.
    pub extent_mm: f64,
    /// Mean speed over the path in mm/s, above 0 and at most 2000. A minimum-jerk movement peaks at
    /// 1.875 times this.
    pub mean_speed_mm_s: f64,
    /// Mean normal force in N, 0 to 100.
    pub force_n: f64,
    /// Swing of the force as a part of it, 0 to 1.
    pub force_swing: f64,
    /// Frequency of the swing in Hz, 0 to 5.
    pub force_swing_hz: f64,
    /// Stiffness of the surface in N/mm, 0.001 to 1000. The stroke lies force / stiffness below z = 0.
    pub stiffness_n_per_mm: f64,
    /// Height before approach and after lift-off in mm, 0 to 1000.
    pub clearance_mm: f64,
    /// Time of the approach, and of the lift-off, in seconds, 0.01 to 10.
    pub approach_s: f64,
    /// Whole time from approach to lift-off in seconds, at least 0.1 longer than both, at most 1e6.
    pub duration_s: f64,
    /// Largest tremor on each axis in mm, 0 to 10.
    pub tremor_mm: f64,
    /// Step of the sensor, to which positions are rounded, in mm, 0 (none) to 10.
    pub quantum_mm: f64,
    /// Seed of the tremor and the force's phase.
    pub seed: u64,
}

impl Default for StrokeParams {
    /// An 80 mm zigzag at 100 mm/s and 1 N for 8 s on a floor of 0.5 N/mm, with a sensor step of 0.055 mm.
    fn default() -> Self {
        Self {
            shape: Shape::Zigzag,
            extent_mm: 80.0,
            mean_speed_mm_s: 100.0,
            force_n: 1.0,
            force_swing: 0.3,
            force_swing_hz: 0.3,
            stiffness_n_per_mm: 0.5,
            clearance_mm: 10.0,
            approach_s: 0.4,
            duration_s: 8.0,
            tremor_mm: 0.05,
            quantum_mm: 0.055,
            seed: 1,
        }
    }
}

/// Movements of a zigzag until it turns back along y.
const LEGS_PER_SWEEP: u64 = 8;
/// Longest start, and stop, of a circle in seconds.
const CIRCLE_RAMP_S: f64 = 0.5;

/// A made stroke: approach, path on the surface, lift-off. It is a pure function of time: samples may
/// be taken in any order.
///
/// Its samples have no force and no speed. The force follows from the depth in a surface of
/// [`stiffness_n_per_mm`](StrokeParams::stiffness_n_per_mm) at z = 0.
#[derive(Clone, Debug)]
pub struct Stroke {
    params: StrokeParams,
    tremor: Tremor,
    force_phase: f64,
    /// Time of a movement between turns, or of a circle's start.
    leg_s: f64,
    /// Time of the path on the surface.
    path_s: f64,
    /// Length of the last movement as a part of a whole one.
    last_leg: f64,
    /// Whole movements.
    legs: u64,
}

impl Stroke {
    /// A stroke with these parameters. Error: a parameter out of its documented range. The error has no
    /// place; the caller knows it. The message begins with the parameter's name in back quotes.
    pub fn new(params: StrokeParams) -> Result<Self, Diagnostic> {
        let p = &params;
        for (name, value, least, greatest) in [
            ("extent_mm", p.extent_mm, f64::MIN_POSITIVE, 1000.0),
            ("mean_speed_mm_s", p.mean_speed_mm_s, f64::MIN_POSITIVE, 2000.0),
            ("force_n", p.force_n, 0.0, 100.0),
            ("force_swing", p.force_swing, 0.0, 1.0),
            ("force_swing_hz", p.force_swing_hz, 0.0, 5.0),
            ("stiffness_n_per_mm", p.stiffness_n_per_mm, 0.001, 1000.0),
            ("clearance_mm", p.clearance_mm, 0.0, 1000.0),
            ("approach_s", p.approach_s, 0.01, 10.0),
            ("duration_s", p.duration_s, 2.0 * p.approach_s + 0.1, 1e6),
            ("tremor_mm", p.tremor_mm, 0.0, 10.0),
            ("quantum_mm", p.quantum_mm, 0.0, 10.0),
        ] {
            // NaN fails.
            if !(value >= least && value <= greatest) {
                let from = if least == f64::MIN_POSITIVE {
                    "above 0 and at most".into()
                } else {
                    format!("{least} to")
                };
                return Err(Diagnostic::new(format!("`{name}` is {value}, out of range"))
                    .help(format!("`{name}` is {from} {greatest}")));
            }
        }
        let path_s = p.duration_s - 2.0 * p.approach_s;
        let (leg_s, legs, last_leg) = match p.shape {
            Shape::Circle => (CIRCLE_RAMP_S.min(path_s / 2.0), 0, 0.0),
            Shape::Line | Shape::Zigzag => {
                let leg_s = p.extent_mm.hypotenuse(leg_pitch(p)) / p.mean_speed_mm_s;
                let legs = (path_s / leg_s).floor();
                // The rest makes a shorter movement at the same mean speed, unless it would be a jolt.
                let rest = (path_s / leg_s - legs).clamp(0.0, 1.0);
                (leg_s, legs as u64, if rest >= 0.5 || legs == 0.0 { rest } else { 0.0 })
            }
        };
        let tremor = Tremor::new(p.tremor_mm, p.seed);
        let force_phase = TAU * Random::new(!p.seed).unit();
        Ok(Self { tremor, force_phase, leg_s, path_s, last_leg, legs, params })
    }

    /// Seconds from the start of the approach to the end of the lift-off.
    pub fn duration_s(&self) -> f64 {
        self.params.duration_s
    }

    /// The stylus at `t` seconds. Before 0 and after the end it rests above the surface, with tremor.
    /// NaN and infinity count as 0. Does not allocate.
    pub fn sample(&self, t: f64) -> Sample {
        let p = &self.params;
        let t = if t.is_finite() { t } else { 0.0 };
        let [x, y] = self.path(t - p.approach_s);
        let down = minimum_jerk(t / p.approach_s).min(minimum_jerk((p.duration_s - t) / p.approach_s));
        let z = p.clearance_mm * (1.0 - down) - down * self.force_at(t) / p.stiffness_n_per_mm;
        let tremor = self.tremor.at(t);
        let position = [x + tremor[0], y + tremor[1], z + tremor[2]].map(|v| quantise(v, p.quantum_mm));
        Sample { position, ..Sample::default() }
    }

    /// Intended force in N at `t` seconds on the surface.
    pub fn force_at(&self, t: f64) -> f64 {
        let p = &self.params;
        p.force_n * (1.0 + p.force_swing * (TAU * p.force_swing_hz * t + self.force_phase).sine())
    }

    /// x and y in mm, `t` seconds after the path began, without tremor.
    fn path(&self, t: f64) -> [f64; 2] {
        let t = t.clamp(0.0, self.path_s);
        if self.params.shape == Shape::Circle {
            return self.circle(t);
        }
        let leg = ((t / self.leg_s) as u64).min(self.legs);
        let way = if leg < self.legs {
            minimum_jerk(t / self.leg_s - leg as f64)
        } else if self.last_leg > 0.0 {
            self.last_leg * minimum_jerk((t / self.leg_s - leg as f64) / self.last_leg)
        } else {
            0.0
        };
        let (from, to) = (self.turn(leg), self.turn(leg + 1));
        [0, 1].map(|k| from[k] + way * (to[k] - from[k]))
    }

    /// Turn number `n` in mm.
    fn turn(&self, n: u64) -> [f64; 2] {
        let half = self.params.extent_mm / 2.0;
        let x = if n.is_multiple_of(2) { -half } else { half };
        let along = n % (2 * LEGS_PER_SWEEP);
        let steps = along.min(2 * LEGS_PER_SWEEP - along) as f64;
        let sweep = leg_pitch(&self.params) * LEGS_PER_SWEEP as f64;
        [x, steps * leg_pitch(&self.params) - sweep / 2.0]
    }

    fn circle(&self, t: f64) -> [f64; 2] {
        let (ramp, all) = (self.leg_s, self.path_s);
        let cruise = self.params.mean_speed_mm_s * all / (all - ramp);
        // The speed rises like a minimum-jerk movement, stays, and falls likewise. Each ramp counts
        // half its time.
        let rise = ramp * minimum_jerk_ramp_integral(t / ramp);
        let fall = ramp * (0.5 - minimum_jerk_ramp_integral((all - t) / ramp));
        let steady = (t - ramp).clamp(0.0, all - 2.0 * ramp);
        let radius = self.params.extent_mm / 2.0;
        let angle = cruise * (rise + steady + fall) / radius;
        [-radius * angle.cosine(), radius * angle.sine()]
    }
}

/// Step of a movement along y in mm.
fn leg_pitch(p: &StrokeParams) -> f64 {
    match p.shape {
        Shape::Zigzag => p.extent_mm / LEGS_PER_SWEEP as f64,
        Shape::Line | Shape::Circle => 0.0,
    }
}

#[cfg(test)]
#[path = "stroke_tests.rs"]
mod tests;
