use super::passivity::Law;
use super::{EffectError, counted_vector, length};

/// Drag in a volume: a force against the velocity and in proportion to it, up to a greatest one. It remembers nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Viscosity {
    ns_per_mm: f64,
    max_force_n: f64,
}

impl Viscosity {
    /// A drag of `viscosity_ns_per_m` \[N s/m\], at most `max_force_n` \[N\].
    ///
    /// # Errors
    /// A viscosity that is not from 0 to 1000 N s/m, a force that is not from 0 to 1000 N.
    pub fn new(viscosity_ns_per_m: f64, max_force_n: f64) -> Result<Self, EffectError> {
        let viscosity = EffectError::check("a viscosity", viscosity_ns_per_m, (0.0, 1000.0), "N s/m")?;
        let max_force_n = EffectError::check("a greatest force", max_force_n, (0.0, 1000.0), "N")?;
        Ok(Self { ns_per_mm: 1e-3 * viscosity, max_force_n })
    }

    /// The force on a stylus of this velocity, F = -c v, shortened to the greatest force. A velocity that is not finite counts as 0.
    pub fn force_n(&self, velocity_mm_s: [f64; 3]) -> [f64; 3] {
        let force = counted_vector(velocity_mm_s).map(|v| -self.ns_per_mm * v);
        let size = length(force);
        let share = if size > self.max_force_n { self.max_force_n / size } else { 1.0 };
        force.map(|f| share * f)
    }

    /// The law near rest, in every direction.
    pub fn law(&self) -> Law {
        Law { stiffness_n_per_mm: 0.0, damping_ns_per_m: 1e3 * self.ns_per_mm }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drag_is_against_the_velocity_in_proportion_to_it_and_bounded() {
        let honey = Viscosity::new(5.0, 2.0).unwrap();
        // 5 N s/m at 100 mm/s is half a newton.
        assert!((honey.force_n([100.0, 0.0, 0.0])[0] + 0.5).abs() < 1e-15);
        let force = honey.force_n([-60.0, 0.0, 80.0]);
        assert!((force[0] - 0.3).abs() < 1e-15 && force[1] == 0.0 && (force[2] + 0.4).abs() < 1e-15);
        let most = honey.force_n([-6e4, 0.0, 8e4]);
        assert!((most[0] - 1.2).abs() < 1e-12 && (most[2] + 1.6).abs() < 1e-12, "{most:?}");
        assert_eq!(honey.law().damping_ns_per_m, 5.0);
    }

    #[test]
    fn what_is_not_a_number_is_no_drag_and_nothing_is_refused_silently() {
        let honey = Viscosity::new(1000.0, 1000.0).unwrap();
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(honey.force_n([5.0, bad, 1.0]), [0.0; 3]);
            assert!(Viscosity::new(bad, 1.0).is_err() && Viscosity::new(1.0, bad).is_err());
        }
        let force = honey.force_n([f64::MAX; 3]);
        assert!((length(force) - 1000.0).abs() < 1e-9, "{force:?}");
        assert_eq!(Viscosity::new(3.0, 0.0).unwrap().force_n([1e3; 3]).map(f64::abs), [0.0; 3]);
        assert!(Viscosity::new(-1.0, 1.0).unwrap_err().to_string().contains("from 0 to 1000 N s/m"));
    }
}
