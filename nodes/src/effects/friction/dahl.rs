use asperity_state::State;

use super::law::{BRISTLE, Bristle, MAX_COEFFICIENT, inputs};
use asperity_node::Law;

use crate::effects::bounds::EffectError;

/// Dahl's friction (P. R. Dahl, "A solid friction model", 1968) on a plane: a bristle that bends as the
/// surface passes, and gives way,
///
/// ```text
/// z' = v - s0 |v| z / F_c,    F = -s0 z,    F_c = mu F_n
/// ```
///
/// with v the vector of the velocity. In steady motion, F is F_c against it. Where the motion turns, the
/// force follows within some F_c / s0 of distance. For small displacements it is a spring. It does not depend
/// on speed.
///
/// As in Dahl's model, motion to and fro under a steady pull creeps. So does a stylus at rest whose position
/// is noisy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dahl {
    coefficient: f64,
    stiffness_n_per_mm: f64,
    bristle: Bristle,
}

impl Dahl {
    /// Friction of coefficient `mu`, without unit, whose bristle has the stiffness `s0` \[N/mm\]; at rest.
    ///
    /// # Errors
    /// A coefficient that is not from 0 to 10, a stiffness not from 0.001 to 1000 N/mm.
    pub fn new(coefficient: f64, bristle_stiffness_n_per_mm: f64) -> Result<Self, EffectError> {
        let coefficient =
            EffectError::check("a coefficient of friction", coefficient, (0.0, MAX_COEFFICIENT), "")?;
        let stiffness_n_per_mm =
            EffectError::check("a bristle's stiffness", bristle_stiffness_n_per_mm, BRISTLE, "N/mm")?;
        Ok(Self { coefficient, stiffness_n_per_mm, bristle: Bristle::default() })
    }

    /// The force on the stylus \[N\] after a tick of `dt_s` at this velocity. A velocity or a time that is
    /// not a number bends nothing.
    pub fn step(&mut self, velocity_mm_s: [f64; 2], normal_force_n: f64, dt_s: f64) -> [f64; 2] {
        let (velocity, speed, normal, dt) = inputs(velocity_mm_s, normal_force_n, dt_s);
        let most_mm = self.coefficient * normal / self.stiffness_n_per_mm;
        self.bristle.hold(most_mm);
        self.bristle.pass(velocity, speed, most_mm, dt);
        self.bristle.bent_mm.map(|z| -self.stiffness_n_per_mm * z)
    }

    /// The law at rest, along the surface: the bristle's stiffness.
    pub fn law(&self) -> Law {
        Law { stiffness_n_per_mm: self.stiffness_n_per_mm, damping_ns_per_m: 0.0 }
    }

    /// Energy in the bristle \[mJ\].
    pub fn stored_mj(&self) -> f64 {
        0.5 * self.stiffness_n_per_mm
            * crate::effects::bounds::dot(self.bristle.bent_mm, self.bristle.bent_mm)
    }

    /// Unbends the bristle.
    pub fn reset(&mut self) {
        self.bristle = Bristle::default();
    }

    /// Takes the bristle from one pair of tangents to another. Tangents are directions along the surface of
    /// length 1. It gives no energy.
    pub fn turn(&mut self, from: &[[f64; 3]; 2], to: &[[f64; 3]; 2]) {
        self.bristle.turn(from, to);
    }

    /// Bend of the bristle.
    pub fn state(&mut self, state: &mut State<'_>) {
        self.bristle.state(state);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn force_along_a_line_follows_closed_form_at_any_tick() {
        // From rest F = F_c (1 - e^(-s0 x / F_c)); turning at F: F -> -F_c + (F_0 + F_c) e^(-s0 x / F_c).
        for (dt, speed) in [(1e-4, 7.0), (2e-3, 30.0), (1e-2, 3.0)] {
            let mut f = Dahl::new(0.4, 2.0).unwrap();
            let (most, mut x, mut force) = (0.4 * 1.5, 0.0, 0.0);
            while x < 0.5 {
                force = f.step([0.0, speed], 1.5, dt)[1];
                x += speed * dt;
                let want = -most * (1.0 - (-2.0 * x / most).exp());
                assert!((force - want).abs() < 1e-12, "{force}, not {want} after {x} mm");
            }
            let (turned, mut back) = (force, 0.0);
            while back < 0.5 {
                force = f.step([0.0, -speed], 1.5, dt)[1];
                back += speed * dt;
                let want = most + (turned - most) * (-2.0 * back / most).exp();
                assert!((force - want).abs() < 1e-12, "{force}, not {want} after {back} mm back");
            }
        }
    }

    #[test]
    fn on_a_plane_it_follows_a_fine_integration_of_its_equation() {
        let mut f = Dahl::new(0.5, 3.0).unwrap();
        let (dt, mut z) = (1e-3, [0.0_f64; 2]);
        for k in 0..600 {
            let t = f64::from(k) * dt;
            // A velocity that turns round and never rests, a normal force that swells.
            let velocity = [40.0 * (9.0 * t).cos(), 25.0 * (14.0 * t).sin() + 5.0];
            let normal = 1.0 + 0.5 * (7.0 * t).sin();
            let force = f.step(velocity, normal, dt);
            let most = 0.5 * normal / 3.0;
            let size = z[0].hypot(z[1]);
            if size > most {
                z = z.map(|z| z * most / size);
            }
            for _ in 0..1000 {
                let speed = velocity[0].hypot(velocity[1]);
                // Heun's method, steps of a microsecond.
                let slope = |z: [f64; 2]| [0, 1].map(|i| velocity[i] - speed * z[i] / most);
                let first = slope(z);
                let second = slope([0, 1].map(|i| z[i] + 1e-6 * first[i]));
                z = [0, 1].map(|i| z[i] + 0.5e-6 * (first[i] + second[i]));
            }
            assert!((0..2).all(|i| (force[i] + 3.0 * z[i]).abs() < 1e-7), "{k}: {force:?} {z:?}");
        }
    }

    #[test]
    fn falling_normal_force_releases_bristle_none_gives_zero() {
        let mut f = Dahl::new(0.5, 1.0).unwrap();
        for _ in 0..1000 {
            f.step([30.0, 40.0], 2.0, 1e-3);
        }
        let held = f.step([0.0; 2], 2.0, 1e-3);
        assert!((held[0] + 0.6).abs() < 1e-12 && (held[1] + 0.8).abs() < 1e-12, "{held:?}");
        let less = f.step([0.0; 2], 1.0, 1e-3);
        assert!((less[0] + 0.3).abs() < 1e-12 && (less[1] + 0.4).abs() < 1e-12, "{less:?}");
        // It does not come back.
        assert_eq!(f.step([0.0; 2], 2.0, 1e-3), less);
        assert_eq!(f.step([30.0, 40.0], 0.0, 1e-3).map(f64::abs), [0.0; 2]);
        assert_eq!((f.step([0.0; 2], 2.0, 1e-3).map(f64::abs), f.stored_mj()), ([0.0; 2], 0.0));
    }
}
