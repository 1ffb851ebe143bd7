use super::*;
use crate::testing::LOW as FRAMING;

fn known(ratio: &[f64]) -> Statistics<'_, f64> {
    Statistics { ratio, variance: None, means: false }
}

/// Frames of these magnitudes, from frame 0 on.
fn scattered(framing: Framing, magnitudes: &[f64], known: Statistics<'_, f64>, count: u64) -> Vec<Vec<f64>> {
    let mut scatter = Scatter::<f64>::new(framing, 11).unwrap();
    let frame = |frame| {
        let mut out = vec![0.0; framing.bins];
        scatter.process(frame, magnitudes, known, 1.0, &mut out);
        out
    };
    (0..count).map(frame).collect()
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), x| (sum + x, count + 1.0));
    sum / count
}

#[test]
fn ratio_is_the_mean_of_the_rice_distribution() {
    // SciPy: x = (1 - q) / q; sqrt(pi q / 4) ((1 + x) ive(0, x / 2) + x ive(1, x / 2))
    for (q, want) in [
        (0.0, 1.0),
        (0.05, 0.987_592_2),
        (0.25, 0.942_437_0),
        (0.5, 0.906_454_0),
        (0.75, 0.890_362_4),
        (0.9, 0.886_820_0),
        (1.0, NOISE_RATIO),
    ] {
        assert!((ratio(q) - want).abs() < 1e-3, "{q}: {}", ratio(q));
        if q < 0.9 {
            assert!((random_part(ratio(q)) - q).abs() < 5e-3, "{q}");
        }
    }
    assert_eq!((random_part(2.0), random_part(f64::NAN)), (0.0, 1.0));
}

#[test]
fn noise_keeps_its_power_and_is_rayleigh_distributed() {
    let frames = scattered(FRAMING, &[2.0; 101], known(&[]), 50_000);
    for bin in [0, 1, 30, 100] {
        let square = mean(frames.iter().map(|f| f[bin] * f[bin]));
        let level = mean(frames.iter().map(|f| f[bin]));
        let want = if bin == 0 { REAL_NOISE_RATIO } else { NOISE_RATIO };
        assert!((square / 4.0 - 1.0).abs() < 0.08, "{bin}: {square}");
        assert!((level / square.sqrt() - want).abs() < 0.02, "{bin}: {level}");
    }
    // Powers of neighbouring bins go together by (2/3)^2, and of a frame 20 ms later by the window's overlap.
    let power = |f: &Vec<f64>, bin: usize| f[bin] * f[bin] / 4.0 - 1.0;
    let beside = mean(frames.iter().map(|f| power(f, 30) * power(f, 31)));
    assert!((beside - 4.0 / 9.0).abs() < 0.1, "{beside}");
    let later = mean(frames.windows(11).map(|f| power(&f[0], 30) * power(&f[10], 30)));
    let apart = mean(frames.windows(51).map(|f| power(&f[0], 30) * power(&f[50], 30)));
    assert!(later > 0.5 && apart.abs() < 0.1, "{later} {apart}");
}

#[test]
fn bin_scatter_follows_its_ratio() {
    for want in [0.9, 0.95, 0.99] {
        let ratios = [want; 101];
        let frames = scattered(FRAMING, &[1.0; 101], known(&ratios), 50_000);
        let square = mean(frames.iter().map(|f| f[40] * f[40]));
        let found = mean(frames.iter().map(|f| f[40])) / square.sqrt();
        assert!((square - 1.0).abs() < 0.08 && (found - want).abs() < 0.01, "{want}: {square} {found}");
    }
    let steady = scattered(FRAMING, &[1.5; 101], known(&[1.0; 101]), 100);
    assert!(steady.iter().flatten().all(|m| (m - 1.5).abs() < 1e-9));
}

#[test]
fn frame_power_has_the_wanted_variance() {
    let power = |f: &Vec<f64>| f.iter().map(|m| m * m).sum::<f64>();
    let varies = |variance| {
        let known = Statistics { ratio: &[], variance, means: false };
        let frames = scattered(FRAMING, &[1.0; 101], known, 100_000);
        let level = mean(frames.iter().map(power));
        (level / 101.0, mean(frames.iter().map(|f| (power(f) / level - 1.0).powi(2))))
    };
    let (level, own) = varies(None);
    // Of 101 bins under Hann's window: (1 + 2 (4/9 + 1/36)) / 101.
    assert!((level - 1.0).abs() < 0.03 && (own / 0.0193 - 1.0).abs() < 0.15, "{level} {own}");
    for want in [0.1, 0.5, 2.0] {
        let (level, found) = varies(Some(want));
        assert!((level - 1.0).abs() < 0.1 && (found / want - 1.0).abs() < 0.3, "{want}: {level} {found}");
    }
}

#[test]
fn mean_magnitudes_keep_their_mean() {
    let known = Statistics { ratio: &[], variance: Some(0.5), means: true };
    let frames = scattered(FRAMING, &[1.0; 101], known, 100_000);
    for bin in [1, 50] {
        let level = mean(frames.iter().map(|f| f[bin]));
        assert!((level - 1.0).abs() < 0.03, "{level}");
    }
}

#[test]
fn skipped_frame_changes_no_later_one() {
    for framing in [FRAMING, Framing { rate_hz: 44_100, fft_len: 4410, ..FRAMING }] {
        let known = Statistics { ratio: &[], variance: Some(0.3), means: false };
        let all = scattered(framing, &[1.0; 101], known, 200);
        let mut scatter = Scatter::<f64>::new(framing, 11).unwrap();
        for frame in [3, 4, 60, 61, 62, 150, 199] {
            let mut out = vec![0.0; 101];
            scatter.process(frame, &[1.0; 101], known, 1.0, &mut out);
            assert_eq!(out, all[frame as usize], "{frame}");
        }
    }
}

#[test]
fn strength_0_changes_nothing_and_bad_numbers_are_counted() {
    let mut scatter = Scatter::<f32>::new(FRAMING, 11).unwrap();
    let magnitudes: Vec<f32> = (0..101).map(|k| 0.1 * k as f32).collect();
    let known = Statistics { ratio: &[], variance: Some(3.0), means: false };
    let mut out = [9.0_f32; 120];
    assert_eq!(scatter.process(5, &magnitudes, known, 0.0, &mut out), 0);
    assert!(out.iter().zip(&magnitudes).all(|(a, b)| (a - b).abs() <= 1e-5 * b));
    assert_eq!(out[101..], [0.0; 19]);
    assert_eq!(scatter.process(6, &[f32::NAN, -1.0, f32::INFINITY, f32::MAX], known, 1.0, &mut out), 3);
    assert!(out.iter().all(|x| x.is_finite()));
}
