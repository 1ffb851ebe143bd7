//! Agreement of a rendered acceleration with that of a real tool along the same stroke. The figures are
//! never combined into one.
//!
//! A texture's waveform is a draw: two strokes over two places of one surface share no sample. They share the
//! power of each frequency at each moment, so the figures compare spectra over 20 to 1000 Hz
//! ([`Spectrogram`]). Only [`waveform_db`] compares samples, of two runs of one setting.
//! `docs/explanation/accuracy.md` explains the figures.
//!
//! # Silence
//!
//! A signal below [`SILENCE_M_S2`] (root mean square, 20 to 1000 Hz) is silent. Two silent signals agree in
//! all figures. Where only one is silent, the errors of level, spectrum and bands are [`LIMIT_DB`] (or the
//! bound of the figure).

mod long_term;
mod perceptual;
pub mod rhythm;
mod spectrogram;
#[cfg(test)]
pub(crate) mod testing;

use long_term::{BANDS, band_rms_db, bands_db, level_db, spectrum_db};
pub use perceptual::felt_db;
use perceptual::perceptual;
pub use rhythm::{Rhythm, RhythmAgreement};
use spectrogram::MIN_FRAMES;
pub use spectrogram::{BINS, FIRST_HZ, HOP_S, STEP_HZ, Spectrogram, WINDOW_S};

/// Largest error \[dB\], of either sign: that of silence.
pub const LIMIT_DB: f64 = 120.0;

/// Root mean square in m/s^2 below which a signal is silent.
pub const SILENCE_M_S2: f64 = 1e-6;

/// Agreement of a rendered acceleration with the truth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Agreement {
    /// Root mean square over 20 to 1000 Hz over the truth's; 0 is right, above 0 is too loud.
    pub level_db: f64,
    /// Root mean square error of the long-term spectrum; 0 is right.
    pub spectrum_db: f64,
    /// Root mean square error of the energies of nine bands; 0 is right.
    pub bands_db: f64,
    /// The error of each band; none above half of the truth's rate.
    pub bands: [Option<f64>; BANDS],
    /// 0 to 1; 1 is no perceptible difference.
    pub perceptual: f64,
}

/// Why there is no figure.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AccuracyError {
    /// A rate in Hz that is not 100 to 1e6.
    #[error("a rate of {0} Hz is not 100 to 1000000")]
    Rate(f64),
    /// A signal without an axis, or no truth.
    #[error("no signal, or one without an axis")]
    NoAxes,
    /// A sample that is not finite or beyond 1e100, by its number.
    #[error("sample {0} is not finite")]
    NotFinite(usize),
    /// Less than 0.5 s that both signals have.
    #[error("less than 0.5 s to compare")]
    TooShort,
    /// Two signals of different lengths, where the same samples are compared.
    #[error("{0} and {1} samples")]
    Lengths(usize, usize),
}

/// All figures of a spectrogram against several draws of one truth, such as one stroke over several places of
/// a surface. The powers of the truth's axes add, since one signal has to carry the vibration of three
/// (Landin, Romano, McMahan, Kuchenbecker 2010).
///
/// Sample 0 of all signals is the same moment. The longer signal's end does not count, nor do frequencies
/// from half the truth's rate on. The rendered signal has no power from half its own rate on.
/// The truth is their mean power; `perceptual` is the mean over the draws, since masks are those
/// of one draw.
///
/// # Errors
/// [`AccuracyError::TooShort`], [`AccuracyError::NoAxes`] without a truth.
pub fn compare(rendered: &Spectrogram, truths: &[Spectrogram]) -> Result<Agreement, AccuracyError> {
    let shortest = truths.iter().map(Spectrogram::frames).min().ok_or(AccuracyError::NoAxes)?;
    let frames = rendered.frames().min(shortest);
    if frames < MIN_FRAMES {
        return Err(AccuracyError::TooShort);
    }
    let known = truths.iter().map(Spectrogram::bins).min().unwrap_or(BINS);
    let mut truth = [0.0; BINS];
    for one in truths {
        let part = one.mean(0..frames);
        truth.iter_mut().zip(part).for_each(|(sum, power)| *sum += power / truths.len() as f64);
    }
    let rendered_powers = rendered.mean(0..frames);
    let (r, t) = (rendered_powers.get(..known).unwrap_or(&[]), truth.get(..known).unwrap_or(&[]));
    let bands = bands_db(r, t);
    Ok(Agreement {
        level_db: level_db(r, t),
        spectrum_db: spectrum_db(r, t),
        bands_db: band_rms_db(&bands),
        bands,
        perceptual: long_term::mean(truths.iter().map(|truth| perceptual(rendered, truth))),
    })
}

/// Error of identical signals \[dB\]; its negative is that of any signal against a reference of zeros.
const EXACT_DB: f64 = -300.0;

/// Error of a waveform against a reference of the same setting, sample by sample: the noise-to-signal ratio
/// `20 log10 (|| y - r || / || r ||)` \[dB\].
///
/// 0 dB is silence; 3 dB is an independent signal of the same level; -6 dB is half or one and a half times
/// the amplitude. Within -300 and 300 dB.
///
/// # Errors
/// [`AccuracyError::Lengths`], [`AccuracyError::NotFinite`].
pub fn waveform_db(rendered: &[f64], reference: &[f64]) -> Result<f64, AccuracyError> {
    if rendered.len() != reference.len() {
        return Err(AccuracyError::Lengths(rendered.len(), reference.len()));
    }
    let bad = |(y, r): (&f64, &f64)| !(y.abs() <= 1e100 && r.abs() <= 1e100);
    if let Some(at) = rendered.iter().zip(reference).position(bad) {
        return Err(AccuracyError::NotFinite(at));
    }
    // Brought to a peak of 1, so that squares of what is small do not vanish.
    let peak = reference.iter().fold(0.0, |peak: f64, r| peak.max(r.abs()));
    let scale = if peak > 0.0 { peak } else { 1.0 };
    let (mut error, mut whole) = (0.0, 0.0);
    for (y, r) in rendered.iter().zip(reference) {
        error += ((y - r) / scale).powi(2);
        whole += (r / scale).powi(2);
    }
    Ok(match (error > 0.0, whole > 0.0) {
        (false, _) => EXACT_DB,
        (true, false) => -EXACT_DB,
        (true, true) => (10.0 * (error / whole).log10()).clamp(EXACT_DB, -EXACT_DB),
    })
}

#[cfg(test)]
mod tests;
