//! `magnet`: a surface that snaps.

use crate::prelude::*;

use super::{Force, Renders, one_each, slot, vector};

/// Snaps a stylus to a surface: a force toward it within a reach. The force depends on the distance alone, so
/// no closed path gains or loses energy.
///
/// With the spring `k`, the peak `P` and `a = P / k`, at the distance `d` from the surface, toward it:
///
/// ```text
/// f = k d                         d <= a/2        a spring
/// f = P (1 - (3/2 - d/a)^2 / 2)   a/2 .. 3a/2     up to the peak
/// f = P (1 - 3 s^2 + 2 s^3)       3a/2 .. reach   s = (d - 3a/2) / (reach - 3a/2): down to 0
/// ```
///
/// Force and slope are continuous everywhere, and no slope is steeper than `k`; this slope decides passivity.
/// Behind the surface the force is mirrored, and adds to the wall's own stiffness. The peak is `max_force_n`,
/// or `k reach / 3` where that is less: the force of a spring that has no room for more.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pull {
    stiffness_n_per_mm: f64,
    peak_n: f64,
    reach_mm: f64,
    /// Distance at which the spring alone would have the peak, `a`.
    knee_mm: f64,
}

impl Pull {
    /// A magnet of a stiffness of 0 or more, a greatest force of 0 or more and a reach above 0.
    pub(crate) fn new(stiffness_n_per_mm: f64, max_force_n: f64, reach_mm: f64) -> Self {
        let peak_n = max_force_n.min(stiffness_n_per_mm * reach_mm / 3.0);
        // For a magnet without force, the distance does not matter.
        let knee_mm = if peak_n > 0.0 { peak_n / stiffness_n_per_mm } else { reach_mm / 3.0 };
        Self { stiffness_n_per_mm, peak_n, reach_mm, knee_mm }
    }

    /// The force along the outward normal \[N\] at a distance above the surface (below 0 inside it). From
    /// both sides it points toward the surface. A distance that is not a number is out of reach.
    pub(crate) fn force_n(&self, distance_mm: f64) -> f64 {
        let (d, a) = (distance_mm.abs(), self.knee_mm);
        // Also for a distance that is not a number.
        if !matches!(d.partial_cmp(&self.reach_mm), Some(std::cmp::Ordering::Less)) || self.peak_n == 0.0 {
            return 0.0;
        }
        let pull = if d <= 0.5 * a {
            self.stiffness_n_per_mm * d
        } else if d <= 1.5 * a {
            let u = 1.5 - d / a;
            self.peak_n * (1.0 - 0.5 * u * u)
        } else {
            let s = (d - 1.5 * a) / (self.reach_mm - 1.5 * a);
            self.peak_n * (1.0 - s * s * (3.0 - 2.0 * s))
        };
        -pull.copysign(distance_mm)
    }

    /// The law on the surface, along the normal.
    pub(crate) fn law(&self) -> Law {
        let stiffness = if self.peak_n > 0.0 { self.stiffness_n_per_mm } else { 0.0 };
        Law { stiffness_n_per_mm: stiffness, damping_ns_per_m: 0.0 }
    }
}

fn read(settings: &Settings) -> Pull {
    let [stiffness, most, reach] =
        ["stiffness_n_per_mm", "max_force_n", "reach_mm"].map(|name| settings.number(name));
    Pull::new(stiffness, most, reach)
}

/// A force toward a surface from both of its sides, of the distance alone.
pub struct Magnet;

