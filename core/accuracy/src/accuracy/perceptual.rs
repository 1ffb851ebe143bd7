use std::f64::consts::TAU;

use super::spectrogram::{BINS, Spectrogram, bin_hz};

/// Frames of a segment: 0.575 s of signal.
const SEGMENT_FRAMES: usize = 20;
/// Deviation in dB of the psychometric function.
const SUPPORT_DB: f64 = 12.0;

/// Threshold at 250 Hz, the least, in micrometres of displacement. Chosen.
const LEAST_UM: f64 = 0.03;
/// How far the threshold rises from 250 to 0 Hz, in dB.
const RISE_DB: f64 = 62.0;
/// `log10(f / 550 + 6 / 11)` is 0 at 250 Hz.
const CURVE: (f64, f64) = (1.0 / 550.0, 6.0 / 11.0);
/// Largest rise of the threshold over its minimum \[dB\].
const MOST_DB: f64 = 77.0;
/// Distance of a mask below its peak at 0 Hz \[dB\], and the frequency where it reaches the peak \[Hz\].
const MASK: (f64, f64) = (5.0, 1400.0);
/// Fall of a mask at 0 Hz and at twice its peak's frequency \[dB\].
const MASK_FALL_DB: f64 = 30.0;
/// A masking peak: least prominence, and largest distance below the loudest felt bin \[dB\].
const PEAK_DB: (f64, f64) = (12.0, 45.0);
/// Support of a bin 24 dB below the threshold: Phi(-2).
const LITTLE: f64 = 0.022_750_13;

/// How alike two signals feel by their spectra, 0 to 1; 1 is no perceptible difference.
///
/// This is the spectral part of ST-SIM (R. Hassen and E. Steinbach, IEEE Trans. Haptics 13(1), 2020), with
/// the threshold curve and masks of VC-PWQ (A. Noll, B. Gulecyuz, A. Hofmann, E. Steinbach, IEEE Haptics
/// Symposium 2020; IEEE 1918.1.1). `docs/explanation/accuracy.md` has the formulas,
/// and the differences from the papers.
///
/// Frames that only one signal has do not count, nor bins from half the truth's rate on. 1 without frames.
pub(super) fn perceptual(rendered: &Spectrogram, truth: &Spectrogram) -> f64 {
    let frames = rendered.frames().min(truth.frames());
    let length = SEGMENT_FRAMES.min(frames);
    let segments = frames - length + 1;
    let bins = truth.bins();
    let (mut both, mut of_rendered, mut of_truth) = (0.0, 0.0, 0.0);
    let absolute: [f64; BINS] = std::array::from_fn(|bin| threshold_m_s2(bin_hz(bin)).powi(2));
    let masks = [rendered, truth].map(|signal| masks(signal, frames));
    for from in 0..segments {
        let part = from..from + length;
        let [r, t] = [rendered, truth].map(|signal| signal.mean(part.clone()));
        let [mask_r, mask_t] =
            masks.each_ref().map(|masks| mean(masks.get(part.clone()).unwrap_or_default()));
        for bin in 0..bins {
            let threshold = absolute[bin] + mask_r[bin].max(mask_t[bin]);
            let [r, t] = [r[bin], t[bin]].map(|power| support(3.0 * power, threshold));
            both += r * t;
            of_rendered += r * r;
            of_truth += t * t;
        }
    }
    let little = (segments * bins) as f64 * LITTLE * LITTLE;
    let most = f64::max(of_rendered, of_truth) + little;
    if most > 0.0 { ((both + little) / most).clamp(0.0, 1.0) } else { 1.0 }
}

/// Smallest amplitude \[m/s^2\] at which a sine of a frequency \[Hz\] is felt: the codec's curve, taken for a
/// displacement and set to 0.03 um at 250 Hz (A. J. Brisben, S. S. Hsiao, K. O. Johnson, J. Neurophysiology
/// 81(4), 1999). Of the two rises in versions of the codec, 62 and 50 dB, this is the later.
fn threshold_m_s2(hz: f64) -> f64 {
    let (per_hz, at_0) = CURVE;
    let rise = RISE_DB * ((per_hz * hz.max(0.0) + at_0).log10() / at_0.log10()).powi(2);
    let um = LEAST_UM * 10f64.powf(rise.min(MOST_DB) / 20.0);
    1e-6 * um * (TAU * hz).powi(2)
}

