use super::*;
use crate::testing::{check_bad_magnitudes, framing};
use crate::{OverlapAdd, Stft};

fn kernel(level: Level, seed: u64) -> RandomPhase<f64> {
    RandomPhase::new(framing(2500, 101), level, seed).unwrap()
}

#[test]
fn random_phase_depends_on_the_frame_number_alone() {
    let (mut all, mut some) = (kernel(Level::Plain, 1), kernel(Level::Plain, 1));
    let (mut x, mut y) = (vec![Complex::default(); 101], vec![Complex::default(); 101]);
    for n in 0..1000 {
        all.process(n, &[1.0; 101], &mut x);
        if n % 7 == 0 {
            some.process(n, &[1.0; 101], &mut y);
            assert_eq!(x, y);
        }
    }
    all.process(10_000_000, &[1.0; 101], &mut x);
    assert_ne!(x, y);
    kernel(Level::Plain, 2).process(10_000_000, &[1.0; 101], &mut y);
    assert_ne!(x, y, "it is a function of the seed");
}

#[test]
fn random_phase_is_uniform_and_independent() {
    let mut kernel = kernel(Level::Plain, 1);
    let (mut out, mut last) = (vec![Complex::default(); 101], vec![Complex::default(); 101]);
    let (mut mean, mut frames, mut bins) = (Complex::default(), Complex::default(), Complex::default());
    for n in 0..1000 {
        kernel.process(n, &[1.0; 101], &mut out);
        for k in 1..100 {
            assert!((out[k].norm() - 1.0f64).abs() < 1e-12);
            mean += out[k];
            frames += out[k] * last[k].conj();
            bins += out[k] * out[k + 1].conj();
        }
        last.copy_from_slice(&out);
    }
    // Four standard deviations of a sum of 99000 points on a circle.
    assert!([mean, frames, bins].iter().all(|s: &Complex<f64>| s.norm() < 1260.0), "{mean} {frames} {bins}");
}

#[test]
fn random_phase_level_falls_by_the_overlap_unless_kept() {
    // 44.1 kHz: 50.1 hops of 88 or 89 samples a window.
    for (rate, level) in [(2500, Level::Plain), (2500, Level::Keep), (44_100, Level::Keep)] {
        let f = framing(rate, 101);
        let mut kernel = RandomPhase::<f64>::new(f, level, 5).unwrap();
        let mut ola = OverlapAdd::<f64>::new(f).unwrap();
        let mut mags = [1.0; 101];
        mags[..4].fill(0.0);
        let (mut spectrum, mut signal) = (vec![Complex::default(); 101], Vec::new());
        for n in 0..3000 {
            kernel.process(n, &mags, &mut spectrum);
            ola.add_frame(f.start(n), &spectrum).unwrap();
            let mut out = vec![0.0; (f.start(n + 1) - f.start(n)) as usize];
            ola.emit(f.start(n), &mut out);
            signal.extend(out);
        }
        let (mut stft, n) = (Stft::new(f.fft_len), f.fft_len);
        let energies: Vec<f64> = signal[n..]
            .chunks_exact(n)
            .map(|x| stft.process(x).iter().map(|c| c.norm_sqr()).sum::<f64>() / 97.0)
            .collect();
        let db = 10.0 * (energies.iter().sum::<f64>() / energies.len() as f64).log10();
        let want = if level == Level::Keep { 0.0 } else { -10.0 * 50f64.log10() };
        // 59 windows of 97 bins: one standard deviation is 0.08 dB.
        assert!((db - want).abs() < 0.3, "{rate} Hz {level:?}: {db} dB, not {want}");
    }
}

#[test]
fn random_phase_counts_bad_magnitudes_as_silence() {
    let mut kernel = RandomPhase::<f32>::new(framing(2500, 101), Level::Keep, 1).unwrap();
    let process = |frame, mags: &[f32], out: &mut [Complex<f32>]| {
        let bad = kernel.process(frame, mags, out);
        assert!(out[0].im.abs() < 1e-6, "bin 0 is real");
        bad
    };
    check_bad_magnitudes(process, &[1.0; 101], 50f32.sqrt());
}
