//! `my_filter`: a node to change. It softens a signal.

use asperity_sdk::{
    Descriptor, Diagnostic, Input, Node, Output, Param, Prepared, Processor, RateSpec, Setup, ShapeSpec,
    State, Status, Tick, Unit,
};

/// A one-pole low pass.
pub struct MyFilterNode {
    memory: f32,
    softness: f32,
}

impl Node for MyFilterNode {
    fn descriptor() -> Descriptor {
        let audio = ShapeSpec::Audio(RateSpec::Of('r'));
        Descriptor::new("my_filter", "Softens a signal.")
            .input(Input::new("in", audio, Unit::NONE).unit_of('u').doc("any signal"))
            .output(Output::new("out", audio, Unit::NONE).unit_of('u').doc("softer signal"))
            .param(Param::number("softness", 0.9, 0.0..=0.999, "Softness; 0 changes nothing.").live())
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        Ok(Prepared::new(Self { memory: 0.0, softness: setup.params.number("softness") as f32 }))
    }
}

impl Processor for MyFilterNode {
    // Real time: nothing here may allocate, lock, print or panic.
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        for (y, x) in tick.outputs.audio(0).iter_mut().zip(tick.inputs.audio(0)) {
            // What is not a number must not stay for ever.
            self.memory = if x.is_finite() { x + self.softness * (self.memory - x) } else { 0.0 };
            *y = self.memory;
        }
        Status::Continue
    }

    fn set_parameter(&mut self, _index: usize, value: f64) {
        self.softness = value as f32;
    }

    fn reset(&mut self) {
        self.memory = 0.0;
    }

    fn state(&mut self, state: &mut State<'_>) {
        state.keep(&mut self.memory);
    }
}

asperity_sdk::export!(MyFilterNode);
