//! A node whose kernel runs in single or in double precision, as its parameter `precision` says. What comes in and goes out is
//! in single precision either way.

use std::path::PathBuf;

use asperity_node::{
    Config, Descriptor, Diagnostic, Fact, Latency, Node, Param, Ports, Setup, State, Status, Tick,
};

/// The parameter `precision`.
pub(crate) fn precision() -> Param {
    Param::choice(
        "precision",
        &["f32", "f64"],
        "What the node computes in; f64 shows what f32 costs in accuracy. Inputs and outputs are f32.",
    )
}

/// The same node in one of two precisions: `Single` of f32, `Double` of f64.
///
/// `Single` has the parameter [`precision`], and what its descriptor says holds for both. What one remembers the other goes on from where
/// their states are written alike; what is not alike is refused.
pub enum Precise<Single, Double> {
    /// `precision: "f32"`.
    Single(Single),
    /// `precision: "f64"`.
    Double(Double),
}

/// The same of whichever node it is.
macro_rules! either {
    ($self:ident, $node:ident => $same:expr) => {
        match $self {
            Self::Single($node) => $same,
            Self::Double($node) => $same,
        }
    };
}

impl<Single: Node, Double: Node> Node for Precise<Single, Double> {
    fn descriptor() -> Descriptor {
        Single::descriptor()
    }

    fn ports(config: &Config<'_>, ports: Ports) -> Result<Ports, Diagnostic> {
        Single::ports(config, ports)
    }

    fn prepare(setup: &Setup<'_>) -> Result<Self, Diagnostic> {
        match setup.params.text("precision") {
            "f64" => Double::prepare(setup).map(Self::Double),
            _ => Single::prepare(setup).map(Self::Single),
        }
    }

    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        either!(self, node => node.process(tick))
    }

    fn reset(&mut self) {
        either!(self, node => node.reset());
    }

    fn wants(&mut self, tick: &mut Tick<'_>) -> bool {
        either!(self, node => node.wants(tick))
    }

    fn absorb(&mut self, tick: &mut Tick<'_>) {
        either!(self, node => node.absorb(tick));
    }

    fn elapsed(&mut self, ticks: u64) {
        either!(self, node => node.elapsed(ticks));
    }

    fn set_parameter(&mut self, index: usize, value: f64) {
        either!(self, node => node.set_parameter(index, value));
    }

    fn state(&mut self, state: &mut State<'_>) {
        either!(self, node => node.state(state));
    }

    fn latency(&self) -> Latency {
        either!(self, node => node.latency())
    }

    fn tail(&self) -> Latency {
        either!(self, node => node.tail())
    }

    fn duration(&self) -> Option<Latency> {
        either!(self, node => node.duration())
    }

    fn allocation_free(&self) -> bool {
        either!(self, node => node.allocation_free())
    }

    fn facts(&self) -> Vec<Fact> {
        either!(self, node => node.facts())
    }

    fn files(&self) -> Vec<PathBuf> {
        either!(self, node => node.files())
    }
}

#[cfg(test)]
#[path = "precision_tests.rs"]
mod tests;
