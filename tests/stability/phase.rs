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

/// A spectrum that a mutant changes.
struct Call<'a> {
    /// A number to remember something in.
    memory: &'a mut f64,
    /// Whether the node computes in single precision.
    single: bool,
    magnitudes: &'a [f32],
    /// The frame's number and first sample.
    frame: (u64, u64),
    out: &'a mut [Complex<f32>],
}

impl Call<'_> {
    /// Lets each bin run on by so many turns.
    fn turn(&mut self, turns: impl Fn(f64) -> f64) {
        for (k, z) in self.out.iter_mut().enumerate() {
            let (sin, cos) = (TAU * turns(k as f64).fract()).sin_cos();
            *z *= Complex::new(cos as f32, sin as f32);
        }
    }

    /// Multiplies the bins whose size is so.
    fn scale(&mut self, by: f32, of: impl Fn(f64) -> bool) {
        self.out.iter_mut().filter(|z| of(f64::from(z.norm()))).for_each(|z| *z *= by);
    }
}

/// A kind whose spectra are changed.
fn changed(kind: &str, change: fn(Call<'_>)) -> Subject<'static> {
    mutant(kind, move |setup| {
        let single = setup.params.text("precision") == "f32";
        let mut memory = 0.0;
        Box::new(move |node, tick| {
            let Some(frame) = tick.inputs.magnitude(0) else { return node.run(tick) };
            let status = node.run(tick)?;
            let out = tick.outputs.spectrum(0, frame.index, frame.start);
            let (magnitudes, frame) = (frame.bins, (frame.index, frame.start));
            change(Call { memory: &mut memory, single, magnitudes, frame, out });
            Ok(status)
        })
    })
}

#[test]
fn phase_silence() {
    holds("phase_silence", &all());
    let hum = sounding(&subject(None), "oscillator_bank", |y, _| y.iter_mut().for_each(|x| *x += 1e-6));
    fails("phase_silence", &hum, "before its tone begins");
}

/// A case holds, and fails for a kind whose spectra are changed.
fn holds_but_for(case: &str, kind: &str, change: fn(Call<'_>), why: &str) {
    holds(case, &all());
    fails(case, &changed(kind, change), why);
}

#[test]
fn phase_spectra() {
    holds_but_for("phase_spectra", "phase_vocoder", |mut it| it.scale(2.0, |_| true), "the energy is");
}

/// Frames that take turns are never got over.
#[test]
fn phase_alternating() {
    let change = |mut it: Call<'_>| {
        let now = f64::from(it.magnitudes.iter().fold(0.0, |m: f32, x| m.max(*x)));
        *it.memory = if *it.memory < 0.0 || now == 0.0 { -1.0 } else { now };
        let hurt = *it.memory < 0.0;
        it.scale(0.8, |_| hurt);
    };
    holds_but_for("phase_alternating", "phase_vocoder", change, "the level is");
}

#[test]
fn phase_units() {
    let absolute = |mut it: Call<'_>| it.scale(0.0, |size| size < 1e-15);
    holds_but_for("phase_units", "phase_vocoder", absolute, "a tone of 1e-30");
}

/// A billionth of what there ever was is nothing.
#[test]
fn phase_levels() {
    let dazzled = |mut it: Call<'_>| {
        *it.memory = it.magnitudes.iter().fold(*it.memory, |m, x| m.max(f64::from(*x)));
        let most = *it.memory;
        it.scale(0.0, |size| size < 2e-9 * most);
    };
    holds_but_for("phase_levels", "phase_vocoder", dazzled, "the level is");
}

/// Every hop is taken for 88 samples.
#[test]
fn phase_hop_88_89() {
    let even = |mut it: Call<'_>| {
        let ahead = it.frame.1 as f64 - 88.0 * it.frame.0 as f64;
        it.turn(|k| -k * ahead / 4410.0);
    };
    holds_but_for("phase_hop_88_89", "spsi", even, "at 44.1 kHz");
}

/// The frame's first sample in single precision.
#[test]
fn phase_after_a_day() {
    let coarse = |mut it: Call<'_>| {
        let off = f64::from(it.frame.1 as f32) - it.frame.1 as f64;
        it.turn(|k| k * off / 250.0);
    };
    holds_but_for("phase_after_a_day", "phase_vocoder", coarse, "spectral convergence is");
}

/// A tone that is 0.05 Hz higher after ten seconds.
#[test]
fn phase_for_a_day() {
    let creeps = |mut it: Call<'_>| {
        let later = it.frame.0.saturating_sub(2500) as f64 / 250.0;
        it.turn(|_| 0.05 * later);
    };
    holds_but_for("phase_for_a_day", "spsi", creeps, "0.01 Hz");
}

/// In single precision a phase that is added up and never wrapped.
#[test]
fn phase_against_f64() {
    let adds_up = |mut it: Call<'_>| {
        *it.memory = f64::from(*it.memory as f32 + 1000.3);
        let exact = 1000.3_f32 as f64 * (it.frame.0 + 1) as f64;
        let by = if it.single { *it.memory - exact } else { 0.0 };
        it.turn(|_| by);
    };
    holds_but_for("phase_against_f64", "spsi", adds_up, "dB apart");
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
