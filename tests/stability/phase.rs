//! Phase retrieval, built in and from plugins.

use std::f64::consts::TAU;
use std::sync::{Arc, OnceLock};

use asperity_checks::Subject;
use asperity_checks::wrap::Process;
use asperity_loader::Plugin;
use asperity_node::{Complex, Fault, NodeKind, Registry, Setup, Status, Tick};

use crate::{called, effort, fails, holds, sounding, subject};
use harness::plugins;

/// The built-in kinds and those of the plugins that retrieve phase.
fn all() -> Subject<'static> {
    static ALL: OnceLock<Registry> = OnceLock::new();
    let registry = ALL.get_or_init(|| {
        let mut registry = harness::registry();
        for package in ["asperity-rtpghi", "asperity-gsrtisi-la", "my_phase"] {
            let plugin = Plugin::load(plugins::rust(package)).unwrap_or_else(|e| panic!("{e}"));
            for kind in plugin.kinds() {
                assert!(registry.add(Arc::<NodeKind>::clone(kind)).is_none());
            }
        }
        registry
    });
    Subject::new(registry.clone()).effort(effort())
}

/// The built-in kinds with one that is called in another way.
fn mutant(kind: &str, make: impl Fn(&Setup<'_>) -> Process + Send + Sync + 'static) -> Subject<'static> {
    called(&subject(None), kind, make)
}

/// Change of a spectrum by a mutant: with the input, the frame's number and first sample, and the
/// spectrum.
type Change = fn(&mut f64, &[f32], (u64, u64), &mut [Complex<f32>]);

/// `phase_vocoder` whose spectra are changed, with a number to remember something in.
fn changed(change: Change) -> Subject<'static> {
    mutant("phase_vocoder", move |_| {
        let mut memory = 0.0;
        Box::new(move |node, tick| {
            let Some(frame) = tick.inputs.magnitude(0) else { return node.run(tick) };
            let status = node.run(tick)?;
            let out = tick.outputs.spectrum(0, frame.index, frame.start);
            change(&mut memory, frame.bins, (frame.index, frame.start), out);
            Ok(status)
        })
    })
}

/// Lets every bin run on by so many samples.
fn turn(spectrum: &mut [Complex<f32>], samples: f64, len: f64) {
    for (k, z) in spectrum.iter_mut().enumerate() {
        let (sin, cos) = (TAU * (k as f64 * samples / len).fract()).sin_cos();
        *z *= Complex::new(cos as f32, sin as f32);
    }
}

#[test]
fn phase_silence() {
    holds("phase_silence", &all());
    let hum = sounding(&subject(None), "oscillator_bank", |y, _| y.iter_mut().for_each(|x| *x += 1e-6));
    fails("phase_silence", &hum, "before its tone begins");
}

#[test]
fn phase_spectra() {
    holds("phase_spectra", &all());
    let loud = changed(|_, _, _, out| out.iter_mut().for_each(|z| *z *= 2.0));
    fails("phase_spectra", &loud, "the energy is");
}

#[test]
fn phase_alternating() {
    holds("phase_alternating", &all());
    // Frames that take turns are never got over.
    let hurt = changed(|before, given, _, out| {
        let now = f64::from(given.iter().fold(0.0, |m: f32, x| m.max(*x)));
        *before = if *before < 0.0 || now == 0.0 { -1.0 } else { now };
        if *before < 0.0 {
            out.iter_mut().for_each(|z| *z *= 0.8);
        }
    });
    fails("phase_alternating", &hurt, "the level is");
}

#[test]
fn phase_units() {
    holds("phase_units", &all());
    let absolute = changed(|_, _, _, out| {
        out.iter_mut().filter(|z| z.norm() < 1e-15).for_each(|z| *z = Complex::default());
    });
    fails("phase_units", &absolute, "a tone of 1e-30");
}

#[test]
fn phase_levels() {
    holds("phase_levels", &all());
    // What is a billionth of what there ever was is nothing.
    let dazzled = changed(|most, given, _, out| {
        *most = given.iter().fold(*most, |m, x| m.max(f64::from(*x)));
        out.iter_mut().filter(|z| f64::from(z.norm()) < 2e-9 * *most).for_each(|z| *z = Complex::default());
    });
    fails("phase_levels", &dazzled, "the level is");
}

