use super::*;
use crate::testing::{apart, check_bad_magnitudes, saved, tone, turns};
use crate::window::hann_lobe;

fn run<T: Float>(spsi: &mut Spsi<T>, mags: &[T], advance: u32) -> Vec<Complex<T>> {
    let mut out = vec![Complex::default(); spsi.bins()];
    assert_eq!(spsi.process(mags, advance, &mut out), 0);
    out
}

fn power<T: Float>(out: &[Complex<T>]) -> f64 {
    out.iter().map(|c| c.re.f64().powi(2) + c.im.f64().powi(2)).sum()
}

#[test]
fn spsi_finds_a_peak_shared_by_two_equal_bins() {
    let mut spsi = Spsi::new(250, 101, 1);
    let mags = tone(40.5, 101);
    assert_eq!(mags[40], mags[41]);
    let mut before = run(&mut spsi, &mags, 0);
    for _ in 0..20 {
        let next = run(&mut spsi, &mags, 5);
        assert!((power(&next) - mags.iter().map(|m| m * m).sum::<f64>()).abs() < 1e-12);
        for k in 39..=42 {
            assert!(apart(turns(next[k]), turns(before[k]) + 40.5 * 5.0 / 250.0) < 1e-9, "bin {k}");
        }
        before = next;
    }
}

#[test]
fn spsi_follows_a_sinusoid_between_bins() {
    for freq in [5.0, 17.0, 40.01, 40.25, 40.49, 40.5, 40.51, 40.99, 77.3] {
        let mut spsi = Spsi::new(250, 101, 3);
        let mags = tone(freq, 101);
        let (first, second) = (run(&mut spsi, &mags, 0), run(&mut spsi, &mags, 5));
        let at = freq.round() as usize;
        // A true sinusoid's transform: the window's lobe with its signs, half a turn a bin from centre to
        // start.
        let ideal =
            |k: usize| hann_lobe(k as f64 - freq).signum() * if k.is_multiple_of(2) { 1.0 } else { -1.0 };
        for k in (0..101).filter(|&k| (k as f64 - freq).abs() < 8.0 && mags[k] > 1e-9) {
            assert!(
                (first[k] * first[at].conj()).re * ideal(k) * ideal(at) > 0.0,
                "sign of bin {k} for {freq}"
            );
            assert!(apart(turns(second[k]) - turns(first[k]), freq * 5.0 / 250.0) < 1e-9, "{freq}, bin {k}");
        }
    }
}

#[test]
fn spsi_keeps_every_magnitude() {
    let mut spsi = Spsi::new(250, 101, 7);
    for n in 0..50 {
        let mags: Vec<f64> = (0..101).map(|k| uniform_at(n, k)).collect();
        for (c, m) in run(&mut spsi, &mags, 5).iter().zip(&mags) {
            assert!((c.norm() - m).abs() < 1e-12);
        }
    }
}

#[test]
fn spsi_keeps_bin_0_and_nyquist_real() {
    for seed in 0..8 {
        let mut spsi = Spsi::<f64>::new(50, 26, seed);
        let mut mags = vec![0.0f64; 26];
        (mags[0], mags[1], mags[24], mags[25]) = (1.0, 0.5, 0.25, 0.5);
        let first = run(&mut spsi, &mags, 0);
        for n in 1..9 {
            let out = run(&mut spsi, &mags, 1);
            assert!(out[0].im.abs() < 1e-12 && (out[0].re - first[0].re).abs() < 1e-12, "bin 0 is constant");
            let alternates = (-1.0f64).powi(n) * first[25].re;
            assert!(
                out[25].im.abs() < 1e-12 && (out[25].re - alternates).abs() < 1e-12,
                "Nyquist alternates"
            );
        }
        assert!((first[0].re.abs() - 1.0).abs() < 1e-12);
        assert!((first[25].re.abs() - 0.5).abs() < 1e-12);
    }
}

#[test]
fn spsi_finds_a_peak_in_the_last_bin_below_nyquist() {
    for freq in [99.7, 100.0, 100.3, 100.45] {
        let (mags, mut spsi) = (tone(freq, 101), Spsi::new(4800, 101, 1));
        let (first, second) = (run(&mut spsi, &mags, 0), run(&mut spsi, &mags, 96));
        assert!(apart(turns(second[100]) - turns(first[100]), freq * 96.0 / 4800.0) < 1e-9, "{freq}");
    }
    let mut spsi = Spsi::new(250, 101, 1);
    let mut alone = vec![0.0; 101];
    alone[100] = 1.0;
    let (first, second) = (run(&mut spsi, &alone, 0), run(&mut spsi, &alone, 5));
    // 100 bins x 5 of 250 samples are two whole turns.
    assert!(apart(turns(second[100]), turns(first[100])) < 1e-9);
}

