//! Kernels in single and double precision.

use crate::sample_commit::{SampleCommit, Settings};
use crate::testing::{LOW, saved};
use crate::{
    Complex, Conversion, FilterPhase, Float, OscillatorBank, OverlapAdd, Partials, Resampler, Spsi, random,
};
use asperity_state::State;

macro_rules! keep {
    () => {
        fn keep(&mut self, state: &mut State<'_>) {
            self.state(state);
        }
    };
}

/// A kernel from magnitudes to numbers, one hop at a time, in single precision.
trait Kernel {
    fn hop(&mut self, n: u64, mags: &[f32]) -> Vec<f32>;
    fn keep(&mut self, state: &mut State<'_>);
}

/// Input of overlap-add and resampler: the same spectra for both precisions.
fn spectrum(n: u64, mags: &[f32]) -> Vec<Complex<f32>> {
    let turns = |k: usize| std::f64::consts::TAU * (k as f64 * n as f64 * 5.0 / 250.0 + 0.3 * k as f64);
    mags.iter().enumerate().map(|(k, &m)| Complex::from_polar(m, turns(k) as f32)).collect()
}

impl<T: Float> Kernel for Spsi<T> {
    fn hop(&mut self, _: u64, mags: &[f32]) -> Vec<f32> {
        let mut out = vec![Complex::default(); mags.len()];
        self.process(mags, 5, &mut out);
        out.into_iter().flat_map(|c| [c.re, c.im]).collect()
    }
    keep!();
}

impl<T: Float> Kernel for OverlapAdd<T> {
    fn hop(&mut self, n: u64, mags: &[f32]) -> Vec<f32> {
        let mut out = vec![0.0; 5];
        self.add_frame(5 * n, &spectrum(n, mags)).unwrap();
        self.emit(5 * n, &mut out);
        out
    }
    keep!();
}

impl<T: Float> Kernel for Resampler<T> {
    fn hop(&mut self, n: u64, mags: &[f32]) -> Vec<f32> {
        let mut out = vec![0.0; 96];
        self.process(5 * n, &mags[..5], 96 * n, &mut out);
        out
    }
    keep!();
}

impl<T: Float> Kernel for OscillatorBank<T> {
    fn hop(&mut self, n: u64, mags: &[f32]) -> Vec<f32> {
        let mut out = vec![0.0; 5];
        self.add_frame(n, 5 * n, mags);
        self.emit(5 * n, &mut out);
        out
    }
    keep!();
}

impl<T: Float> Kernel for SampleCommit<T> {
    fn hop(&mut self, n: u64, mags: &[f32]) -> Vec<f32> {
        let mut out = vec![0.0; 5];
        self.push(n, mags).unwrap();
        self.emit(5 * n, &mut out);
        out
    }
    keep!();
}

/// Each kernel in one precision.
fn kernels<T: Float>() -> Vec<(&'static str, Box<dyn Kernel>)> {
    let conversion = Conversion {
        in_hz: 2500,
        out_hz: 48_000,
        tick_num: 500,
        tick_den: 1,
        passband: Conversion::PASSBAND,
        phase: FilterPhase::Linear,
    };
    vec![
        ("spsi", Box::new(Spsi::<T>::new(250, 101, 1))),
        ("overlap_add", Box::new(OverlapAdd::<T>::new(LOW).unwrap())),
        ("resample", Box::new(Resampler::<T>::new(&conversion).unwrap())),
        ("oscillator_bank", Box::new(OscillatorBank::<T>::new(LOW, Partials::Noise, 1).unwrap())),
        ("oscillator_bank, tracked", Box::new(OscillatorBank::<T>::new(LOW, Partials::Tracked, 1).unwrap())),
        ("sample_commit", Box::new(SampleCommit::<T>::new(LOW, Settings::default(), 1).unwrap())),
    ]
}

/// A frame of a few peaks over a floor, which change from frame to frame.
fn mags(n: u64) -> Vec<f32> {
    let peak = |k: u64| (20.0 - (k as f64 - 15.4 - 0.05 * n as f64).powi(2)).max(0.0) / 20.0;
    (0..101).map(|k| (peak(k) + 0.01 * random::uniform(5, n / 20, k)) as f32).collect()
}

fn goes_on<A: Float, B: Float>() {
    for ((name, mut old), (_, mut new)) in kernels::<A>().into_iter().zip(kernels::<B>()) {
        let peak = (0..100).flat_map(|n| old.hop(n, &mags(n))).fold(0.0f32, |a, y| a.max(y.abs()));
        assert!(peak > 1e-3, "{name}: {peak}");
        let bytes = saved(|s| old.keep(s));
        assert!(State::restore(&bytes, |s| new.keep(s)), "{name}");
        for n in 100..104 {
            for (a, b) in old.hop(n, &mags(n)).into_iter().zip(new.hop(n, &mags(n))) {
                assert!((a - b).abs() < 2e-5 * peak, "{name}, frame {n}: {a} {b}");
            }
        }
    }
}

#[test]
fn kernel_continues_from_the_other_precision() {
    goes_on::<f32, f64>();
    goes_on::<f64, f32>();
}

#[test]
fn state_beyond_single_precision_is_refused() {
    let frame = vec![Complex::new(1e300, 0.0); 101];
    let mut old = OverlapAdd::<f64>::new(LOW).unwrap();
    old.add_frame(0, &frame).unwrap();
    let bytes = saved(|s| old.state(s));
    let mut new = OverlapAdd::<f32>::new(LOW).unwrap();
    assert!(!State::restore(&bytes, |s| new.state(s)));
    let mut out = [1.0f32; 5];
    new.emit(0, &mut out);
    assert_eq!(out, [0.0; 5], "it starts anew");
    assert!(State::restore(&bytes, |s| OverlapAdd::<f64>::new(LOW).unwrap().state(s)));
}
