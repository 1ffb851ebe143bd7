//! `spsi`: Single Pass Spectrogram Inversion.

use asperity_dsp::{Float, spsi};
use asperity_node::{
    Descriptor, Diagnostic, Fact, Input, LayoutSpec, Node, Output, Param, Prepared, Processor, Setup, Shape,
    ShapeSpec, State, Status, Tick, Unit,
};

use crate::precision::{in_precision, precision};

/// Gives every frame of magnitudes a phase at once (Beauregard, Harish, Wyse 2015).
pub struct Spsi;

/// `spsi` in one precision.
struct Running<T> {
    spsi: spsi::Spsi<T>,
    /// Start of the frame before.
    before: Option<u64>,
    bad: u64,
}

impl Node for Spsi {
    fn descriptor() -> Descriptor {
        Descriptor::new(
            "spsi",
            "Single Pass Spectrogram Inversion: each peak runs on as a sinusoid, its neighbours locked to \
             it.",
        )
        .input(
            Input::new("magnitude", ShapeSpec::Magnitude(LayoutSpec::Of('l')), Unit::NONE)
                .unit_of('u')
                .doc("what the next frame is to have"),
        )
        .output(
            Output::new("spectrum", ShapeSpec::Spectrum(LayoutSpec::Of('l')), Unit::NONE)
                .unit_of('u')
                .doc("the same magnitudes with phases"),
        )
        .param(
            Param::integer("seed", 1, 0..=i64::MAX, "Seed of the start phases; left out, from the graph's.")
                .optional(),
        )
        .param(precision())
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        in_precision(setup, prepare::<f32>, prepare::<f64>)
    }
}

fn prepare<T: Float>(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
    let Some(Shape::Magnitude(layout)) = setup.input(0).map(|p| p.shape) else {
        return Err(setup.params.node_error("nothing settles the layout of the frames"));
    };
    let seed = setup.params.get_integer("seed").map_or(setup.seed, |s| s as u64);
    let spsi = spsi::Spsi::new(layout.length as usize, layout.bins as usize, seed);
    Ok(Prepared::new(Running::<T> { spsi, before: None, bad: 0 }))
}

impl<T: Float> Processor for Running<T> {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let Some(frame) = tick.inputs.magnitude(0) else { return Status::Quiet };
        let before = self.before.replace(frame.start).unwrap_or(frame.start);
        let out = tick.outputs.spectrum(0, frame.index, frame.start);
        self.bad += self.spsi.process(
            frame.bins,
            u32::try_from(frame.start.saturating_sub(before)).unwrap_or(u32::MAX),
            out,
        ) as u64;
        Status::Continue
    }

    fn reset(&mut self) {
        self.spsi.reset();
        self.before = None;
    }

    /// Phases of all bins, whatever the seed.
    fn state(&mut self, state: &mut State<'_>) {
        self.spsi.state(state);
        state.keep(&mut self.before);
    }

    fn facts(&mut self) -> Vec<Fact> {
        vec![Fact::count("bad_magnitudes", self.bad)]
    }
}
