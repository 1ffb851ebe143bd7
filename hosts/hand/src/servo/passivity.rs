//! Whether a wall is stable for every hand.
//!
//! A spring and damper behind a sampler and a hold are passive if b > K T / 2 + |B|: b is the physical
//! damping of the device, K and B the wall's stiffness and damping, T the servo's period (J. E. Colgate and
//! G. Schenkel, "Passivity of a class of sampled-data systems: application to haptic interfaces", American
//! Control Conference 1994; Journal of Robotic Systems 14, 1997, pp. 37-47). There the wall's velocity is a
//! plain first difference. A low-pass F behind it, as in [`servo`](crate::servo), changes the damper's
//! share from -B cos wT to -B Re(F e^-jwT). That is at most
//! |B| while |F| is at
//! most 1, so the bound stays sufficient.
//!
//! A delay d of the loop besides the hold costs K d more, to first order: use 1 / (T + 2 d) as the rate.
//!
//! The bound is about any passive hand. A given hand may be stable beyond it, since a grip adds damping.

/// Damping of the device along the normal, and its source.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DeviceDamping {
    /// Measured or given \[N s/m\].
    Known(f64),
    /// Inferred from the largest stiffness \[N/mm\] that its maker recommends at a servo rate of 1 kHz: a
    /// passive device that renders it has at least K T / 2.
    Recommended(f64),
    /// Unknown: [`ASSUMED_NS_PER_M`] is used.
    Unknown,
}

/// Assumed damping of an unknown device \[N s/m\]. We found no reliable figure for a Touch or an Inverse3.
/// This is a guess on
/// the safe side for a device built without friction, and every sentence made of it says so.
pub const ASSUMED_NS_PER_M: f64 = 0.1;

impl DeviceDamping {
    /// Damping \[N s/m\].
    pub fn ns_per_m(self) -> f64 {
        match self {
            Self::Known(b) => b,
            Self::Recommended(stiffness) => stiffness * 1e3 / 1000.0 / 2.0,
            Self::Unknown => ASSUMED_NS_PER_M,
        }
    }
}

/// Result of the bound for a wall on a device.
#[derive(Clone, Debug, PartialEq)]
pub struct Passivity {
    /// Damping that the device needs \[N s/m\]: K T / 2 + |B|.
    pub needed_ns_per_m: f64,
    /// Its damping less the needed damping \[N s/m\].
    pub margin_ns_per_m: f64,
    /// Whether the bound is met: the margin is above 0, or 0 at the very stiffness that the maker
    /// recommends.
    pub passive: bool,
    /// Largest passive stiffness with this wall damping \[N/mm\]; 0 if the damping alone is too much.
    pub stiffest_n_per_mm: f64,
    /// The result as a sentence with figures.
    pub sentence: String,
}

impl Passivity {
    /// Whether the bound is met.
    pub fn holds(&self) -> bool {
        self.passive
    }
}

/// Checks a wall's stiffness \[N/mm\] and damping \[N s/m\] against Colgate's bound, at a servo rate in Hz
/// above 0.
pub fn passivity(
    stiffness_n_per_mm: f64,
    damping_ns_per_m: f64,
    servo_hz: f64,
    device: DeviceDamping,
) -> Passivity {
    let period = 1.0 / servo_hz;
    let has = device.ns_per_m();
    let needed = stiffness_n_per_mm * 1e3 * period / 2.0 + damping_ns_per_m.abs();
    let stiffest = (2.0 * (has - damping_ns_per_m.abs()) / period * 1e-3).max(0.0);
    let known = match device {
        DeviceDamping::Known(_) => "of its own".to_owned(),
        DeviceDamping::Recommended(k) => {
            format!("of its own, inferred from the {k:.3} N/mm that its maker recommends at most")
        }
        DeviceDamping::Unknown => "assumed, since it is not known".to_owned(),
    };
    let margin = has - needed;
    // The recommended stiffness itself counts as passive, despite rounding.
    let at_most = matches!(device, DeviceDamping::Recommended(_)) && margin > -1e-9;
    let passive = margin > 0.0 || at_most;
    let verdict = if passive { "passive, whoever holds it" } else { "may buzz or be unstable in some hands" };
    let sentence = format!(
        "a wall of {stiffness_n_per_mm:.3} N/mm and {damping_ns_per_m:.3} N s/m at {servo_hz:.0} Hz \
         needs a device with more than {needed:.3} N s/m (K T / 2 + |B|); \
         this one has {has:.3} N s/m, {known}: {verdict}; the limit is {stiffest:.3} N/mm",
    );
    Passivity {
        needed_ns_per_m: needed,
        margin_ns_per_m: margin,
        passive,
        stiffest_n_per_mm: stiffest,
        sentence,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wall_of_1_n_mm_at_1_khz_needs_half_an_ns_per_m() {
        // 1000 N/m at 1 kHz: 1000 * 0.001 / 2.
        let p = passivity(1.0, 0.0, 1000.0, DeviceDamping::Known(0.6));
        assert!((p.needed_ns_per_m - 0.5).abs() < 1e-12 && (p.margin_ns_per_m - 0.1).abs() < 1e-12);
        assert!(p.holds() && (p.stiffest_n_per_mm - 1.2).abs() < 1e-12);
        // Virtual damping costs as much as it gives, whichever its sign.
        assert!(!passivity(1.0, 0.2, 1000.0, DeviceDamping::Known(0.6)).holds());
        assert!(!passivity(1.0, -0.2, 1000.0, DeviceDamping::Known(0.6)).holds());
        // A slower servo needs more.
        assert!(!passivity(1.0, 0.0, 500.0, DeviceDamping::Known(0.6)).holds());
    }

    #[test]
    fn recommended_stiffness_is_passive() {
        for most in [0.3, 0.5, 0.8, 2.31] {
            let device = DeviceDamping::Recommended(most);
            assert!(passivity(most, 0.0, 1000.0, device).holds(), "{most}");
            assert!(!passivity(1.01 * most, 0.0, 1000.0, device).holds(), "{most}");
            assert!(!passivity(most, 0.01, 1000.0, device).holds(), "{most}");
        }
    }

    #[test]
    fn named_limit_has_margin_0() {
        for device in [DeviceDamping::Known(2.0), DeviceDamping::Recommended(0.8), DeviceDamping::Unknown] {
            let limit = passivity(1.0, 0.05, 1000.0, device).stiffest_n_per_mm;
            assert!(passivity(limit, 0.05, 1000.0, device).margin_ns_per_m.abs() < 1e-12);
        }
    }

    #[test]
    fn sentence_has_the_figures_and_assumptions() {
        let p = passivity(1.0, 0.0, 1000.0, DeviceDamping::Unknown);
        for part in
            ["1.000 N/mm", "1000 Hz", "0.500 N s/m", "0.100 N s/m", "not known", "0.200 N/mm", "may buzz"]
        {
            assert!(p.sentence.contains(part), "{part} is not in: {}", p.sentence);
        }
        assert!(passivity(0.5, 0.0, 1000.0, DeviceDamping::Known(1.0)).sentence.contains("passive, whoever"));
    }
}
