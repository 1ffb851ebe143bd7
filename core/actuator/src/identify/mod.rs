//! Finds an actuator's figures from a drive and the acceleration of its handle.
//!
//! ```text
//! A/I = -(k_f / m_h) s^2 / (s^2 + (c / mu) s + k / mu),    1 / mu = 1 / m_a + 1 / m_h
//! ```
//!
//! **What can be known.** A current and the handle's acceleration give three numbers: the gain at high
//! frequencies k_f / m_h, the resonance w_n^2 = k / mu and the damping c / mu. With the handle's mass
//! k_f follows. The moving mass does not: twice the moving mass, stiffness and damping (a little more,
//! for mu) move the handle in the same way. One of two things helps. A second recording with another
//! known handle mass has a resonance that differs by k (1 / m_1 - 1 / m_2). Or the base profile gives
//! the moving mass. One fit serves both: it knows the uncertainty of each, and the intervals show it.
//! The second resonance differs little where the mover is light: by 3.2 % for 4.4 g on 50 g and on 200
//! g. The masses must be far apart, and better known than the wanted intervals. A voltage damps by
//! k_f^2 / R more than a current, with R and L of the base profile; heat changes R.
//!
//! **How.** Both signals are transformed whole. Neighbouring bins form bands of 1/24 octave. In each a
//! straight line separates response and noise. Correlation finds latency and signs, a grid the figures. Then
//! weighted least squares over all bins fits everything, latency included ([`identify`]). The drive may have
//! any waveform, so the limiter may have changed it. But it must be the drive that was really sent, and
//! begin and end in silence. Intervals follow from the fit's curvature and are widened by the part that the
//! model cannot explain.
//!
//! The model is in continuous time; a sound card's converters come close. The simulated
//! [`Plant`](super::Plant) holds each sample. That delays the mover by half a sample, but not the push
//! on the handle: [`IdentifySettings::held`].
//!
//! **How well.** Simulation of 59 random actuators (0.5 to 50 g, 25 to 500 Hz, damping ratios 0.02 to
//! 0.9, handles of 50 to 200 g): sweeps of 4 s through the limiter, 20 dB signal to noise (white noise
//! and hum), moving mass known. Stiffness, damping and force factor came out within 0.4 %, the latency
//! within 0.01 samples. Ignoring the hold costs up to 4.4 %, at strongly damped resonances above 400
//! Hz. A damping much below k_f^2 / R is not found behind a voltage; its interval says so.

mod findings;
mod fit;
mod judge;
mod spectra;
mod sweep;

use asperity_diagnostics::Diagnostic;
use asperity_numbers::Elementary as _;

use super::{ActuatorProfile, Drive};
use fit::{Belief, Coil, Fitted, Run};
use spectra::Spectra;

pub use findings::{Estimate, Findings, Measurement, Point, Trust, write_profile};
pub use sweep::{Sweep, SweepSettings, SweepShape, raised_cosine};

/// A drive and the acceleration of the handle, in step.
#[derive(Clone, Copy, Debug)]
pub struct Recording<'a> {
    /// The drive behind the limiter \[A or V\].
    pub drive: &'a [f32],
    /// The accelerometer's signal \[m/s^2\], later by an unknown latency of at most 0.5 s.
    pub acceleration: &'a [f32],
    /// Sampling rate of both \[Hz\].
    pub rate_hz: f64,
    /// Mass of the handle with everything fixed to it, housing and accelerometer included, without the
    /// mover \[g\].
    pub handle_mass_g: f64,
    /// Whether the limiter changed the drive ([`LimiterReport::acted`](super::LimiterReport::acted)).
    pub limited: bool,
    /// [`Sweep::time_constant_s`] of an exponential sweep, to measure distortion.
    pub sweep_time_constant_s: Option<f64>,
}

/// Prior knowledge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IdentifySettings {
    /// The meaning of a drive sample.
    pub drive: Drive,
    /// Frequencies to use \[Hz\], as far as the drive excites them. Above, handles bend.
    pub band_hz: (f64, f64),
    /// Uncertainty of the handles' masses: half the 95 % interval, as a part of them, 0.0001 to 0.5.
    pub handle_mass_uncertainty: f64,
    /// Uncertainty of the base profile's resistance, in the same form. Only a voltage needs it. Copper
    /// gains 0.4 % a kelvin.
    pub resistance_uncertainty: f64,
    /// Whether a sample is held until the next, as in a simulated [`Plant`](super::Plant). Behind a
    /// sound card the signal is smooth.
    pub held: bool,
}

impl Default for IdentifySettings {
    fn default() -> Self {
        Self {
            drive: Drive::Current,
            band_hz: (5.0, 2000.0),
            handle_mass_uncertainty: 0.01,
            resistance_uncertainty: 0.03,
            held: false,
        }
    }
}

