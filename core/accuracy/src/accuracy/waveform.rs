use super::AccuracyError;

/// Error of identical signals \[dB\]; its negative is that of any signal against a reference of zeros.
pub const EXACT_DB: f64 = -300.0;

/// Error of a waveform against a reference of the same setting, sample by sample: the noise-to-signal ratio
/// `20 log10 (|| y - r || / || r ||)` \[dB\].
///
/// 0 dB is silence; 3 dB is an independent signal of the same level; -6 dB is half or one and a half times
/// the amplitude. Within [`EXACT_DB`] and its negative.
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
mod tests {
    use super::super::testing::noise;
    use super::*;

    #[test]
    fn scaled_copies_have_the_error_of_their_gain() {
        let r = noise(3, 4000, 0.7);
        let times = |gain: f64| -> Vec<f64> { r.iter().map(|x| gain * x).collect() };
        for (gain, db) in
            [(0.0, 0.0), (0.5, -6.0206), (1.5, -6.0206), (1.001, -60.0), (-1.0, 6.0206), (11.0, 20.0)]
        {
            assert!((waveform_db(&times(gain), &r).unwrap() - db).abs() < 1e-3, "{gain}");
        }
        // An independent draw of the same level.
        assert!((waveform_db(&noise(4, 4000, 0.7), &r).unwrap() - 3.01).abs() < 0.3);
        // Rounding to f32 is an error of 2^-25 at most, of each sample: uniform, 2^-26 or less on average.
        let rounded: Vec<f64> = r.iter().map(|x| f64::from(*x as f32)).collect();
        assert!((-157.0..-148.0).contains(&waveform_db(&rounded, &r).unwrap()));
    }

    #[test]
    fn equal_silent_and_invalid_signals_differ() {
        let (zero, tiny) = ([0.0; 5], [1e-200; 5]);
        assert_eq!(waveform_db(&zero, &zero), Ok(EXACT_DB));
        assert_eq!(waveform_db(&tiny, &tiny), Ok(EXACT_DB));
        assert_eq!(waveform_db(&[], &[]), Ok(EXACT_DB));
        assert!(waveform_db(&zero, &tiny).unwrap().abs() < 1e-9);
        assert_eq!(waveform_db(&[1.0; 5], &zero), Ok(-EXACT_DB));
        assert_eq!(waveform_db(&[1.0; 5], &[1.0; 4]), Err(AccuracyError::Lengths(5, 4)));
        assert_eq!(waveform_db(&[0.0, f64::NAN], &[0.0; 2]), Err(AccuracyError::NotFinite(1)));
        assert_eq!(waveform_db(&[0.0; 2], &[f64::INFINITY, 0.0]), Err(AccuracyError::NotFinite(0)));
    }
}
