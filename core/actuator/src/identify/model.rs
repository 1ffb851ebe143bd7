//! The actuator's transfer function and how it depends on each figure.

use asperity_numbers::{Elementary as _, polar};
use std::f64::consts::{PI, TAU};

use realfft::num_complex::Complex64;

use super::super::Drive;

/// Figures of the actuator, in the order of the fit: k_f, m_a, k, c.
pub(super) const SHARED: usize = 4;
/// Figures of each recording, behind those of the actuator: m_h and the latency.
pub(super) const OWN: usize = 2;
/// All that one recording depends on.
pub(super) const EACH: usize = SHARED + OWN;

/// Coil and amplifier: what turns a sample into a current.
#[derive(Clone, Copy, Debug)]
pub(super) struct Coil {
    pub(super) drive: Drive,
    pub(super) resistance: f64,
    pub(super) inductance: f64,
    /// How long a sample acts \[s\]; 0 where a converter makes a smooth signal of it.
    pub(super) hold: f64,
}

/// What one recording's response follows from, SI units.
#[derive(Clone, Copy, Debug)]
pub(super) struct Model {
    pub(super) coil: Coil,
    pub(super) force_factor: f64,
    pub(super) moving_mass: f64,
    pub(super) stiffness: f64,
    pub(super) damping: f64,
    pub(super) handle_mass: f64,
    pub(super) latency: f64,
    /// -1 where coil or accelerometer point the other way.
    pub(super) sign: f64,
}

impl Model {
    /// 1 / mu.
    pub(super) fn inverse_reduced_mass(&self) -> f64 {
        1.0 / self.moving_mass + 1.0 / self.handle_mass
    }

    pub(super) fn natural_rad_s(&self) -> f64 {
        (self.stiffness * self.inverse_reduced_mass()).sqrt()
    }

    pub(super) fn damping_ratio(&self) -> f64 {
        0.5 * self.damping * (self.inverse_reduced_mass() / self.stiffness).sqrt()
    }

    /// E, P and the denominator D = s^2 E + P / mu, with E = 1 and P = c s + k for a current, E = R + L s and
    /// P = (c s + k) E + k_f^2 s for a voltage.
    fn parts(&self, s: Complex64) -> (Complex64, Complex64, Complex64) {
        let e = match self.coil.drive {
            Drive::Current => Complex64::from(1.0),
            Drive::Voltage => s * self.coil.inductance + self.coil.resistance,
        };
        let p = (s * self.damping + self.stiffness) * e + s * self.emf();
        (e, p, s * s * e + p * self.inverse_reduced_mass())
    }

    /// k_f^2 where the back-EMF acts, else 0.
    fn emf(&self) -> f64 {
        match self.coil.drive {
            Drive::Current => 0.0,
            Drive::Voltage => self.force_factor * self.force_factor,
        }
    }

    /// What holding does to the answer of mover and coil, and the push on the handle, which is read at once.
    fn held(&self, hz: f64) -> (Complex64, f64) {
        let half = PI * hz * self.coil.hold;
        let push = match self.coil.drive {
            Drive::Current => -self.sign * self.force_factor / self.handle_mass,
            Drive::Voltage => 0.0,
        };
        let droop = if half > 0.0 { half.sine() / half } else { 1.0 };
        (polar(droop, -half), push)
    }

    /// Acceleration of the handle per ampere or volt, latency left out.
    pub(super) fn response(&self, hz: f64) -> Complex64 {
        Self { latency: 0.0, ..*self }.gradient(hz).0
    }

    /// The response with its latency, and its derivatives by ln k_f, ln m_a, ln k, ln c, ln m_h and the latency.
    pub(super) fn gradient(&self, hz: f64) -> (Complex64, [Complex64; EACH]) {
        let s = Complex64::new(0.0, TAU * hz);
        let (e, p, d) = self.parts(s);
        let late = polar(1.0, -TAU * hz * self.latency);
        let (hold, push) = self.held(hz);
        let moved = -s * s / d * (self.sign * self.force_factor / self.handle_mass) * hold * late;
        let pushed = (Complex64::from(1.0) - hold) * push * late;
        let u = self.inverse_reduced_mass();
        let one = Complex64::from(1.0);
        let by = [
            (one - s / d * (2.0 * u * self.emf())) * moved + pushed,
            p / d / self.moving_mass * moved,
            -e / d * (u * self.stiffness) * moved,
            -s * e / d * (u * self.damping) * moved,
            (p / d / self.handle_mass - 1.0) * moved - pushed,
            -s * (moved + pushed),
        ];
        (moved + pushed, by)
    }
}
