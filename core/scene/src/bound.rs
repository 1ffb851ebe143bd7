//! Passivity bounds: the laws of force that a device can render at a tick rate without generating energy.
//!
//! A law of force F = K x + B v along one direction is sampled every T and held. Its velocity comes from
//! backward difference. The law is passive in any passive hand if the device's own damping b meets
//!
//! ```text
//! b > K (T/2 + t_d) + |B|
//! ```
//!
//! Source, for t_d = 0: J. E. Colgate and G. Schenkel, "Passivity of a class of sampled-data systems:
//! application to haptic interfaces", Journal of Robotic Systems 14, 1997, pp. 37-47. The delay `t_d` is
//! the time from reading the place to setting the force. It adds `K t_d` to the bound. The condition of
//! the paper is
//!
//! ```text
//! b > T/2 Re((1 - e^-jwT) H(e^jwT)) / (1 - cos wT)
//! ```
//!
//! With H = (K + B (1 - e^-jwT) / T) e^-jw t_d its right side is
//!
//! ```text
//! K T/2 sin((1/2 + t_d/T) wT) / sin(wT/2) - B cos(wT + w t_d)
//! ```
//!
//! The first part is at most K (T/2 + t_d), at w = 0. The second part is at most |B|. Without a delay,
//! both parts reach their maximum at half the tick rate (for B > 0), and the bound is exact. With a
//! delay, they need not reach it at the same frequency, and the bound is sufficient. If the delay is not
//! a whole number of ticks, the bound is the first order of the delay's effect.
//!
//! Friction along the surface is such a law too. Friction that grows with speed by dF/dv (viscosity or a
//! viscous start) counts as B. Friction that sticks by a bristle counts as K, the bristle's stiffness.
//! Laws along one direction add.
//!
//! A device that reports places in steps D generates energy, because the force does not change within a
//! step. The device's dry friction c takes that energy away if
//!
//! ```text
//! c > K D / 2 + |B| D / T
//! ```
//!
//! Source, for B = 0: N. Diolaiti, G. Niemeyer, F. Barbagli and J. K. Salisbury, "Stability of haptic
//! rendering: discretization, quantization, time delay, and Coulomb effects", IEEE Transactions on
//! Robotics 22, 2006, pp. 256-268. A reported place has an error e of at most D/2. The force then has an
//! error of K e, plus B / T times the change of e in a tick, which is at most D. Over a path, this error
//! gives at most its size times the length of the path. A motion to and fro across the border of a step
//! at half the tick rate reaches that maximum, however short it is.
//!
//! Both bounds hold for any hand. A given hand may be stable beyond them, since grips add damping of
//! their own.

use std::fmt;

use asperity_node::Law;

/// Timing: when places are read and forces are set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampling {
    /// Ticks per second, above 0.
    pub tick_hz: f64,
    /// Time from reading a place to setting the force that follows from it, t_d \[s\], at least 0.
    pub delay_s: f64,
}

impl Sampling {
    /// Mean lateness of a force, `T/2 + t_d` \[s\].
    fn late_s(self) -> f64 {
        0.5 / self.tick_hz + self.delay_s
    }
}

/// Passivity bound for one law on one device. Its text has the figures with their units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Passivity {
    /// The law.
    pub law: Law,
    /// Timing with which the law is evaluated.
    pub sampling: Sampling,
    /// Damping of the device itself, b \[N s/m\].
    pub device_ns_per_m: f64,
    /// Damping that the device must exceed \[N s/m\]: K (T/2 + t_d) + |B|.
    pub needed_ns_per_m: f64,
    /// Damping of the device minus needed damping \[N s/m\].
    pub margin_ns_per_m: f64,
    /// Stiffness below which the law would be passive with this damping \[N/mm\]; 0 if the damping alone
    /// is too much.
    pub stiffest_n_per_mm: f64,
}

impl Passivity {
    /// Compares a law with the bound. Numbers that are not finite are never passive.
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

    /// Whether the law is passive in any hand.
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
            " take more than {:.3} N s/m; the device has {:.3}: {} by {:.3}",
            self.needed_ns_per_m,
            self.device_ns_per_m,
            if self.holds() { "passive" } else { "not passive" },
            self.margin_ns_per_m.abs(),
        )
    }
}

/// The largest number of two digits that is below `limit`, a positive number.
pub fn below(limit: f64) -> f64 {
    two_digits(limit * (1.0 - 1e-9), f64::floor)
}

/// The least number of two digits that is above `limit`, a positive number.
pub fn above(limit: f64) -> f64 {
    two_digits(limit * (1.0 + 1e-9), f64::ceil)
}

fn two_digits(x: f64, rounded: fn(f64) -> f64) -> f64 {
    if !(x > 0.0 && x.is_finite()) {
        return 0.0;
    }
    let digits = 1 - x.log10().floor() as i32;
    // The text of a number in decimal is read back as it is.
    format!("{:.*}", digits.max(0) as usize, rounded(x * 10f64.powi(digits)) / 10f64.powi(digits))
        .parse()
        .unwrap_or(0.0)
}

/// Stiffness \[N/mm\] below which a law with damping `damping_ns_per_m` is passive on a device with
/// damping `device_ns_per_m`. Both dampings are in N s/m. The answer is 0 if no stiffness is passive.
pub fn stiffest_n_per_mm(damping_ns_per_m: f64, sampling: Sampling, device_ns_per_m: f64) -> f64 {
    let stiffest = 1e-3 * (device_ns_per_m - damping_ns_per_m.abs()) / sampling.late_s();
    if stiffest.is_finite() { stiffest.max(0.0) } else { 0.0 }
}

/// Dry-friction bound for a law on a device that reports places in steps. Its text has the figures with
/// their units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quantisation {
    /// The law.
    pub law: Law,
    /// Step of the reported places, D \[mm\].
    pub step_mm: f64,
    /// Dry friction of the device itself \[N\].
    pub device_n: f64,
    /// Dry friction that the device must exceed \[N\]: K D / 2 + |B| D / T.
    pub needed_n: f64,
    /// Dry friction of the device minus needed dry friction \[N\].
    pub margin_n: f64,
    /// Stiffness below which the bound is met \[N/mm\]; 0 if the damping alone is too much.
    pub stiffest_n_per_mm: f64,
}

impl Quantisation {
    /// Compares a law with the bound.
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

    /// Whether the device's dry friction takes away the energy of the steps.
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
