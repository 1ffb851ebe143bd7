//! What a device at a tick rate bears without becoming a source of energy.
//!
//! A law of force F = K x + B v along one direction, sampled every T and held, the velocity by backward difference, is passive in any passive hand
//! where the device's own damping is
//!
//! ```text
//! b > K (T/2 + t_d) + |B|
//! ```
//!
//! (J. E. Colgate and G. Schenkel, "Passivity of a class of sampled-data systems: application to haptic interfaces", Journal of Robotic Systems
//! 14, 1997, pp. 37-47, for t_d = 0). The delay `t_d` is what passes from reading the place to setting the force. It counts as `K t_d`: their
//! condition, b > T/2 Re((1 - e^-jwT) H(e^jwT)) / (1 - cos wT), with H = (K + B (1 - e^-jwT) / T) e^-jw t_d has the right side
//!
//! ```text
//! K T/2 sin((1/2 + t_d/T) wT) / sin(wT/2) - B cos(wT + w t_d)
//! ```
//!
//! of which the first part is at most K (T/2 + t_d), at w = 0, and the second at most |B|. Without a delay both are reached at half the rate
//! (for B > 0): the bound is exact. With one the two need not be reached together, and the bound is sufficient. Where the delay is no whole number
//! of ticks it is the first order of what a delay costs.
//!
//! Along the surface, friction is such a law: one that grows with speed by dF/dv, of viscosity or of a viscous start, counts as B, one that sticks by a
//! bristle as the bristle's K. Laws along one direction add.
//!
//! A device that tells places in steps D has its energy made of what it does not see: within a step the force does not change. Its dry friction c
//! takes that away where
//!
//! ```text
//! c > K D / 2 + |B| D / T
//! ```
//!
//! (for B = 0: N. Diolaiti, G. Niemeyer, F. Barbagli and J. K. Salisbury, "Stability of haptic rendering: discretization, quantization, time delay, and
//! Coulomb effects", IEEE Transactions on Robotics 22, 2006, pp. 256-268). A place that is told e off, at most D/2, is a force off by K e, and by B / T times what e has
//! changed in a tick, at most D; over a way it gives so much times its length at most, and does on a motion to and fro over the border of a step at half the
//! rate, however short.
//!
//! Both are about any hand. A given one may be stable beyond, since grips add damping of their own.

use std::fmt;

use asperity_node::Law;

/// When places are read and forces are set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampling {
    /// Ticks a second, above 0.
    pub tick_hz: f64,
    /// From reading a place to setting the force that follows from it, t_d \[s\], at least 0.
    pub delay_s: f64,
}

impl Sampling {
    /// `T/2 + t_d` \[s\]: how late a force is on the mean.
    fn late_s(self) -> f64 {
        0.5 / self.tick_hz + self.delay_s
    }
}

/// The bound for one law on one device; its text has the figures with their units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Passivity {
    /// The law.
    pub law: Law,
    /// When it is evaluated.
    pub sampling: Sampling,
    /// Damping of the device itself, b \[N s/m\].
    pub device_ns_per_m: f64,
    /// Damping that it would need more of \[N s/m\]: K (T/2 + t_d) + |B|.
    pub needed_ns_per_m: f64,
    /// What it has less what it needs \[N s/m\].
    pub margin_ns_per_m: f64,
    /// The stiffness below which the law would be passive with this damping \[N/mm\]; 0 where the damping alone is too much.
    pub stiffest_n_per_mm: f64,
}

impl Passivity {
    /// Holds a law against the bound. Numbers that are not finite are passive nowhere.
    pub fn of(law: Law, sampling: Sampling, device_ns_per_m: f64) -> Self {
        let late_s = sampling.late_s();
        let needed = 1e3 * law.stiffness_n_per_mm * late_s + law.damping_ns_per_m.abs();
        Self {
            law,
            sampling,
            device_ns_per_m,
            needed_ns_per_m: needed,
            margin_ns_per_m: device_ns_per_m - needed,
            stiffest_n_per_mm: stiffest_n_per_mm(law.damping_ns_per_m, sampling, device_ns_per_m),
        }
    }

    /// Whether the law is passive, whoever holds the device.
    pub fn holds(&self) -> bool {
        self.margin_ns_per_m > 0.0
    }
}

impl fmt::Display for Passivity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Law { stiffness_n_per_mm, damping_ns_per_m } = self.law;
        let Sampling { tick_hz, delay_s } = self.sampling;
        write!(f, "{stiffness_n_per_mm:.3} N/mm and {damping_ns_per_m:.3} N s/m at {tick_hz:.0} Hz")?;
        if delay_s > 0.0 {
            write!(f, ", {:.2} ms late,", 1e3 * delay_s)?;
        }
        write!(
            f,
            " take more than {:.3} N s/m; the device has {:.3}: {} by {:.3}; the limit is {:.3} N/mm",
            self.needed_ns_per_m,
            self.device_ns_per_m,
            if self.holds() { "passive" } else { "not passive" },
            self.margin_ns_per_m.abs(),
            self.stiffest_n_per_mm,
        )
    }
}

/// The stiffness \[N/mm\] below which a law with damping `damping_ns_per_m` is passive on a device with damping `device_ns_per_m`, both in N s/m;
/// 0 where there is none.
pub fn stiffest_n_per_mm(damping_ns_per_m: f64, sampling: Sampling, device_ns_per_m: f64) -> f64 {
    let stiffest = 1e-3 * (device_ns_per_m - damping_ns_per_m.abs()) / sampling.late_s();
    if stiffest.is_finite() { stiffest.max(0.0) } else { 0.0 }
}

/// The bound for a law on a device that tells places in steps; its text has the figures with their units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quantisation {
    /// The law.
    pub law: Law,
    /// Step of the places D \[mm\].
    pub step_mm: f64,
    /// Dry friction of the device itself \[N\].
    pub device_n: f64,
    /// Dry friction that it would need more of \[N\]: K D / 2 + |B| D / T.
    pub needed_n: f64,
    /// What it has less what it needs \[N\].
    pub margin_n: f64,
    /// The stiffness below which the bound is met \[N/mm\]; 0 where the damping alone is too much.
    pub stiffest_n_per_mm: f64,
}

impl Quantisation {
    /// Holds a law against the bound.
    pub fn of(law: Law, sampling: Sampling, step_mm: f64, device_n: f64) -> Self {
        let of_damping = 1e-3 * law.damping_ns_per_m.abs() * step_mm * sampling.tick_hz;
        let needed_n = 0.5 * law.stiffness_n_per_mm * step_mm + of_damping;
        Self {
            law,
            step_mm,
            device_n,
            needed_n,
            margin_n: device_n - needed_n,
            stiffest_n_per_mm: (2.0 * (device_n - of_damping) / step_mm).max(0.0),
        }
    }

    /// Whether the steps give no energy.
    pub fn holds(&self) -> bool {
        self.margin_n > 0.0
    }
}

impl fmt::Display for Quantisation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.3} N/mm", self.law.stiffness_n_per_mm)?;
        if self.law.damping_ns_per_m != 0.0 {
            write!(f, " and {:.3} N s/m", self.law.damping_ns_per_m)?;
        }
        write!(
            f,
            " in steps of {:.3} mm take more than {:.1} mN of dry friction; the device has {:.1}: {}",
            self.step_mm,
            1e3 * self.needed_n,
            1e3 * self.device_n,
            if self.holds() { "passive" } else { "not passive" },
        )
    }
}

#[cfg(test)]
#[path = "bound_tests.rs"]
mod tests;
