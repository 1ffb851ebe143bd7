//! The inverse: from a wanted acceleration of the handle to a current or voltage.
//!
//! A/I has a double zero at s = 0: an actuator on a free handle cannot push without end. So the inverse does
//! not use a double pole at 0, but a second-order pole near 20 Hz (w_c, zeta_c). A wanted A* then gives
//!
//! ```text
//! I/A* = -(m_h / k_f) (s^2 + 2 zeta w_n s + w_n^2) / (s^2 + 2 zeta_c w_c s + w_c^2)
//! A/A* = s^2 / (s^2 + 2 zeta_c w_c s + w_c^2)
//! ```
//!
//! The inverse alone passes DC, with (w_n / w_c)^2 times its gain at high frequency. Inverse and actuator
//! together are a high-pass.
//!
//! For a voltage, V = (R + L s) I + k_f s x. With the actuator's x/I, the mechanical resonance cancels in the
//! back-EMF:
//!
//! ```text
//! s x / A* = (k_f / mu) s / (s^2 + 2 zeta w_n s + w_n^2) I/A*
//!          = -(m_h / mu) s / (s^2 + 2 zeta_c w_c s + w_c^2)
//! V/A* = [(R + L s) I/A* + k_f s x/A*] / (1 + s / w_r)
//! ```
//!
//! All poles are at w_c and w_r, so it is stable for any actuator. Without the pole at w_r its gain would
//! rise with L s without end. w_r is 10 kHz or a quarter of the rate, whichever is less. A coil of 4.5 ohm
//! and 128 uH has its corner near that, at 5.6 kHz. A/A* is then multiplied by 1 / (1 + s / w_r): 0.04 dB and
//! 16 us at 1 kHz.
//!
//! [`InverseModel`] selects how much of this is kept. A/A* shows the effect of the omitted terms. H_c is the
//! high-pass above, `Z = R + L s + k_f s x/I` the coil's impedance. Only the full model under a voltage has
//! `1 / (1 + s / w_r)`:
//!
//! ```text
//! model          under a current                  under a voltage
//! full           H_c                              H_c / (1 + s / w_r)
//! no_inductance  H_c                              H_c (R + k_f s x/I) / Z
//! no_emf         H_c                              H_c R / Z
//! mass           s^2 / (s^2 + 2 zeta w_n s + w_n^2)    the same times R / Z
//! ```

use asperity_diagnostics::Diagnostic;
use std::f64::consts::{FRAC_1_SQRT_2, TAU};

use asperity_dsp::filter::{Biquad, Complex64, Section};
use asperity_state::State;

use super::{Drive, Dynamics, check};

/// Largest acceleration \[m/s^2\]: ten times the most that a texture may ask for. The filters would
/// remember 1e30 for 0.8 s and hold the limiter at its peak.
const MOST_M_S2: f64 = 1e6;

/// Inverted part of the actuator.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum InverseModel {
    /// Mass, spring, damper, and for a voltage the whole coil: third order.
    #[default]
    Full,
    /// Without the coil's inductance: second order, with the back-EMF as another damper.
    NoInductance,
    /// Without inductance and back-EMF: mass, spring and damper behind the resistance.
    NoEmf,
    /// The constant far above resonance, -m_h / k_f, for a voltage times R. It has no corner.
    Mass,
}

/// Settings of an inverse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InverseSettings {
    /// Corner w_c / 2 pi of the high-pass of inverse and actuator \[Hz\], 5 to 60.
    /// [`InverseModel::Mass`] has none.
    pub corner_hz: f64,
    /// Damping ratio zeta_c of that high-pass, 0.3 to 2. 0.707 is a Butterworth filter.
    /// [`InverseModel::Mass`] has none.
    pub corner_damping: f64,
    /// Inverted part of the actuator.
    pub model: InverseModel,
}

impl Default for InverseSettings {
    fn default() -> Self {
        Self { corner_hz: 20.0, corner_damping: FRAC_1_SQRT_2, model: InverseModel::Full }
    }
}

/// Turns a wanted acceleration of the handle \[m/s^2\] into a drive \[A or V\]. Allocates nothing.
///
/// Each section is bilinear and exact at w_n. With the default corner, inverse and actuator are within
/// 0.3 dB of 1 from 40 to 1000 Hz; -0.26 dB at 40 Hz is the corner's own. 96 samples take 0.24 us
/// (current) or 0.27 us (voltage): medians on one of 2 cores of a shared server-class x86-64 with
/// AVX-512, by `benches/actuator.rs`.
#[derive(Clone, Debug)]
pub struct Inverse {
    path: Path,
    drive: Drive,
    /// I/A*, k_f s x/A*, (R + L s) / (1 + s / w_r) and 1 / (1 + s / w_r). A section that the path does
    /// not use stays at rest.
    sections: [Biquad; 4],
    rate_hz: f64,
    ignored: u64,
}

/// The way from acceleration to drive.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Path {
    /// A constant.
    Gain(f64),
    /// The current times this: 1, or R for a voltage.
    Current(f64),
    /// This R times the current, plus the back-EMF.
    Resistance(f64),
    /// The current through the whole coil, plus the back-EMF.
    Coil,
}