impl Node for Magnet {
    fn descriptor() -> Descriptor {
        Descriptor::new("magnet", "Pulls the stylus towards a surface from both sides, within a reach.")
            .input(slot("index into `magnets`, from 0; below 0: no force").wakes())
            .input(control("distance", 1, MM).doc("distance from the surface; above 0 outside"))
            .input(control("normal", 3, ONE).or(0.0))
            .doc("outward unit normal of the surface; if unconnected, z")
            .output(super::force("pull on the stylus, x, y, z"))
            .renders(
                Effect::new("magnets", Acts::Near)
                    .form(
                        Form::new("", "(stiffness_n_per_mm: 0.2, max_force_n: 0.5, reach_mm: 4)")
                            .field(number("stiffness_n_per_mm", 0.0, 0.0..=100.0, "N/mm").required())
                            .doc("stiffness at the surface")
                            .field(number("max_force_n", 0.0, 0.0..=1000.0, "N").required())
                            .doc("largest force")
                            .field(number("reach_mm", 1.0, 1e-3..=1000.0, "mm").required())
                            .doc("distance up to which it pulls"),
                    )
                    .needs("distance", "distance")
                    .needs("normal", "normal")
                    .law(Direction::Normal, |settings, _| read(settings).law()),
            )
            .timing("no latency; sleeps while out of reach")
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let slots = one_each(setup, |settings| Ok(read(settings)))?;
        // Along the outward normal: below 0 outside.
        let force = |pull: &Pull, inputs: &Inputs<'_>| {
            let normal = if inputs.connected(2) { vector(inputs, 2) } else { [0.0, 0.0, 1.0] };
            let force = pull.force_n(inputs.value(1));
            normal.map(|n| force * n)
        };
        Ok(Prepared::new(Force { slots, force }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn magnet_is_spring_then_peak_and_ends_at_reach() {
        let m = Pull::new(0.5, 1.0, 10.0);
        assert_eq!((m.peak_n, m.force_n(0.0), m.force_n(10.0)), (1.0, 0.0, 0.0));
        assert!((m.force_n(0.7) + 0.35).abs() < 1e-15 && (m.force_n(-0.7) - 0.35).abs() < 1e-15);
        // The peak at one and a half of P / k = 2 mm.
        assert!((m.force_n(3.0) + 1.0).abs() < 1e-15);
        assert!((0..10_000).all(|i| m.force_n(f64::from(i) * 1e-3).abs() <= 1.0));
        // Halfway down the fall.
        assert!((m.force_n(6.5) + 0.5).abs() < 1e-12);
        // No room for 50 N within 2 mm.
        let short = Pull::new(0.5, 50.0, 2.0);
        assert!((short.peak_n - 1.0 / 3.0).abs() < 1e-15 && (short.force_n(1.0) + 1.0 / 3.0).abs() < 1e-12);
    }

    proptest! {
        #[test]
        fn force_and_slope_are_continuous_slope_at_most_spring(
            stiffness in 0.01..10.0f64, most in 0.01..20.0f64, reach in 0.05..30.0f64,
        ) {
            let m = Pull::new(stiffness, most, reach);
            let (n, span) = (40_000, 1.1 * reach);
            let step = 2.0 * span / f64::from(n);
            let force: Vec<f64> = (0..=n).map(|i| m.force_n(f64::from(i) * step - span)).collect();
            let slope: Vec<f64> = force.windows(2).map(|w| (w[1] - w[0]) / step).collect();
            prop_assert!(slope.iter().all(|s| s.abs() <= stiffness * (1.0 + 1e-6)));
            // The steepest curve is that of the arch, k / a, or of the fall,
            // 6 P / way^2 <= 6 k a / (3 a / 2)^2.
            let curve = 2.7 * stiffness * stiffness / m.peak_n;
            for w in slope.windows(2) {
                prop_assert!((w[1] - w[0]).abs() <= curve * step * 1.01 + 1e-6 * stiffness);
            }
        }
    }

    #[test]
    fn whatever_comes_it_is_finite() {
        let m = Pull::new(0.5, 1.0, 10.0);
        for d in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -10.0] {
            assert_eq!(m.force_n(d), 0.0);
        }
        let none = Pull::new(0.0, 1.0, 1.0);
        assert_eq!((none.force_n(0.1), none.law().stiffness_n_per_mm), (0.0, 0.0));
        assert_eq!(Pull::new(1.0, 0.0, 1.0).force_n(0.3), 0.0);
    }
}
