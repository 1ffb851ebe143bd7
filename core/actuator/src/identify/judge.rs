//! Trust in a fit, and notes about it.

use asperity_numbers::Elementary as _;
use num_complex::Complex64;

use super::super::Drive;
use super::fit::Model;
use super::spectra::{Band, Spectra};
use super::{Estimate, Findings, IdentifySettings, Measurement, Recording, Trust};

/// Least signal-to-noise ratio for good and for fair \[dB\].
const SNR_DB: (f64, f64) = (15.0, 6.0);
/// Least coherence for good and for fair.
const COHERENCE: (f64, f64) = (0.9, 0.6);
/// Greatest misfit for good and for fair.
const MISFIT: (f64, f64) = (0.05, 0.2);
/// Greatest half interval of a recording's figures for good and for fair.
const WITHIN: (f64, f64) = (0.05, 0.25);
/// Greatest half interval of moving mass, stiffness and damping for good and for fair.
const WITHIN_ABSOLUTE: (f64, f64) = (0.1, 0.6);
/// Greatest difference of fitted and given handle mass, in half intervals, for good and for fair. Two
/// recordings whose gains fit their masses reach 0.4 by chance; one recording always fits.
const MASS_OFF: (f64, f64) = (1.0, 2.0);
/// Greatest distortion for good and for fair.
const DISTORTION: (f64, f64) = (0.05, 0.3);

/// For every band: the residual that still follows the drive. Its power relative to the noise (1 by
/// chance), its response and its noise.
fn left(spectra: &Spectra, model: &Model) -> impl Iterator<Item = (Band, f64, Complex64, f64)> {
    spectra.bands.iter().map(|band| {
        let (mut cross, mut power) = (Complex64::default(), 0.0);
        for n in band.bins.0..band.bins.1 {
            let x = spectra.drive[n];
            cross += (spectra.acceleration[n] - model.gradient(spectra.hz(n)).0 * x) * x.conj();
            power += x.norm_sqr();
        }
        let noise = band.noise / power.max(1e-300) / spectra.independent;
        let response = cross / power.max(1e-300);
        (*band, response.norm_sqr() / noise, response, noise)
    })
}

/// Residual over noise: 1 if the model explains everything. The greater of the mean over all bands and
/// over those near the resonance.
pub(super) fn unexplained(spectra: &Spectra, model: &Model) -> f64 {
    let natural_hz = model.natural_rad_s() / std::f64::consts::TAU;
    let (mut all, mut near) = ((0.0, 0.0), (0.0, 0.0));
    for (band, power, _, _) in left(spectra, model) {
        all = (all.0 + power, all.1 + 1.0);
        if (0.6..1.7).contains(&(band.hz / natural_hz)) {
            near = (near.0 + power, near.1 + 1.0);
        }
    }
    let mean = |(sum, count): (f64, f64)| if count > 0.0 { sum / count } else { 0.0 };
    mean(all).max(mean(near))
}

/// Rms difference of measured and fitted response beyond the noise, as a part of the response.
pub(super) fn misfit(spectra: &Spectra, model: &Model) -> f64 {
    let (mut off, mut all) = (0.0, 0.0);
    for (band, _, response, noise) in left(spectra, model) {
        off += (response.norm_sqr() - noise).max(0.0);
        all += model.response(band.hz).norm_sqr();
    }
    (off / all.max(1e-300)).sqrt()
}

/// Power that the model explains over the rest \[dB\].
pub(super) fn snr_db(spectra: &Spectra, model: &Model) -> f64 {
    let mut explained = 0.0;
    let mut rest = spectra.whole_power;
    for (n, (x, y)) in spectra.drive.iter().zip(&spectra.acceleration).enumerate() {
        let heard = model.gradient(spectra.hz(n)).0 * x;
        explained += heard.norm_sqr();
        rest += (y - heard).norm_sqr() - y.norm_sqr();
    }
    10.0 * (explained.max(1e-300) / rest.max(1e-12 * explained).max(1e-300)).log_10()
}

/// Median, 0 of none.
pub(super) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// Whether a signal looks clipped: the top 0.2 % of its range hold many more samples than the next 0.2
/// %. A sine has 2.4 times as many there, noise fewer.
fn is_clipped(signal: &[f32]) -> bool {
    let side = |sign: f32| {
        let peak = signal.iter().fold(0.0f32, |m, x| m.max(sign * x));
        let count = |from: f32, to: f32| {
            signal.iter().filter(|x| (from * peak..to * peak).contains(&(sign * **x))).count()
        };
        let (top, next) = (count(0.998, 1.001), count(0.996, 0.998));
        top >= 24 && top > 6 * next
    };
    side(1.0) || side(-1.0)
}

/// A note with the trust that is left where it counts.
type Note = (Option<Trust>, String);

/// The trust that a value leaves: none is lost if it is at least `good`.
fn least(value: f64, (good, fair): (f64, f64)) -> Option<Trust> {
    let lost = value.is_nan() || value < good;
    lost.then_some(if value >= fair { Trust::Fair } else { Trust::Poor })
}

/// The same for a value that is to be at most `good`.
fn most(value: f64, (good, fair): (f64, f64)) -> Option<Trust> {
    least(-value, (-good, -fair))
}

