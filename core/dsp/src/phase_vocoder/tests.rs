use super::*;
use crate::testing::{apart, check_bad_magnitudes, framing, turns};
use crate::{OverlapAdd, Stft};
use std::f64::consts::TAU;

const STARTS: [StartPhase; 3] = [StartPhase::Zero, StartPhase::Random, StartPhase::Quadratic];

#[test]
fn phase_vocoder_advances_by_centre_frequency_for_hours() {
    // 44.1 kHz at 500 frames a second: 88 or 89 samples.
    let f = framing(44_100, 101);
    let mut kernel = PhaseVocoder::<f64>::new(f, StartPhase::Random, Level::Plain, 1).unwrap();
    let (mut first, mut out) = (vec![Complex::default(); 101], vec![Complex::default(); 101]);
    assert_eq!(kernel.process(0, &[1.0; 101], &mut first), 0);
    // 10^7 frames are 5.6 hours, 10^13 are 634 years.
    for n in (0..1000).chain(10_000_000..10_000_010).chain([10_000_000_000_000]) {
        kernel.process(f.start(n), &[1.0; 101], &mut out);
        for k in 0..101u64 {
            let exact = (u128::from(k) * u128::from(f.start(n)) % 4410) as f64 / 4410.0;
            let moved = turns(out[k as usize]) - turns(first[k as usize]);
            assert!(apart(moved, exact) < 1e-12, "frame {n}, bin {k}");
        }
    }
}

#[test]
fn quadratic_start_phases_spread_over_the_window() {
    let (k, start) = (101, |k| StartPhase::Quadratic.turns(k, 101, 0));
    for i in 1..k - 1 {
        // The second difference is half a turn, and 1/K to visit every instant of the window.
        let bend = start(i + 1) - 2.0 * start(i) + start(i - 1);
        assert!(apart(bend, 0.5 + 1.0 / 101.0) < 1e-12, "bin {i}");
    }
}

/// The signal that steady magnitudes make, after it has faded in.
fn steady(mags: &[f64], start: StartPhase, level: Level) -> Vec<f64> {
    let f = framing(2500, mags.len());
    let mut kernel = PhaseVocoder::<f64>::new(f, start, level, 3).unwrap();
    let (mut ola, mut spectrum) = (OverlapAdd::<f64>::new(f).unwrap(), vec![Complex::default(); mags.len()]);
    let mut all = vec![0.0; 1000];
    for n in 0..200 {
        kernel.process(f.start(n), mags, &mut spectrum);
        ola.add_frame(f.start(n), &spectrum).unwrap();
        ola.emit(f.start(n), &mut all[5 * n as usize..][..5]);
    }
    all.split_off(250)
}

#[test]
fn phase_vocoder_scales_oscillators_by_two_thirds() {
    let mags: Vec<f64> =
        (0..101).map(|k| if k == 0 { 0.0 } else { random::uniform(9, 0, k) * 2.0 }).collect();
    for start in STARTS {
        for (t, y) in steady(&mags, start, Level::Plain).iter().enumerate() {
            let t = t as f64 + 250.0;
            let sum: f64 = (1..101)
                .map(|k| {
                    let phase = k as f64 * t / 250.0 + start.turns(k, 101, 3);
                    2.0 / 3.0 * mags[k] * (TAU * phase).cos()
                })
                .sum();
            assert!((y - sum).abs() < 1e-9, "{start:?}, sample {t}");
        }
    }
}

#[test]
fn phase_vocoder_level_keep_keeps_the_energy() {
    // Away from bin 0, where bins beat with their images.
    let mags: Vec<f64> = (0..101).map(|k| if k < 4 { 0.0 } else { random::uniform(7, 0, k) }).collect();
    let want: f64 = mags.iter().map(|m| m * m).sum();
    for (start, level) in STARTS.iter().flat_map(|&s| [(s, Level::Plain), (s, Level::Keep)]) {
        let signal = steady(&mags, start, level);
        let mut stft = Stft::new(250);
        // Over one period of the signal.
        let energy = |from| stft.process(&signal[from..from + 250]).iter().map(|c| c.norm_sqr()).sum::<f64>();
        let mean = (0..250).map(energy).sum::<f64>() / 250.0;
        let factor = if level == Level::Keep { 1.0 } else { 2.0 / 3.0 };
        assert!((mean / want - factor).abs() < 1e-9, "{start:?} {level:?}: {}", mean / want);
    }
}

#[test]
fn phase_vocoder_keeps_bin_0_and_nyquist_real() {
    let f = Framing { rate_hz: 500, fft_len: 50, bins: 26, frame_num: 500, frame_den: 1 };
    for start in STARTS {
        for seed in 0..8 {
            let mut kernel = PhaseVocoder::<f64>::new(f, start, Level::Plain, seed).unwrap();
            let mut out = vec![Complex::<f64>::default(); 26];
            kernel.process(0, &[1.0; 26], &mut out);
            let first = (out[0], out[25]);
            for n in 1..9 {
                kernel.process(n, &[1.0; 26], &mut out);
                let sign = if n % 2 == 0 { 1.0 } else { -1.0 };
                assert!((out[0] - first.0).norm() < 1e-12 && out[0].im.abs() < 1e-12);
                assert!((out[25] - first.1 * sign).norm() < 1e-12 && out[25].im.abs() < 1e-12);
            }
            assert!((first.0.norm() - 1.0).abs() < 1e-12 && (first.1.norm() - 1.0).abs() < 1e-12);
        }
    }
}

#[test]
fn phase_vocoder_counts_bad_magnitudes_as_silence() {
    let mut kernel =
        PhaseVocoder::<f32>::new(framing(2500, 101), StartPhase::Quadratic, Level::Keep, 1).unwrap();
    let process = |start, mags: &[f32], out: &mut [Complex<f32>]| kernel.process(start, mags, out);
    check_bad_magnitudes(process, &[1.0; 101], 1.5f32.sqrt());
}
