//! Wraps a kind, so that its nodes are called in another way.

use std::sync::Arc;

use asperity_node::{Fault, NodeKind, Prepared, Processor, Setup, Status, Tick};

/// Called instead of a node's `process`, with the node; it may run it.
pub type Process = Box<dyn FnMut(&mut dyn Processor, &mut Tick<'_>) -> Result<Status, Fault> + Send>;

/// Makes a [`Process`] for a node.
pub type Maker = Arc<dyn Fn(&Setup<'_>) -> Process + Send + Sync>;

/// A kind with the same name, ports and parameters. Its nodes are called by the process that `make` makes.
pub fn wrap(inner: Arc<NodeKind>, make: Maker) -> Arc<NodeKind> {
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
    let make = move |_: &Setup<'_>| -> Process {
        let change = change.clone();
        Box::new(move |node, tick| {
            let status = node.run(tick)?;
            change(tick);
            // A quiet output may have changed.
            Ok(if status == Status::Quiet { Status::Continue } else { status })
        })
    };
    wrap(inner, Arc::new(make))
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
