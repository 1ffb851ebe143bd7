//! Helpers shared by the tests of several kernels.

use crate::window::hann_lobe;
use crate::{Complex, Framing};
use asperity_state::State;
use std::f64::consts::TAU;

/// Frames at 2500 Hz with 101 of 126 bins, a hop of 5 samples.
pub(crate) const LOW: Framing =
    Framing { rate_hz: 2500, fft_len: 250, bins: 101, frame_num: 500, frame_den: 1 };

/// Frames of 0.1 s, 500 a second.
pub(crate) fn framing(rate_hz: u32, bins: usize) -> Framing {
    Framing { rate_hz, fft_len: rate_hz as usize / 10, bins, ..LOW }
}

/// Magnitudes of a sinusoid of amplitude 1 at `freq` bins.
pub(crate) fn tone(freq: f64, bins: usize) -> Vec<f64> {
    (0..bins).map(|k| hann_lobe(k as f64 - freq).abs()).collect()
}

/// Amplitude of the line that advances by `turns` a sample.
pub(crate) fn line(x: &[f64], turns: f64) -> f64 {
    let turn = |i: usize| Complex::from_polar(2.0 / x.len() as f64, TAU * turns * i as f64);
    x.iter().enumerate().map(|(i, x)| turn(i) * x).sum::<Complex<f64>>().norm()
}

/// The largest sample.
pub(crate) fn peak(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |most, x| most.max(x.abs()))
}

/// The largest step from a sample to the next.
pub(crate) fn steepest(x: &[f64]) -> f64 {
    x.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max)
}

/// Phase in turns.
pub(crate) fn turns(c: Complex<f64>) -> f64 {
    c.im.atan2(c.re) / TAU
}

/// Difference of phases in turns, in [0, 0.5].
pub(crate) fn apart(a: f64, b: f64) -> f64 {
    ((a - b) - (a - b).round()).abs()
}

/// The bytes that a kernel saves.
pub(crate) fn saved(mut keep: impl FnMut(&mut State<'_>)) -> Vec<u8> {
    let mut bytes = vec![0; State::measure(&mut keep)];
    let len = State::save(&mut bytes, keep).unwrap();
    bytes.truncate(len);
    bytes
}

/// Checks a kernel from magnitudes to spectra, scaled by `gain`, on values that are no magnitudes. `process`
/// takes a frame's number, its magnitudes and the output, and answers how many magnitudes were bad.
pub(crate) fn check_bad_magnitudes(
    mut process: impl FnMut(u64, &[f32], &mut [Complex<f32>]) -> usize,
    mags: &[f32; 101],
    gain: f32,
) {
    let mut mags = *mags;
    (mags[3], mags[60], mags[61], mags[90]) = (f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0);
    let silent = |out: &[Complex<f32>]| out.iter().all(|&c| c == Complex::default());
    let mut out = vec![Complex::new(9.0, 9.0); 200];
    assert_eq!(process(5, &mags, &mut out), 4);
    assert!(out.iter().all(|c| c.re.is_finite() && c.im.is_finite()));
    assert!([3, 60, 61, 90].iter().all(|&k: &usize| out[k] == Complex::default()));
    assert!((out[30].norm() - gain * mags[30]).abs() < 1e-5);
    assert!(silent(&out[101..]), "output beyond the bins is silent");
    assert_eq!(process(u64::MAX, &[f32::MAX; 101], &mut out), 0);
    assert!(out.iter().all(|c| c.re.is_finite() && c.im.is_finite()));
    assert_eq!(process(5, &mags[..50], &mut out[..60]), 1);
    assert!(silent(&out[50..60]), "missing bins are silent");
    assert_eq!(process(5, &mags, &mut out[..10]), 4, "a short output is no error");
    assert_eq!(process(5, &[0.0; 101], &mut out), 0);
    assert!(silent(&out), "silence is silence");
}
