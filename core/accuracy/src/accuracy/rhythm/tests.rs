use std::f64::consts::{SQRT_2, TAU};

use super::super::testing::{louder, noise, sine};
use super::*;
use crate::phase;
use asperity_dsp::sample_commit::Settings;
use asperity_dsp::scatter::Statistics;
use asperity_dsp::{Complex, Framing, OverlapAdd, SampleCommit, Scatter, ShapedNoise, Spsi};

/// Samples of a formula of the time in seconds.
fn made(rate_hz: f64, seconds: f64, f: impl Fn(f64) -> f64) -> Vec<f64> {
    (0..(rate_hz * seconds).round() as usize).map(|n| f(n as f64 / rate_hz)).collect()
}

fn rhythm(signal: &[f64], rate_hz: f64) -> Rhythm {
    Rhythm::new(&[signal], rate_hz).unwrap()
}

/// Bursts of 5 ms of noise, each the same, so many seconds apart.
fn bursts(rate_hz: f64, seconds: f64, apart_s: f64) -> Vec<f64> {
    let burst = noise(4, (0.005 * rate_hz) as usize, 1.0);
    let apart = (apart_s * rate_hz).round() as usize;
    (0..(seconds * rate_hz) as usize).map(|n| burst.get(n % apart).copied().unwrap_or(0.0)).collect()
}

#[test]
fn modulated_tone_has_its_depth_in_its_band_alone() {
    for (hz, band) in [(3.0, 0), (5.0, 1), (10.0, 2), (20.0, 3), (40.0, 4)] {
        for rate in [2500.0, 10_000.0, 44_100.0] {
            let tone = made(rate, 4.0, |t| (1.0 + 0.4 * (TAU * hz * t).sin()) * (TAU * 220.0 * t).sin());
            let found = rhythm(&tone, rate);
            for (k, depth) in found.modulation.into_iter().enumerate() {
                let want = if k == band { 0.4 / SQRT_2 } else { 0.0 };
                assert!((depth - want).abs() < 1e-9, "{hz} Hz at {rate}, band {k}: {depth}");
            }
            // Mean x^4 is that of the sine times mean (1 + m sin)^4, = 1 + 3 m^2 + 3 m^4 / 8; mean x^2 times
            // 1 + m^2 / 2.
            let m2 = 0.16_f64;
            let kurtosis = 1.5 * (1.0 + 3.0 * m2 + 0.375 * m2 * m2) / (1.0 + 0.5 * m2).powi(2);
            assert!((found.kurtosis - kurtosis).abs() < 1e-9);
            // All of it repeats itself after a whole number of 50 ms, but what is slower than 5 Hz does not
            // count.
            let repeats = hz == 20.0 || hz == 40.0 || hz == 10.0 || hz == 5.0;
            assert!(!repeats || found.envelope_repetition > 0.999, "{found:?}");
        }
    }
}

#[test]
fn sine_is_steady_and_its_kurtosis_is_1_5() {
    let found = rhythm(&sine(2.0, 220.0, 2500.0, 3.0), 2500.0);
    assert!(found.modulation.iter().all(|m| *m < 1e-9), "{found:?}");
    assert!((found.kurtosis - 1.5).abs() < 1e-9 && (found.rms - SQRT_2).abs() < 1e-9);
    assert!((found.wave_repetition - 1.0).abs() < 1e-6 && found.envelope_repetition == 0.0);
    assert!(found.level_deviation_db < 1e-6);
}

