//! Simulation of coil, mover and handle under a current or a voltage.

use asperity_numbers::Elementary as _;
use asperity_state::State;

use super::{Drive, Dynamics};

/// Motion of the actuator at one instant, in SI units.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion {
    /// Place of the mover relative to the handle \[m\].
    pub displacement: f64,
    /// Speed of the mover relative to the handle \[m/s\].
    pub velocity: f64,
    /// Coil current \[A\].
    pub current: f64,
    /// Acceleration of the handle \[m/s^2\].
    pub acceleration: f64,
}

/// Linear simulation of an actuator on a free handle, exact for a drive that is held between samples.
///
/// The state (w_n x, x', I) advances by the matrix exponential of the whole electromechanical system
/// (zero-order hold). There are no end stops: the displacement may exceed the stroke.
#[derive(Clone, Debug)]
pub struct Plant {
    pub(crate) a: [[f64; 3]; 3],
    pub(crate) b: [f64; 3],
    pub(crate) state: [f64; 3],
    natural: f64,
    drive: Drive,
    // Acceleration of the handle from the state.
    read: [f64; 3],
}

impl Plant {
    /// The actuator at rest. `rate_hz` must be positive and finite, or nothing moves.
    pub fn new(dynamics: &Dynamics, drive: Drive, rate_hz: f64) -> Self {
        let w = dynamics.natural_rad_s();
        let (c, kf) = (dynamics.damping / dynamics.reduced_mass(), dynamics.force_factor);
        let push = kf / dynamics.reduced_mass();
        let dt = if rate_hz > 0.0 && rate_hz.is_finite() { 1.0 / rate_hz } else { 0.0 };
        // Rows: d(w x)/dt, dx'/dt, dI/dt, du/dt = 0.
        let mut m = [[0.0; 4]; 4];
        m[0][1] = w;
        m[1] = [-w, -c, push, 0.0];
        match drive {
            Drive::Current => {
                m[1][2] = 0.0;
                m[1][3] = push;
            }
            Drive::Voltage => {
                let l = dynamics.inductance;
                m[2] = [0.0, -kf / l, -dynamics.resistance / l, 1.0 / l];
            }
        }
        let e = exponential(m.map(|row| row.map(|x| x * dt)));
        let mut a = [e[0], e[1], e[2]].map(|r| [r[0], r[1], r[2]]);
        let mut b = [e[0][3], e[1][3], e[2][3]];
        if drive == Drive::Current {
            a[2] = [0.0; 3];
            b[2] = 1.0;
        }
        let mh = dynamics.handle_mass;
        let read = [dynamics.stiffness / w / mh, dynamics.damping / mh, -kf / mh];
        Self { a, b, state: [0.0; 3], natural: w, drive, read }
    }

    /// Applies `drive` \[A or V\] until the next sample and returns the motion now, with this drive. A
    /// sample that is not finite counts as 0.
    pub fn step(&mut self, drive: f64) -> Motion {
        let u = if drive.is_finite() { drive } else { 0.0 };
        if self.drive == Drive::Current {
            self.state[2] = u;
        }
        let [x, v, i] = self.state;
        let acceleration = self.read[0] * x + self.read[1] * v + self.read[2] * i;
        self.advance(u);
        Motion { displacement: x / self.natural, velocity: v, current: i, acceleration }
    }

    /// Advances to the next sample.
    #[inline(always)]
    pub(crate) fn advance(&mut self, u: f64) {
        let [x, v, i] = self.state;
        let row = |n: usize| (self.a[n][0] * x + self.a[n][1] * v) + (self.a[n][2] * i + self.b[n] * u);
        self.state = [row(0), row(1), row(2)];
    }

    /// State: displacement, speed and current. Another actuator, drive or rate can go on from it.
    /// Values that no coil reaches (10^9 m/s or A) are refused and put it at rest.
    pub fn state(&mut self, state: &mut State<'_>) {
        let mut natural = self.natural;
        state.keep(&mut self.state).keep(&mut natural);
        if state.restores() {
            // Exactly 1 for the same actuator.
            self.state[0] *= self.natural / natural;
            if !self.state.iter().all(|x| x.abs() < 1e9) {
                self.reset();
                state.refuse();
            }
        }
    }

    /// Puts everything at rest.
    pub fn reset(&mut self) {
        self.state = [0.0; 3];
    }
}

/// e^m by scaling and squaring of the Taylor series. Where the last rows are 0, it takes a linear system over
/// a time of constant inputs, exactly.
pub fn exponential<const N: usize>(m: [[f64; N]; N]) -> [[f64; N]; N] {
    let matrix =
        |at: &dyn Fn(usize, usize) -> f64| std::array::from_fn(|i| std::array::from_fn(|j| at(i, j)));
    let product = |a: &[[f64; N]; N], b: &[[f64; N]; N]| -> [[f64; N]; N] {
        matrix(&|i, j| (0..N).map(|k| a[i][k] * b[k][j]).sum())
    };
    let norm = m.iter().map(|r| r.iter().map(|x| x.abs()).sum::<f64>()).fold(0.0, f64::max);
    let squarings = if norm > 0.25 { ((norm / 0.25).log_2().ceil() as i32).clamp(0, 60) } else { 0 };
    let small = m.map(|r| r.map(|x| x / f64::from(squarings).exp_2()));
    let one: [[f64; N]; N] = matrix(&|i, j| f64::from(u8::from(i == j)));
    // Horner; 0.25^14 / 14! is below 1e-19.
    let sum = (1..=14).rev().fold(one, |sum, n| {
        let p = product(&small, &sum);
        matrix(&|i, j| one[i][j] + p[i][j] / f64::from(n))
    });
    (0..squarings).fold(sum, |sum, _| product(&sum, &sum))
}

#[cfg(test)]
mod tests {
    use super::super::testing::{RungeKutta, hapcoil};
    use super::*;

    #[test]
    fn plant_agrees_with_runge_kutta() {
        for drive in [Drive::Current, Drive::Voltage] {
            let d = hapcoil(100.0);
            let (mut plant, mut fine) =
                (Plant::new(&d, drive, 48_000.0), RungeKutta::new(d, drive, 48_000.0, 32));
            let mut seed = 1u32;
            let mut worst = [0.0f64; 3];
            for n in 0..20_000 {
                seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                let u = if n % 7000 < 3500 { f64::from(seed >> 8) / 8_388_608.0 - 1.0 } else { 0.7 };
                let (p, f) = (plant.step(u), fine.step(u));
                worst[0] = worst[0].max((p.displacement - f.displacement).abs());
                worst[1] = worst[1].max((p.current - f.current).abs());
                worst[2] = worst[2].max((p.acceleration - f.acceleration).abs());
            }
            assert!(worst[0] < 1e-12 && worst[1] < 1e-7 && worst[2] < 1e-5, "{drive:?} {worst:?}");
        }
    }

    #[test]
    fn constant_voltage_gives_static_deflection_only() {
        let d = hapcoil(250.0);
        let mut plant = Plant::new(&d, Drive::Voltage, 48_000.0);
        let mut last = Motion::default();
        for _ in 0..96_000 {
            last = plant.step(0.9);
        }
        let amps = 0.9 / d.resistance;
        assert!((last.current - amps).abs() < 1e-12);
        assert!((last.displacement - d.force_factor * amps / d.stiffness).abs() < 1e-12);
        assert!(last.acceleration.abs() < 1e-9);
    }
}
