//! `my_phase`: a phase-retrieval node to change.
//!
//! Its input is the strength of each frequency, frame by frame. It finds phases with which overlapping
//! frames agree. This one lets every bin run on at the frequency of its centre, which is simple and not very
//! good: a sinusoid that lies between two bins beats. `asperity compare --plugin` says how it does beside
//! all others.

use std::f64::consts::TAU;

use asperity_sdk::{
    Complex, Descriptor, Diagnostic, Fact, Input, LayoutSpec, Node, Output, Param, Prepared, Processor,
    Setup, Shape, ShapeSpec, State, Status, Tick, Unit, random,
};

/// Magnitudes in, spectra out. An `overlap_add` after it makes the signal.
pub struct MyPhaseNode {
    /// Samples of a frame.
    length: f64,
    /// Phase of each bin at the frame's first sample, in turns.
    turns: Vec<f64>,
    /// First sample of the frame before.
    before: Option<u64>,
    spread: f64,
    seed: u64,
    bad: u64,
}

impl Node for MyPhaseNode {
    fn descriptor() -> Descriptor {
        Descriptor::new("my_phase", "Continues every bin at its centre frequency.")
            .input(
                Input::new("magnitude", ShapeSpec::Magnitude(LayoutSpec::Of('l')), Unit::NONE)
                    .unit_of('u')
                    .doc("magnitudes of the next frame"),
            )
            .output(
                Output::new("spectrum", ShapeSpec::Spectrum(LayoutSpec::Of('l')), Unit::NONE)
                    .unit_of('u')
                    .doc("the same magnitudes with phases"),
            )
            .param(Param::number("spread", 1.0, 0.0..=1.0, "Spread of the start phases, in turns."))
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let Some(Shape::Magnitude(layout)) = setup.input(0).map(|p| p.shape) else {
            return Err(setup.params.node_error("the layout of the frames cannot be determined"));
        };
        let mut node = Self {
            length: f64::from(layout.length),
            turns: vec![0.0; layout.bins as usize],
            before: None,
            spread: setup.params.number("spread"),
            seed: setup.seed,
            bad: 0,
        };
        node.reset();
        Ok(Prepared::new(node))
    }
}

impl Processor for MyPhaseNode {
    // Real time: nothing here may allocate, lock, print or panic.
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let Some(frame) = tick.inputs.magnitude(0) else { return Status::Quiet };
        let hop = frame.start.saturating_sub(self.before.unwrap_or(frame.start)) as f64;
        self.before = Some(frame.start);
        let out = tick.outputs.spectrum(0, frame.index, frame.start);
        for (k, ((bin, &m), turns)) in out.iter_mut().zip(frame.bins).zip(&mut self.turns).enumerate() {
            *turns = (*turns + k as f64 * hop / self.length).fract();
            let good = m >= 0.0 && m.is_finite();
            self.bad += u64::from(!good);
            *bin = Complex::from_polar(if good { m } else { 0.0 }, (TAU * *turns) as f32);
        }
        Status::Continue
    }

    fn reset(&mut self) {
        for (k, turns) in self.turns.iter_mut().enumerate() {
            *turns = self.spread * random::uniform(self.seed, k as u64);
        }
        self.before = None;
    }

    // What another instance needs to go on without a break when the plugin is swapped while it runs.
    fn state(&mut self, state: &mut State<'_>) {
        state.keep(&mut self.turns).keep(&mut self.before);
    }

    fn facts(&mut self) -> Vec<Fact> {
        vec![Fact::count("bad_magnitudes", self.bad)]
    }
}

asperity_sdk::export!(MyPhaseNode);