#[test]
fn phase_no_magnitudes() {
    holds("phase_no_magnitudes", &all());
    let strict = mutant("spsi", |_| {
        Box::new(|node, tick| match tick.inputs.magnitude(0) {
            Some(frame) if frame.bins.iter().any(|m| !m.is_finite()) => Err(Fault::Failed(1)),
            _ => node.run(tick),
        })
    });
    fails("phase_no_magnitudes", &strict, "it fails in frame");
}

#[test]
fn phase_missing_frames() {
    holds("phase_missing_frames", &all());
    // Where no frame comes the last one comes again.
    let stuck = mutant("random_phase", |_| {
        let mut last: Option<Vec<Complex<f32>>> = None;
        Box::new(move |node, tick: &mut Tick<'_>| {
            if let Some(frame) = tick.inputs.magnitude(0) {
                let status = node.run(tick)?;
                last = Some(tick.outputs.spectrum(0, frame.index, frame.start).to_vec());
                return Ok(status);
            }
            let start = tick.samples(2500).start;
            if let Some(last) = &last {
                tick.outputs.spectrum(0, tick.index, start).copy_from_slice(last);
            }
            Ok(Status::Continue)
        })
    });
    fails("phase_missing_frames", &stuck, "without frames it is not silent");
}

#[test]
fn phase_hop_88_89() {
    holds("phase_hop_88_89", &all());
    // Every hop is taken for 88 samples.
    let even = mutant("spsi", |_| {
        Box::new(|node, tick| {
            let Some(frame) = tick.inputs.magnitude(0) else { return node.run(tick) };
            let status = node.run(tick)?;
            let ahead = frame.start as f64 - 88.0 * frame.index as f64;
            turn(tick.outputs.spectrum(0, frame.index, frame.start), -ahead, 4410.0);
            Ok(status)
        })
    });
    fails("phase_hop_88_89", &even, "at 44.1 kHz");
}

#[test]
fn phase_after_a_day() {
    holds("phase_after_a_day", &all());
    // The frame's first sample in single precision.
    let coarse = changed(|_, _, (_, start), out| turn(out, f64::from(start as f32) - start as f64, 250.0));
    fails("phase_after_a_day", &coarse, "spectral convergence is");
}

#[test]
fn phase_for_a_day() {
    holds("phase_for_a_day", &all());
    // A tone that is 0.05 Hz higher after ten seconds.
    let creeps = mutant("spsi", |_| {
        Box::new(|node, tick| {
            let Some(frame) = tick.inputs.magnitude(0) else { return node.run(tick) };
            let status = node.run(tick)?;
            let later = frame.index.saturating_sub(2500) as f64 / 250.0;
            let (sin, cos) = (TAU * (0.05 * later).fract()).sin_cos();
            let by = Complex::new(cos as f32, sin as f32);
            tick.outputs.spectrum(0, frame.index, frame.start).iter_mut().for_each(|z| *z *= by);
            Ok(status)
        })
    });
    fails("phase_for_a_day", &creeps, "0.01 Hz");
}

#[test]
fn phase_against_f64() {
    holds("phase_against_f64", &all());
    // In single precision a phase that is added up and never wrapped.
    let adds_up = mutant("spsi", |setup| {
        let single = setup.params.text("precision") == "f32";
        let mut turns = 0.0_f32;
        Box::new(move |node, tick| {
            let Some(frame) = tick.inputs.magnitude(0) else { return node.run(tick) };
            let status = node.run(tick)?;
            turns += 1000.3;
            let exact = 1000.3_f32 as f64 * (frame.index + 1) as f64;
            let by = if single { f64::from(turns) - exact } else { 0.0 };
            let (sin, cos) = (TAU * by.fract()).sin_cos();
            let by = Complex::new(cos as f32, sin as f32);
            tick.outputs.spectrum(0, frame.index, frame.start).iter_mut().for_each(|z| *z *= by);
            Ok(status)
        })
    });
    fails("phase_against_f64", &adds_up, "dB apart");
}
