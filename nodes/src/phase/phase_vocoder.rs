//! `phase_vocoder`: every bin runs on at its centre frequency.

use asperity_dsp::{Float, Level, StartPhase, phase_vocoder};
use asperity_node::{
    Descriptor, Diagnostic, Fact, Input, LayoutSpec, Node, Output, Param, Prepared, Processor, Resume, Setup,
    ShapeSpec, Status, Tick, Unit,
};

use crate::precision::{in_precision, precision};

/// Integrates each bin's centre frequency, from start phases that spread the energy over the window.
pub struct PhaseVocoder;

/// `phase_vocoder` in one precision.
struct Running<T> {
    kernel: phase_vocoder::PhaseVocoder<T>,
    bad: u64,
}

impl Node for PhaseVocoder {
    fn descriptor() -> Descriptor {
        Descriptor::new(
            "phase_vocoder",
            "Every bin runs on at its centre frequency; right in level and spectrum for smooth magnitudes.",
        )
        .input(
            Input::new("magnitude", ShapeSpec::Magnitude(LayoutSpec::Of('l')), Unit::NONE)
                .unit_of('u')
                .doc("what the next frame is to have"),
        )
        .output(
            Output::new("spectrum", ShapeSpec::Spectrum(LayoutSpec::Of('l')), Unit::NONE)
                .unit_of('u')
                .doc("the magnitudes with phases"),
        )
        .param(Param::choice(
            "start",
            &["quadratic", "random", "zero"],
            "Start phases: quadratic beats least and spreads the energy over the window, zero puts it at one \
             instant.",
        ))
        .param(Param::choice(
            "level",
            &["keep", "plain"],
            "Keep scales up by 1.76 dB, so that steady magnitudes keep their energy through overlap-add.",
        ))
        .param(
            Param::integer(
                "seed",
                1,
                0..=i64::MAX,
                "Seed of random start phases; left out, from the graph's.",
            )
            .optional(),
        )
        .param(precision())
        // Phases follow from the frame's place in time.
        .resumes(Resume::Continue)
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        in_precision(setup, prepare::<f32>, prepare::<f64>)
    }
}

fn prepare<T: Float>(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
    let params = setup.params;
    let start = match params.text("start") {
        "zero" => StartPhase::Zero,
        "random" => StartPhase::Random,
        _ => StartPhase::Quadratic,
    };
    let level = if params.text("level") == "plain" { Level::Plain } else { Level::Keep };
    let kernel = phase_vocoder::PhaseVocoder::new(super::framing(setup)?, start, level, super::seed(setup))
        .map_err(|e| params.node_error(e.to_string()))?;
    Ok(Prepared::new(Running::<T> { kernel, bad: 0 }))
}

impl<T: Float> Processor for Running<T> {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let Some(frame) = tick.inputs.magnitude(0) else { return Status::Quiet };
        let out = tick.outputs.spectrum(0, frame.index, frame.start);
        self.bad += self.kernel.process(frame.start, frame.bins, out) as u64;
        Status::Continue
    }

    fn reset(&mut self) {}

    fn facts(&mut self) -> Vec<Fact> {
        vec![Fact::count("bad_magnitudes", self.bad)]
    }
}
