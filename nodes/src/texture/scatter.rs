//! `scatter`: from expected magnitudes to those of one random signal.

use crate::prelude::*;
use asperity_dsp::Float;
use asperity_dsp::scatter::{self, Statistics};

use crate::phase::{framing, kernel_error, seed_of};
use crate::precision::{in_precision, precision};

/// Scatters magnitudes about their expected values, as those of noise, or of lines in noise, scatter.
pub struct Scatter<T = f32> {
    kernel: scatter::Scatter<T>,
    strength: f64,
    bad: u64,
}

impl Node for Scatter {
    fn descriptor() -> Descriptor {
        Descriptor::new(
            "scatter",
            "Scatters expected magnitudes like those of a random signal. Without it, phase retrieval \
             makes a signal that repeats.",
        )
        .input(magnitude().doc("expected magnitudes"))
        .input(Input::new("ratio", ShapeSpec::Magnitude(LayoutSpec::Of('l')), Unit::NONE).or(0.0).doc(
            "mean divided by rms of each bin: up to 0.886 noise, 1 a steady line; if unconnected, noise",
        ))
        .input(control("statistics", 2, ONE).or(-1.0).doc(
            "variance of a frame's power over its squared mean, below 0 unknown; then above 0 if \
             magnitudes are means",
        ))
        .output(Output::new("magnitude", ShapeSpec::Magnitude(LayoutSpec::Of('l')), Unit::NONE).unit_of('u'))
        .doc("magnitudes of one random signal")
        .param(number("strength", 1.0, 0.0..=1.0, "").live())
        .doc("Strength of the scatter; 0 leaves magnitudes unchanged.")
        .param(seed().doc("Seed of its random numbers; left out, derived from the graph's seed."))
        .param(precision())
        .timing("no latency")
        // Noise follows from the frame's number.
        .resumes(Resume::Continue)
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        in_precision(setup, prepare::<f32>, prepare::<f64>)
    }
}

fn prepare<T: Float>(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
    let kernel = scatter::Scatter::new(framing(setup)?, seed_of(setup)).map_err(kernel_error(setup))?;
    Ok(Prepared::new(Scatter::<T> { kernel, strength: setup.params.number("strength"), bad: 0 }))
}

impl<T: Float> Processor for Scatter<T> {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let Some(frame) = tick.inputs.magnitude(0) else { return Status::Quiet };
        let ratio = tick.inputs.magnitude(1).filter(|r| r.index == frame.index).map_or(&[][..], |r| r.bins);
        let statistics = tick.inputs.control(2);
        let value = |at: usize| statistics.get(at).copied();
        let known = Statistics {
            ratio,
            variance: value(0).filter(|v| *v >= 0.0),
            means: value(1).is_some_and(|v| v > 0.0),
        };
        let out = tick.outputs.magnitude(0, frame.index, frame.start);
        self.bad += self.kernel.process(frame.index, frame.bins, known, self.strength, out) as u64;
        Status::Continue
    }

    fn set_parameter(&mut self, index: usize, value: f64) {
        if index == 0 {
            self.strength = value;
        }
    }

    fn facts(&mut self) -> Vec<Fact> {
        vec![Fact::count("bad_magnitudes", self.bad)]
    }
}
