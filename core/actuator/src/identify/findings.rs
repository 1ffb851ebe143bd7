//! Findings for people and plots, and the profile that they make.

use std::fmt::Write as _;

use super::super::ActuatorProfile;
use super::super::profile::FIELDS;
use super::fit::{EACH, Fitted, Model, Run, places};
use super::judge;
use super::spectra::{Spectra, distortion};
use super::{IdentifySettings, Recording, WITHIN_95};
use asperity_numbers::{Elementary as _, size};

/// A half interval of this part of the value means that the value was not found.
const UNDETERMINED: f64 = 2.0;

/// A value with its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// Lower end of the interval.
    pub low: f64,
    /// Upper end of the interval.
    pub high: f64,
}

impl Estimate {
    /// From a value and the standard deviation of its logarithm.
    pub(super) fn of_log(value: f64, spread: f64) -> Self {
        // Keeps the ends finite. Beyond this nothing is known.
        let factor = (WITHIN_95 * spread).min(100.0).exp_e();
        Self { value, low: value / factor, high: value * factor }
    }

    /// Half the interval as a part of the value: the greater side.
    pub fn relative(&self) -> f64 {
        (self.high / self.value - 1.0).max(1.0 - self.low / self.value)
    }

    /// Whether the measurement determines the value: the interval ends below three times the value.
    pub fn is_determined(&self) -> bool {
        self.relative() < UNDETERMINED
    }

    /// The same in another unit; `factor` of them make one of this.
    #[must_use]
    pub fn times(self, factor: f64) -> Self {
        Self { value: self.value * factor, low: self.low * factor, high: self.high * factor }
    }
}

/// Trust in the findings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Trust {
    /// Something is wrong; the notes give the reason.
    Poor,
    /// Better than an estimate; the notes say how to improve it.
    Fair,
    /// The intervals are reliable.
    Good,
}

impl Trust {
    /// The word for people.
    pub fn word(self) -> &'static str {
        match self {
            Self::Poor => "poor",
            Self::Fair => "fair",
            Self::Good => "good",
        }
    }
}

/// Response at a frequency, measured and fitted, without the latency.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Frequency \[Hz\].
    pub hz: f64,
    /// Measured magnitude \[dB of m/s^2 per A or V\].
    pub measured_db: f64,
    /// Measured phase \[rad\], -pi to pi.
    pub measured_phase: f64,
    /// Fitted magnitude \[dB of m/s^2 per A or V\].
    pub fitted_db: f64,
    /// Fitted phase \[rad\], -pi to pi.
    pub fitted_phase: f64,
    /// Part of the acceleration's power that the drive explains, 0 to 1.
    pub coherence: f64,
}

/// Findings of one recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Measurement {
    /// Best fit of the handle's mass \[kg\].
    pub handle_mass: f64,
    /// Resonance on this handle \[Hz\].
    pub natural_hz: Estimate,
    /// Damping ratio on this handle, with open coil.
    pub damping_ratio: Estimate,
    /// k_f / m_h: acceleration per current at high frequencies \[m/s^2 per A\].
    pub gain: Estimate,
    /// Latency from drive to acceleration \[s\].
    pub latency_s: f64,
    /// Half of its 95 % interval \[s\].
    pub latency_within_s: f64,
    /// Whether the acceleration's sign is opposite to the model's.
    pub inverted: bool,
    /// Power that the model explains over all other power \[dB\].
    pub snr_db: f64,
    /// Median coherence of the bands.
    pub coherence: f64,
    /// Rms difference of measured and fitted response beyond the noise, as a part of the response.
    pub misfit: f64,
    /// Amplitude of the second to fifth harmonics over the linear response. Only for a sweep.
    pub distortion: Option<f64>,
    /// Frequencies used \[Hz\].
    pub band_hz: (f64, f64),
}

/// Figures of the actuator in SI units, with trust and notes.
#[derive(Clone, Debug, PartialEq)]
pub struct Findings {
    /// Moving mass m_a \[kg\].
    pub moving_mass: Estimate,
    /// Suspension stiffness k \[N/m\].
    pub stiffness: Estimate,
    /// Suspension damping c \[N s/m\], with open coil.
    pub damping: Estimate,
    /// Force factor k_f \[N/A\].
    pub force_factor: Estimate,
    /// Whether recordings on several handles gave the moving mass. If not, it is the base profile's,
    /// and the intervals of stiffness and damping include its uncertainty.
    pub moving_mass_measured: bool,
    /// Findings of each recording.
    pub recordings: Vec<Measurement>,
    /// Measured and fitted response of each recording.
    pub curves: Vec<Vec<Point>>,
    /// Trust in them.
    pub trust: Trust,
    /// Notes for a person, one sentence each, the worst first.
    pub notes: Vec<String>,
}

