//! From a wanted acceleration of the handle to the current or voltage that causes it.
//!
//! A/I has a double zero at s = 0: an actuator on a free handle cannot push for ever. The inverse therefore
//! puts in place of its double pole at 0 one of second order near 20 Hz (w_c, zeta_c). The wanted A* then gives
//!
//! ```text
//! I/A* = -(m_h / k_f) (s^2 + 2 zeta w_n s + w_n^2) / (s^2 + 2 zeta_c w_c s + w_c^2)
//! A/A* = s^2 / (s^2 + 2 zeta_c w_c s + w_c^2)
//! ```
//!
//! The inverse alone passes DC, with (w_n / w_c)^2 times its gain at high frequency; inverse and
//! actuator together are a high-pass.
//!
//! For a voltage, V = (R + L s) I + k_f s x. With x/I from the actuator, the mechanical resonance drops out
//! of the back-EMF:
//!
//! ```text
//! s x / A* = (k_f / mu) s / (s^2 + 2 zeta w_n s + w_n^2) I/A* = -(m_h / mu) s / (s^2 + 2 zeta_c w_c s + w_c^2)
//! V/A* = [(R + L s) I/A* + k_f s x/A*] / (1 + s / w_r)
//! ```
//!
//! All poles are at w_c and w_r, so it is stable for any actuator. Without the pole at w_r it would be improper,
//! its gain rising with L s without end; w_r is 10 kHz, or a quarter of the rate if that is less, which is beside
//! the 5.6 kHz of a coil of 4.5 ohm and 128 uH. Then A/A* is multiplied by 1 / (1 + s / w_r): 0.04 dB and 16 us
//! at 1 kHz.

use std::f64::consts::{FRAC_1_SQRT_2, TAU};

use asperity_dsp::filter::{Biquad, Complex64, Section};
use asperity_state::State;

use super::{ActuatorError, Drive, Dynamics};

/// Accelerations are held to this \[m/s^2\], ten times what the loudest of textures may ask for: the filters would remember 1e30 for 0.8 s, and
/// keep the limiter at its peak all the while.
const MOST_M_S2: f64 = 1e6;

/// What may be chosen about the inverse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InverseSettings {
    /// Corner w_c / 2 pi of the high-pass that inverse and actuator make together \[Hz\], 5 to 60.
    pub corner_hz: f64,
    /// Damping ratio zeta_c of that high-pass, 0.3 to 2; 0.707 is a Butterworth filter.
    pub corner_damping: f64,
}

impl Default for InverseSettings {
    fn default() -> Self {
        Self { corner_hz: 20.0, corner_damping: FRAC_1_SQRT_2 }
    }
}

/// Turns the handle's wanted acceleration \[m/s^2\] into a drive \[A or V\]. Allocates nothing.
///
/// Each section is transformed bilinearly and is exact at w_n. With the default corner the pair of inverse and
/// actuator is within 0.3 dB of 1 from 40 to 1000 Hz (-0.26 dB at 40 Hz is the corner's own). 96 samples take
/// 0.24 us (current) or 0.27 us (voltage), medians on one of 2 cores of a shared server-class x86-64 with
/// AVX-512; `examples/actuator_cost.rs` measures it.
#[derive(Clone, Debug)]
pub struct Inverse {
    current: Biquad,
    voltage: Option<Voltage>,
    rate_hz: f64,
    ignored: u64,
}

#[derive(Clone, Debug)]
struct Voltage {
    // k_f s x / A*
    emf: Biquad,
    // (R + L s) / (1 + s / w_r)
    coil: Biquad,
    // 1 / (1 + s / w_r)
    roof: Biquad,
}