/// The fault for which these figures were made: a texture that was the same, or pulsed, every 50 ms. Its
/// spectrum was right.
#[test]
fn texture_repeating_every_50_ms_is_seen() {
    let rate = 2500.0;
    let once = noise(9, 125, 1.0);
    let signal: Vec<f64> = once.iter().cycle().take(10_000).copied().collect();
    let found = rhythm(&signal, rate);
    let fair = Rhythm::of_noise_like(&[&signal], rate).unwrap();
    assert!(found.wave_repetition > 0.999 && found.envelope_repetition > 0.999, "{found:?}");
    assert!(fair.repetition() < 0.3, "{fair:?}");
    // Pulses of noise, none like the other: only the envelope repeats itself.
    let mut pulses = noise(10, 10_000, 1.0);
    pulses.iter_mut().enumerate().for_each(|(n, x)| *x *= 1.0 + 0.8 * (TAU * 20.0 * n as f64 / rate).sin());
    let found = rhythm(&pulses, rate);
    assert!(found.pulses() > 4.0 * fair.pulses() && found.envelope_repetition > 0.3, "{found:?}");
    assert!(found.wave_repetition < 0.15, "{found:?}");
}

/// Signals of 20 s of frames that stand still: of the kernel without phase retrieval, and of scattered frames
/// through two kinds of phase retrieval.
fn steady(magnitudes: &[f64], framing: Framing, seed: u64) -> [Vec<f64>; 3] {
    const HOP: usize = 5;
    let unknown = Statistics { ratio: &[], variance: None, means: false };
    let mut noise = ShapedNoise::<f32>::new(framing, 0.002, seed).unwrap();
    let mut scatter = Scatter::<f32>::new(framing, seed).unwrap();
    let settings = Settings { frames: 2, passes: 2, ..Settings::default() };
    let mut commit = SampleCommit::<f32>::new(framing, settings, seed).unwrap();
    let mut spsi = Spsi::<f32>::new(framing.fft_len, framing.bins, seed);
    let mut overlap = OverlapAdd::<f32>::new(framing).unwrap();
    let mut made = [vec![], vec![], vec![]];
    let (mut frame, mut spectrum) = ([0.0; 101], [Complex::default(); 101]);
    for n in 0..10_500 {
        let (start, mut out) = (n * HOP as u64, [[0.0; HOP]; 3]);
        noise.push(n, magnitudes, 1.0);
        noise.emit(start, None, &mut out[0]);
        scatter.process(n, magnitudes, unknown, 1.0, &mut frame);
        commit.push(n, &frame).unwrap();
        commit.emit(start, &mut out[1]);
        spsi.process(&frame, HOP as u32, &mut spectrum);
        overlap.add_frame(start, &spectrum).unwrap();
        overlap.emit(start, &mut out[2]);
        made.iter_mut().zip(out).for_each(|(made, out)| made.extend(out));
    }
    made.map(|made| made[2500..].to_vec())
}

#[test]
fn steady_magnitudes_of_any_shape_do_not_pulse() {
    let framing = phase::framing(2500, 101);
    let resonance = |hz: f64, wide_hz: f64| {
        (0..101).map(|k| (1.0 + ((10.0 * f64::from(k) - hz) / wide_hz).powi(2)).sqrt().recip()).collect()
    };
    // Narrower bands swing more, as any noise in them does.
    let shapes: [(&str, Vec<f64>); 4] = [
        ("flat", vec![1.0; 101]),
        ("falls by 3 dB an octave", (0..101).map(|k| f64::from(k.max(3)).sqrt().recip()).collect()),
        ("resonance at 250 Hz", resonance(250.0, 80.0)),
        ("resonance at 600 Hz", resonance(600.0, 150.0)),
    ];
    for (shape, magnitudes) in shapes {
        let scaled: Vec<f32> = magnitudes.iter().map(|m| (m * framing.bin_scale()) as f32).collect();
        let figures = |x: &[f64]| {
            let score = phase::score(&scaled.repeat(x.len() / 5 - 50), &framing, x).unwrap();
            let rhythm = rhythm(x, 2500.0);
            [rhythm.pulses(), rhythm.repetition(), score.gain_db.abs(), score.ltas_rms_db]
        };
        let draws: Vec<_> = (0..3).map(|n| steady(&magnitudes, framing, n).map(|x| figures(&x))).collect();
        for (way, name) in ["shaped_noise", "sample_commit", "spsi"].into_iter().enumerate() {
            // SPSI is made for peaks: its level is low.
            let most = if name == "spsi" { [0.16, 0.1, 1.2, 1.2] } else { [0.16, 0.1, 0.3, 0.5] };
            for (figure, most) in most.into_iter().enumerate() {
                let mut of: Vec<f64> = draws.iter().map(|draw| draw[way][figure]).collect();
                of.sort_by(f64::total_cmp);
                assert!(of[1] <= most, "{name}, {shape}, figure {figure}: {of:?}");
            }
        }
    }
}

