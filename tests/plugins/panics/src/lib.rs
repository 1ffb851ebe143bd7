//! A plugin for the tests, whose node panics when told to.

use asperity_sdk::{
    Descriptor, Diagnostic, Node, Output, Param, Prepared, Processor, RateSpec, Setup, ShapeSpec, Status,
    Tick, Unit,
};

/// A slow wave, but for one tick.
#[derive(Debug)]
pub struct Panics {
    at: u64,
}

impl Node for Panics {
    fn descriptor() -> Descriptor {
        Descriptor::new("panics", "Panics when told to.")
            .output(Output::new("out", ShapeSpec::Audio(RateSpec::Graph), Unit::AMPERE).doc("a slow wave"))
            .param(Param::integer("at", 100, 0..=i64::MAX, "In which tick."))
            .param(Param::flag("early", false, "While it is prepared."))
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        assert!(!setup.params.flag("early"), "as told, early");
        Ok(Prepared::new(Self { at: setup.params.integer("at") as u64 }))
    }
}

impl Processor for Panics {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        assert!(tick.index != self.at, "as told");
        let span = tick.samples(48_000);
        for (y, n) in tick.outputs.audio(0).iter_mut().zip(span) {
            *y = 0.1 * (n as f32 * 0.01).sin();
        }
        Status::Continue
    }

    fn reset(&mut self) {}
}

asperity_sdk::export!(Panics);