/// How strong a signal feels by its mean powers, in dB: 0 is the threshold of feeling. Each bin counts by its
/// distance above the threshold of its frequency, so that bins which are not felt count for little. A sine of
/// twice its threshold is 6 dB.
///
/// It takes the threshold of [`Agreement::perceptual`](super::Agreement::perceptual), without masks.
pub fn felt_db(powers: &[f64; BINS]) -> f64 {
    let over = |(bin, power): (usize, &f64)| 2.0 * power / threshold_m_s2(bin_hz(bin)).powi(2);
    db(powers.iter().enumerate().map(over).sum())
}

fn db(power: f64) -> f64 {
    10.0 * power.max(1e-300).log10()
}

/// Probability that a bin is felt, from the powers of signal and threshold in the same unit.
fn support(power: f64, threshold: f64) -> f64 {
    normal_cdf((db(power) - db(threshold)) / SUPPORT_DB)
}

/// The powers of each frame's mask, as squared amplitudes.
fn masks(signal: &Spectrogram, frames: usize) -> Vec<[f64; BINS]> {
    (0..frames).filter_map(|frame| signal.frame(frame)).map(|powers| mask(powers, signal.bins())).collect()
}

/// Power of a frame's mask. Bins below the absolute threshold mask nothing.
fn mask(powers: &[f64; BINS], known: usize) -> [f64; BINS] {
    // Squared amplitudes of sines.
    let levels: Vec<f64> = powers.iter().take(known).map(|p| db(3.0 * p)).collect();
    let felt = |bin: usize, level: f64| level >= db(threshold_m_s2(bin_hz(bin)).powi(2));
    let loudest = levels.iter().enumerate().filter(|(bin, level)| felt(*bin, **level));
    let loudest = loudest.map(|(_, level)| *level).fold(f64::NEG_INFINITY, f64::max);
    let mut mask = [f64::NEG_INFINITY; BINS];
    for peak in peaks(&levels) {
        let (hz, level) = (bin_hz(peak), levels[peak]);
        if !felt(peak, level) || level < loudest - PEAK_DB.1 {
            continue;
        }
        for (bin, mask) in mask.iter_mut().enumerate() {
            let away = (bin_hz(bin) - hz) / hz;
            *mask = mask.max(level - MASK.0 + MASK.0 / MASK.1 * hz - MASK_FALL_DB * away * away);
        }
    }
    mask.map(|db| 10f64.powf(0.1 * db))
}

/// The means of frames, bin by bin; 0 of none.
pub(super) fn mean(frames: &[[f64; BINS]]) -> [f64; BINS] {
    let mut sums = [0.0; BINS];
    for frame in frames {
        sums.iter_mut().zip(frame).for_each(|(sum, x)| *sum += x);
    }
    sums.map(|sum| sum / frames.len().max(1) as f64)
}

/// Indices of peaks of levels in dB: higher than both neighbours, with a prominence of 12 dB. The prominence
/// is the height over the higher of the two valleys, each up to the next higher level or the end.
fn peaks(levels: &[f64]) -> Vec<usize> {
    // Of silence the levels are all alike, and there is none.
    let base = |peak: f64, side: &mut dyn Iterator<Item = &f64>| {
        side.take_while(|level| **level <= peak).copied().fold(peak, f64::min)
    };
    let is_peak = |at: &usize| {
        let (left, here, right) = (&levels[..*at], levels[*at], &levels[at + 1..]);
        let higher = left.last().is_some_and(|l| *l < here) && right.first().is_some_and(|r| *r < here);
        let bases = [base(here, &mut left.iter().rev()), base(here, &mut right.iter())];
        higher && here - bases[0].max(bases[1]) >= PEAK_DB.0
    };
    (0..levels.len()).filter(is_peak).collect()
}

/// Cumulative normal distribution, to 7.5e-8 (Abramowitz and Stegun, "Handbook of mathematical functions",
/// 26.2.17).
fn normal_cdf(x: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.231_641_9 * x.abs());
    let sum = [0.319_381_530, -0.356_563_782, 1.781_477_937, -1.821_255_978, 1.330_274_429]
        .into_iter()
        .rev()
        .fold(0.0, |sum, b| t * (b + sum));
    let above = sum * (-0.5 * x * x).exp() / TAU.sqrt();
    if x < 0.0 { above } else { 1.0 - above }
}

#[cfg(test)]
#[path = "perceptual_tests.rs"]
mod tests;