#[test]
fn spsi_of_silence_is_silent() {
    let mut spsi = Spsi::new(250, 101, 1);
    let silence = vec![0.0; 101];
    for _ in 0..3 {
        assert_eq!(power(&run(&mut spsi, &silence, 5)), 0.0);
    }
    let mags = tone(30.2, 101);
    assert!((power(&run(&mut spsi, &mags, 5)) - power(&run(&mut spsi, &mags, 5))).abs() < 1e-12);
    assert_eq!(power(&run(&mut spsi, &silence, 5)), 0.0);
    assert!(power(&run(&mut spsi, &tone(60.0, 101), 5)) > 1.0);
}

#[test]
fn spsi_treats_a_plateau_as_one_peak() {
    let mut spsi = Spsi::new(250, 101, 1);
    let flat = vec![1.0; 101];
    let (first, second) = (run(&mut spsi, &flat, 0), run(&mut spsi, &flat, 5));
    assert!((power(&second) - 101.0).abs() < 1e-9);
    assert!(apart(turns(second[50]) - turns(first[50]), 50.0 * 5.0 / 250.0) < 1e-9);
    let mut plateau = vec![0.0; 101];
    plateau[20..25].fill(2.0);
    let (first, second) = (run(&mut spsi, &plateau, 5), run(&mut spsi, &plateau, 5));
    for k in 20..25 {
        assert!(apart(turns(second[k]) - turns(first[k]), 22.0 * 5.0 / 250.0) < 1e-9, "{k}");
    }
}

#[test]
fn spsi_counts_bad_magnitudes_as_silence() {
    let mut spsi = Spsi::<f32>::new(250, 101, 1);
    let mags = std::array::from_fn(|k| hann_lobe(k as f64 - 30.3).abs() as f32);
    check_bad_magnitudes(|_, mags, out| spsi.process(mags, 5, out), &mags, 1.0);
    Spsi::<f32>::new(0, 0, 0).process(&mags, 5, &mut [Complex::new(9.0, 9.0); 200]);
}

#[test]
fn spsi_advances_by_the_true_hop() {
    // 44.1 kHz at 500 frames a second: 88, 88, 88, 88, 89 samples.
    let framing = crate::Framing { rate_hz: 44_100, fft_len: 4410, bins: 101, frame_num: 500, frame_den: 1 };
    let mut spsi = Spsi::<f64>::new(4410, 101, 1);
    let mags = tone(33.4, 101);
    let first = run(&mut spsi, &mags, 0);
    for n in 1..1000 {
        let out = run(&mut spsi, &mags, (framing.start(n) - framing.start(n - 1)) as u32);
        let exact = turns(first[33]) + 33.4 * framing.start(n) as f64 / 4410.0;
        assert!(apart(turns(out[33]), exact) < 1e-7, "frame {n}");
    }
}

#[test]
fn spsi_does_not_drift_in_a_million_frames() {
    // A peak exactly on bin 3, whose closed form is exact in integers, and one off it, in both precisions.
    let framing = crate::Framing { rate_hz: 44_100, fft_len: 4410, bins: 8, frame_num: 500, frame_den: 1 };
    let mut spsi = Spsi::<f32>::new(4410, 8, 1);
    let (mut single, mut double) = (Spsi::<f32>::new(4410, 8, 2), Spsi::<f64>::new(4410, 8, 2));
    let on: [f32; 8] = [0.0, 0.0, 0.5, 1.0, 0.5, 0.0, 0.0, 0.0];
    let off = tone(3.3, 8);
    let off_single: Vec<f32> = off.iter().map(|&m| m as f32).collect();
    let (mut x, mut y, mut z) = ([Complex::default(); 8], [Complex::default(); 8], [Complex::default(); 8]);
    spsi.process(&on, 0, &mut x);
    let start = spsi.turns[3];
    let frames = 1_000_000;
    for n in 0..frames {
        let advance = if n == 0 { 0 } else { (framing.start(n) - framing.start(n - 1)) as u32 };
        spsi.process(&on, advance, &mut x);
        single.process(&off_single, advance, &mut y);
        double.process(&off, advance, &mut z);
    }
    let exact = start + ((3 * framing.start(frames - 1)) % 4410) as f64 / 4410.0;
    assert!(apart(spsi.turns[3], exact) < 1e-9);
    // Half an hour of a frequency known to 1e-8 bins.
    assert!(apart(single.turns[3], double.turns[3]) < 1e-2);
    assert!(spsi.turns.iter().chain(&single.turns).chain(&double.turns).all(|t| (0.0..=1.0).contains(t)));
}

#[test]
fn spsi_refuses_state_of_another_window_and_bad_phases() {
    let mut old = Spsi::<f32>::new(250, 101, 1);
    let mut bytes = saved(|s| old.state(s));
    assert!(State::restore(&bytes, |s| Spsi::<f32>::new(250, 101, 2).state(s)));
    // As many bins, ten times as far apart.
    assert!(!State::restore(&bytes, |s| Spsi::<f32>::new(2500, 101, 1).state(s)));
    for wild in [f64::NAN, 1.0, -0.1] {
        // Behind the length of the window and the number of bins.
        bytes[16..24].copy_from_slice(&wild.to_le_bytes());
        assert!(!State::restore(&bytes, |s| Spsi::<f32>::new(250, 101, 1).state(s)), "{wild}");
    }
}
