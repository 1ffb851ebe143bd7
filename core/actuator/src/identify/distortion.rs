//! Harmonic distortion of a sweep, by deconvolution.

use asperity_dsp::plans;
use asperity_numbers::Elementary as _;
use realfft::num_complex::Complex64;

use super::Recording;
use super::spectra::{fast_len, transform};

/// Harmonics from the second to this one.
const HARMONICS: u32 = 5;
/// A response begins this long before its time \[s\].
const EARLY: f64 = 0.004;

/// Amplitude of the second to fifth harmonics over that of the linear response, up to `highest_hz`.
///
/// An exponential sweep's acceleration divided by the drive's spectrum is the impulse response. The
/// k-th harmonic's stands L ln(k) before it (Farina 2000). The time before the highest harmonic tells
/// the noise, which is subtracted.
pub(super) fn distortion(recording: &Recording<'_>, highest_hz: f64, latency: f64) -> Option<f64> {
    let constant = recording.sweep_time_constant_s?;
    let rate = recording.rate_hz;
    let count = recording.drive.len().min(recording.acceleration.len());
    let len = fast_len(count);
    let drive = transform(&recording.drive[..count], 0.0, len);
    let mut response = transform(&recording.acceleration[..count], 0.0, len);
    let strongest = drive.iter().map(Complex64::norm_sqr).fold(0.0, f64::max);
    for (n, (y, x)) in response.iter_mut().zip(&drive).enumerate() {
        let hz = n as f64 * rate / len as f64;
        // A soft edge makes the impulse short.
        let edge = super::raised_cosine((highest_hz - hz).max(0.0), 0.2 * highest_hz);
        *y = *y * x.conj() * edge / (x.norm_sqr() + 1e-5 * strongest);
    }
    response[0] = Complex64::default();
    if let Some(last) = response.last_mut() {
        *last = Complex64::default();
    }
    let impulse = plans::signal(response, len);
    let lead = |k: u32| constant * f64::from(k).log_e();
    let length = (lead(HARMONICS + 1) - lead(HARMONICS)).min(0.2);
    let energy = |from: f64| {
        let first = ((from - EARLY) * rate).round() as i64;
        let all = first..first + (length * rate) as i64;
        all.map(|n| impulse[n.rem_euclid(len as i64) as usize].powi(2)).sum::<f64>()
    };
    if length * rate < 8.0 || lead(HARMONICS + 3) > 0.5 * len as f64 / rate {
        return None;
    }
    let noise = energy(latency - lead(HARMONICS + 2)).min(energy(latency - lead(HARMONICS + 3)));
    let harmonics: f64 = (2..=HARMONICS).map(|k| (energy(latency - lead(k)) - noise).max(0.0)).sum();
    let linear = energy(latency);
    (linear > 0.0).then(|| (harmonics / linear).sqrt())
}
