use super::super::testing::{louder, noise, sine};
use super::*;

const RATE: f64 = 2500.0;
/// 8 s.
const COUNT: usize = 20_000;

fn seen(signal: &[f64]) -> Spectrogram {
    Spectrogram::new(&[signal], RATE).unwrap()
}

fn score(rendered: &[f64], truth: &[f64]) -> f64 {
    perceptual(&seen(rendered), &seen(truth))
}

fn sum(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a + b).collect()
}

#[test]
fn normal_distribution_matches_tables() {
    for (x, share) in [
        (0.0, 0.5),
        (1.0, 0.841_344_746),
        (-1.0, 0.158_655_254),
        (-2.0, 0.022_750_132),
        (3.0, 0.998_650_102),
        (-40.0, 0.0),
        (f64::INFINITY, 1.0),
        (f64::NEG_INFINITY, 0.0),
    ] {
        assert!((normal_cdf(x) - share).abs() < 1e-7, "{x}: {}", normal_cdf(x));
    }
}

#[test]
fn threshold_matches_the_formula() {
    for (hz, m_s2) in
        [(0.0, 0.0), (25.0, 0.160_208), (100.0, 0.084_950_7), (250.0, 0.074_022), (500.0, 4.529_26)]
    {
        assert!((threshold_m_s2(hz) - m_s2).abs() < 1e-5 * m_s2 + 1e-12, "{hz}: {}", threshold_m_s2(hz));
    }
    // Beyond 77 dB only acceleration grows on.
    assert!((threshold_m_s2(1000.0) / threshold_m_s2(900.0) - (10.0_f64 / 9.0).powi(2)).abs() < 1e-12);
}

#[test]
fn peak_stands_out_by_12_db() {
    let at = |levels: &[f64]| peaks(levels);
    assert_eq!(at(&[0.0, 12.0, 0.0]), [1]);
    assert_eq!(at(&[0.0, 11.9, 0.0]), [0; 0]);
    // Over the higher of both valleys.
    assert_eq!(at(&[-40.0, 11.0, 0.0]), [0; 0]);
    // The valley towards the next higher level counts, not the one behind it.
    assert_eq!(at(&[0.0, 30.0, 19.0, 30.5, 0.0, 20.0, -50.0]), [3, 5]);
    assert_eq!(at(&[0.0, 50.0, 0.0, 11.9, -20.0]), [1]);
    assert_eq!(at(&[0.0, 50.0, 0.0, 12.1, -20.0]), [1, 3]);
    // Ends and flats are no peaks.
    assert_eq!(at(&[50.0, 0.0, 50.0]), [0; 0]);
    assert_eq!(at(&[-3000.0; 9]), [0; 0]);
    assert_eq!(at(&[]), [0; 0]);
}

#[test]
fn line_masks_by_the_parabola_of_the_codec() {
    let line = seen(&sine(3.0, 200.0, RATE, 1.0));
    let found = mask(line.frame(3).unwrap(), BINS);
    for (hz, away_db) in [(200.0, 0.0), (400.0, -30.0), (100.0, -7.5), (260.0, -2.7)] {
        let bin = ((hz - 20.0) / 10.0) as usize;
        let want = 20.0 * 3f64.log10() - 5.0 + 200.0 / 280.0 + away_db;
        assert!((db(found[bin]) - want).abs() < 1e-6, "{hz}: {}, not {want}", db(found[bin]));
    }
}

#[test]
fn line_masks_down_to_45_db_below_the_loudest() {
    let at_300 = |below_db: f64| {
        let both = sum(&sine(30.0, 60.0, RATE, 1.0), &louder(&sine(30.0, 300.0, RATE, 1.0), -below_db));
        db(mask(seen(&both).frame(0).unwrap(), BINS)[28])
    };
    let by_60 = 20.0 * 30f64.log10() - 5.0 + 60.0 / 280.0 - 30.0 * 16.0;
    assert!((at_300(46.0) - by_60.max(-3000.0)).abs() < 1e-6, "{}", at_300(46.0));
    let by_itself = 20.0 * 30f64.log10() - 44.0 - 5.0 + 300.0 / 280.0;
    assert!((at_300(44.0) - by_itself).abs() < 1e-6, "{}", at_300(44.0));
}

#[test]
fn line_of_half_the_amplitude_scores_0_66() {
    // Three bins carry a line, L and twice L - 6.02 dB; its mask is L - 4.29 dB, 0.075 less beside it.
    let line = sine(30.0, 200.0, RATE, 1.0);
    let half = louder(&line, -20.0 * 2f64.log10());
    assert!((score(&half, &line) - 0.661_6).abs() < 1e-3, "{}", score(&half, &line));
    assert!((score(&line, &half) - 0.661_6).abs() < 1e-3, "twice as loud is as wrong as half");
    assert!((score(&line, &line) - 1.0).abs() < 1e-12);
}

