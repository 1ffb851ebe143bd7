use super::testing::{louder, noise, sine};
use super::*;
use proptest::prelude::*;

fn agreement(
    rendered: &[f64],
    rate_hz: f64,
    truth: &[&[f64]],
    truth_rate_hz: f64,
) -> Result<Agreement, AccuracyError> {
    compare(&Spectrogram::new(&[rendered], rate_hz)?, &[Spectrogram::new(truth, truth_rate_hz)?])
}

fn lines(of: &[(f64, f64)], rate_hz: f64) -> Vec<f64> {
    let all: Vec<Vec<f64>> = of.iter().map(|(hz, amplitude)| sine(*amplitude, *hz, rate_hz, 2.0)).collect();
    (0..all[0].len()).map(|n| all.iter().map(|line| line[n]).sum()).collect()
}

const CHORD: [(f64, f64); 3] = [(60.0, 0.5), (180.0, 2.0), (430.0, 1.0)];

#[test]
fn same_signal_at_other_rates_agrees() {
    let truth = lines(&CHORD, 10_000.0);
    for rate in [2500.0, 4096.0, 44_100.0, 48_000.0] {
        let found = agreement(&lines(&CHORD, rate), rate, &[&truth], 10_000.0).unwrap();
        let near = if rate == 4096.0 { 0.05 } else { 1e-6 };
        assert!(
            found.level_db.abs() < near && found.spectrum_db < near && found.bands_db < near,
            "{found:?}"
        );
        assert!(found.perceptual > 1.0 - near, "{found:?}");
    }
}

#[test]
fn powers_of_three_axes_add() {
    let axis = |part: f64| louder(&lines(&CHORD, 10_000.0), 20.0 * part.log10());
    let truth = [axis(3.0 / 13.0), axis(4.0 / 13.0), axis(12.0 / 13.0)];
    let truth = truth.each_ref().map(Vec::as_slice);
    let found = agreement(&lines(&CHORD, 48_000.0), 48_000.0, &truth, 10_000.0).unwrap();
    assert!(
        found.level_db.abs() < 1e-6 && found.spectrum_db < 1e-6 && found.perceptual > 0.999_999,
        "{found:?}"
    );
    let one = agreement(&lines(&CHORD, 48_000.0), 48_000.0, &truth[..1], 10_000.0).unwrap();
    assert!((one.level_db - 20.0 * (13.0_f64 / 3.0).log10()).abs() < 1e-6, "{one:?}");
}

#[test]
fn loud_line_changes_only_its_bins_and_bands() {
    let mut wrong = CHORD;
    wrong[1].1 = 20.0;
    let truth = lines(&CHORD, 10_000.0);
    let found = agreement(&lines(&wrong, 10_000.0), 10_000.0, &[&truth], 10_000.0).unwrap();
    // 0.25 + 400 + 1 over 0.25 + 4 + 1.
    assert!((found.level_db - 10.0 * (401.25_f64 / 5.25).log10()).abs() < 1e-6);
    // Nine bins, of which three are off by 20 dB.
    assert!((found.spectrum_db - 20.0 / 3f64.sqrt()).abs() < 1e-6, "{found:?}");
    // 170 Hz, a sixth of the line, is in the fifth band, which has nothing else; 180 and 190 Hz are in the
    // sixth.
    let bands = found.bands.map(Option::unwrap);
    assert!((bands[4] - 20.0).abs() < 1e-6 && (bands[5] - 20.0).abs() < 1e-6, "{bands:?}");
    assert!(bands.iter().enumerate().all(|(k, b)| [4, 5].contains(&k) || b.abs() < 1e-6), "{bands:?}");
    assert!((found.bands_db - 20.0 * (2.0_f64 / 9.0).sqrt()).abs() < 1e-6);
}

#[test]
fn frequencies_above_half_the_rate_do_not_count() {
    let truth = lines(&CHORD, 1000.0);
    let loud = [CHORD.as_slice(), &[(700.0, 9.0)]].concat();
    let found = agreement(&lines(&loud, 48_000.0), 48_000.0, &[&truth], 1000.0).unwrap();
    assert!(found.level_db.abs() < 1e-6 && found.spectrum_db < 1e-6 && found.bands_db < 1e-6, "{found:?}");
    assert_eq!(found.bands.iter().flatten().count(), 7);
    // The rendered one has nothing there if it is slow itself.
    let slow = agreement(&truth, 1000.0, &[&lines(&loud, 48_000.0)], 48_000.0).unwrap();
    assert!(slow.level_db < -10.0 && slow.bands[8].is_some_and(|b| b < -30.0), "{slow:?}");
}

