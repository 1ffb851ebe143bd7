//! Phase retrieval frame by frame: `phase_vocoder`, `random_phase` and `spsi`.

use crate::prelude::*;
use asperity_dsp::{Complex, Float, Level, StartPhase, phase_vocoder, random_phase, spsi};

use super::{framing, kernel_error, seed_of};
use crate::precision::{in_precision, precision};

/// Integrates each bin's centre frequency, from start phases that spread the energy over the window.
pub struct PhaseVocoder;

/// Independent uniform phases: the baseline for other methods.
pub struct RandomPhase;

/// Gives every frame of magnitudes a phase at once (Beauregard, Harish, Wyse 2015).
pub struct Spsi;

/// A kernel that gives a frame of magnitudes phases.
trait Kernel: Send + 'static {
    /// Writes the spectrum of a frame. Returns how many magnitudes were bad.
    fn process(&mut self, index: u64, start: u64, bins: &[f32], out: &mut [Complex<f32>]) -> usize;
    fn reset(&mut self) {}
    fn state(&mut self, _state: &mut State<'_>) {}
}

/// A node with its kernel.
struct Running<K> {
    kernel: K,
    bad: u64,
}

fn running<K: Kernel>(kernel: K) -> Prepared {
    Prepared::new(Running { kernel, bad: 0 })
}

impl<K: Kernel> Processor for Running<K> {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let Some(frame) = tick.inputs.magnitude(0) else { return Status::Quiet };
        let out = tick.outputs.spectrum(0, frame.index, frame.start);
        self.bad += self.kernel.process(frame.index, frame.start, frame.bins, out) as u64;
        Status::Continue
    }

    fn reset(&mut self) {
        self.kernel.reset();
    }

    fn state(&mut self, state: &mut State<'_>) {
        self.kernel.state(state);
    }

    fn facts(&mut self) -> Vec<Fact> {
        vec![Fact::count("bad_magnitudes", self.bad)]
    }
}

impl Node for PhaseVocoder {
    fn descriptor() -> Descriptor {
        Descriptor::new(
            "phase_vocoder",
            "Phase vocoder: each bin continues at its centre frequency. For smooth magnitudes.",
        )
        .input(magnitude().doc("magnitudes of the next frame"))
        .output(spectrum_out().doc("magnitudes with phases"))
        .param(choice("start", &["quadratic", "random", "zero"]).doc(
            "Start phases. `quadratic` beats least and spreads energy over the window. `zero` puts all \
             energy at one instant.",
        ))
        .param(choice("level", &["keep", "plain"]))
        .doc(
            "Level correction. `keep` adds 1.76 dB, so that steady magnitudes keep their energy through \
             overlap-add.",
        )
        .param(seed().doc("Seed of random start phases; left out, derived from the graph's seed."))
        .param(precision())
        // Phases follow from the frame's place in time.
        .resumes(Resume::Continue)
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        fn prepare<T: Float>(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
            let start = match setup.params.text("start") {
                "zero" => StartPhase::Zero,
                "random" => StartPhase::Random,
                _ => StartPhase::Quadratic,
            };
            let level = if setup.params.text("level") == "plain" { Level::Plain } else { Level::Keep };
            let kernel = phase_vocoder::PhaseVocoder::<T>::new(framing(setup)?, start, level, seed_of(setup));
            Ok(running(kernel.map_err(kernel_error(setup))?))
        }
        in_precision(setup, prepare::<f32>, prepare::<f64>)
    }
}

impl<T: Float> Kernel for phase_vocoder::PhaseVocoder<T> {
    fn process(&mut self, _index: u64, start: u64, bins: &[f32], out: &mut [Complex<f32>]) -> usize {
        self.process(start, bins, out)
    }
}

impl Node for RandomPhase {
    fn descriptor() -> Descriptor {
        Descriptor::new(
            "random_phase",
            "Independent random phases: a baseline. Overlap-add makes them 17 dB too quiet at 50 frames \
             per window.",
        )
        .input(magnitude().doc("magnitudes of the next frame"))
        .output(spectrum_out().doc("magnitudes with phases"))
        .param(choice("level", &["plain", "keep"]).doc(
            "Level correction. `keep` multiplies by the square root of the frames per window, so that \
             magnitudes keep their energy through overlap-add.",
        ))
        .param(seed().doc("Seed of its random numbers; left out, derived from the graph's seed."))
        .param(precision())
        // Phases follow from the frame's number.
        .resumes(Resume::Continue)
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        fn prepare<T: Float>(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
            let level = if setup.params.text("level") == "keep" { Level::Keep } else { Level::Plain };
            let kernel = random_phase::RandomPhase::<T>::new(framing(setup)?, level, seed_of(setup));
            Ok(running(kernel.map_err(kernel_error(setup))?))
        }
        in_precision(setup, prepare::<f32>, prepare::<f64>)
    }
}

impl<T: Float> Kernel for random_phase::RandomPhase<T> {
    fn process(&mut self, index: u64, _start: u64, bins: &[f32], out: &mut [Complex<f32>]) -> usize {
        self.process(index, bins, out)
    }
}

impl Node for Spsi {
    fn descriptor() -> Descriptor {
        Descriptor::new(
            "spsi",
            "Single Pass Spectrogram Inversion: each peak continues as a sinusoid, with its neighbours \
             locked to it.",
        )
        .input(magnitude().doc("magnitudes of the next frame"))
        .output(spectrum_out().doc("magnitudes with phases"))
        .param(seed().doc("Seed of the start phases; left out, derived from the graph's seed."))
        .param(precision())
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        fn prepare<T: Float>(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
            let framing = framing(setup)?;
            let kernel = spsi::Spsi::<T>::new(framing.fft_len, framing.bins, seed_of(setup));
            Ok(running(SpsiKernel { kernel, before: None }))
        }
        in_precision(setup, prepare::<f32>, prepare::<f64>)
    }
}

struct SpsiKernel<T> {
    kernel: spsi::Spsi<T>,
    /// Start of the frame before.
    before: Option<u64>,
}

impl<T: Float> Kernel for SpsiKernel<T> {
    fn process(&mut self, _index: u64, start: u64, bins: &[f32], out: &mut [Complex<f32>]) -> usize {
        let before = self.before.replace(start).unwrap_or(start);
        let step = u32::try_from(start.saturating_sub(before)).unwrap_or(u32::MAX);
        self.kernel.process(bins, step, out)
    }

    fn reset(&mut self) {
        self.kernel.reset();
        self.before = None;
    }

    /// Phases of all bins, whatever the seed.
    fn state(&mut self, state: &mut State<'_>) {
        self.kernel.state(state);
        state.keep(&mut self.before);
    }
}
