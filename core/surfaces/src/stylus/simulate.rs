use super::Tool;
use crate::topography::{Contact, HeightField};
use asperity_numbers::Elementary as _;

/// Samples a second.
pub const SAMPLE_HZ: u32 = 10_000;
/// Default number of simulation steps a sample.
pub const STEPS: u32 = 4;
/// Time in which the hand's rest follows the tool, in seconds.
const FOLLOWS_S: f64 = 0.5;
/// Speed below which friction fades, in m/s.
const SLIP_M_S: f64 = 2e-3;

/// Motion and force of the hand in one sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moment {
    /// Velocity along x and y in mm/s.
    pub velocity_mm_s: [f64; 2],
    /// Normal force in N, not negative.
    pub force_n: f64,
}

/// Signal of the accelerometer in m/s^2.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Acceleration {
    /// Along the normal.
    pub normal: f64,
    /// Along the surface, x and y.
    pub lateral: [f64; 2],
}

impl Acceleration {
    /// All three axes.
    pub fn axes(&self) -> [f64; 3] {
        [self.normal, self.lateral[0], self.lateral[1]]
    }
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
    pub(super) steps: u32,
    /// Place of the hand in millimetres.
    place_mm: [f64; 2],
    /// Heights of tip and body over the patch's zero in metres, and their speeds.
    heights: [f64; 2],
    rise: [f64; 2],
    /// Distance of the tool from the hand along x and y in metres, and its rate.
    away: [f64; 2],
    drift: [f64; 2],
    rest: f64,
}

impl<'s> Stylus<'s> {
    /// A tool at rest on the [envelope](crate::topography::envelope) for its tip, pressed with
    /// `force_n`.
    pub fn new(
        tool: Tool,
        envelope: &'s HeightField,
        contact: Contact,
        place_mm: [f64; 2],
        force_n: f64,
    ) -> Self {
        let hertz = tool.hertz(&contact);
        let depth = (force_n.max(0.0) / hertz).power(2.0 / 3.0);
        let height = envelope.sample(place_mm[0], place_mm[1]).height_mm * 1e-3 - depth;
        let body = height - force_n / tool.shaft_n_m;
        Self {
            tool,
            envelope,
            contact,
            hertz,
            per_kg: [tool.tip_kg, tool.body_kg, tool.mass_kg()].map(|kg| 1.0 / kg),
            steps: STEPS,
            place_mm,
            heights: [height, body],
            rise: [0.0; 2],
            away: [0.0; 2],
            drift: [0.0; 2],
            rest: body,
        }
    }

    /// Duration of a step in seconds.
    fn step_s(&self) -> f64 {
        1.0 / f64::from(SAMPLE_HZ * self.steps)
    }

    /// Advances by one sample.
    pub fn next(&mut self, moment: &Moment) -> Acceleration {
        let (rise, drift) = (self.rise[1], self.drift);
        let velocity = moment.velocity_mm_s.map(|v| 1e-3 * v);
        for _ in 0..self.steps {
            self.step(velocity, moment.force_n.max(0.0));
        }
        let per_s = 1.0 / (self.step_s() * f64::from(self.steps));
        Acceleration {
            normal: per_s * (self.rise[1] - rise),
            lateral: std::array::from_fn(|i| per_s * (self.drift[i] - drift[i])),
        }
    }

    /// Depth of the tip in the surface in metres, and the slopes there.
    fn depth(&self) -> (f64, [f64; 2]) {
        let [x, y] = [0, 1].map(|i| self.place_mm[i] + 1e3 * self.away[i]);
        let surface = self.envelope.sample(x, y);
        (surface.height_mm * 1e-3 - self.heights[0], surface.slope)
    }

    /// One step with the hand at this velocity in m/s.
    fn step(&mut self, velocity: [f64; 2], force: f64) {
        let (t, dt) = (self.tool, self.step_s());
        let (depth, slope) = self.depth();
        let slip: [f64; 2] = std::array::from_fn(|i| velocity[i] + self.drift[i]);
        let approach = dot(slope, slip) - self.rise[0];
        let hertz = if depth > 0.0 { self.hertz * depth * depth.sqrt() } else { 0.0 };
        let normal = (hertz * (1.0 + self.contact.damping_s_m * approach)).max(0.0);
        // Friction acts against the slip and fades at slow slip.
        let rub = self.contact.friction * normal / (SLIP_M_S * SLIP_M_S + dot(slip, slip)).sqrt();
        let apart = self.rise[0] - self.rise[1];
        let shaft = t.shaft_n_m * (self.heights[0] - self.heights[1]) + t.shaft_ns_m * apart;
        let hand = t.hand_n_m[0] * (self.heights[1] - self.rest) + t.hand_ns_m[0] * self.rise[1];
        // Force of the surface along x and y.
        let drag: [f64; 2] = std::array::from_fn(|i| normal * slope[i] + rub * slip[i]);
        let [tip, body, whole] = self.per_kg.map(|per_kg| dt * per_kg);
        self.rise[0] += tip * (normal - shaft);
        self.rise[1] += body * (shaft - force - hand);
        for i in 0..2 {
            let held = t.hand_n_m[1] * self.away[i] + t.hand_ns_m[1] * self.drift[i];
            self.drift[i] -= whole * (drag[i] + held);
            self.heights[i] += dt * self.rise[i];
            self.away[i] += dt * self.drift[i];
            self.place_mm[i] += 1e3 * dt * velocity[i];
        }
        self.rest += dt / FOLLOWS_S * (self.heights[1] - self.rest);
    }
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

#[cfg(test)]
#[path = "simulate_tests.rs"]
mod tests;
