//! Independent references for the tests of this crate.

use std::f64::consts::TAU;

use asperity_dsp::filter::Complex64;

use super::{ActuatorProfile, Drive, Dynamics, Motion};

/// The shipped actuator on a handle of `grams`.
pub(crate) fn hapcoil(grams: f64) -> Dynamics {
    let profile = ActuatorProfile::shipped("hapcoil_one").unwrap().unwrap();
    Dynamics::new(&profile, grams).unwrap()
}

/// Fourth-order Runge-Kutta on the equations of both masses, not of their difference.
pub(crate) struct RungeKutta {
    d: Dynamics,
    drive: Drive,
    dt: f64,
    substeps: u32,
    // Place and speed of mover and handle, current.
    s: [f64; 5],
}

impl RungeKutta {
    pub(crate) fn new(d: Dynamics, drive: Drive, rate_hz: f64, substeps: u32) -> Self {
        Self { d, drive, dt: 1.0 / rate_hz / f64::from(substeps), substeps, s: [0.0; 5] }
    }

    /// Speed of the mover relative to the handle, now.
    pub(crate) fn relative_speed(&self) -> f64 {
        self.s[1] - self.s[3]
    }

    fn slope(&self, s: [f64; 5], u: f64) -> [f64; 5] {
        let d = &self.d;
        let [xm, vm, xh, vh, i] = s;
        let i = if self.drive == Drive::Current { u } else { i };
        let force = d.force_factor * i - d.stiffness * (xm - xh) - d.damping * (vm - vh);
        let di = match self.drive {
            Drive::Current => 0.0,
            Drive::Voltage => (u - d.resistance * i - d.force_factor * (vm - vh)) / d.inductance,
        };
        [vm, force / d.moving_mass, vh, -force / d.handle_mass, di]
    }

    pub(crate) fn step(&mut self, u: f64) -> Motion {
        let now = self.slope(self.s, u);
        let motion = Motion {
            displacement: self.s[0] - self.s[2],
            velocity: self.s[1] - self.s[3],
            current: if self.drive == Drive::Current { u } else { self.s[4] },
            acceleration: now[3],
        };
        let h = self.dt;
        let add = |s: [f64; 5], k: [f64; 5], h: f64| std::array::from_fn(|n| s[n] + h * k[n]);
        for _ in 0..self.substeps {
            let k1 = self.slope(self.s, u);
            let k2 = self.slope(add(self.s, k1, h / 2.0), u);
            let k3 = self.slope(add(self.s, k2, h / 2.0), u);
            let k4 = self.slope(add(self.s, k3, h), u);
            for n in 0..5 {
                self.s[n] += h / 6.0 * (k1[n] + 2.0 * k2[n] + 2.0 * k3[n] + k4[n]);
            }
        }
        motion
    }
}

/// Amplitude and phase of the part of `y` at `hz` against a sine, over whole periods.
pub(crate) fn lock_in(y: &[f64], hz: f64, rate_hz: f64) -> Complex64 {
    let sum: Complex64 =
        y.iter().enumerate().map(|(n, y)| Complex64::from_polar(*y, -TAU * hz * n as f64 / rate_hz)).sum();
    sum * Complex64::new(0.0, 2.0 / y.len() as f64)
}