#[test]
fn bursts_repeat_at_their_period() {
    for rate in [2500.0, 10_000.0] {
        for apart in [0.03, 0.05, 0.12] {
            let signal = bursts(rate, 3.0, apart);
            let found = rhythm(&signal, rate);
            assert!(found.repetition() > 0.98, "{found:?}");
            let all = [0.8, 1.0, 1.3].map(|part| repeats_at(&signal, rate, part * apart).unwrap());
            for repeat in all {
                assert!((repeat.lag_s - apart).abs() < 1.5 / 8000.0, "{apart}: {repeat:?}");
                assert!(repeat.correlation > 0.98, "{repeat:?}");
            }
        }
    }
    let found = repeats_at(&noise(3, 20_000, 1.0), 2500.0, 0.05).unwrap();
    assert!(found.correlation < 0.1 && (0.025..=0.075).contains(&found.lag_s), "{found:?}");
}

#[test]
fn slow_surface_repeats_at_lags_below_30_hz() {
    // A pitch of 2 mm at 20 mm/s: 10 Hz, which the figures' own band does not have.
    let signal = made(2500.0, 4.0, |t| (TAU * 10.0 * t).sin());
    let found = repeats_at(&signal, 2500.0, 0.09).unwrap();
    assert!((found.lag_s - 0.1).abs() < 1.0 / 8000.0 && found.correlation > 0.999, "{found:?}");
}

#[test]
fn gaussian_noise_has_no_rhythm_at_any_rate() {
    for (seed, rate) in [(1, 2500.0), (2, 10_000.0), (3, 48_000.0)] {
        let found = rhythm(&noise(seed, (8.0 * rate) as usize, 1.0), rate);
        assert!((found.kurtosis - 3.0).abs() < 0.15, "{found:?}");
        assert!(found.repetition() < 0.12, "{found:?}");
        // The envelope of noise of a bandwidth B has a modulation density of 4 / pi - 1 = 0.273 in all, over
        // about B.
        assert!((0.02..0.08).contains(&found.pulses()), "{found:?}");
        assert!((0.4..1.2).contains(&found.level_deviation_db), "{found:?}");
    }
}

#[test]
fn noise_like_noise_has_the_same_figures() {
    // A band 100 Hz wide around 150 Hz, by two passes of a resonator.
    let shaped = |seed| {
        let mut y = noise(seed, 20_000, 1.0);
        for _ in 0..2 {
            let (a, b) = (2.0 * 0.9 * (TAU * 150.0 / 2500.0_f64).cos(), -0.81);
            let (mut y1, mut y2) = (0.0, 0.0);
            for x in &mut y {
                *x += a * y1 + b * y2;
                (y1, y2) = (*x, y1);
            }
        }
        y
    };
    let signal = shaped(5);
    let (found, fair) = (rhythm(&signal, 2500.0), Rhythm::of_noise_like(&[&signal], 2500.0).unwrap());
    assert_eq!(fair, Rhythm::of_noise_like(&[&signal], 2500.0).unwrap());
    let agreement = compare(&found, &[fair]).unwrap();
    assert!(agreement.modulation_db < 1.5 && agreement.pulses_db.abs() < 1.5, "{agreement:?}");
    assert!(agreement.repetition < 0.05 && agreement.kurtosis_db < 0.3, "{agreement:?}");
    assert!(agreement.steadiness_db < 0.5, "{agreement:?}");
    assert!((fair.rms - found.rms).abs() < 1e-9);
    // A spectrum that is known gives the same, in whatever unit.
    let response = |hz: f64| {
        let z = asperity_dsp::Complex::from_polar(1.0, -TAU * hz / 2500.0);
        (1.0 - 1.8 * (TAU * 150.0 / 2500.0_f64).cos() * z + 0.81 * z * z).norm()
    };
    let powers: Vec<f64> = (0..101).map(|k| 1e30 * response(10.0 * f64::from(k)).powi(-4)).collect();
    let known = Rhythm::of_noise(&powers, 10.0, 8.0).unwrap();
    assert!((known.rms - 1.0).abs() < 0.05 && (known.kurtosis - 3.0).abs() < 0.1, "{known:?}");
    let agreement = compare(&known, &[fair]).unwrap();
    assert!(agreement.modulation_db < 0.5 && agreement.repetition < 0.03, "{agreement:?}");
    assert_eq!(Rhythm::of_noise(&[0.0; 9], 10.0, 8.0).unwrap().rms, 0.0);
    assert_eq!(Rhythm::of_noise(&[0.0, -1.0], 10.0, 8.0), Err(AccuracyError::NotFinite(1)));
    assert_eq!(Rhythm::of_noise(&[1.0], 10.0, 0.4), Err(AccuracyError::TooShort));
    assert_eq!(Rhythm::of_noise(&[1.0], 0.0, 8.0), Err(AccuracyError::Rate(0.0)));
}

