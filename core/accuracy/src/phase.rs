//! Agreement of a signal with magnitude frames.
//!
//! The vectors in `tests/data/phase` have periodic Hann windows of 0.1 s, frames 2 ms apart, and magnitudes
//! of the unscaled DFT of `w x`, bin 0 first. Spectral convergence is that of D. Griffin and J. Lim (IEEE
//! Trans. ASSP 32(2), 1984) in dB, `20 log10(|| |STFT(y)| - S || / || S ||)`. 0 dB is silence, -5.7 dB a
//! Gaussian noise against its own mean magnitudes.

use asperity_dsp::{Framing, Stft};
use std::ops::Range;

/// Frames at each end that do not count, where a stream fades in or out.
pub const EDGE_FRAMES: usize = 50;

/// Agreement of a signal with magnitude frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Score {
    /// Spectral convergence in dB; lower is better.
    pub convergence_db: f64,
    /// Energy of the signal's bins over that of the magnitudes, in dB.
    pub gain_db: f64,
    /// RMS error of the long-term average spectrum, over bins within 40 dB of its top \[dB\].
    pub ltas_rms_db: f64,
    /// Energy in bins above those of the magnitudes, over their energy \[dB\]; none without such bins.
    pub out_of_band_db: Option<f64>,
    /// Samples that are NaN or infinite (counted as 0 in all other figures): any is a failure.
    pub nonfinite: usize,
    /// Largest absolute sample.
    pub peak: f64,
}

/// Why there is no score.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ScoreError {
    /// No bins, too many bins for the transform, or magnitudes that are not a multiple of the bins.
    #[error("the number of bins does not fit the transform or the magnitudes")]
    Shape,
    /// Not more than twice [`EDGE_FRAMES`].
    #[error("there are not more than 100 frames")]
    TooFewFrames,
    /// The magnitudes are all 0, or one is not finite.
    #[error("the magnitudes are all 0, or not all finite")]
    Magnitudes,
}

/// The convention's layout at a sample rate: windows of 0.1 s, 500 frames a second.
pub fn framing(rate_hz: u32, bins: usize) -> Framing {
    let fft_len = (f64::from(rate_hz) * 0.1).round() as usize;
    Framing { rate_hz, fft_len, bins, frame_num: 500, frame_den: 1 }
}

/// Unscaled DFT magnitudes of `frames` frames of a signal, frame by frame; samples beyond its end are 0.
pub fn magnitudes(signal: &[f64], framing: &Framing, frames: usize) -> Vec<f64> {
    let mut all = Vec::with_capacity(frames.saturating_mul(framing.bins));
    each_frame(signal, framing, 0..frames, |_, bins| {
        all.extend(bins.iter().take(framing.bins));
    });
    all
}

fn each_frame(signal: &[f64], framing: &Framing, frames: Range<usize>, mut f: impl FnMut(usize, &[f64])) {
    let mut stft = Stft::<f64>::new(framing.fft_len);
    for n in frames {
        let start = usize::try_from(framing.start(n as u64)).unwrap_or(usize::MAX).min(signal.len());
        let end = start.saturating_add(framing.fft_len).min(signal.len());
        let bins = stft.process(&signal[start..end]).iter().map(|c| c.norm() * framing.bin_scale());
        f(n, &bins.collect::<Vec<f64>>());
    }
}

/// Compares a signal with magnitudes `[frames, framing.bins]`; sample 0 is the first of frame 0.
pub fn score(magnitudes: &[f32], framing: &Framing, signal: &[f64]) -> Result<Score, ScoreError> {
    let bins = framing.bins;
    if framing.check().is_err() || !magnitudes.len().is_multiple_of(bins) {
        return Err(ScoreError::Shape);
    }
    let frames = magnitudes.len() / bins;
    if frames <= 2 * EDGE_FRAMES {
        return Err(ScoreError::TooFewFrames);
    }
    let nonfinite = signal.iter().filter(|x| !x.is_finite()).count();
    let signal: Vec<f64> = signal.iter().map(|&x| if x.is_finite() { x } else { 0.0 }).collect();

    let (mut error, mut want, mut have, mut above) = (0.0, 0.0, 0.0, 0.0);
    let (mut want_bins, mut have_bins) = (vec![0.0; bins], vec![0.0; bins]);
    each_frame(&signal, framing, EDGE_FRAMES..frames - EDGE_FRAMES, |n, y| {
        let (inside, outside) = y.split_at(bins.min(y.len()));
        let row = magnitudes.iter().skip(n * bins);
        for (k, (y, s)) in inside.iter().zip(row).enumerate() {
            let s = f64::from(*s);
            error += (y - s) * (y - s);
            want += s * s;
            have += y * y;
            want_bins[k] += s * s;
            have_bins[k] += y * y;
        }
        above += outside.iter().map(|y| y * y).sum::<f64>();
    });
    if !want.is_finite() || want <= 0.0 {
        return Err(ScoreError::Magnitudes);
    }

    let top: f64 = want_bins.iter().copied().fold(0.0, f64::max);
    let errors = want_bins.iter().zip(&have_bins).filter(|&(&w, _)| w > top * 1e-4).map(|(&w, &h)| {
        let db = 10.0 * (h.max(top * 1e-24) / w).log10();
        db * db
    });
    let (sum, count) = errors.fold((0.0, 0.0), |(sum, count), e| (sum + e, count + 1.0));
    let ratio_db = |power: f64| 10.0 * (power / want).max(1e-30).log10();
    Ok(Score {
        convergence_db: ratio_db(error),
        gain_db: ratio_db(have),
        ltas_rms_db: (sum / count).sqrt(),
        out_of_band_db: (bins < framing.fft_len / 2 + 1).then(|| ratio_db(above)),
        nonfinite,
        peak: signal.iter().fold(0.0, |a, x| a.max(x.abs())),
    })
}
