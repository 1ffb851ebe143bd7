use super::law::{MAX_COEFFICIENT, VISCOSITY, inputs};
use asperity_node::Law;

use crate::effects::bounds::EffectError;

/// Friction that begins as drag: `F_n c |v|` up to `mu F_n`, against the velocity. It is continuous in
/// velocity and normal force, remembers nothing and does not stick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViscousCoulomb {
    coefficient: f64,
    viscosity_s_per_mm: f64,
}

impl ViscousCoulomb {
    /// The usual slope \[s/mm\]: half the normal force at 125 mm/s.
    pub const VISCOSITY_S_PER_MM: f64 = 0.004;

    /// Friction of coefficient `mu`, without unit, and slope `c` \[s/mm\], usually
    /// [`VISCOSITY_S_PER_MM`](Self::VISCOSITY_S_PER_MM).
    ///
    /// # Errors
    /// A coefficient that is not from 0 to 10, a slope not from 0 to 10 s/mm.
    pub fn new(coefficient: f64, viscosity_s_per_mm: f64) -> Result<Self, EffectError> {
        let coefficient =
            EffectError::check("a coefficient of friction", coefficient, (0.0, MAX_COEFFICIENT), "")?;
        let viscosity_s_per_mm = EffectError::check("a viscosity", viscosity_s_per_mm, VISCOSITY, "s/mm")?;
        Ok(Self { coefficient, viscosity_s_per_mm })
    }

    /// The force on the stylus \[N\].
    pub fn force_n(&self, velocity_mm_s: [f64; 2], normal_force_n: f64) -> [f64; 2] {
        let (velocity, speed, normal, _) = inputs(velocity_mm_s, normal_force_n, 0.0);
        let most = self.coefficient * normal;
        let drag = self.viscosity_s_per_mm * normal;
        if drag * speed <= most { velocity.map(|v| -drag * v) } else { velocity.map(|v| -most * (v / speed)) }
    }

    /// The law at rest, along the surface: a damping of 1000 c F_n \[N s/m\]. With the usual slope this is
    /// 4 N s/m under a newton.
    pub fn law(&self, normal_force_n: f64) -> Law {
        let (_, _, normal, _) = inputs([0.0; 2], normal_force_n, 0.0);
        let slope = if self.coefficient > 0.0 { 1e3 * self.viscosity_s_per_mm * normal } else { 0.0 };
        Law { stiffness_n_per_mm: 0.0, damping_ns_per_m: slope }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_drag_in_proportion_to_the_normal_force_up_to_coulombs() {
        let f = ViscousCoulomb::new(0.5, ViscousCoulomb::VISCOSITY_S_PER_MM).unwrap();
        // 2 N at 60 and 80 mm/s: 2 * 0.004 * 100 = 0.8 N against it.
        let force = f.force_n([60.0, -80.0], 2.0);
        assert!((force[0] + 0.48).abs() < 1e-15 && (force[1] - 0.64).abs() < 1e-15, "{force:?}");
        // Coulomb's from 125 mm/s on, and no step there.
        let (below, above) = (f.force_n([124.999_999, 0.0], 2.0)[0], f.force_n([125.000_001, 0.0], 2.0)[0]);
        assert!((below + 1.0).abs() < 1e-7 && (above + 1.0).abs() < 1e-15);
        let fast = f.force_n([-6e4, 8e4], 2.0);
        assert!((fast[0] - 0.6).abs() < 1e-12 && (fast[1] + 0.8).abs() < 1e-12);
        for still in [f.force_n([0.0; 2], 2.0), f.force_n([50.0, 1.0], 0.0), f.force_n([500.0, 1.0], -1.0)] {
            assert_eq!(still.map(f64::abs), [0.0; 2]);
        }
    }

    #[test]
    fn the_law_is_the_slope_at_rest() {
        let f = ViscousCoulomb::new(0.5, 0.004).unwrap();
        assert!((f.law(1.0).damping_ns_per_m - 4.0).abs() < 1e-12 && f.law(1.0).stiffness_n_per_mm == 0.0);
        let slope = (f.force_n([-1e-6, 0.0], 1.7)[0] - f.force_n([1e-6, 0.0], 1.7)[0]) / 2e-9;
        assert!((f.law(1.7).damping_ns_per_m - slope).abs() < 1e-9);
        assert_eq!(ViscousCoulomb::new(0.0, 0.004).unwrap().law(1.0).damping_ns_per_m, 0.0);
    }

    #[test]
    fn not_finite_gives_no_friction_bad_settings_are_refused() {
        let f = ViscousCoulomb::new(10.0, 10.0).unwrap();
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            for force in [f.force_n([bad, 1.0], 1.0), f.force_n([1.0, 1.0], bad)] {
                assert_eq!(force.map(f64::abs), [0.0; 2]);
            }
            assert!(ViscousCoulomb::new(bad, 0.0).is_err() && ViscousCoulomb::new(0.0, bad).is_err());
        }
        for v in [f64::MAX, f64::MIN_POSITIVE, 5e-324] {
            assert!(f.force_n([v, -v], f64::MAX).iter().all(|x| x.is_finite()));
        }
        assert!(ViscousCoulomb::new(-0.1, 0.0).is_err() && ViscousCoulomb::new(0.5, -1e-9).is_err());
    }
}