/// Fills in trust and notes.
pub(super) fn judge(
    findings: &mut Findings,
    recordings: &[Recording<'_>],
    settings: &IdentifySettings,
    base_is_estimate: bool,
) {
    let mut notes: Vec<Note> = Vec::new();
    for (n, (m, r)) in findings.recordings.iter().zip(recordings).enumerate() {
        let which = if recordings.len() > 1 { format!("recording {}: ", n + 1) } else { String::new() };
        let all = of_recording(settings, m, r).into_iter();
        notes.extend(all.map(|(trust, note)| (trust, format!("{which}{note}"))));
    }
    notes.extend(of_values(findings, base_is_estimate));
    let mut notes: Vec<_> = notes.into_iter().filter_map(|(trust, note)| Some((trust?, note))).collect();
    notes.sort_by_key(|(trust, _)| *trust);
    findings.trust = notes.first().map_or(Trust::Good, |(trust, _)| *trust);
    findings.notes = notes.into_iter().map(|(_, note)| note).collect();
}

fn of_recording(settings: &IdentifySettings, m: &Measurement, r: &Recording<'_>) -> Vec<Note> {
    let (coherence, (from, to)) = (m.coherence, m.band_hz);
    let follows = if coherence < 0.3 {
        let note = "the acceleration does not follow the drive: check the accelerometer's channel, and \
                    whether the actuator moves";
        (Some(Trust::Poor), format!("{note} (coherence {coherence:.2})"))
    } else {
        let note = "much of the acceleration does not follow the drive";
        (least(coherence, COHERENCE), format!("{note} (coherence {coherence:.2})"))
    };
    let noisy = format!(
        "the recording is noisy ({:.0} dB signal to noise, {:.0} dB would be good): use a stronger drive, a \
         longer sweep, or a quieter place",
        m.snr_db, SNR_DB.0
    );
    let outside = format!(
        "the resonance lies outside of the frequencies that were excited ({from:.0} to {to:.0} Hz), or there \
         is none: is the input connected to the drive itself?"
    );
    let odd = format!(
        "the actuator does not behave like a mass on a spring: {:.0} % of its response remain unexplained",
        100.0 * m.misfit
    );
    let distortion = m.distortion.unwrap_or(0.0);
    let bent =
        format!("{:.0} % harmonic distortion: the drive is too strong for a linear fit", 100.0 * distortion);
    let inverted = "the polarity is inverted: coil or accelerometer point the other way (the figures hold)";
    // Gains of several recordings must match the masses of their handles.
    let (grams, given) = (1e3 * m.handle_mass, r.handle_mass_g);
    let off = (grams / given).log_e().abs() / settings.handle_mass_uncertainty.log_1_plus();
    let weighed = format!(
        "the handle moves as if it weighed {grams:.1} g, not {given} g: was its mass changed between the \
         recordings, and are the given masses right?"
    );
    // Behind a voltage the back-EMF may hide the suspension's damping.
    let damping = if settings.drive == Drive::Current { m.damping_ratio.relative() } else { 0.0 };
    let clips = "the input clips: lower its gain or the drive, and record again";
    let within = (1.2 * from..to / 1.5).contains(&m.natural_hz.value);
    vec![
        follows,
        (least(m.snr_db, SNR_DB), noisy),
        (is_clipped(r.acceleration).then_some(Trust::Poor), clips.into()),
        ((!within).then_some(Trust::Poor), outside),
        (most(m.misfit, MISFIT), odd),
        (most(distortion, DISTORTION), bent),
        (most(m.natural_hz.relative(), WITHIN), known("resonance", m.natural_hz)),
        (most(damping, WITHIN), known("damping ratio", m.damping_ratio)),
        (most(m.gain.relative(), WITHIN), known("gain", m.gain)),
        (m.inverted.then_some(Trust::Good), inverted.into()),
        (r.limited.then_some(Trust::Good), "the limiter acted; the fit uses the drive behind it".into()),
        (most(off, MASS_OFF), weighed),
    ]
}

/// Says how uncertain a value is, or how to determine it.
fn known(what: &str, value: Estimate) -> String {
    if value.is_determined() {
        return format!("the {what} is known within {:.0} % only", 100.0 * value.relative());
    }
    let better = match what {
        "damping" | "damping ratio" => {
            "use a stronger drive, a longer sweep, or a current amplifier, which does not damp the coil"
        }
        "moving mass" => "use handles whose masses are farther apart",
        _ => {
            "use a stronger drive, a longer sweep, or one that reaches farther to both sides of the resonance"
        }
    };
    format!("the {what} is not determined by this measurement: {better}")
}

fn of_values(f: &Findings, base_is_estimate: bool) -> Vec<Note> {
    let why = match f.recordings.len() {
        1 => "one recording cannot tell",
        _ => "the handles are too much alike to tell",
    };
    let (trust, is) = match base_is_estimate {
        true => (Trust::Fair, "an estimate there"),
        false => (Trust::Good, "a published figure there"),
    };
    let assumed = format!(
        "{why} the moving mass; it is the base profile's, {is}, and stiffness and damping are only as good. \
         Record again with a weight of a few moving masses added to the handle, or taken from it"
    );
    let values = [
        ("moving mass", f.moving_mass),
        ("stiffness", f.stiffness),
        ("damping", f.damping),
        ("force factor", f.force_factor),
    ];
    let uncertain = values.map(|(what, it)| (most(it.relative(), WITHIN_ABSOLUTE), known(what, it)));
    [((!f.moving_mass_measured).then_some(trust), assumed)].into_iter().chain(uncertain).collect()
}
