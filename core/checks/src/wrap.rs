//! Kinds whose nodes are called in another way than theirs, and kinds of one function.

use std::sync::Arc;

use asperity_node::{
    Buffer, Descriptor, Fault, InputRef, Inputs, NodeKind, Outputs, Prepared, Processor, Setup, Status, Tick,
};

/// Called instead of a node's `process`, with the node; it may run it.
pub type Process = Box<dyn FnMut(&mut dyn Processor, &mut Tick<'_>) -> Result<Status, Fault> + Send>;

/// A kind with the same name, ports and parameters. Its nodes are called by the process that `make` makes.
pub fn wrap(
    inner: Arc<NodeKind>,
    make: impl Fn(&Setup<'_>) -> Process + Send + Sync + 'static,
) -> Arc<NodeKind> {
    Arc::new(Arc::unwrap_or_clone(inner).wrapped(move |setup, node| {
        let wrapped = Node { inner: node.processor, process: make(setup), fault: None };
        Ok(Prepared { processor: Box::new(wrapped), ..node })
    }))
}

/// A kind whose nodes run as they are, and then have their outputs changed.
pub fn after(
    inner: Arc<NodeKind>,
    change: impl Fn(&mut Tick<'_>) + Clone + Send + Sync + 'static,
) -> Arc<NodeKind> {
    with_memory(inner, move |(): &mut (), tick| change(tick))
}

/// As [`after`]. The change has a memory for each node, which a reset leaves alone.
pub fn with_memory<M: Default + Send + 'static>(
    inner: Arc<NodeKind>,
    change: impl Fn(&mut M, &mut Tick<'_>) + Clone + Send + Sync + 'static,
) -> Arc<NodeKind> {
    wrap(inner, move |_| {
        let (change, mut memory) = (change.clone(), M::default());
        Box::new(move |node, tick| {
            let status = node.run(tick)?;
            change(&mut memory, tick);
            // A quiet output may have changed.
            Ok(if status == Status::Quiet { Status::Continue } else { status })
        })
    })
}

/// Changes copies of the inputs of a tick.
pub(crate) type Mislead = Box<dyn FnMut(u64, &mut [Buffer]) + Send>;

/// A kind whose nodes get changed copies of their inputs.
pub(crate) fn misled(
    inner: Arc<NodeKind>,
    make: impl Fn(&Setup<'_>) -> Mislead + Send + Sync + 'static,
) -> Arc<NodeKind> {
    wrap(inner, move |setup| {
        let mut mislead = make(setup);
        Box::new(move |node, tick| {
            let own = tick.inputs;
            let copy = |i| own.buffer(i).cloned().unwrap_or_else(|| Buffer::constant(0, 0.0));
            let mut given: Vec<Buffer> = (0..own.len()).map(copy).collect();
            mislead(tick.index, &mut given);
            let wire = |i| InputRef { buffer: i as u32, connected: own.connected(i) };
            let map: Vec<InputRef> = (0..own.len()).map(wire).collect();
            let inputs = Inputs::new(&given, &[], given.len(), &map);
            let outputs = Outputs::new(tick.outputs.buffers());
            node.run(&mut Tick { index: tick.index, tick_hz: tick.tick_hz, inputs, outputs })
        })
    })
}

/// A kind whose nodes have nothing to reset: each tick calls what `make` made.
pub fn stateless<F: FnMut(&mut Tick<'_>) -> Status + Send + 'static>(
    descriptor: Descriptor,
    make: impl Fn(&Setup<'_>) -> F + Send + Sync + 'static,
) -> Arc<NodeKind> {
    struct Stateless<F>(F);
    impl<F: FnMut(&mut Tick<'_>) -> Status + Send> Processor for Stateless<F> {
        fn process(&mut self, tick: &mut Tick<'_>) -> Status {
            (self.0)(tick)
        }
        fn reset(&mut self) {}
    }
    Arc::new(NodeKind::new(descriptor, move |setup| Ok(Prepared::new(Stateless(make(setup))))))
}

struct Node {
    inner: Box<dyn Processor>,
    process: Process,
    fault: Option<Fault>,
}

impl Processor for Node {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let answer = (self.process)(&mut *self.inner, tick);
        self.fault = answer.err();
        answer.unwrap_or(Status::Error(u32::MAX))
    }

    fn reset(&mut self) {
        self.inner.reset();
    }

    fn fault(&mut self) -> Option<Fault> {
        self.fault.take().or_else(|| self.inner.fault())
    }

    fn inner(&mut self, call: &mut dyn FnMut(&mut dyn Processor)) {
        call(&mut *self.inner);
    }
}
