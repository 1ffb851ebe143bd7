//! Facts of every kernel: state and precision, reset and seed, unit.

use crate::sample_commit::{SampleCommit, Settings};
use crate::testing::{LOW, saved};
use crate::{
    Complex, Conversion, FilterPhase, Float, Level, OscillatorBank, OverlapAdd, Partials, PhaseVocoder,
    RandomPhase, Resampler, Spsi, StartPhase, random,
};
use asperity_state::State;

macro_rules! stateful {
    ($($start:expr)?) => {
        fn keep(&mut self, state: &mut State<'_>) {
            self.state(state);
        }
        fn anew(&mut self) {
            self.reset($($start)?);
        }
    };
}

/// The numbers of a spectrum.
fn spectrum_by(bins: usize, process: impl FnOnce(&mut [Complex<f32>]) -> usize) -> Vec<f32> {
    let mut out = vec![Complex::default(); bins];
    process(&mut out);
    out.into_iter().flat_map(|c| [c.re, c.im]).collect()
}

/// The samples of a tick.
fn samples_by(len: usize, emit: impl FnOnce(&mut [f32])) -> Vec<f32> {
    let mut out = vec![0.0; len];
    emit(&mut out);
    out
}

/// A kernel from magnitudes to numbers, one hop at a time, in single precision.
trait Kernel {
    fn hop(&mut self, n: u64, mags: &[f32]) -> Vec<f32>;
    fn keep(&mut self, _: &mut State<'_>) {}
    fn anew(&mut self) {}
}

/// Input of overlap-add and resampler: the same spectra for both precisions.
fn spectrum(n: u64, mags: &[f32]) -> Vec<Complex<f32>> {
    let turns = |k: usize| std::f64::consts::TAU * (k as f64 * n as f64 * 5.0 / 250.0 + 0.3 * k as f64);
    mags.iter().enumerate().map(|(k, &m)| Complex::from_polar(m, turns(k) as f32)).collect()
}

impl<T: Float> Kernel for Spsi<T> {
    fn hop(&mut self, _: u64, mags: &[f32]) -> Vec<f32> {
        spectrum_by(mags.len(), |out| self.process(mags, 5, out))
    }
    stateful!();
}

impl<T: Float> Kernel for OverlapAdd<T> {
    fn hop(&mut self, n: u64, mags: &[f32]) -> Vec<f32> {
        self.add_frame(5 * n, &spectrum(n, mags)).unwrap();
        samples_by(5, |out| self.emit(5 * n, out))
    }
    stateful!(0);
}

impl<T: Float> Kernel for Resampler<T> {
    fn hop(&mut self, n: u64, mags: &[f32]) -> Vec<f32> {
        samples_by(96, |out| self.process(5 * n, &mags[..5], 96 * n, out))
    }
    stateful!();
}

impl<T: Float> Kernel for OscillatorBank<T> {
    fn hop(&mut self, n: u64, mags: &[f32]) -> Vec<f32> {
        self.add_frame(n, 5 * n, mags);
        samples_by(5, |out| _ = self.emit(5 * n, out))
    }
    stateful!(0);
}

impl<T: Float> Kernel for SampleCommit<T> {
    fn hop(&mut self, n: u64, mags: &[f32]) -> Vec<f32> {
        self.push(n, mags).unwrap();
        samples_by(5, |out| self.emit(5 * n, out))
    }
    stateful!(0);
}

impl<T: Float> Kernel for RandomPhase<T> {
    fn hop(&mut self, n: u64, mags: &[f32]) -> Vec<f32> {
        spectrum_by(mags.len(), |out| self.process(n, mags, out))
    }
}

impl<T: Float> Kernel for PhaseVocoder<T> {
    fn hop(&mut self, n: u64, mags: &[f32]) -> Vec<f32> {
        spectrum_by(mags.len(), |out| self.process(5 * n, mags, out))
    }
}

/// Each kernel in one precision.
fn kernels<T: Float>(seed: u64) -> Vec<(&'static str, Box<dyn Kernel>)> {
    let conversion = Conversion {
        in_hz: 2500,
        out_hz: 48_000,
        tick_num: 500,
        tick_den: 1,
        passband: Conversion::PASSBAND,
        phase: FilterPhase::Linear,
    };
    vec![
        ("spsi", Box::new(Spsi::<T>::new(250, 101, seed))),
        ("random_phase", Box::new(RandomPhase::<T>::new(LOW, Level::Keep, seed).unwrap())),
        (
            "phase_vocoder",
            Box::new(PhaseVocoder::<T>::new(LOW, StartPhase::Random, Level::Keep, seed).unwrap()),
        ),
        ("overlap_add", Box::new(OverlapAdd::<T>::new(LOW).unwrap())),
        ("resample", Box::new(Resampler::<T>::new(&conversion).unwrap())),
        ("oscillator_bank", Box::new(OscillatorBank::<T>::new(LOW, Partials::Noise, seed).unwrap())),
        (
            "oscillator_bank, tracked",
            Box::new(OscillatorBank::<T>::new(LOW, Partials::Tracked, seed).unwrap()),
        ),
        ("sample_commit", Box::new(SampleCommit::<T>::new(LOW, Settings::default(), seed).unwrap())),
    ]
}

/// A frame of a few peaks over a floor, which change from frame to frame.
fn mags(n: u64) -> Vec<f32> {
    let peak = |k: u64| (20.0 - (k as f64 - 15.4 - 0.05 * n as f64).powi(2)).max(0.0) / 20.0;
    (0..101).map(|k| (peak(k) + 0.01 * random::uniform(5, n / 20, k)) as f32).collect()
}

fn goes_on<A: Float, B: Float>() {
    for ((name, mut old), (_, mut new)) in kernels::<A>(1).into_iter().zip(kernels::<B>(1)) {
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

fn run(kernel: &mut dyn Kernel, scale: f32) -> Vec<f32> {
    let scaled = |n| mags(n).iter().map(|m| m * scale).collect::<Vec<f32>>();
    (0..40).flat_map(|n| kernel.hop(n, &scaled(n))).map(|y| y / scale).collect()
}

#[test]
fn output_depends_on_input_and_seed_alone_in_any_unit() {
    for ((name, mut kernel), (_, mut other)) in kernels::<f32>(1).into_iter().zip(kernels::<f32>(2)) {
        let first = run(&mut *kernel, 1.0);
        let seeded = !["overlap_add", "resample"].contains(&name);
        assert_eq!(first != run(&mut *other, 1.0), seeded, "{name}");
        for scale in [1.0, 2f32.powi(-40), 2f32.powi(40)] {
            kernel.anew();
            assert!(run(&mut *kernel, scale) == first, "{name} times {scale}");
        }
    }
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