/// The reference is SciPy 1.17:
///
/// ```python
/// import numpy as np, scipy.signal as ss, scipy.stats as st
/// rate, n = 8000, 16000
/// t = np.arange(n) / rate
/// x = sum(np.sin(2 * np.pi * 23.7 * k * t + k * k) / k for k in range(1, 61))
/// x *= 1 + 0.6 * np.sin(2 * np.pi * 19.3 * t)
/// X = np.fft.rfft(x); f = np.fft.rfftfreq(n, 1 / rate)
/// X[(f < 30) | (f >= 1000)] = 0
/// y = np.fft.irfft(X, n); e = np.abs(ss.hilbert(y)); E = np.fft.rfft(e / e.mean())
/// for a, b in zip([2, 4, 8, 15, 25], [4, 8, 15, 25, 50]):
///     print(np.sqrt(2 * (abs(E[(f >= a) & (f < b)] / n) ** 2).sum()))
/// E[f < 5] = 0; r = np.fft.irfft(E, n)
/// def alike(a, b):
///     return a @ b / np.sqrt((a @ a) * (b @ b))
/// def best(z):
///     return max(alike(z[:-k], z[k:]) for k in range(160, 1601))
/// print(best(r), best(y), st.kurtosis(y, fisher=False))
/// p = 10 * np.log10((y.reshape(-1, 400) ** 2).mean(1)); print(p[p >= p.max() - 40].std())
/// ```
#[test]
fn figures_match_scipy() {
    let signal = made(8000.0, 2.0, |t| {
        let sum: f64 = (1..61).map(f64::from).map(|k| (TAU * 23.7 * k * t + k * k).sin() / k).sum();
        sum * (1.0 + 0.6 * (TAU * 19.3 * t).sin())
    });
    let found = rhythm(&signal, 8000.0);
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-9, "{a} {b}");
    near(found.rms, 0.637_652_589_608_134);
    let depths = [
        0.033_362_103_476_273_91,
        0.121_372_531_751_048_47,
        0.046_701_201_062_004_95,
        0.305_788_899_773_670_74,
        0.134_769_633_538_086_4,
    ];
    found.modulation.into_iter().zip(depths).for_each(|(a, b)| near(a, b));
    near(found.envelope_repetition, 0.666_480_989_572_565_6);
    near(found.wave_repetition, 0.861_951_959_503_449_6);
    near(found.kurtosis, 3.132_505_841_338_931);
    near(found.level_deviation_db, 0.838_459_766_729_536_6);
}

