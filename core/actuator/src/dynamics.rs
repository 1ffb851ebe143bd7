//! An actuator on a handle.

use asperity_diagnostics::Diagnostic;
use std::f64::consts::TAU;

use asperity_dsp::filter::Section;

use super::{ActuatorProfile, check};

/// An actuator fixed to a handle of known mass. All values in SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dynamics {
    /// Moving mass m_a \[kg\].
    pub moving_mass: f64,
    /// Mass of the handle with the actuator's housing, m_h \[kg\].
    pub handle_mass: f64,
    /// Suspension stiffness k \[N/m\].
    pub stiffness: f64,
    /// Suspension damping c \[N s/m\], with open coil.
    pub damping: f64,
    /// Force factor k_f \[N/A\], which is also the back-EMF \[V s/m\].
    pub force_factor: f64,
    /// Coil resistance R \[ohm\].
    pub resistance: f64,
    /// Coil inductance L \[H\].
    pub inductance: f64,
    /// Largest displacement from the middle \[m\].
    pub stroke: f64,
    /// Thermal time constant of the coil \[s\].
    pub thermal_time_constant: f64,
    /// Current that the coil bears continuously \[A rms\].
    pub rated_current: f64,
    /// Largest current at any time \[A\].
    pub peak_current: f64,
    /// Largest voltage at any time \[V\].
    pub peak_voltage: f64,
}

impl Dynamics {
    /// The actuator of `profile` on a handle of `handle_mass_g` grams.
    ///
    /// # Errors
    /// A mass outside 1 g to 10 kg. A resonance outside 5 to 1000 Hz, or a damping ratio outside 0.002
    /// to 2, of this profile with this mass.
    pub fn new(profile: &ActuatorProfile, handle_mass_g: f64) -> Result<Self, Diagnostic> {
        check("a handle's mass", handle_mass_g, 1.0, 10_000.0, "g")?;
        let this = Self {
            moving_mass: profile.moving_mass.value,
            handle_mass: handle_mass_g * 1e-3,
            stiffness: profile.stiffness.value,
            damping: profile.damping.value,
            force_factor: profile.force_factor.value,
            resistance: profile.resistance.value,
            inductance: profile.inductance.value,
            stroke: profile.stroke.value,
            thermal_time_constant: profile.thermal_time_constant.value,
            rated_current: profile.rated_current.value,
            peak_current: profile.peak_current.value,
            peak_voltage: profile.peak_voltage.value,
        };
        check("a resonance on this handle", this.natural_hz(), 5.0, 1000.0, "Hz")?;
        check("a damping ratio on this handle", this.damping_ratio(), 0.002, 2.0, "")?;
        Ok(this)
    }

    /// mu = m_a m_h / (m_a + m_h) \[kg\].
    pub fn reduced_mass(&self) -> f64 {
        self.moving_mass * self.handle_mass / (self.moving_mass + self.handle_mass)
    }

    /// w_n = sqrt(k / mu) \[rad/s\].
    pub fn natural_rad_s(&self) -> f64 {
        (self.stiffness / self.reduced_mass()).sqrt()
    }

    /// w_n / 2 pi \[Hz\].
    pub fn natural_hz(&self) -> f64 {
        self.natural_rad_s() / TAU
    }

    /// zeta = c / (2 mu w_n), with open coil.
    pub fn damping_ratio(&self) -> f64 {
        self.damping / (2.0 * self.reduced_mass() * self.natural_rad_s())
    }

    /// A/I \[m/s^2 per A\]: acceleration of the handle.
    pub fn acceleration_per_current(&self) -> Section {
        Section { num: [-self.force_factor / self.handle_mass, 0.0, 0.0], den: self.characteristic() }
    }

    /// s^2 + 2 zeta w_n s + w_n^2, highest power first.
    pub(crate) fn characteristic(&self) -> [f64; 3] {
        let mu = self.reduced_mass();
        [1.0, self.damping / mu, self.stiffness / mu]
    }
}
