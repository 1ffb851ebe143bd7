//! Transfer function of the actuator and its derivatives.

use asperity_numbers::{Elementary as _, polar};
use std::f64::consts::{PI, TAU};

use realfft::num_complex::Complex64;

use super::super::Drive;

/// Number of figures of the actuator: k_f, m_a, k, c.
pub(super) const SHARED: usize = 4;
/// Number of figures of each recording: m_h and the latency.
pub(super) const OWN: usize = 2;
/// Number of figures that one recording depends on.
pub(super) const EACH: usize = SHARED + OWN;

/// Places in the fit's vector of the figures that recording `n` depends on.
pub(super) fn places(n: usize) -> [usize; EACH] {
    std::array::from_fn(|i| if i < SHARED { i } else { OWN * n + i })
}

/// Coil and amplifier: from a sample to a current.
#[derive(Clone, Copy, Debug)]
pub(super) struct Coil {
    pub(super) drive: Drive,
    pub(super) resistance: f64,
    pub(super) inductance: f64,
    /// Time that a sample is held \[s\]; 0 behind a converter that smooths.
    pub(super) hold: f64,
}

impl Coil {
    /// Impedance R + L s of a coil under a voltage; 1 for a current.
    pub(super) fn impedance(&self, s: Complex64) -> Complex64 {
        match self.drive {
            Drive::Current => Complex64::from(1.0),
            Drive::Voltage => s * self.inductance + self.resistance,
        }
    }
}

/// Figures behind one recording's response, in SI units.
#[derive(Clone, Copy, Debug)]
pub(super) struct Model {
    pub(super) coil: Coil,
    pub(super) force_factor: f64,
    pub(super) moving_mass: f64,
    pub(super) stiffness: f64,
    pub(super) damping: f64,
    pub(super) handle_mass: f64,
    pub(super) latency: f64,
    /// -1 if coil or accelerometer point the other way.
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

    /// E, P and the denominator D = s^2 E + P / mu. For a current E = 1 and P = c s + k. For a voltage
    /// E = R + L s and P = (c s + k) E + k_f^2 s.
    fn parts(&self, s: Complex64) -> (Complex64, Complex64, Complex64) {
        let e = self.coil.impedance(s);
        let p = (s * self.damping + self.stiffness) * e + s * self.emf();
        (e, p, s * s * e + p * self.inverse_reduced_mass())
    }

    /// k_f^2 if the back-EMF acts, else 0.
    fn emf(&self) -> f64 {
        match self.coil.drive {
            Drive::Current => 0.0,
            Drive::Voltage => self.force_factor * self.force_factor,
        }
    }

    /// Effect of the hold on mover and coil, and the push on the handle, which is read at once.
    fn held(&self, hz: f64) -> (Complex64, f64) {
        let half = PI * hz * self.coil.hold;
        let push = match self.coil.drive {
            Drive::Current => -self.sign * self.force_factor / self.handle_mass,
            Drive::Voltage => 0.0,
        };
        let droop = if half > 0.0 { half.sine() / half } else { 1.0 };
        (polar(droop, -half), push)
    }

    /// Acceleration of the handle per ampere or volt, without latency.
    pub(super) fn response(&self, hz: f64) -> Complex64 {
        Self { latency: 0.0, ..*self }.gradient(hz).0
    }

    /// The response with latency, and its derivatives by ln k_f, ln m_a, ln k, ln c, ln m_h and the
    /// latency.
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
