//! `viscosity`: drag in a volume.

use crate::prelude::*;

use super::bounds::{counted_vector, length};
use super::{Force, Renders, one_each, slot, vector};

/// Drag in a volume: a force against the velocity and in proportion to it, up to a largest force. It
/// remembers nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Drag {
    ns_per_mm: f64,
    max_force_n: f64,
}

impl Drag {
    /// A drag of `viscosity_ns_per_m` \[N s/m\], at most `max_force_n` \[N\], both 0 or more.
    pub(crate) fn new(viscosity_ns_per_m: f64, max_force_n: f64) -> Self {
        Self { ns_per_mm: 1e-3 * viscosity_ns_per_m, max_force_n }
    }

    /// The force on a stylus of this velocity, F = -c v, shortened to the largest force. A velocity that is
    /// not finite counts as 0.
    pub(crate) fn force_n(&self, velocity_mm_s: [f64; 3]) -> [f64; 3] {
        let force = counted_vector(velocity_mm_s).map(|v| -self.ns_per_mm * v);
        let size = length(force);
        let share = if size > self.max_force_n { self.max_force_n / size } else { 1.0 };
        force.map(|f| share * f)
    }

    /// The law near rest, in every direction.
    pub(crate) fn law(&self) -> Law {
        Law { stiffness_n_per_mm: 0.0, damping_ns_per_m: 1e3 * self.ns_per_mm }
    }
}

fn read(settings: &Settings) -> Drag {
    Drag::new(settings.number("viscosity_ns_per_m"), settings.number("max_force_n"))
}

/// A force against the velocity and in proportion to it, by the drag of the volume that the stylus is in.
pub struct Viscosity;

impl Node for Viscosity {
    fn descriptor() -> Descriptor {
        Descriptor::new("viscosity", "Renders drag: a force against the velocity inside a volume.")
            .input(slot("index into `drags`, from 0; below 0: no force").wakes())
            .input(control("velocity", 3, MM_S))
            .doc("unfiltered velocity x, y, z; filtered velocity would make drag unstable")
            .output(super::force("drag on the stylus, x, y, z"))
            .renders(
                Effect::new("drags", Acts::Inside)
                    .form(
                        Form::new("", "(viscosity_ns_per_m: 1, max_force_n: 1.5)")
                            .field(number("viscosity_ns_per_m", 0.0, 0.0..=1000.0, "N s/m").required())
                            .doc("force divided by speed")
                            .field(number("max_force_n", 3.3, 0.0..=100.0, "N").doc("largest force")),
                    )
                    .needs("velocity", "unfiltered")
                    .law(Direction::Any, |settings, _| read(settings).law()),
            )
            .timing("no latency; sleeps while the stylus is in no volume")
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let slots = one_each(setup, |settings| Ok(read(settings)))?;
        Ok(Prepared::new(Force { slots, force: |drag: &Drag, inputs| drag.force_n(vector(inputs, 1)) }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drag_is_against_the_velocity_in_proportion_to_it_and_bounded() {
        let honey = Drag::new(5.0, 2.0);
        // 5 N s/m at 100 mm/s is half a newton.
        assert!((honey.force_n([100.0, 0.0, 0.0])[0] + 0.5).abs() < 1e-15);
        let force = honey.force_n([-60.0, 0.0, 80.0]);
        assert!((force[0] - 0.3).abs() < 1e-15 && force[1] == 0.0 && (force[2] + 0.4).abs() < 1e-15);
        let most = honey.force_n([-6e4, 0.0, 8e4]);
        assert!((most[0] - 1.2).abs() < 1e-12 && (most[2] + 1.6).abs() < 1e-12, "{most:?}");
        assert_eq!(honey.law().damping_ns_per_m, 5.0);
    }

    #[test]
    fn not_finite_gives_no_drag() {
        let honey = Drag::new(1000.0, 1000.0);
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(honey.force_n([5.0, bad, 1.0]), [0.0; 3]);
        }
        let force = honey.force_n([f64::MAX; 3]);
        assert!((length(force) - 1000.0).abs() < 1e-9, "{force:?}");
        assert_eq!(Drag::new(3.0, 0.0).force_n([1e3; 3]).map(f64::abs), [0.0; 3]);
    }
}