/// Finds the actuator that turns every recording's drive into its acceleration.
///
/// `base` gives the coil's resistance and inductance if the drive is a voltage. It also gives the
/// moving mass if the recordings cannot: there is only one, or the handles are too similar. Two
/// recordings of 5 s at 48 kHz took 0.10 to 0.14 s.
///
/// # Errors
/// Recordings or settings from which nothing can be computed. A bad recording gives [`Findings`] of
/// [`Trust::Poor`] with notes that say why.
pub fn identify(
    recordings: &[Recording<'_>],
    base: &ActuatorProfile,
    settings: IdentifySettings,
) -> Result<Findings, Diagnostic> {
    if recordings.is_empty() {
        return Err(Diagnostic::new("there is no recording to identify an actuator from"));
    }
    check_settings(&settings)?;
    let believed = Belief {
        value: base.moving_mass.value,
        spread: spread_of(if base.moving_mass.estimate { ESTIMATED } else { PUBLISHED }),
    };
    let rate_hz = recordings[0].rate_hz;
    let hold = if settings.held { 1.0 / rate_hz } else { 0.0 };
    let (resistance, inductance) = (base.resistance.value, base.inductance.value);
    let coil = Coil { drive: settings.drive, resistance, inductance, hold };
    let spread = spread_of(1.0 + settings.handle_mass_uncertainty);
    let run = |recording: &Recording<'_>| {
        check(recording, rate_hz)?;
        let handle_mass = Belief { value: recording.handle_mass_g * 1e-3, spread };
        Ok(Run::new(Spectra::new(recording, settings.band_hz)?, handle_mass, coil))
    };
    let runs = recordings.iter().map(run).collect::<Result<Vec<Run>, Diagnostic>>()?;
    let (fitted, measured) = best(&runs, coil, believed, settings.resistance_uncertainty);
    Ok(findings::sum_up(recordings, &runs, &fitted, &settings, (measured, base.moving_mass.estimate)))
}

/// A published moving mass is right within this factor for 95 of 100 actuators; an estimated one within
/// the other.
const PUBLISHED: f64 = 1.05;
const ESTIMATED: f64 = 1.5;
/// Prior factor for a moving mass that two recordings shall find.
const OPEN: f64 = 20.0;
/// 95 % of a normal distribution lie within this many standard deviations.
const WITHIN_95: f64 = 1.959_964;

/// Standard deviation of the logarithm of a value known within a factor, 95 %.
fn spread_of(factor: f64) -> f64 {
    factor.log_e() / WITHIN_95
}

/// Fits with an open moving mass if there are several handles, and with the believed one if that is
/// more certain. Returns whether the moving mass was measured.
fn best(runs: &[Run], coil: Coil, believed: Belief, resistance: f64) -> (Fitted, bool) {
    let mass = |r: &Run| r.handle_mass.value;
    let least = runs.iter().map(mass).fold(f64::INFINITY, f64::min);
    let most = runs.iter().map(mass).fold(0.0, f64::max);
    if most > 1.05 * least {
        let open = Belief { spread: spread_of(OPEN), ..believed };
        let fitted = fit_widely(runs, coil, open, resistance);
        if fitted.covariance[1][1].sqrt() < believed.spread.max(spread_of(1.1)) {
            return (fitted, true);
        }
    }
    (fit_widely(runs, coil, believed, resistance), false)
}

/// Fits, then fits again with the noise that the first fit left unexplained. Behind a voltage it fits
/// once more with another resistance and widens the intervals by the change. A fitted resistance would
/// follow the least errors at high frequencies.
fn fit_widely(runs: &[Run], coil: Coil, moving_mass: Belief, resistance: f64) -> Fitted {
    let first = fit::fit(runs, coil, moving_mass, &vec![1.0; runs.len()]);
    let noise = runs.iter().zip(&first.models);
    let noise: Vec<f64> = noise.map(|(run, m)| judge::unexplained(&run.spectra, m).max(1.0)).collect();
    let mut fitted = fit::fit(runs, coil, moving_mass, &noise);
    if coil.drive == Drive::Voltage {
        let other = Coil { resistance: coil.resistance * spread_of(1.0 + resistance).exp_e(), ..coil };
        fitted.widen(&fit::fit(runs, other, moving_mass, &noise));
    }
    fitted
}

const NO_DRIVE: &str = "the drive is silent: nothing was sent to the actuator";

/// The first value that is out of range.
fn refuse(values: &[(&'static str, f64, bool)]) -> Result<(), Diagnostic> {
    let bad = values.iter().find(|(.., fits)| !fits);
    bad.map_or(Ok(()), |&(what, found, _)| Err(Diagnostic::new(format!("{what} of {found} does not fit"))))
}

fn check_settings(s: &IdentifySettings) -> Result<(), Diagnostic> {
    let (low, high) = s.band_hz;
    let part = |x: f64| (1e-4..=0.5).contains(&x);
    refuse(&[
        ("a lowest frequency", low, low >= 0.1 && low.is_finite()),
        ("a highest frequency", high, high > low && high.is_finite()),
        ("an uncertainty of the handle's mass", s.handle_mass_uncertainty, part(s.handle_mass_uncertainty)),
        ("an uncertainty of the resistance", s.resistance_uncertainty, part(s.resistance_uncertainty)),
    ])
}

fn check(r: &Recording<'_>, rate_hz: f64) -> Result<(), Diagnostic> {
    let constant = r.sweep_time_constant_s.unwrap_or(1.0);
    refuse(&[
        ("a rate", r.rate_hz, (1000.0..=1e6).contains(&r.rate_hz) && r.rate_hz == rate_hz),
        ("a handle's mass", r.handle_mass_g, (1.0..=10_000.0).contains(&r.handle_mass_g)),
        ("a sweep's time constant", constant, constant > 0.0 && constant.is_finite()),
    ])?;
    let seconds = r.drive.len().min(r.acceleration.len()) as f64 / r.rate_hz;
    let wrong = if seconds < 0.5 {
        &format!("a recording of {seconds:.2} s is too short to identify an actuator; 0.5 s is the least")
    } else if !r.drive.iter().chain(r.acceleration).all(|x| x.is_finite()) {
        "a recording holds samples that are not finite"
    } else if r.drive.iter().all(|x| *x == 0.0) {
        NO_DRIVE
    } else if r.acceleration.windows(2).all(|w| w[0] == w[1]) {
        "the accelerometer is silent: is it connected, and is this its channel?"
    } else {
        return Ok(());
    };
    Err(Diagnostic::new(wrong))
}

#[cfg(test)]
mod tests;