impl Inverse {
    /// An inverse for an actuator on its handle, at a sampling rate.
    ///
    /// # Errors
    /// Settings out of their ranges; a rate below 1 kHz, above 1 MHz, or below eight times the actuator's resonance.
    pub fn new(
        dynamics: &Dynamics,
        drive: Drive,
        rate_hz: f64,
        settings: InverseSettings,
    ) -> Result<Self, ActuatorError> {
        ActuatorError::check("an inverse's corner", settings.corner_hz, 5.0, 60.0, "Hz")?;
        ActuatorError::check("an inverse's corner damping", settings.corner_damping, 0.3, 2.0, "")?;
        let least = (8.0 * dynamics.natural_hz()).max(1000.0);
        ActuatorError::check("a rate", rate_hz, least, 1e6, "Hz")?;
        let (natural, mh) = (dynamics.natural_hz(), dynamics.handle_mass);
        let wc = TAU * settings.corner_hz;
        let corner = [1.0, 2.0 * settings.corner_damping * wc, wc * wc];
        let current =
            Section { num: dynamics.characteristic(), den: corner }.scaled(-mh / dynamics.force_factor);
        let current = current.bilinear(rate_hz, natural)?;
        let voltage = match drive {
            Drive::Current => None,
            Drive::Voltage => {
                let gain = -dynamics.force_factor * mh / dynamics.reduced_mass();
                let lag = 1.0 / (TAU * (rate_hz / 4.0).min(10_000.0));
                let first = |num| Section { num, den: [0.0, lag, 1.0] }.bilinear(rate_hz, natural);
                Some(Voltage {
                    emf: Section { num: [0.0, gain, 0.0], den: corner }.bilinear(rate_hz, natural)?,
                    coil: first([0.0, dynamics.inductance, dynamics.resistance])?,
                    roof: first([0.0, 0.0, 1.0])?,
                })
            }
        };
        Ok(Self { current, voltage, rate_hz, ignored: 0 })
    }

    /// Whether silence gives silence: nothing of what came in before is left.
    pub fn rests(&self) -> bool {
        let voltage = self.voltage.as_ref();
        self.current.is_at_rest()
            && voltage.is_none_or(|v| [v.emf, v.coil, v.roof].iter().all(Biquad::is_at_rest))
    }

    /// Turns a block of accelerations \[m/s^2\] into drive \[A or V\]; blocks of any length give the same
    /// samples. A sample that is not finite is taken as 0 and counted; one beyond 1e6 m/s^2 is held there.
    pub fn process(&mut self, acceleration: &[f32], drive: &mut [f32]) {
        let mut ignored = 0;
        let mut read = |x: &f32| {
            let good = x.is_finite();
            ignored += u64::from(!good);
            if good { f64::from(*x).clamp(-MOST_M_S2, MOST_M_S2) } else { 0.0 }
        };
        let write = |y: f64| y.clamp(f64::from(f32::MIN), f64::from(f32::MAX)) as f32;
        let mut current = self.current;
        match &mut self.voltage {
            None => {
                for (x, y) in acceleration.iter().zip(drive) {
                    *y = write(current.step(read(x)));
                }
            }
            Some(v) => {
                let (mut emf, mut coil, mut roof) = (v.emf, v.coil, v.roof);
                for (x, y) in acceleration.iter().zip(drive) {
                    let x = read(x);
                    *y = write(coil.step(current.step(x)) + roof.step(emf.step(x)));
                }
                (v.emf, v.coil, v.roof) = (emf, coil, roof);
                v.emf.settle();
                v.coil.settle();
                v.roof.settle();
            }
        }
        self.current = current;
        self.current.settle();
        self.ignored = self.ignored.saturating_add(ignored);
    }

    /// The inverse's own frequency response, drive over acceleration \[A or V per m/s^2\].
    pub fn response(&self, hz: f64) -> Complex64 {
        let current = self.current.response(hz, self.rate_hz);
        match &self.voltage {
            None => current,
            Some(v) => {
                current * v.coil.response(hz, self.rate_hz)
                    + v.emf.response(hz, self.rate_hz) * v.roof.response(hz, self.rate_hz)
            }
        }
    }

