//! The network's inputs as the chain measures them, with the sensor's faults, and their true values.

use asperity_dsp::frame::BINS;
use asperity_dsp::low_pass::{LowPass, corner, opened_hz};
pub(crate) use asperity_motion::STIFFNESS_N_PER_MM;
use asperity_numbers::Random;

use crate::example::Example;

/// Samples in a history.
pub const HISTORY: usize = 10;
/// Rate of history samples [Hz].
pub const RATE_HZ: f64 = 500.0;
/// Fastest stroke trained [mm/s].
pub const MAX_SPEED_MM_S: f64 = 300.0;
/// Largest force trained [N].
pub const MAX_FORCE_N: f64 = 3.5;

/// Corner of the chain's velocity filter at rest [Hz].
const CUTOFF_HZ: f64 = 20.0;
/// Rise of that corner with speed [Hz per mm/s].
const CUTOFF_HZ_PER_MM_S: f64 = 1.0;
/// Step of the sensor [mm].
const SENSOR_STEP_MM: f64 = 0.055;
/// Ticks before a drawn history begins: five time constants of the filter.
const WARM_UP: usize = 30;

/// One input of the network and its true values.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct History {
    /// Forces [N], oldest first.
    pub force: [f32; HISTORY],
    /// 10 vx, then 10 vy [mm/s], oldest first, as measured.
    pub velocity: [f32; 2 * HISTORY],
    /// True speed [mm/s] and force [N]. The force is as measured. The speed of a [drawn](History::draw)
    /// motion is that of unrounded positions through the same filter.
    pub clean: [(f64, f64); HISTORY],
}

impl History {
    /// Draws one for training. One in ten begins less than ten ticks before its end, with zeros before.
    pub fn draw(random: &mut Random) -> Self {
        let motion = Motion::draw(random);
        let force = draw_force(random);
        let (mut measured, mut clean) = (Velocity::default(), Velocity::default());
        let known = if random.chance(0.1) { 1 + random.below(HISTORY - 1) } else { HISTORY };
        let mut tick = -1.0;
        let mut observe = |measured: &mut Velocity, clean: &mut Velocity| {
            tick += 1.0;
            let p = motion.position(tick / RATE_HZ);
            (measured.step(p.map(rounded)), clean.step(p))
        };
        if known == HISTORY {
            let (p, v) = (motion.position(-1.0 / RATE_HZ), motion.velocity(0.0));
            measured.start_at(p.map(rounded), v);
            clean.start_at(p, v);
            for _ in 0..WARM_UP {
                observe(&mut measured, &mut clean);
            }
        }
        let mut history = Self::default();
        for force in force.into_iter().skip(HISTORY - known) {
            let (measured, clean) = observe(&mut measured, &mut clean);
            history.push(force, measured, clean);
        }
        history
    }

    /// An example with the magnitudes that follow.
    pub(crate) fn example(&self, magnitudes: [f32; BINS]) -> Example {
        Example { force: self.force, velocity: self.velocity, magnitudes, other: None }
    }

    fn push(&mut self, force: f64, measured: [f64; 2], clean: [f64; 2]) {
        self.force.rotate_left(1);
        self.velocity[..HISTORY].rotate_left(1);
        self.velocity[HISTORY..].rotate_left(1);
        self.clean.rotate_left(1);
        self.force[HISTORY - 1] = force as f32;
        self.velocity[HISTORY - 1] = measured[0] as f32;
        self.velocity[2 * HISTORY - 1] = measured[1] as f32;
        self.clean[HISTORY - 1] = (clean[0].hypot(clean[1]), force);
    }
}

/// Velocity as the chain measures it: a finite difference and a second-order low-pass that opens with speed.
#[derive(Clone, Debug, Default)]
struct Velocity {
    filters: [LowPass; 2],
    now: [f64; 2],
    last: Option<[f64; 2]>,
}

impl Velocity {
    fn start_at(&mut self, position: [f64; 2], velocity: [f64; 2]) {
        (self.last, self.now) = (Some(position), velocity);
        for (filter, v) in self.filters.iter_mut().zip(velocity) {
            filter.reset_to(v);
        }
    }

    fn step(&mut self, position: [f64; 2]) -> [f64; 2] {
        let last = self.last.replace(position).unwrap_or(position);
        let speed = self.now[0].hypot(self.now[1]);
        let at = corner(opened_hz(CUTOFF_HZ, CUTOFF_HZ_PER_MM_S, speed, RATE_HZ), RATE_HZ);
        self.now = std::array::from_fn(|i| self.filters[i].step((position[i] - last[i]) * RATE_HZ, at));
        self.now
    }
}

/// Measures a stroke as the chain does, in ticks of 2 ms. It starts without history.
#[derive(Clone, Debug, Default)]
pub struct Recorder {
    velocity: Velocity,
    history: History,
}

impl Recorder {
    /// Takes a tick's place in mm and force in N.
    pub fn observe(&mut self, place_mm: [f64; 2], force_n: f64) -> &History {
        let velocity = self.velocity.step(place_mm);
        self.history.push(force_n, velocity, velocity);
        &self.history
    }
}

