//! The nodes around the one under test, and a kind that lets one see the ports it came to have.

use std::sync::{Arc, OnceLock};

use asperity_node::{
    Config, Descriptor, Diagnostic, Fault, Input, NodeKind, Output, Ports, Processor, Resume, Setup,
    ShapeSpec, Status, Tick, Unit, UnitSpec,
};

use crate::conformance::signal::{Feed, Signal};

/// A source of any signal for one input.
pub(crate) struct Source {
    descriptor: Descriptor,
    signal: Signal,
    seed: u64,
}

impl Source {
    pub(crate) fn new(
        name: &str,
        shape: ShapeSpec,
        unit: Unit,
        limited: bool,
        signal: Signal,
        seed: u64,
    ) -> Self {
        let mut output = Output::new("out", shape, unit);
        output.limited = limited;
        // What it puts out depends on the tick alone.
        let descriptor =
            Descriptor::new(name.to_owned(), "Any signal.").output(output).resumes(Resume::Resume);
        Self { descriptor, signal, seed }
    }
}

impl NodeKind for Source {
    fn descriptor(&self) -> &Descriptor {
        &self.descriptor
    }
    fn ports(&self, _: &Config<'_>) -> Result<Ports, Diagnostic> {
        Ok(Ports { inputs: Vec::new(), outputs: self.descriptor.outputs.clone() })
    }
    fn prepare(&self, setup: &Setup<'_>) -> Result<Box<dyn Processor>, Diagnostic> {
        let port = setup.output(0).ok_or_else(|| Diagnostic::new("the source has no type"))?;
        Ok(Box::new(Playing(Feed::new(self.signal, self.seed, port, setup.tick_hz, setup.every))))
    }
}

struct Playing(Feed);

impl Processor for Playing {
    fn process(&mut self, tick: &mut Tick<'_>) -> Result<Status, Fault> {
        let (index, hz) = (tick.index, tick.tick_hz);
        tick.outputs.buffers().iter_mut().for_each(|b| self.0.fill(b, index, hz, false));
        Ok(Status::Continue)
    }
    fn reset(&mut self) -> Result<(), Fault> {
        Ok(())
    }
}

/// A sink for any output.
pub(crate) struct Probe(Descriptor);

impl Probe {
    /// Its name, which no kind of a graph can have.
    pub(crate) const KIND: &'static str = "conformance probe";

    pub(crate) fn new() -> Self {
        let input = Input::new("in", ShapeSpec::Like('s'), Unit::NONE).unit_of('u');
        Self(Descriptor::new(Self::KIND, "Looks on.").input(input).sink())
    }
}

impl NodeKind for Probe {
    fn descriptor(&self) -> &Descriptor {
        &self.0
    }
    fn ports(&self, _: &Config<'_>) -> Result<Ports, Diagnostic> {
        Ok(Ports { inputs: self.0.inputs.clone(), outputs: Vec::new() })
    }
    fn prepare(&self, _: &Setup<'_>) -> Result<Box<dyn Processor>, Diagnostic> {
        Ok(Box::new(Looking))
    }
}

struct Looking;

impl Processor for Looking {
    fn process(&mut self, _: &mut Tick<'_>) -> Result<Status, Fault> {
        Ok(Status::Continue)
    }
    fn reset(&mut self) -> Result<(), Fault> {
        Ok(())
    }
}

/// The kind under test, and the ports that its parameters led to.
pub(crate) struct Watched {
    kind: Arc<dyn NodeKind>,
    ports: OnceLock<Ports>,
}

impl Watched {
    pub(crate) fn new(kind: Arc<dyn NodeKind>) -> Self {
        Self { kind, ports: OnceLock::new() }
    }

    /// The ports, once a graph with this kind in it has been looked at.
    pub(crate) fn seen(&self) -> Option<&Ports> {
        self.ports.get()
    }
}

impl NodeKind for Watched {
    fn descriptor(&self) -> &Descriptor {
        self.kind.descriptor()
    }
    fn ports(&self, config: &Config<'_>) -> Result<Ports, Diagnostic> {
        let ports = self.kind.ports(config)?;
        Ok(self.ports.get_or_init(|| ports).clone())
    }
    fn prepare(&self, setup: &Setup<'_>) -> Result<Box<dyn Processor>, Diagnostic> {
        self.kind.prepare(setup)
    }
}

/// The unit of a source for an input.
pub(crate) fn unit(spec: &UnitSpec) -> Unit {
    match spec {
        UnitSpec::Is(unit) => unit.clone(),
        UnitSpec::Of { among, .. } => among.first().cloned().unwrap_or(Unit::NEWTON),
    }
}
