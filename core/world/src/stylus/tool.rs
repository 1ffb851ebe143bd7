use crate::topography::Contact;

/// Poisson's ratio of tip and surface.
const POISSON: f64 = 0.35;

/// A stylus in a hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tool {
    /// Radius of the tip's round end in millimetres.
    pub tip_mm: f64,
    /// Young's modulus of the tip in MPa.
    pub tip_modulus_mpa: f64,
    /// Mass of the tip in kilograms.
    pub tip_kg: f64,
    /// Mass of the rest, with the accelerometer, in kilograms.
    pub body_kg: f64,
    /// Stiffness of the shaft between them, in N/m.
    pub shaft_n_m: f64,
    /// Damping of the shaft in N s/m.
    pub shaft_ns_m: f64,
    /// Stiffness of the hand along the normal and along the stroke, in N/m.
    pub hand_n_m: [f64; 2],
    /// Damping of the hand along the normal and along the stroke, in N s/m.
    pub hand_ns_m: [f64; 2],
}

impl Tool {
    /// A pen-sized tool with a tip of acetal, 0.8 mm in radius. Its figures, the hand's among them, are chosen for a light grip and not measured; the
    /// shaft and the two masses resonate at 1 kHz, free.
    pub const PEN: Self = Self {
        tip_mm: 0.8,
        tip_modulus_mpa: 2_800.0,
        tip_kg: 0.004,
        body_kg: 0.026,
        shaft_n_m: 1.5e5,
        shaft_ns_m: 8.0,
        hand_n_m: [500.0, 1_200.0],
        hand_ns_m: [4.0, 6.0],
    };

    /// Stiffness `K` of the contact with a surface, in N/m^(3/2).
    pub fn hertz(&self, contact: &Contact) -> f64 {
        let yields = (1.0 - POISSON * POISSON) * (1.0 / contact.modulus_mpa + 1.0 / self.tip_modulus_mpa);
        4.0 / 3.0 * 1e6 / yields * (self.tip_mm * 1e-3).sqrt()
    }

    /// Mass of the whole in kilograms.
    pub fn mass_kg(&self) -> f64 {
        self.tip_kg + self.body_kg
    }
}