fn rounded(x: f64) -> f64 {
    (x / SENSOR_STEP_MM).round() * SENSOR_STEP_MM
}

/// A drawn motion in closed form: an ellipse of any flatness and speed, plus a tremor.
struct Motion {
    start: [f64; 2],
    along: [f64; 2],
    across: [f64; 2],
    omega: f64,
    phase: f64,
    tremor: [f64; 2],
    tremor_omega: f64,
    tremor_phase: f64,
}

impl Motion {
    fn draw(random: &mut Random) -> Self {
        use std::f64::consts::TAU;
        let still = random.chance(0.05);
        let omega = TAU * 0.1 * 40f64.powf(random.unit());
        let tremor = if random.chance(0.5) || still { 0.0 } else { random.range(0.0, 15.0) };
        let speed = if still { 0.0 } else { (MAX_SPEED_MM_S - tremor) * random.unit().powf(1.2) };
        let across = if random.chance(0.5) { 0.0 } else { speed * random.range(-1.0, 1.0) };
        let (sin, cos) = (TAU * random.unit()).sin_cos();
        let (tremor_sin, tremor_cos) = (TAU * random.unit()).sin_cos();
        Self {
            start: [random.range(-50.0, 50.0), random.range(-50.0, 50.0)],
            along: [speed * cos, speed * sin],
            across: [-across * sin, across * cos],
            omega,
            phase: TAU * random.unit(),
            tremor: [tremor * tremor_cos, tremor * tremor_sin],
            tremor_omega: TAU * random.range(8.0, 12.0),
            tremor_phase: TAU * random.unit(),
        }
    }

    fn position(&self, t: f64) -> [f64; 2] {
        let (sin, cos) = (self.omega * t + self.phase).sin_cos();
        let tremor = (self.tremor_omega * t + self.tremor_phase).sin() / self.tremor_omega;
        std::array::from_fn(|i| {
            self.start[i]
                + (self.along[i] * sin - self.across[i] * cos) / self.omega
                + self.tremor[i] * tremor
        })
    }

    fn velocity(&self, t: f64) -> [f64; 2] {
        let (sin, cos) = (self.omega * t + self.phase).sin_cos();
        let tremor = (self.tremor_omega * t + self.tremor_phase).cos();
        std::array::from_fn(|i| self.along[i] * cos + self.across[i] * sin + self.tremor[i] * tremor)
    }
}

/// Draws the forces of a history: level, slope, tremor, contact made or lost, sensor steps.
fn draw_force(random: &mut Random) -> [f64; HISTORY] {
    let none = random.chance(0.08);
    let level =
        if random.chance(0.2) { 0.02 * 25f64.powf(random.unit()) } else { random.range(0.0, MAX_FORCE_N) };
    let slope = 0.016 * random.normal();
    let (swing, step, phase) = (random.range(0.0, 0.15), random.range(0.10, 0.15), random.range(0.0, 6.3));
    let (made, lost) = match random.below(8) {
        0 => (1 + random.below(HISTORY - 1), HISTORY),
        1 => (0, 1 + random.below(HISTORY - 1)),
        _ => (0, HISTORY),
    };
    let quantum = if random.chance(0.7) { SENSOR_STEP_MM * STIFFNESS_N_PER_MM } else { 0.0 };
    std::array::from_fn(|i| {
        if none || i < made || i >= lost {
            return 0.0;
        }
        let force = level + slope * (i as f64 - 9.0) + swing * (step * i as f64 + phase).sin();
        let force = if quantum > 0.0 { (force / quantum).round() * quantum } else { force };
        force.clamp(0.0, MAX_FORCE_N)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drawn_histories_cover_exactly_the_stated_ranges() {
        let mut random = Random::new(5);
        let (mut fastest, mut strongest, mut still, mut partly) = (0.0f64, 0.0f64, 0, 0);
        for _ in 0..20_000 {
            let h = History::draw(&mut random);
            for (speed, force) in h.clean {
                assert!((0.0..=MAX_SPEED_MM_S + 5.0).contains(&speed), "{speed}");
                assert!((0.0..=MAX_FORCE_N).contains(&force), "{force}");
                fastest = fastest.max(speed);
                strongest = strongest.max(force);
            }
            still += usize::from(h.velocity == [0.0; 20]);
            partly += usize::from(h.velocity[0] == 0.0 && h.velocity[9] != 0.0);
        }
        assert!(fastest > 290.0 && strongest > 3.45, "{fastest} {strongest}");
        assert!(still > 500 && partly > 1000, "{still} {partly}");
    }

    #[test]
    fn sensor_step_adds_small_noise_to_velocity() {
        let mut random = Random::new(6);
        let (mut squares, mut n) = (0.0, 0);
        for _ in 0..5000 {
            let h = History::draw(&mut random);
            let measured = f64::from(h.velocity[9]).hypot(f64::from(h.velocity[19]));
            if h.clean[0].0 > 20.0 {
                squares += (measured - h.clean[HISTORY - 1].0).powi(2);
                n += 1;
            }
        }
        let rms = (squares / f64::from(n)).sqrt();
        assert!((0.1..3.0).contains(&rms), "{rms} mm/s");
    }
}