/// Makes the findings from a fit.
pub(super) fn sum_up(
    recordings: &[Recording<'_>],
    runs: &[Run],
    fitted: &Fitted,
    settings: &IdentifySettings,
    (moving_mass_measured, base_is_estimate): (bool, bool),
) -> Findings {
    let model = fitted.models[0];
    let shared = |i: usize, value: f64| Estimate::of_log(value, fitted.covariance[i][i].sqrt());
    let mut measurements = Vec::new();
    for (n, ((recording, run), model)) in recordings.iter().zip(runs).zip(&fitted.models).enumerate() {
        let mut m = measurement(n, &run.spectra, model, &fitted.covariance);
        m.distortion = distortion(recording, settings.band_hz.1, m.latency_s);
        measurements.push(m);
    }
    let mut findings = Findings {
        force_factor: shared(0, model.force_factor),
        moving_mass: shared(1, model.moving_mass),
        stiffness: shared(2, model.stiffness),
        damping: shared(3, model.damping),
        moving_mass_measured,
        recordings: measurements,
        curves: runs.iter().zip(&fitted.models).map(|(r, m)| curve(&r.spectra, m)).collect(),
        trust: Trust::Good,
        notes: Vec::new(),
    };
    judge::judge(&mut findings, recordings, settings, base_is_estimate);
    findings
}

fn measurement(n: usize, spectra: &Spectra, model: &Model, covariance: &[Vec<f64>]) -> Measurement {
    let at = places(n);
    // Standard deviation of a sum of logarithms with these weights of k_f, m_a, k, c, m_h, and of the
    // latency.
    let spread = |by: [f64; EACH]| {
        let sum: f64 = (0..EACH * EACH)
            .map(|i| by[i / EACH] * by[i % EACH] * covariance[at[i / EACH]][at[i % EACH]])
            .sum();
        sum.max(0.0).sqrt()
    };
    // Relative derivatives of 1 / mu by ln m_a and ln m_h.
    let u = model.inverse_reduced_mass();
    let (a, h) = (-1.0 / (model.moving_mass * u), -1.0 / (model.handle_mass * u));
    let natural = spread([0.0, a / 2.0, 0.5, 0.0, h / 2.0, 0.0]);
    let zeta = spread([0.0, a / 2.0, -0.5, 1.0, h / 2.0, 0.0]);
    let gain = spread([1.0, 0.0, 0.0, 0.0, -1.0, 0.0]);
    Measurement {
        handle_mass: model.handle_mass,
        natural_hz: Estimate::of_log(model.natural_rad_s() / std::f64::consts::TAU, natural),
        damping_ratio: Estimate::of_log(model.damping_ratio(), zeta),
        gain: Estimate::of_log(model.force_factor / model.handle_mass, gain),
        latency_s: model.latency,
        latency_within_s: WITHIN_95 * spread([0.0, 0.0, 0.0, 0.0, 0.0, 1.0]),
        inverted: model.sign < 0.0,
        snr_db: judge::snr_db(spectra, model),
        coherence: judge::median(spectra.bands.iter().map(|b| b.coherence).collect()),
        misfit: judge::misfit(spectra, model),
        distortion: None,
        band_hz: spectra.band_hz(),
    }
}

fn curve(spectra: &Spectra, model: &Model) -> Vec<Point> {
    let db = |x: f64| 20.0 * x.max(1e-12).log_10();
    let point = |band: &super::spectra::Band| {
        let fitted = model.response(band.hz);
        Point {
            hz: band.hz,
            measured_db: db(size(band.response)),
            measured_phase: band.response.im.arc_tangent(band.response.re),
            fitted_db: db(size(fitted)),
            fitted_phase: fitted.im.arc_tangent(fitted.re),
            coherence: band.coherence,
        }
    };
    spectra.bands.iter().map(point).collect()
}

/// Text of a profile with the measured figures, for [`ActuatorProfile::parse`]. Other values come from
/// `base` with their source and are marked as estimates. `date` is written as given.
///
/// Findings of [`Trust::Poor`] are marked as estimates too. Notes stand at the top.
pub fn write_profile(findings: &Findings, base: &ActuatorProfile, date: Option<&str>) -> String {
    let mut text = String::new();
    let when = date.map(|d| format!(" on {}", one_line(d))).unwrap_or_default();
    let _ = writeln!(text, "// {}, measured{when}. Trust: {}.", one_line(&base.name), findings.trust.word());
    for m in &findings.recordings {
        let _ = writeln!(
            text,
            "// On {:.1} g: resonance {:.2} Hz, damping ratio {:.4}, {:.0} dB signal to noise, \
             coherence {:.3}, misfit {:.1} %.",
            m.handle_mass * 1e3,
            m.natural_hz.value,
            m.damping_ratio.value,
            m.snr_db,
            m.coherence,
            100.0 * m.misfit
        );
    }
    for note in &findings.notes {
        let _ = writeln!(text, "// Note: {}.", one_line(note));
    }
    let _ = writeln!(text, "ActuatorProfile(\n    version: 1,\n    name: {:?},", base.name);
    for ((name, quantity), (_, unit, say, _, _, si, _)) in base.quantities().into_iter().zip(FIELDS) {
        let (value, source, estimate) = match measured(findings, name) {
            Some(estimate) => {
                let value = estimate.times(1.0 / si);
                (value.value, source(findings, name, value, say, &when), findings.trust == Trust::Poor)
            }
            None => (quantity.value / si, quantity.source.clone(), true),
        };
        let estimate = if estimate { "estimate: true, " } else { "" };
        let _ = writeln!(text, "    {name}: ({unit}: {}, {estimate}source: {source:?}),", digits(value));
    }
    text.push_str(")\n");
    text
}

fn measured(f: &Findings, name: &str) -> Option<Estimate> {
    match name {
        "m_a" => f.moving_mass_measured.then_some(f.moving_mass),
        "k" => Some(f.stiffness),
        "damping" => Some(f.damping),
        "k_f" => Some(f.force_factor),
        _ => None,
    }
}

fn source(f: &Findings, name: &str, value: Estimate, unit: &str, when: &str) -> String {
    let depends = !f.moving_mass_measured && ["k", "damping"].contains(&name);
    let with = if depends { ", with the moving mass given here" } else { "" };
    let trust = f.trust.word();
    if !value.is_determined() {
        return format!("measured{when}, but not determined by that{with}, trust {trust}");
    }
    let (low, high) = (digits(value.low), digits(value.high));
    format!("measured{when}: 95 % interval {low} to {high} {unit}{with}, trust {trust}")
}

/// Five significant digits.
fn digits(x: f64) -> String {
    format!("{:.4e}", x).parse::<f64>().map_or_else(|_| x.to_string(), |x| x.to_string())
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}