#[test]
fn draws_of_one_noise_agree_within_chance() {
    let (one, other) = (noise(7, 80_000, 1.0), noise(8, 20_000, 0.5));
    let found = agreement(&other, 2500.0, &[&one], 10_000.0).unwrap();
    // 990 Hz of 1250 in one, of 5000 in the other: 0.25 / 1250 over 1 / 5000 is 0 dB.
    assert!(found.level_db.abs() < 0.2, "{found:?}");
    // 8 s have about 150 independent frames: a bin's mean power is off by 4.34 / sqrt(150) = 0.35 dB, of two
    // by 0.5.
    assert!((0.35..0.65).contains(&found.spectrum_db), "{found:?}");
    assert!(found.bands_db < 0.4 && found.perceptual > 0.97, "{found:?}");
}

#[test]
fn several_draws_of_a_truth_reduce_the_error() {
    let seen = |seed| Spectrogram::new(&[&noise(seed, 20_000, 1.0)], 2500.0).unwrap();
    let rendered = Spectrogram::new(&[&noise(1, 20_000, 1.0)], 2500.0).unwrap();
    let truths: Vec<Spectrogram> = (2..18).map(seen).collect();
    let (one, all) = (compare(&rendered, &truths[..1]).unwrap(), compare(&rendered, &truths).unwrap());
    // The truth's own part of the error's square, a half, falls to a sixteenth of that.
    let less = all.spectrum_db / one.spectrum_db;
    assert!((less - (17.0_f64 / 32.0).sqrt()).abs() < 0.12, "{less}");
    assert!((all.perceptual - one.perceptual).abs() < 0.01, "{} {}", all.perceptual, one.perceptual);
    assert_eq!(compare(&rendered, &[]), Err(AccuracyError::NoAxes));
}

#[test]
fn silent_and_invalid_signals_differ() {
    let (silence, sound) = (vec![0.0; 2500], lines(&CHORD, 2500.0)[..2500].to_vec());
    let of = |a: &[f64], b: &[f64]| agreement(a, 2500.0, &[b], 2500.0);
    let both = of(&silence, &silence).unwrap();
    assert_eq!((both.level_db, both.spectrum_db, both.bands_db, both.perceptual), (0.0, 0.0, 0.0, 1.0));
    let mute = of(&silence, &sound).unwrap();
    assert_eq!((mute.level_db, mute.spectrum_db, mute.bands_db), (-LIMIT_DB, LIMIT_DB, LIMIT_DB));
    let ghost = of(&sound, &silence).unwrap();
    assert_eq!((ghost.level_db, ghost.spectrum_db, ghost.bands_db), (LIMIT_DB, LIMIT_DB, LIMIT_DB));
    assert!(mute.perceptual < 0.2 && ghost.perceptual < 0.2, "{mute:?} {ghost:?}");
    assert_eq!(of(&sound[..1249], &sound), Err(AccuracyError::TooShort));
    assert!(of(&sound[..1250], &sound).is_ok());
    let mut bad = sound.clone();
    bad[9] = f64::NAN;
    assert_eq!(of(&bad, &sound), Err(AccuracyError::NotFinite(9)));
    assert_eq!(of(&sound, &bad), Err(AccuracyError::NotFinite(9)));
    assert_eq!(agreement(&sound, 2500.0, &[], 2500.0), Err(AccuracyError::NoAxes));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn figures_are_in_range_for_any_signals(
        seeds in (0u64..1000, 0u64..1000),
        levels in (-170.0..170.0f64, -170.0..170.0f64),
        rates in (100.0..5000.0f64, 100.0..5000.0f64),
        hole in 0usize..400,
    ) {
        let signal = |seed, db, rate: f64| {
            let mut x = louder(&noise(seed, (1.3 * rate) as usize, 1.0), db);
            x.iter_mut().take(hole).for_each(|x| *x = 0.0);
            x
        };
        let (a, b) = (signal(seeds.0, levels.0, rates.0), signal(seeds.1, levels.1, rates.1));
        let found = agreement(&a, rates.0, &[&b, &a[..b.len().min(a.len())]], rates.1);
        if let Ok(f) = found {
            prop_assert!(f.level_db.abs() <= LIMIT_DB && (0.0..=LIMIT_DB).contains(&f.spectrum_db), "{f:?}");
            prop_assert!((0.0..=LIMIT_DB).contains(&f.bands_db), "{f:?}");
            prop_assert!((0.0..=1.0).contains(&f.perceptual), "{f:?}");
        }
    }
}

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