#[test]
fn level_scale_and_direction_do_not_matter() {
    let (one, small) = (noise(6, 20_000, 1.0), noise(7, 20_000, 0.1));
    let figures = |r: Rhythm| Rhythm { rms: 0.0, ..r };
    let near = |a: Rhythm, b: Rhythm| {
        let all = |r: Rhythm| [r.modulation.as_slice(), &[r.envelope_repetition, r.wave_repetition]].concat();
        assert!(all(a).iter().zip(all(b)).all(|(a, b)| (a - b).abs() < 1e-9), "{a:?} {b:?}");
        assert!((a.kurtosis - b.kurtosis).abs() + (a.level_deviation_db - b.level_deviation_db).abs() < 1e-9);
    };
    let plain = figures(rhythm(&one, 10_000.0));
    for db in [-110.0, -40.0, 60.0, 1900.0] {
        near(figures(rhythm(&louder(&one, db), 10_000.0)), plain);
    }
    // The same wave along a direction in space.
    let axes = [3.0, -4.0, 12.0].map(|part| one.iter().map(|x| part / 13.0 * x).collect::<Vec<f64>>());
    let axes = axes.each_ref().map(Vec::as_slice);
    near(figures(Rhythm::new(&axes, 10_000.0).unwrap()), plain);
    // An axis of less power, at right angles, is not the principal one.
    let both = Rhythm::new(&[&small, &one], 10_000.0).unwrap();
    assert!(
        (both.rms / rhythm(&one, 10_000.0).rms - 1.0).abs() < 0.01
            && (both.kurtosis - plain.kurtosis).abs() < 0.01
    );
}

#[test]
fn level_that_switches_deviates_by_half_its_step() {
    let wave = |level: &dyn Fn(usize) -> f64| {
        let sample = |n: usize| level(n / 800 % 4) * (TAU * n as f64 / 40.0).sin();
        Wave { rate_hz: 8000.0, samples: (0..16_000).map(sample).collect(), envelope: Vec::new() }
    };
    // 20 dB between pieces of 0.1 s; pauses, and what is 41 dB below the loudest, do not count.
    for levels in [[1.0, 0.1, 1.0, 0.1], [1.0, 0.0, 0.1, 0.0], [1.0, 0.1, 0.008, 0.0]] {
        assert!((deviation_db(&wave(&|k| levels[k])) - 10.0).abs() < 1e-9, "{levels:?}");
    }
    assert!((deviation_db(&wave(&|k| [1.0, 0.02][k % 2])) - 10.0 * 50f64.log10()).abs() < 1e-9);
    // The whole way: the band-pass smears a step a little.
    let signal = made(8000.0, 4.0, |t| if t < 2.0 { 1.0 } else { 0.1 } * (TAU * 200.0 * t).sin());
    assert!((rhythm(&signal, 8000.0).level_deviation_db - 10.0).abs() < 0.3);
}

#[test]
fn agreement_is_known_of_tones_and_of_silence() {
    let tone = |m: f64| {
        rhythm(&made(2500.0, 4.0, |t| (1.0 + m * (TAU * 20.0 * t).sin()) * (TAU * 220.0 * t).sin()), 2500.0)
    };
    let (deep, flat) = (tone(0.8), tone(0.4));
    let six = 20.0 * 2f64.log10();
    let found = compare(&deep, &[flat, flat]).unwrap();
    assert!((found.pulses_db - six).abs() < 1e-6 && (found.modulation_db - six / 5f64.sqrt()).abs() < 1e-6);
    assert!(compare(&flat, &[deep]).unwrap().pulses_db < -6.0);
    // Errors of either sign average out.
    assert!(compare(&tone(0.4), &[tone(0.2), tone(0.8)]).unwrap().modulation_db < 1e-6);
    assert_eq!(compare(&flat, &[]), Err(AccuracyError::NoAxes));

    let silence = rhythm(&[0.0; 2500], 2500.0);
    assert_eq!((silence.modulation, silence.repetition(), silence.kurtosis), ([0.0; 5], 0.0, 3.0));
    assert_eq!(silence, Rhythm::of_noise_like(&[&[0.0; 2500]], 2500.0).unwrap());
    for same in [flat, silence].map(|one| compare(&one, &[one]).unwrap()) {
        let RhythmAgreement { modulation_db, repetition, kurtosis_db, steadiness_db, .. } = same;
        assert_eq!([modulation_db, repetition, kurtosis_db, steadiness_db], [0.0; 4]);
    }
    for (r, t) in [(silence, flat), (flat, silence)] {
        let one = compare(&r, &[t]).unwrap();
        assert_eq!((one.modulation_db, one.repetition, one.kurtosis_db), (LIMIT_DB, 1.0, LIMIT_DB));
    }
}

