//! Wraps a kind, so that its nodes are called in another way.

use std::path::PathBuf;
use std::sync::Arc;

use asperity_node::{
    Config, Descriptor, Diagnostic, Fact, Fault, Guard, Latency, NodeKind, Ports, Processor, Setup, Status,
    Tick,
};

/// Called instead of a node's `process`, with the node.
pub type Process = Box<dyn FnMut(&mut dyn Processor, &mut Tick<'_>) -> Result<Status, Fault> + Send>;

/// Makes a [`Process`] for a node.
pub type Maker = Arc<dyn Fn(&Setup<'_>) -> Process + Send + Sync>;

struct Wrapped {
    inner: Arc<dyn NodeKind>,
    make: Maker,
}

/// A kind with the same name, ports and parameters. Its nodes are called by the process that `make` makes.
pub fn wrap(inner: Arc<dyn NodeKind>, make: Maker) -> Arc<dyn NodeKind> {
    Arc::new(Wrapped { inner, make })
}

/// A kind whose nodes run as they are, and then have their outputs changed.
pub fn after(
    inner: Arc<dyn NodeKind>,
    change: impl Fn(&mut Tick<'_>) + Clone + Send + Sync + 'static,
) -> Arc<dyn NodeKind> {
    let make = move |_: &Setup<'_>| -> Process {
        let change = change.clone();
        Box::new(move |node, tick| {
            let status = node.process(tick)?;
            change(tick);
            // A quiet output may have changed.
            Ok(if status == Status::Quiet { Status::Continue } else { status })
        })
    };
    wrap(inner, Arc::new(make))
}

impl NodeKind for Wrapped {
    fn descriptor(&self) -> &Descriptor {
        self.inner.descriptor()
    }

    fn origin(&self) -> &str {
        self.inner.origin()
    }

    fn ports(&self, config: &Config<'_>) -> Result<Ports, Diagnostic> {
        self.inner.ports(config)
    }

    fn prepare(&self, setup: &Setup<'_>) -> Result<Box<dyn Processor>, Diagnostic> {
        Ok(Box::new(Node { inner: self.inner.prepare(setup)?, process: (self.make)(setup) }))
    }
}

struct Node {
    inner: Box<dyn Processor>,
    process: Process,
}

impl Processor for Node {
    fn process(&mut self, tick: &mut Tick<'_>) -> Result<Status, Fault> {
        (self.process)(&mut *self.inner, tick)
    }
    fn reset(&mut self) -> Result<(), Fault> {
        self.inner.reset()
    }
    fn wants(&mut self, tick: &mut Tick<'_>) -> Result<bool, Fault> {
        self.inner.wants(tick)
    }
    fn absorb(&mut self, tick: &mut Tick<'_>) -> Result<(), Fault> {
        self.inner.absorb(tick)
    }
    fn elapsed(&mut self, ticks: u64) -> Result<(), Fault> {
        self.inner.elapsed(ticks)
    }
    fn set_parameter(&mut self, index: usize, value: f64) -> Result<(), Fault> {
        self.inner.set_parameter(index, value)
    }
    fn state_size(&mut self) -> usize {
        self.inner.state_size()
    }
    fn save(&mut self, bytes: &mut [u8]) -> Option<usize> {
        self.inner.save(bytes)
    }
    fn restore(&mut self, bytes: &[u8]) -> bool {
        self.inner.restore(bytes)
    }
    fn latency(&self) -> Latency {
        self.inner.latency()
    }
    fn tail(&self) -> Latency {
        self.inner.tail()
    }
    fn duration(&self) -> Option<Latency> {
        self.inner.duration()
    }
    fn allocation_free(&self) -> bool {
        self.inner.allocation_free()
    }
    fn facts(&self) -> Vec<Fact> {
        self.inner.facts()
    }
    fn files(&self) -> Vec<PathBuf> {
        self.inner.files()
    }
    fn guard(&self) -> Option<Box<dyn Guard>> {
        self.inner.guard()
    }
    fn warm(&mut self, heat: f64) {
        self.inner.warm(heat);
    }
}
