//! Figures of long-term powers of bins: level, spectrum, bands.

use super::spectrogram::bin_hz;
use super::{LIMIT_DB, SILENCE_M_S2};

/// Range below the truth's loudest bin, or band, that counts \[dB\].
const RANGE_DB: f64 = 40.0;
pub(super) const BANDS: usize = 9;
/// First and last edge of the bands in Hz.
const EDGES_HZ: (f64, f64) = (20.0, 1000.0);

/// Whether powers in (m/s^2)^2 add up to [silence](SILENCE_M_S2).
pub(super) fn silent(powers: &[f64]) -> bool {
    powers.iter().sum::<f64>() < SILENCE_M_S2 * SILENCE_M_S2
}

/// A ratio of powers in dB, within [`LIMIT_DB`]; 0 over 0 is 0 dB.
pub(super) fn ratio_db(rendered: f64, truth: f64) -> f64 {
    match (rendered > 0.0, truth > 0.0) {
        (false, false) => 0.0,
        (false, true) => -LIMIT_DB,
        (true, false) => LIMIT_DB,
        (true, true) => (10.0 * (rendered.log10() - truth.log10())).clamp(-LIMIT_DB, LIMIT_DB),
    }
}

/// Error of the level \[dB\], from long-term powers of bins: `10 log10 (sum P_rendered / sum P_truth)`, the
/// ratio of root mean squares over 20 to 1000 Hz. Within [`LIMIT_DB`]; 0 of two silent signals.
pub(super) fn level_db(rendered: &[f64], truth: &[f64]) -> f64 {
    match (silent(rendered), silent(truth)) {
        (true, true) => 0.0,
        (true, false) => -LIMIT_DB,
        (false, true) => LIMIT_DB,
        (false, false) => ratio_db(rendered.iter().sum(), truth.iter().sum()),
    }
}

/// Error of the long-term average spectrum \[dB\], from long-term powers of bins, 0 to [`LIMIT_DB`].
///
/// The root mean square of `10 log10 (P_rendered / P_truth)` over the bins in which the truth is within
/// [`RANGE_DB`] of its loudest. This is the log-spectral distance of A. H. Gray and J. D. Markel
/// (IEEE Trans. ASSP 24(5), 1976) between Welch's averages.
pub(super) fn spectrum_db(rendered: &[f64], truth: &[f64]) -> f64 {
    if silent(rendered) || silent(truth) {
        return level_db(rendered, truth).abs();
    }
    let least = truth.iter().copied().fold(0.0, f64::max) * 10f64.powf(-0.1 * RANGE_DB);
    let pairs = rendered.iter().zip(truth).filter(|(_, t)| **t >= least);
    mean(pairs.map(|(r, t)| ratio_db(*r, *t).powi(2))).sqrt()
}

/// The mean; 0 of nothing.
pub(super) fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), v| (sum + v, count + 1.0));
    if count > 0.0 { sum / count } else { 0.0 }
}

/// Edges of the bands \[Hz\]: 20, 30.9, 47.7, 73.7, 113.8, 175.7, 271.4, 419.2, 647.4, 1000.
///
/// The energies of nine bands predicted best how real virtual textures felt (Balasubramanian and Vardar 2026,
/// "Perceptually lossless tactile texture synthesis with compact spectral envelope models", arXiv
/// 2605.23804). The paper does not say where its bands end; these have equal ratios, `50^(1/9)` = 1.54.
fn band_edges_hz() -> [f64; BANDS + 1] {
    let (first, last) = EDGES_HZ;
    std::array::from_fn(|edge| first * (last / first).powf(edge as f64 / BANDS as f64))
}

/// The band that a bin's frequency lies in.
fn band(bin: usize) -> usize {
    let (first, last) = EDGES_HZ;
    let place = BANDS as f64 * (bin_hz(bin) / first).ln() / (last / first).ln();
    // 1000 Hz, the end of the last, is in it.
    ((place + 1e-9) as usize).min(BANDS - 1)
}

/// Energies of the bands in (m/s^2)^2, of powers of bins: the sums of the bins whose frequency lies in them.
fn band_powers(powers: &[f64]) -> [f64; BANDS] {
    let mut sums = [0.0; BANDS];
    for (bin, power) in powers.iter().enumerate() {
        if let Some(sum) = sums.get_mut(band(bin)) {
            *sum += power;
        }
    }
    sums
}

/// Error of the energy of each band \[dB\], from long-term powers of bins: `10 log10 (E_rendered / E_truth)`.
///
/// An energy more than [`RANGE_DB`] below the truth's loudest band counts as that. So unfelt energy is
/// no error, and energy where the truth has none is one. None for a band that the bins do not cover. Within
/// [`LIMIT_DB`].
pub(super) fn bands_db(rendered: &[f64], truth: &[f64]) -> [Option<f64>; BANDS] {
    let (r, t, edges) = (band_powers(rendered), band_powers(truth), band_edges_hz());
    let known = rendered.len().min(truth.len());
    let least = t.iter().copied().fold(0.0, f64::max) * 10f64.powf(-0.1 * RANGE_DB);
    let one_silent = silent(rendered) || silent(truth);
    std::array::from_fn(|band| {
        // The next bin lies beyond its end.
        let whole = edges.get(band + 1).is_some_and(|end| bin_hz(known) >= end - 1e-9);
        whole.then(|| match one_silent {
            true => level_db(rendered, truth),
            false => ratio_db(r[band].max(least), t[band].max(least)).clamp(-LIMIT_DB, LIMIT_DB),
        })
    })
}

