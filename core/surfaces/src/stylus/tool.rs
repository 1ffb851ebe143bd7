use crate::topography::spectrum::blur;
use crate::topography::{Contact, HeightField, envelope};
use asperity_numbers::Elementary as _;

/// Poisson's ratio of tip and surface.
const POISSON: f64 = 0.35;

/// Force in N for the size of the contact in averages of heights.
pub const AVERAGED_N: f64 = 1.0;

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
    /// Stiffness of the hand along the normal and along the surface, in N/m.
    pub hand_n_m: [f64; 2],
    /// Damping of the hand along the normal and along the surface, in N s/m.
    pub hand_ns_m: [f64; 2],
}

impl Tool {
    /// A pen of 56 g with a steel ball of 1/8 inch, held like a pen: the usual instrument for texture
    /// recordings. The shaft's stiffness is that of a slanted bending rod. Masses and tip are those of
    /// such an instrument. Stiffness and damping of shaft and hand are chosen; the hand's damping makes
    /// the contact's resonance (100 to 600 Hz) as broad as in recordings.
    pub const PEN: Self = Self {
        tip_mm: 1.6,
        tip_modulus_mpa: 200_000.0,
        tip_kg: 0.006,
        body_kg: 0.050,
        shaft_n_m: 8.0e5,
        shaft_ns_m: 60.0,
        hand_n_m: [500.0, 1_200.0],
        hand_ns_m: [30.0, 30.0],
    };

    /// Stiffness `K` of the contact with a surface, in N/m^(3/2).
    pub fn hertz(&self, contact: &Contact) -> f64 {
        let yields = (1.0 - POISSON * POISSON) * (1.0 / contact.modulus_mpa + 1.0 / self.tip_modulus_mpa);
        4.0 / 3.0 * 1e6 / yields * (self.tip_mm * 1e-3).sqrt()
    }

    /// Radius in millimetres of the contact under `force_n`: `a = sqrt(R d)` with Hertz's depth `d`.
    pub fn touching_mm(&self, contact: &Contact, force_n: f64) -> f64 {
        let depth_mm = 1e3 * (force_n.max(0.0) / self.hertz(contact)).power(2.0 / 3.0);
        (self.tip_mm * depth_mm).sqrt()
    }

    /// Path of the tip's middle: the [envelope] of the averaged surface. Hertz's pressure `sqrt(1 - r^2
    /// / a^2)` has a standard deviation of `a / sqrt(5)` along an axis, so the average is a Gaussian of
    /// this width. It uses `a` at [`AVERAGED_N`] for every force (`a` grows with the cube root of the
    /// force).
    pub fn track(&self, surface: &HeightField, contact: &Contact) -> HeightField {
        let spread = self.touching_mm(contact, AVERAGED_N) / 5.0_f64.sqrt();
        if spread < 0.3 * surface.step_mm() {
            return envelope(surface, self.tip_mm);
        }
        envelope(&blur(surface, spread), self.tip_mm)
    }

    /// Mass of the whole in kilograms.
    pub fn mass_kg(&self) -> f64 {
        self.tip_kg + self.body_kg
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn contact_averages_soft_surface_and_not_hard_one() {
        let (pen, period) = (Tool::PEN, 1.28);
        // The tip follows a wave this flat everywhere.
        let wave = HeightField::from_fn(256, 0.02, |x, _| 0.001 * (TAU * x / period).sin());
        let of = |modulus_mpa: f64| Contact { modulus_mpa, friction: 0.3, damping_s_m: 5.0 };
        for modulus in [20.0, 200.0, 50_000.0] {
            // Hertz: a^3 = 3 F R / (4 E*), in N and mm.
            let yields = (1.0 - 0.35 * 0.35) * (1.0 / modulus + 1.0 / 200_000.0);
            let radius = (0.75 * pen.tip_mm * yields).cbrt();
            assert!((pen.touching_mm(&of(modulus), 1.0) / radius - 1.0).abs() < 1e-9);
            let want = (-0.5 * (TAU / period * radius).powi(2) / 5.0).exp();
            let track = pen.track(&wave, &of(modulus));
            let found = track.rms_mm() / wave.rms_mm();
            assert!((found - want).abs() < 0.03, "{modulus} MPa: {found}, not {want}");
        }
    }
}
