//! Every method of phase retrieval, as a node, against the published scores on the shared vectors.

use asperity_accuracy::phase::{self, Score};
use asperity_dsp::griffin_lim::{Options, Start, griffin_lim};
use harness::retrieval::{VECTORS, amplitudes, data, published, score, scored, vector};

/// Method, published name, and by how many dB it may converge worse.
const PUBLISHED: [(&str, &str, f64); 8] = [
    ("phase_vocoder: start: zero, level: plain", "pv_zero", 1.5),
    ("phase_vocoder: start: random, level: plain", "pv_rand", 1.5),
    ("phase_vocoder: start: quadratic, level: plain", "pv_quad", 1.5),
    ("phase_vocoder: start: quadratic", "pv_quad", 0.1),
    ("random_phase: level: plain", "random_iid", 1.5),
    ("oscillator_bank: partials: tracked", "ob_tracked", 1.5),
    ("oscillator_bank: seed: 1", "ob_bins", 1.5),
    ("oscillator_bank: seed: 2", "ob_bins", 1.5),
];

#[test]
fn plain_methods_reach_the_published_scores() {
    for (method, key, by) in PUBLISHED {
        for (name, rate_hz) in VECTORS {
            let s = scored(method, name, rate_hz);
            let old = published(name, key);
            println!("{method} on {name}: {s:.1?}; published {old:.1?}");
            let Some([old, ..]) = old else { continue };
            // A sine's own image beats with it by its phase, which the magnitudes do not tell.
            let beats = key == "ob_tracked" && name == "sine_off_2500";
            let most = old + if beats { 20.0 } else { by };
            assert!(s.convergence_db < most, "{method} on {name}: {} dB, published {old}", s.convergence_db);
        }
    }
}

/// Method, largest error of the level and of the long-term spectrum on the smooth magnitudes, in dB.
const SMOOTH: [(&str, f64, f64); 4] = [
    ("phase_vocoder: start: quadratic", 0.1, 1.0),
    ("oscillator_bank", 0.2, 1.0),
    ("sample_commit", 0.5, 1.0),
    // Noise of 2 s: its spectrum is known to 1 dB.
    ("shaped_noise: precision: f32", 0.5, 1.6),
];

#[test]
fn smooth_magnitudes_keep_their_level_and_spectrum() {
    for (method, level_db, ltas_db) in SMOOTH {
        for seed in 1..7 {
            let join = if method.contains(": ") { ", " } else { ": " };
            let s = scored(&format!("{method}{join}seed: {seed}"), "nnsmooth_2500", 2500);
            let near = s.gain_db.abs() < level_db && s.ltas_rms_db < ltas_db;
            assert!(near, "{method}, seed {seed}: {s:?}");
        }
    }
    let s = scored("random_phase: level: keep", "nnsmooth_2500", 2500);
    // -5.7 dB is an independent Gaussian noise.
    assert!(s.gain_db.abs() < 0.5 && s.convergence_db < -5.0, "{s:?}");
    let s = scored("spsi", "nnsmooth_2500", 2500);
    assert!(s.gain_db < -5.0 && s.ltas_rms_db > 20.0, "SPSI collapses: {s:?}");
}

/// Name, rate, the best of the published `spsi_*` in `sc.json`, and what this one must reach, in dB.
const SPSI: [(&str, u32, f64, f64); 9] = [
    ("sine_off_2500", 2500, -76.39, -75.0),
    ("chirp_2500", 2500, -38.43, -38.4),
    ("texture_2500", 2500, -11.26, -11.3),
    ("two25_2500", 2500, -14.80, -16.0),
    ("taps_2500", 2500, -6.62, -6.4),
    ("contact_2500", 2500, -10.69, -10.8),
    ("nnsmooth_2500", 2500, -1.56, -1.4),
    ("texture_48000", 48000, -11.24, -11.6),
    ("amchirp_48000", 48000, -11.91, -12.0),
];

#[test]
fn spsi_reaches_the_best_scores_for_any_seed_and_precision() {
    for (name, rate_hz, published, reach) in SPSI {
        let db = scored("spsi", name, rate_hz).convergence_db;
        assert!(db < reach, "{name}: {db} dB is above {reach}, published {published}");
    }
    for seed in 2..6 {
        let db = scored(&format!("spsi: precision: f64, seed: {seed}"), "texture_2500", 2500).convergence_db;
        assert!(db < -10.7, "seed {seed}: {db} dB");
    }
}

/// Settings, published name, and required scores in dB where they are stricter than the published ones.
const COMMIT: [(&str, &str, [(&str, f64); 5]); 2] = [
    (
        "frames: 5, passes: 5, momentum: 0.9, emission: 0",
        "scr5x5",
        [
            ("texture_2500", -25.0),
            ("contact_2500", -24.0),
            ("taps_2500", -24.0),
            ("two25_2500", -35.0),
            // Published are -93.9 and -84.6. What remains of a tone stems from bins 70 dB below it.
            ("sine_off_2500", -74.0),
        ],
    ),
    // At -25 noise has two answers that last, so that few seeds say little.
    (
        "frames: 5, passes: 6, momentum: 0.85, emission: -25",
        "scr5x5_centre",
        [
            ("texture_2500", -21.0),
            ("contact_2500", -19.5),
            ("taps_2500", -17.0),
            ("two25_2500", -27.0),
            ("sine_off_2500", -70.0),
        ],
    ),
];