#[test]
fn invalid_signal_is_an_error() {
    let x = noise(1, 2500, 1.0);
    let of = |x: &[f64], rate| Rhythm::new(&[x], rate);
    assert_eq!(of(&x[..1249], 2500.0), Err(AccuracyError::TooShort));
    assert!(of(&x[..1250], 2500.0).is_ok() && of(&x, 100.0).is_ok());
    assert_eq!(Rhythm::new(&[], 2500.0), Err(AccuracyError::NoAxes));
    assert_eq!(Rhythm::of_noise_like(&[&[]], 2500.0), Err(AccuracyError::TooShort));
    for rate in [f64::NAN, 0.0, 99.0, 1e7] {
        assert!(matches!(of(&x, rate), Err(AccuracyError::Rate(_))));
    }
    for bad in [f64::NAN, f64::INFINITY, 1e200] {
        let mut y = x.clone();
        y[7] = bad;
        assert_eq!(of(&y, 2500.0), Err(AccuracyError::NotFinite(7)));
        assert_eq!(repeats_at(&y, 2500.0, 0.05), Err(AccuracyError::NotFinite(7)));
    }
    for about in [f64::NAN, -1.0, 0.0, 0.4, f64::INFINITY] {
        assert_eq!(repeats_at(&x, 2500.0, about), Err(AccuracyError::TooShort));
    }
    assert_eq!(Rhythm::up_to(&[&x], 2500.0, 400.0).unwrap().end_hz, 400.0);
    assert_eq!(of(&x, 1000.0).unwrap().end_hz, 500.0);
    // One sample alone: all the energy is in one piece.
    let mut click = vec![0.0; 2500];
    click[1200] = 1.0;
    let found = of(&click, 2500.0).unwrap();
    assert!(found.kurtosis > 100.0 && found.modulation.iter().all(|m| m.is_finite()), "{found:?}");
}

proptest::proptest! {
    #![proptest_config(proptest::prelude::ProptestConfig::with_cases(48))]
    #[test]
    fn figures_are_in_range_for_any_signal(
        seed in 0u64..1000,
        db in -170.0..170.0f64,
        rate in 100.0..5000.0f64,
        hole in 0usize..400,
    ) {
        let mut x = louder(&noise(seed, (1.3 * rate) as usize, 1.0), db);
        x.iter_mut().take(hole).for_each(|x| *x = 0.0);
        for r in [Rhythm::new(&[&x], rate).unwrap(), Rhythm::of_noise_like(&[&x], rate).unwrap()] {
            proptest::prop_assert!(r.modulation.iter().all(|m| (0.0..100.0).contains(m)), "{:?}", r);
            proptest::prop_assert!((0.0..=1.0).contains(&r.repetition()) && r.kurtosis >= 1.0, "{:?}", r);
            proptest::prop_assert!((0.0..=20.0).contains(&r.level_deviation_db), "{:?}", r);
        }
    }
}

#[test]
fn envelope_of_a_modulated_tone_is_its_modulation() {
    let tone = made(5000.0, 4.0, |t| (1.0 + 0.5 * (TAU * 20.0 * t).sin()) * (TAU * 300.0 * t).sin());
    let envelope = envelope(&[&tone], 5000.0).unwrap();
    let deepest = envelope.depths.iter().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
    // A depth of m is m / sqrt 2.
    assert!((19.0..=21.0).contains(&deepest.0) && (deepest.1 - 0.3536).abs() < 0.01, "{deepest:?}");
    let at = |t: f64| envelope.over_mean[(t * envelope.rate_hz) as usize];
    assert!((at(2.0125) - 1.5).abs() < 0.02 && (at(2.0375) - 0.5).abs() < 0.02);
}
