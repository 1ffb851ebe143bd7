//! `sample_commit` on the shared vectors.

use asperity_accuracy::phase::{self, Score};
use asperity_dsp::SampleCommit;
use asperity_dsp::sample_commit::Settings;
use harness::retrieval::{VECTORS, amplitudes, published, vector};

/// The signal that is made of magnitude frames, on their own time whatever the emission.
fn invert(magnitudes: &[f32], rate_hz: u32, settings: Settings, seed: u64) -> Vec<f64> {
    let framing = phase::framing(rate_hz, 101);
    let mut kernel = SampleCommit::<f32>::new(framing, settings, seed).unwrap();
    let mut all = vec![0.0; usize::try_from(-kernel.delay()).unwrap_or(0)];
    let all_frames = amplitudes(magnitudes, rate_hz);
    let mut frames = all_frames.chunks_exact(101);
    let last = frames.len() as u64 + 60 + settings.emission.max(0) as u64;
    let mut out = vec![0.0f32; 96];
    for n in 0..last {
        if let Some(frame) = frames.next() {
            assert_eq!(kernel.push(n, frame), Ok(0));
        }
        let hop = (framing.start(n + 1) - framing.start(n)) as usize;
        kernel.emit(framing.start(n), &mut out[..hop]);
        all.extend(out[..hop].iter().map(|&y| f64::from(y)));
    }
    all.split_off(usize::try_from(kernel.delay()).unwrap_or(0))
}

fn score(name: &str, rate_hz: u32, settings: Settings, seed: u64) -> Score {
    let magnitudes = vector(name, rate_hz);
    harness::retrieval::score(&magnitudes, rate_hz, &invert(&magnitudes, rate_hz, settings, seed))
}

/// Required scores at emission 0 and at -25 [dB], where they are stricter than the published ones.
fn asked(name: &str) -> (f64, f64) {
    match name {
        "texture_2500" => (-25.0, -21.0),
        "contact_2500" => (-24.0, -19.5),
        "taps_2500" => (-24.0, -17.0),
        "two25_2500" => (-35.0, -27.0),
        // Published are -93.9 and -84.6. What remains of a tone stems from bins 70 dB below it.
        "sine_off_2500" => (-74.0, -70.0),
        _ => (0.0, 0.0),
    }
}

fn settings(frames: usize, passes: usize, emission: i32) -> Settings {
    Settings { frames, passes, momentum: 0.9, emission }
}

/// Mean figures of so many seeds: convergence, gain and long-term spectrum in dB.
fn mean(name: &str, rate_hz: u32, settings: Settings, seeds: u64) -> [f64; 3] {
    let all: Vec<Score> = (0..seeds).map(|seed| score(name, rate_hz, settings, seed)).collect();
    assert!(all.iter().all(|s| s.nonfinite == 0), "{name}");
    let of = |f: fn(&Score) -> f64| all.iter().map(f).sum::<f64>() / seeds as f64;
    [of(|s| s.convergence_db), of(|s| s.gain_db), of(|s| s.ltas_rms_db)]
}

#[test]
fn sample_commit_reaches_the_published_scores() {
    for (name, rate_hz) in VECTORS {
        let (newest_db, centre_db) = asked(name);
        // The setting for each emission. At -25 noise has two answers that last, so that few seeds say
        // little.
        let centre = Settings { momentum: 0.85, ..settings(5, 6, -25) };
        for (settings, asked_db, method) in
            [(settings(5, 5, 0), newest_db, "scr5x5"), (centre, centre_db, "scr5x5_centre")]
        {
            let emission = settings.emission;
            let [study_db, ..] = published(name, method).unwrap();
            let most = if name.starts_with("sine") { asked_db } else { asked_db.min(study_db + 1.5) };
            let [db, gain_db, _] = mean(name, rate_hz, settings, 12);
            println!("{name} at {emission}: {db:.1} dB (at most {most:.1}), gain {gain_db:.2} dB");
            assert!(db < most && gain_db.abs() < 0.5, "{name} at {emission}: {db} dB, gain {gain_db} dB");
        }
    }
}

#[test]
fn smooth_magnitudes_keep_their_level_and_spectrum_by_default() {
    for seed in 0..6 {
        let s = score("nnsmooth_2500", 2500, Settings::default(), seed);
        println!("seed {seed}: {s:?}");
        assert!(s.gain_db.abs() < 0.5 && s.ltas_rms_db < 1.0, "seed {seed}: {s:?}");
    }
}

/// The table of the kernel's documentation.
#[test]
#[ignore = "prints, and takes a while"]
fn table() {
    let all = [(2, 0), (3, 0), (5, 0), (5, 10), (5, -10), (5, -15), (3, -20), (5, -20), (3, -25), (5, -25)];
    for (frames, (passes, emission)) in all.map(|s| (5, s)).into_iter().chain([(10, (5, 0)), (10, (5, -25))])
    {
        println!("{frames} frames x {passes} passes, emission {emission}");
        for (name, rate_hz) in VECTORS {
            let [db, gain_db, ltas_db] = mean(name, rate_hz, settings(frames, passes, emission), 3);
            println!("  {name:14} {db:6.1} {gain_db:+5.2} {ltas_db:4.2}");
        }
    }
}