#[test]
fn sample_commit_reaches_the_published_scores() {
    for (settings, key, asked) in COMMIT {
        for (name, rate_hz) in VECTORS {
            let asked = asked.iter().find(|(of, _)| *of == name).map_or(0.0, |(_, db)| *db);
            let [study_db, ..] = published(name, key).unwrap();
            let most = if name.starts_with("sine") { asked } else { asked.min(study_db + 1.5) };
            let of = |seed| scored(&format!("sample_commit: {settings}, seed: {seed}"), name, rate_hz);
            // At 48 kHz each takes twenty times as long.
            let seeds = if rate_hz > 2500 { 2 } else { 12 };
            let all: Vec<_> = (0..seeds).map(of).collect();
            let mean = |of: fn(&Score) -> f64| all.iter().map(of).sum::<f64>() / f64::from(seeds);
            let (db, gain_db) = (mean(|s| s.convergence_db), mean(|s| s.gain_db));
            println!("{name}, {key}: {db:.1} dB (at most {most:.1}), gain {gain_db:.2} dB");
            assert!(db < most && gain_db.abs() < 0.5, "{name}, {key}: {db} dB, gain {gain_db} dB");
        }
    }
}

/// The best of three starts: where an iteration from random phases ends is a matter of luck, by several dB.
#[test]
fn griffin_lim_reaches_the_published_scores() {
    let names = ["texture_2500", "taps_2500", "nnsmooth_2500"];
    let methods = [("gla100", 0.0), ("fgla100", 0.99)];
    for (name, (method, alpha)) in names.into_iter().flat_map(|name| methods.map(|method| (name, method))) {
        let magnitudes = vector(name, 2500);
        let amplitudes = amplitudes(&magnitudes, 2500);
        let scores = [Start::Zero, Start::Random(1), Start::Random(2)].map(|start| {
            let options = Options { iterations: 100, alpha, start };
            let found = griffin_lim(&amplitudes, phase::framing(2500, 101), options, |_| {}).unwrap();
            let signal: Vec<f64> = found.signal.into_iter().map(f64::from).collect();
            score(&magnitudes, 2500, &signal).convergence_db
        });
        let [old, _, _] = published(name, method).unwrap();
        println!("{name}: {scores:.1?}, published {method} {old}");
        let best = scores.iter().copied().fold(0.0, f64::min);
        assert!(best < old + 1.5, "{name}: {best} dB, published {old}");
    }
}

/// `judge.py` on committed files: `judge.py MAG SIG --fs FS [--offset 7] [--scale 0.9] --json`.
#[test]
#[expect(clippy::approx_constant, reason = "-6.28 is a score in dB")]
fn scores_match_the_published_convention() {
    let cases = [
        ("texture_2500", "contact_2500", 2500, 0, 1.0, [-1.08, -3.23, 3.34, -65.5, 3.662]),
        ("texture_2500", "texture_2500", 2500, 7, 1.0, [-22.92, -0.01, 0.02, -99.6, 5.7903]),
        ("texture_2500", "texture_2500", 2500, 0, 0.9, [-20.0, -0.92, 0.92, -100.4, 5.2113]),
        ("texture_48000", "amchirp_48000", 48000, 0, 1.0, [0.28, -4.79, 68.54, -119.5, 1.8999]),
        ("sine_off_2500", "texture_2500", 2500, 0, 1.0, [5.07, 4.83, 15.08, -95.1, 5.7903]),
        ("nnsmooth_2500", "texture_2500", 2500, 0, 1.0, [-6.28, 0.39, 0.83, -99.3, 5.7903]),
        ("sine_off_2500", "sine_off_2500", 2500, 0, 1.0, [-152.22, 0.0, 0.0, -119.3, 1.0]),
    ];
    for (mag, sig, rate_hz, offset, scale, [sc, gain, ltas, oob, peak]) in cases {
        let signal: Vec<f64> = data(&format!("{sig}.sig"))[offset..].iter().map(|x| x * scale).collect();
        let score = score(&vector(mag, rate_hz), rate_hz, &signal);
        // judge.py prints two decimals, one for out of band.
        for (have, want, by) in [
            (score.convergence_db, sc, 0.0051),
            (score.gain_db, gain, 0.0051),
            (score.ltas_rms_db, ltas, 0.0051),
            (score.out_of_band_db.unwrap(), oob, 0.051),
            (score.peak, peak, 5.1e-5),
        ] {
            assert!((have - want).abs() <= by, "{mag} and {sig}: {have} is not {want}: {score:?}");
        }
    }
}

#[test]
fn unscorable_input_is_refused_and_bad_samples_counted() {
    let framing = phase::framing(2500, 101);
    let magnitudes = vector("texture_2500", 2500);
    let mut signal = data("texture_2500.sig");
    let score = |m: &[f32], s: &[f64]| phase::score(m, &framing, s);
    assert_eq!(score(&magnitudes[1..], &signal), Err(phase::ScoreError::Shape));
    assert_eq!(score(&magnitudes[..101 * 100], &signal), Err(phase::ScoreError::TooFewFrames));
    assert_eq!(score(&vec![0.0; 101 * 200], &signal), Err(phase::ScoreError::Magnitudes));
    assert_eq!(score(&[f32::NAN; 101 * 200], &signal), Err(phase::ScoreError::Magnitudes));
    (signal[1000], signal[2000]) = (f64::NAN, f64::INFINITY);
    let spoilt = score(&magnitudes, &signal).unwrap();
    assert_eq!(spoilt.nonfinite, 2);
    assert!(spoilt.convergence_db < -15.0 && spoilt.convergence_db > -60.0, "{spoilt:?}");
    let silent = score(&magnitudes, &[]).unwrap();
    assert!(silent.convergence_db.abs() < 1e-9 && silent.gain_db < -299.0, "{silent:?}");
}