impl Inverse {
    /// An inverse for an actuator on its handle at a sampling rate.
    ///
    /// # Errors
    /// A setting out of range; a rate below 1 kHz, above 1 MHz, or below eight times the resonance.
    pub fn new(
        dynamics: &Dynamics,
        drive: Drive,
        rate_hz: f64,
        settings: InverseSettings,
    ) -> Result<Self, Diagnostic> {
        check("an inverse's corner", settings.corner_hz, 5.0, 60.0, "Hz")?;
        check("an inverse's corner damping", settings.corner_damping, 0.3, 2.0, "")?;
        let least = (8.0 * dynamics.natural_hz()).max(1000.0);
        check("a rate", rate_hz, least, 1e6, "Hz")?;
        let (natural, mh) = (dynamics.natural_hz(), dynamics.handle_mass);
        let wc = TAU * settings.corner_hz;
        let corner = [1.0, 2.0 * settings.corner_damping * wc, wc * wc];
        let current =
            Section { num: dynamics.characteristic(), den: corner }.scaled(-mh / dynamics.force_factor);
        let filter =
            |section: Section| section.bilinear(rate_hz, natural).map_err(|e| Diagnostic::new(e.to_string()));
        let gain = -dynamics.force_factor * mh / dynamics.reduced_mass();
        let lag = 1.0 / (TAU * (rate_hz / 4.0).min(10_000.0));
        let first = |num| filter(Section { num, den: [0.0, lag, 1.0] });
        let sections = [
            filter(current)?,
            filter(Section { num: [0.0, gain, 0.0], den: corner })?,
            first([0.0, dynamics.inductance, dynamics.resistance])?,
            first([0.0, 0.0, 1.0])?,
        ];
        let ohms = if drive == Drive::Voltage { dynamics.resistance } else { 1.0 };
        let path = match (settings.model, drive) {
            (InverseModel::Mass, _) => Path::Gain(-mh / dynamics.force_factor * ohms),
            (InverseModel::NoEmf, _) | (_, Drive::Current) => Path::Current(ohms),
            (InverseModel::NoInductance, Drive::Voltage) => Path::Resistance(ohms),
            (InverseModel::Full, Drive::Voltage) => Path::Coil,
        };
        Ok(Self { path, drive, sections, rate_hz, ignored: 0 })
    }

    /// Whether silence gives silence: no input is remembered.
    pub fn rests(&self) -> bool {
        self.sections.iter().all(Biquad::is_at_rest)
    }

    /// Turns a block of accelerations \[m/s^2\] into drive \[A or V\]. The block length does not matter. A
    /// sample that is not finite counts as 0 and is counted. Samples are clamped to 1e6 m/s^2.
    pub fn process(&mut self, acceleration: &[f32], drive: &mut [f32]) {
        let mut ignored = 0;
        let mut read = |x: &f32| {
            let good = x.is_finite();
            ignored += u64::from(!good);
            if good { f64::from(*x).clamp(-MOST_M_S2, MOST_M_S2) } else { 0.0 }
        };
        let write = |y: f64| y.clamp(f64::from(f32::MIN), f64::from(f32::MAX)) as f32;
        let [mut current, mut emf, mut coil, mut roof] = self.sections;
        let samples = acceleration.iter().zip(drive);
        match self.path {
            Path::Gain(gain) => samples.for_each(|(x, y)| *y = write(gain * read(x))),
            Path::Current(gain) => samples.for_each(|(x, y)| *y = write(gain * current.step(read(x)))),
            Path::Resistance(ohms) => samples.for_each(|(x, y)| {
                let x = read(x);
                *y = write(ohms * current.step(x) + emf.step(x));
            }),
            Path::Coil => samples.for_each(|(x, y)| {
                let x = read(x);
                *y = write(coil.step(current.step(x)) + roof.step(emf.step(x)));
            }),
        }
        self.sections = [current, emf, coil, roof];
        for section in &mut self.sections {
            section.settle();
        }
        self.ignored = self.ignored.saturating_add(ignored);
    }

    /// Frequency response of the inverse alone, drive over acceleration \[A or V per m/s^2\].
    pub fn response(&self, hz: f64) -> Complex64 {
        let [current, emf, coil, roof] = self.sections.map(|section| section.response(hz, self.rate_hz));
        match self.path {
            Path::Gain(gain) => Complex64::new(gain, 0.0),
            Path::Current(gain) => current * gain,
            Path::Resistance(ohms) => current * ohms + emf,
            Path::Coil => current * coil + emf * roof,
        }
    }

    /// Number of samples that were not finite, since construction.
    pub fn ignored(&self) -> u64 {
        self.ignored
    }

    /// State of its filters. An inverse for another handle, actuator, corner or model can go on from it; the
    /// transient decays as fast as the corner lets it. The state for another kind of drive is refused.
    pub fn state(&mut self, state: &mut State<'_>) {
        let mut volts = self.drive == Drive::Voltage;
        state.keep(&mut volts);
        state.require(volts == (self.drive == Drive::Voltage));
        for section in &mut self.sections {
            section.state(state);
        }
        if state.restores() {
            let used = match self.path {
                Path::Gain(_) => 0,
                Path::Current(_) => 1,
                Path::Resistance(_) => 2,
                Path::Coil => 4,
            };
            self.sections[used..].iter_mut().for_each(Biquad::reset);
        }
    }

    /// Clears all memory of input. The count stays.
    pub fn reset(&mut self) {
        self.sections.iter_mut().for_each(Biquad::reset);
    }
}

#[cfg(test)]
#[path = "inverse_tests.rs"]
mod tests;
