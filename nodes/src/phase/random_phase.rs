//! `random_phase`: a phase drawn anew for every bin of every frame.

use asperity_dsp::{Float, Level, random_phase};
use asperity_node::{
    Descriptor, Diagnostic, Fact, Input, LayoutSpec, Node, Output, Param, Prepared, Processor, Resume, Setup,
    ShapeSpec, Status, Tick, Unit,
};

use crate::precision::{in_precision, precision};

/// Independent uniform phases: the baseline for other methods.
pub struct RandomPhase;

/// `random_phase` in one precision.
struct Running<T> {
    kernel: random_phase::RandomPhase<T>,
    bad: u64,
}

impl Node for RandomPhase {
    fn descriptor() -> Descriptor {
        Descriptor::new(
            "random_phase",
            "Independent random phases, the least that can be done; overlap-add makes them 17 dB too quiet \
             at 50 frames a window.",
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
            "level",
            &["plain", "keep"],
            "Keep scales up by the square root of the frames a window, so that magnitudes keep their energy \
             through overlap-add.",
        ))
        .param(
            Param::integer("seed", 1, 0..=i64::MAX, "Seed of the phases; left out, from the graph's.")
                .optional(),
        )
        .param(precision())
        // Phases follow from the frame's number.
        .resumes(Resume::Continue)
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        in_precision(setup, prepare::<f32>, prepare::<f64>)
    }
}

fn prepare<T: Float>(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
    let level = if setup.params.text("level") == "keep" { Level::Keep } else { Level::Plain };
    let kernel = random_phase::RandomPhase::new(super::framing(setup)?, level, super::seed(setup))
        .map_err(|e| setup.params.node_error(e.to_string()))?;
    Ok(Prepared::new(Running::<T> { kernel, bad: 0 }))
}

impl<T: Float> Processor for Running<T> {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let Some(frame) = tick.inputs.magnitude(0) else { return Status::Quiet };
        let out = tick.outputs.spectrum(0, frame.index, frame.start);
        self.bad += self.kernel.process(frame.index, frame.bins, out) as u64;
        Status::Continue
    }

    fn reset(&mut self) {}

    fn facts(&mut self) -> Vec<Fact> {
        vec![Fact::count("bad_magnitudes", self.bad)]
    }
}