/// Root mean square of the bands' errors in dB; 0 of none.
pub(super) fn band_rms_db(bands: &[Option<f64>; BANDS]) -> f64 {
    mean(bands.iter().flatten().map(|e| e * e)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::super::BINS;
    use super::*;

    #[test]
    fn scaled_copy_differs_by_its_gain_only() {
        let truth: Vec<f64> = (1..=99).map(|k| 1.0 / f64::from(k)).collect();
        let half: Vec<f64> = truth.iter().map(|p| 0.25 * p).collect();
        let six = 20.0 * 2f64.log10();
        for (a, b, level) in [(&half, &truth, -six), (&truth, &half, six), (&truth, &truth, 0.0)] {
            assert!((level_db(a, b) - level).abs() < 1e-12, "{level}");
            assert!((spectrum_db(a, b) - level.abs()).abs() < 1e-12, "{level}");
        }
    }

    #[test]
    fn bins_40_db_below_the_loudest_do_not_count() {
        // The third bin is 50 dB below the loudest and does not count, however wrong it is.
        let (truth, rendered) = ([1.0, 0.1, 1e-5], [10.0, 0.1, 1.0]);
        assert!((spectrum_db(&rendered, &truth) - 50f64.sqrt()).abs() < 1e-12);
        assert!((level_db(&rendered, &truth) - 10.0 * (11.1_f64 / 1.10001).log10()).abs() < 1e-12);
        // At 40 dB it does: (10^2 + 0 + 40^2) / 3.
        let truth = [1.0, 0.1, 1e-4];
        assert!((spectrum_db(&rendered, &truth) - (1700.0_f64 / 3.0).sqrt()).abs() < 1e-9);
    }

    #[test]
    fn silence_has_defined_errors() {
        let (nothing, something) = ([0.0; BINS], [1.0; BINS]);
        for (rendered, truth, level) in
            [(nothing, nothing, 0.0), (nothing, something, -LIMIT_DB), (something, nothing, LIMIT_DB)]
        {
            assert_eq!((level_db(&rendered, &truth), spectrum_db(&rendered, &truth)), (level, level.abs()));
            assert_eq!(bands_db(&rendered, &truth), [Some(level); BANDS]);
        }
        let mut one = [1.0; 9];
        one[0] = 0.0;
        assert!((spectrum_db(&one, &[1.0; 9]) - LIMIT_DB / 3.0).abs() < 1e-9);
        assert_eq!(level_db(&[1e300; 9], &[1e-11; 9]), LIMIT_DB);
    }

    #[test]
    fn bins_lie_in_nine_bands_of_equal_ratio() {
        let edges = band_edges_hz();
        assert!(edges[0] == 20.0 && (edges[9] - 1000.0).abs() < 1e-9);
        assert!(edges.windows(2).all(|e| (e[1] / e[0] - 50f64.powf(1.0 / 9.0)).abs() < 1e-12));
        // 20 30 | 40 | 50 60 70 | 80 .. 110 | 120 .. 170 | 180 .. 270 | 280 .. 410 | 420 .. 640 | 650 .. 1000
        assert_eq!(band_powers(&[1.0; BINS]), [2.0, 1.0, 3.0, 4.0, 6.0, 10.0, 14.0, 23.0, 36.0]);
    }

    #[test]
    fn one_band_off_by_3_db_is_1_db_in_all() {
        let truth = [1.0; BINS];
        let mut rendered = truth;
        (33 - 7..40).for_each(|bin| rendered[bin] *= 10f64.powf(0.3));
        let errors = bands_db(&rendered, &truth).map(Option::unwrap);
        for (band, error) in errors.into_iter().enumerate() {
            assert!((error - if band == 6 { 3.0 } else { 0.0 }).abs() < 1e-12, "{band}: {error}");
        }
        assert!((band_rms_db(&errors.map(Some)) - 1.0).abs() < 1e-12);
        let quiet = rendered.map(|p| 0.01 * p);
        assert!((band_rms_db(&bands_db(&quiet, &rendered)) - 20.0).abs() < 1e-12);
    }

    #[test]
    fn quiet_bands_count_as_40_db_below_the_loudest() {
        let (mut truth, mut rendered) = ([0.0; BINS], [0.0; BINS]);
        (truth[20], rendered[20]) = (1.0, 1.0);
        (truth[60], rendered[60]) = (1e-7, 0.0);
        assert_eq!(band_rms_db(&bands_db(&rendered, &truth)), 0.0);
        rendered[60] = 1e-2;
        assert!((bands_db(&rendered, &truth)[7].unwrap() - 20.0).abs() < 1e-9);
        truth[60] = 1e-1;
        rendered[60] = 0.0;
        assert!((bands_db(&rendered, &truth)[7].unwrap() + 30.0).abs() < 1e-9);
    }

    #[test]
    fn bands_beyond_half_the_rate_are_unknown() {
        // At 1 kHz the last bin is 490 Hz.
        let known = bands_db(&[1.0; 48], &[1.0; 48]);
        assert_eq!(known.map(|b| b.is_some()), [true, true, true, true, true, true, true, false, false]);
        assert_eq!(band_rms_db(&bands_db(&[], &[])), 0.0);
    }
}
