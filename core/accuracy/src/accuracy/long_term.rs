use super::{LIMIT_DB, SILENCE_M_S2};

/// How far below its loudest bin a bin of the truth counts, in dB.
pub const SPECTRUM_RANGE_DB: f64 = 40.0;

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
pub fn level_db(rendered: &[f64], truth: &[f64]) -> f64 {
    match (silent(rendered), silent(truth)) {
        (true, true) => 0.0,
        (true, false) => -LIMIT_DB,
        (false, true) => LIMIT_DB,
        (false, false) => ratio_db(rendered.iter().sum(), truth.iter().sum()),
    }
}

/// Errors \[dB\] of the bins in which the truth is within [`SPECTRUM_RANGE_DB`] of its loudest; none where a
/// signal is silent.
fn errors(rendered: &[f64], truth: &[f64]) -> Option<Vec<f64>> {
    if silent(rendered) || silent(truth) {
        return None;
    }
    let least = truth.iter().copied().fold(0.0, f64::max) * 10f64.powf(-0.1 * SPECTRUM_RANGE_DB);
    let pairs = rendered.iter().zip(truth).filter(|(_, t)| **t >= least);
    Some(pairs.map(|(r, t)| ratio_db(*r, *t)).collect())
}

/// Error of the long-term average spectrum \[dB\], from long-term powers of bins, 0 to [`LIMIT_DB`].
///
/// The root mean square of `10 log10 (P_rendered / P_truth)` over the bins in which the truth is within
/// [`SPECTRUM_RANGE_DB`] of its loudest. This is the log-spectral distance of A. H. Gray and J. D. Markel
/// (IEEE Trans. ASSP 24(5), 1976) between Welch's averages.
pub fn spectrum_db(rendered: &[f64], truth: &[f64]) -> f64 {
    match errors(rendered, truth) {
        Some(errors) => mean(errors.iter().map(|e| e * e)).sqrt(),
        None => level_db(rendered, truth).abs(),
    }
}

/// Error of the spectrum's shape \[dB\]: the standard deviation of the errors in [`spectrum_db`].
/// `spectrum^2 = mean^2 + shape^2`.
pub fn shape_db(rendered: &[f64], truth: &[f64]) -> f64 {
    let Some(errors) = errors(rendered, truth) else { return 0.0 };
    let middle = mean(errors.iter().copied());
    mean(errors.iter().map(|e| (e - middle).powi(2))).sqrt()
}

/// The mean; 0 of nothing.
pub(super) fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), v| (sum + v, count + 1.0));
    if count > 0.0 { sum / count } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scaled_copy_differs_by_its_gain_only() {
        let truth: Vec<f64> = (1..=99).map(|k| 1.0 / f64::from(k)).collect();
        let half: Vec<f64> = truth.iter().map(|p| 0.25 * p).collect();
        let six = 20.0 * 2f64.log10();
        assert!((level_db(&half, &truth) + six).abs() < 1e-12);
        assert!((level_db(&truth, &half) - six).abs() < 1e-12);
        assert!((spectrum_db(&half, &truth) - six).abs() < 1e-12);
        assert!(shape_db(&half, &truth) < 1e-12);
        assert_eq!(
            [level_db(&truth, &truth), spectrum_db(&truth, &truth), shape_db(&truth, &truth)],
            [0.0; 3]
        );
    }

    #[test]
    fn spectrum_error_is_the_rms_and_shape_its_deviation() {
        // The third bin is 50 dB below the loudest and does not count, however wrong it is.
        let (truth, rendered) = ([1.0, 0.1, 1e-5], [10.0, 0.1, 1.0]);
        assert!((spectrum_db(&rendered, &truth) - 50f64.sqrt()).abs() < 1e-12);
        assert!((shape_db(&rendered, &truth) - 5.0).abs() < 1e-12);
        assert!((level_db(&rendered, &truth) - 10.0 * (11.1_f64 / 1.10001).log10()).abs() < 1e-12);
        // At 40 dB it does: (10^2 + 0 + 40^2) / 3.
        let truth = [1.0, 0.1, 1e-4];
        assert!((spectrum_db(&rendered, &truth) - (1700.0_f64 / 3.0).sqrt()).abs() < 1e-9);
    }

    #[test]
    fn silence_has_defined_errors() {
        let (nothing, something) = ([0.0; 9], [1.0; 9]);
        for (rendered, truth, level) in
            [(nothing, nothing, 0.0), (nothing, something, -LIMIT_DB), (something, nothing, LIMIT_DB)]
        {
            assert_eq!(level_db(&rendered, &truth), level);
            assert_eq!(spectrum_db(&rendered, &truth), level.abs());
            assert_eq!(shape_db(&rendered, &truth), 0.0);
        }
        let mut one = something;
        one[0] = 0.0;
        assert!((spectrum_db(&one, &something) - LIMIT_DB / 3.0).abs() < 1e-9);
        assert_eq!(level_db(&[1e300; 9], &[1e-11; 9]), LIMIT_DB);
    }
}