    /// Samples that were not finite and were taken as 0, since construction.
    pub fn ignored(&self) -> u64 {
        self.ignored
    }

    /// What its filters remember of the input. An inverse for another handle, actuator or corner can go on from it, with a
    /// transient that decays as fast as the corner lets it; refused is what another kind of drive remembers.
    pub fn state(&mut self, state: &mut State<'_>) {
        self.current.state(state);
        if let Some(v) = &mut self.voltage {
            v.emf.state(state);
            v.coil.state(state);
            v.roof.state(state);
        }
    }

    /// Forgets all input; keeps the count.
    pub fn reset(&mut self) {
        self.current.reset();
        if let Some(v) = &mut self.voltage {
            v.emf.reset();
            v.coil.reset();
            v.roof.reset();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{RungeKutta, hapcoil, lock_in};
    use super::super::{Drive, Plant};
    use super::*;

    const RATE: f64 = 48_000.0;

    fn inverse(grams: f64, drive: Drive, rate: f64) -> Inverse {
        Inverse::new(&hapcoil(grams), drive, rate, InverseSettings::default()).unwrap()
    }

    /// A/A* of inverse and a simulated actuator at `hz`, by a sine of 1 m/s^2.
    fn pair(drive: Drive, hz: f64, mut handle: impl FnMut(f64) -> f64) -> Complex64 {
        let mut inverse = inverse(100.0, drive, RATE);
        let wanted: Vec<f32> = (0..96_000).map(|n| (TAU * hz * f64::from(n) / RATE).sin() as f32).collect();
        let mut driven = vec![0.0; wanted.len()];
        for (x, y) in wanted.chunks(89).zip(driven.chunks_mut(89)) {
            inverse.process(x, y);
        }
        let felt: Vec<f64> = driven.iter().map(|u| handle(f64::from(*u))).collect();
        lock_in(&felt[48_000..], hz, RATE)
    }

    #[test]
    fn inverse_and_simulated_actuator_are_flat_from_40_to_1000_hz() {
        for drive in [Drive::Current, Drive::Voltage] {
            for hz in [40.0, 65.0, 100.0, 250.0, 500.0, 1000.0] {
                let mut plant = Plant::new(&hapcoil(100.0), drive, RATE);
                let exact = pair(drive, hz, |u| plant.step(u).acceleration);
                let mut fine = RungeKutta::new(hapcoil(100.0), drive, RATE, 8);
                let integrated = pair(drive, hz, |u| fine.step(u).acceleration);
                assert!((exact - integrated).norm() < 1e-4, "{drive:?} {hz} Hz: {exact} {integrated}");
                let db = 20.0 * exact.norm().log10();
                assert!(db.abs() < 0.3, "{drive:?} {hz} Hz: {db} dB");
                // And it is the high-pass it is said to be, with the roof's fall under a voltage.
                let mut stated = Section::high_pass(20.0, FRAC_1_SQRT_2).response(hz);
                if drive == Drive::Voltage {
                    stated /= Complex64::new(1.0, hz / 10_000.0);
                }
                let off = 20.0 * (exact.norm() / stated.norm()).log10();
                assert!(off.abs() < 0.05, "{drive:?} {hz} Hz: {off} dB from what is stated");
            }
        }
    }

    #[test]
    fn what_no_actuator_could_follow_is_not_remembered_longer_than_a_large_signal() {
        for drive in [Drive::Current, Drive::Voltage] {
            let mut inv = inverse(100.0, drive, RATE);
            let mut u = vec![0.0; 4800];
            inv.process(&[1e30; 4800], &mut u);
            assert!(u.iter().all(|u| u.is_finite()));
            let mut rest = vec![0.0; 24_000];
            inv.process(&[0.0; 24_000], &mut rest);
            // exp(-w_c zeta_c t) of the corner, 20 Hz, is 309 dB in 0.4 s.
            assert!(rest[19_200..].iter().all(|u| u.abs() < 1e-6), "{drive:?} {}", rest[19_200]);
        }
    }

    #[test]
    fn the_pair_passes_no_dc_though_the_inverse_does() {
        for drive in [Drive::Current, Drive::Voltage] {
            let (d, inv) = (hapcoil(100.0), inverse(100.0, drive, RATE));
            if drive == Drive::Current {
                let ratio = inv.response(0.0).norm() / inv.response(20_000.0).norm();
                assert!((ratio / (65.0f64 / 20.0).powi(2) - 1.0).abs() < 1e-3, "{ratio}");
            }
            let mut inv = inv;
            let mut plant = Plant::new(&d, drive, RATE);
            let (x, mut u) = (vec![1.0f32; 48_000], vec![0.0; 48_000]);
            inv.process(&x, &mut u);
            assert!(u[47_999].abs() > 0.1);
            let last = u.iter().fold(0.0, |_, u| plant.step(f64::from(*u)).acceleration);
            assert!(last.abs() < 1e-4, "{drive:?} {last}");
        }
    }

    #[test]
    fn the_sections_of_the_voltage_inverse_add_up_to_its_transfer_function() {
        let d = hapcoil(60.0);
        let inv = inverse(60.0, Drive::Voltage, 480_000.0);
        for hz in [5.0, 20.0, 71.0, 300.0, 3000.0] {
            let s = Complex64::new(0.0, TAU * hz);
            // From the equations of motion, with no section in common.
            let mu = d.reduced_mass();
            let x_per_i = d.force_factor / (s * s * mu + s * d.damping + d.stiffness);
            let a_per_i = -s * s * mu / d.handle_mass * x_per_i;
            let v_per_i = s * d.inductance + d.resistance + s * d.force_factor * x_per_i;
            let wc = TAU * 20.0;
            let corner = s * s / (s * s + s * 2.0 * FRAC_1_SQRT_2 * wc + wc * wc);
            let want = v_per_i / a_per_i * corner / (s / (TAU * 10_000.0) + 1.0);
            let got = inv.response(hz);
            assert!((got / want - 1.0).norm() < 2e-3, "{hz}: {got} {want}");
        }
    }

    #[test]
    fn any_block_length_gives_the_same_samples_and_what_is_not_finite_passes_over() {
        let x: Vec<f32> = (0..500)
            .map(|n| {
                if n == 100 {
                    f32::NAN
                } else if n == 200 {
                    f32::INFINITY
                } else {
                    (n as f32 * 0.3).sin()
                }
            })
            .collect();
        let (mut a, mut b) = (inverse(100.0, Drive::Voltage, RATE), inverse(100.0, Drive::Voltage, RATE));
        let (mut whole, mut parts) = (vec![0.0; 500], vec![0.0; 500]);
        a.process(&x, &mut whole);
        for n in 0..500 {
            b.process(&x[n..n], &mut []);
            b.process(&x[n..=n], &mut parts[n..=n]);
        }
        assert_eq!(whole, parts);
        assert!(whole.iter().all(|y| y.is_finite()));
        assert_eq!(a.ignored(), 2);
        b.process(&[f32::MAX; 96], &mut parts[..96]);
        assert!(parts.iter().all(|y| y.is_finite()));
    }

    #[test]
    fn settings_and_rates_that_do_not_fit_are_refused() {
        let d = hapcoil(100.0);
        let make = |rate, corner_hz| {
            Inverse::new(&d, Drive::Current, rate, InverseSettings { corner_hz, ..Default::default() })
        };
        assert!(make(48_000.0, 20.0).is_ok());
        for (rate, corner) in
            [(0.0, 20.0), (f64::NAN, 20.0), (500.0, 20.0), (48_000.0, 1.0), (48_000.0, f64::NAN)]
        {
            assert!(make(rate, corner).is_err(), "{rate} {corner}");
        }
    }
}
