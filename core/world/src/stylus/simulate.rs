use super::Tool;
use crate::topography::{Contact, HeightField};

/// Samples a second.
pub const SAMPLE_HZ: u32 = 10_000;
/// Steps of the simulation a sample, unless told otherwise.
pub const STEPS: u32 = 4;
/// Time in which the hand's rest follows the tool, in seconds.
const FOLLOWS_S: f64 = 0.5;
/// Speed below which friction fades, in m/s.
const SLIP_M_S: f64 = 2e-3;

/// What the hand does in one sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moment {
    /// Velocity along x and y in mm/s.
    pub velocity_mm_s: [f64; 2],
    /// Normal force in N, not negative.
    pub force_n: f64,
}

/// What the accelerometer says, in m/s^2.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Acceleration {
    /// Along the normal.
    pub normal: f64,
    /// Along the stroke.
    pub along: f64,
}

/// Energy of a run, in joules. What came in is what is stored and what was lost, up to the step's error.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energy {
    /// Done by the hand: the drag along the stroke.
    pub drag: f64,
    /// Lost in shaft, hand, contact and friction.
    pub lost: f64,
    /// Stored in motion, springs, contact and against the hand's force.
    pub stored: f64,
}

/// A tool on a surface.
#[derive(Clone, Debug)]
pub struct Stylus<'s> {
    tool: Tool,
    envelope: &'s HeightField,
    contact: Contact,
    hertz: f64,
    /// One over the masses of tip, body and both.
    per_kg: [f64; 3],
    step_s: f64,
    steps: u32,
    /// Whether the hand's rest follows.
    follows: bool,
    /// Place of the hand in millimetres.
    place_mm: [f64; 2],
    /// Heights of tip and body over the patch's zero, deflection along the stroke, in metres; and their speeds.
    at: [f64; 3],
    speed: [f64; 3],
    rest: f64,
    energy: Energy,
}

impl<'s> Stylus<'s> {
    /// A tool at rest on the [envelope](crate::topography::envelope) of a surface for its tip, pressed with `force_n`.
    pub fn new(
        tool: Tool,
        envelope: &'s HeightField,
        contact: Contact,
        place_mm: [f64; 2],
        force_n: f64,
    ) -> Self {
        let hertz = tool.hertz(&contact);
        let depth = (force_n.max(0.0) / hertz).powf(2.0 / 3.0);
        let height = envelope.sample(place_mm[0], place_mm[1]).height_mm * 1e-3 - depth;
        let body = height - force_n / tool.shaft_n_m;
        Self {
            tool,
            envelope,
            contact,
            hertz,
            per_kg: [tool.tip_kg, tool.body_kg, tool.mass_kg()].map(|kg| 1.0 / kg),
            step_s: 1.0 / f64::from(SAMPLE_HZ * STEPS),
            steps: STEPS,
            follows: true,
            place_mm,
            at: [height, body, 0.0],
            speed: [0.0; 3],
            rest: body,
            energy: Energy::default(),
        }
    }

    /// The same with another number of steps a sample.
    pub fn with_steps(mut self, steps: u32) -> Self {
        self.steps = steps.max(1);
        self.step_s = 1.0 / f64::from(SAMPLE_HZ * self.steps);
        self
    }

    /// The same with a hand whose rest stays where it is, so that energy can be followed at a force that does not change.
    pub fn with_still_hand(mut self) -> Self {
        self.follows = false;
        self
    }

    /// Goes on by a sample.
    pub fn next(&mut self, moment: &Moment) -> Acceleration {
        let before = self.speed;
        let [vx, vy] = moment.velocity_mm_s;
        let speed = vx.hypot(vy);
        let way = if speed > 0.0 { [vx / speed, vy / speed] } else { [1.0, 0.0] };
        let force = moment.force_n.max(0.0);
        for _ in 0..self.steps {
            self.step(speed * 1e-3, way, force);
        }
        let sample_s = self.step_s * f64::from(self.steps);
        Acceleration {
            normal: (self.speed[1] - before[1]) / sample_s,
            along: (self.speed[2] - before[2]) / sample_s,
        }
    }

    /// Energy since the start, at a force of `force_n` that did not change.
    pub fn energy(&self, force_n: f64) -> Energy {
        let t = &self.tool;
        let [tip, body, along] = self.at;
        let motion = t.tip_kg * self.speed[0].powi(2)
            + t.body_kg * self.speed[1].powi(2)
            + t.mass_kg() * self.speed[2].powi(2);
        let springs = t.shaft_n_m * (tip - body).powi(2)
            + t.hand_n_m[0] * (body - self.rest).powi(2)
            + t.hand_n_m[1] * along.powi(2);
        let depth = self.depth(&[1.0, 0.0]).0.max(0.0);
        let contact = 0.4 * self.hertz * depth.powf(2.5);
        Energy { stored: 0.5 * (motion + springs) + contact + force_n * body, ..self.energy }
    }

    /// How deep the tip is in the surface in metres, and the slope along the way.
    fn depth(&self, way: &[f64; 2]) -> (f64, f64) {
        let away = self.at[2] * 1e3;
        let surface =
            self.envelope.sample(self.place_mm[0] + away * way[0], self.place_mm[1] + away * way[1]);
        let slope = surface.slope[0] * way[0] + surface.slope[1] * way[1];
        (surface.height_mm * 1e-3 - self.at[0], slope)
    }

    /// One step at a speed in m/s along a way.
    fn step(&mut self, speed: f64, way: [f64; 2], force: f64) {
        let (t, dt) = (self.tool, self.step_s);
        let (depth, slope) = self.depth(&way);
        let slip = speed + self.speed[2];
        let approach = slope * slip - self.speed[0];
        let hertz = if depth > 0.0 { self.hertz * depth * depth.sqrt() } else { 0.0 };
        let normal = (hertz * (1.0 + self.contact.damping_s_m * approach)).max(0.0);
        let friction = self.contact.friction * normal * saturating(slip / SLIP_M_S);
        let apart = self.speed[0] - self.speed[1];
        let shaft = t.shaft_n_m * (self.at[0] - self.at[1]) + t.shaft_ns_m * apart;
        let hand = t.hand_n_m[0] * (self.at[1] - self.rest) + t.hand_ns_m[0] * self.speed[1];
        let held = t.hand_n_m[1] * self.at[2] + t.hand_ns_m[1] * self.speed[2];
        let pull = -normal * slope - friction - held;
        let [tip, body, whole] = self.per_kg.map(|per_kg| dt * per_kg);
        self.speed[0] += tip * (normal - shaft);
        self.speed[1] += body * (shaft - force - hand);
        self.speed[2] += whole * pull;
        self.at.iter_mut().zip(self.speed).for_each(|(at, speed)| *at += dt * speed);
        self.place_mm.iter_mut().zip(way).for_each(|(at, way)| *at += 1e3 * speed * dt * way);
        if self.follows {
            self.rest += dt / FOLLOWS_S * (self.at[1] - self.rest);
        }
        // The hand moves at its speed against what pulls at it.
        self.energy.drag += dt * speed * (normal * slope + friction);
        self.energy.lost += dt
            * (t.shaft_ns_m * apart * apart
                + t.hand_ns_m[0] * self.speed[1].powi(2)
                + t.hand_ns_m[1] * self.speed[2].powi(2)
                + friction * slip
                + (normal - hertz) * approach);
    }
}

/// Grows with `x` near 0 and goes to 1 or -1 far from it.
fn saturating(x: f64) -> f64 {
    x / (1.0 + x * x).sqrt()
}

#[cfg(test)]
#[path = "simulate_tests.rs"]
mod tests;