#[test]
fn score_falls_with_level_error_at_any_level() {
    for rms in [0.3, 3.0, 30.0] {
        let (one, other) = (noise(1, COUNT, rms), noise(2, COUNT, rms));
        let at = |db: f64| score(&louder(&other, db), &one);
        assert!(at(0.0) > 0.97, "{rms}: {}", at(0.0));
        for sign in [-1.0, 1.0] {
            let scores = [0.0, 1.0, 3.0, 6.0, 12.0, 40.0].map(|db| at(sign * db));
            assert!(scores.windows(2).all(|s| s[1] < s[0]), "{rms}: {scores:?}");
            assert!((0.7..0.85).contains(&scores[2]) && (0.5..0.7).contains(&scores[3]), "{rms}: {scores:?}");
            assert!(scores[4] < 0.42 && scores[5] < 0.03, "{rms}: {scores:?}");
        }
    }
}

#[test]
fn only_felt_differences_count() {
    let truth = noise(1, COUNT, 1.0);
    // By differences, a noise without low frequencies: 6 dB an octave.
    let thin: Vec<f64> = std::iter::once(0.0).chain(truth.windows(2).map(|x| x[1] - x[0])).collect();
    assert!(score(&thin, &truth) < 0.6, "{}", score(&thin, &truth));
    let quiet = sine(100.0, 900.0, RATE, 8.0);
    assert!(threshold_m_s2(900.0) > 100.0);
    let louder_there = score(&sum(&truth, &quiet), &truth);
    assert!(louder_there > 0.999, "a line below its threshold is not felt: {louder_there}");
    let hidden = score(&sum(&louder(&truth, -12.0), &quiet), &sum(&truth, &quiet));
    assert!(hidden < 0.42, "and it hides nothing: {hidden}");
    let felt = sine(1.0, 250.0, RATE, 8.0);
    assert!(score(&sum(&truth, &felt), &truth) < 0.9, "{}", score(&sum(&truth, &felt), &truth));
}

#[test]
fn same_spectrum_at_another_time_differs() {
    let (loud, silent) = (noise(1, COUNT / 2, 1.0), vec![0.0; COUNT / 2]);
    let (first, last) = ([loud.clone(), silent.clone()].concat(), [silent, loud].concat());
    assert!(score(&first, &last) < 0.1, "{}", score(&first, &last));
    assert!((score(&first, &first) - 1.0).abs() < 1e-12);
}

#[test]
fn unfelt_signal_equals_silence() {
    let (silence, faint, felt) = (vec![0.0; COUNT], noise(1, COUNT, 3e-3), noise(1, COUNT, 1.0));
    assert_eq!(score(&silence, &silence), 1.0);
    assert!(score(&faint, &silence) > 0.99 && score(&silence, &faint) > 0.99);
    assert!(score(&felt, &silence) < 0.02 && score(&silence, &felt) < 0.02);
    assert_eq!(perceptual(&seen(&[]), &seen(&felt)), 1.0);
}

#[test]
fn score_does_not_depend_on_the_start_of_a_pause() {
    // 0.9 s of noise, 0.9 s of nothing; what is rendered ends 50 ms late.
    let mut scores = Vec::new();
    for shift in [0, 250, 500, 750, 1000] {
        let (mut truth, mut late) = (noise(1, COUNT, 1.0), noise(2, COUNT, 1.0));
        let quiet = |signal: &mut [f64], from: usize| {
            signal
                .iter_mut()
                .enumerate()
                .filter(|(n, _)| (n + shift) % 4500 >= from)
                .for_each(|(_, x)| *x = 0.0);
        };
        quiet(&mut truth, 2250);
        quiet(&mut late, 2375);
        scores.push(score(&late, &truth));
    }
    let (least, most) = scores.iter().fold((1.0, 0.0), |(a, b), s| (f64::min(a, *s), f64::max(b, *s)));
    assert!(most - least < 0.03, "{scores:?}");
}

#[test]
fn sine_at_twice_its_threshold_is_felt_at_6_db() {
    for hz in [50.0, 120.0, 250.0, 600.0] {
        let signal = sine(2.0 * threshold_m_s2(hz), hz, 2500.0, 1.0);
        let powers = Spectrogram::new(&[&signal], 2500.0).unwrap().mean(0..usize::MAX);
        let db = felt_db(&powers);
        // The bins beside have other thresholds.
        assert!((db - 20.0 * 2f64.log10()).abs() < 0.2, "{hz} Hz: {db} dB");
    }
}
