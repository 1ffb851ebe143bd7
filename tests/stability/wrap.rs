//! Nodes that are broken on purpose.

use std::sync::Arc;

use asperity_checks::Subject;
pub(crate) use asperity_checks::wrap::{Process, after, wrap};
use asperity_node::{NodeKind, Setup, Status, Tick};

/// A subject's kind whose nodes are called by way of something else.
pub(crate) fn of(
    subject: &Subject<'_>,
    kind: &str,
    make: impl Fn(&Setup<'_>) -> Process + Send + Sync + 'static,
) -> Arc<NodeKind> {
    wrap(subject.kind(kind).expect("the kind"), Arc::new(make))
}

/// A kind whose nodes run as they are, and then have their outputs changed. The change has a memory for each
/// node, which a reset leaves alone.
pub(crate) fn with_memory<M: Default + Send + 'static>(
    inner: Arc<NodeKind>,
    change: impl Fn(&mut M, &mut Tick<'_>) + Clone + Send + Sync + 'static,
) -> Arc<NodeKind> {
    let make = move |_: &Setup<'_>| -> Process {
        let (change, mut memory) = (change.clone(), M::default());
        Box::new(move |node, tick| {
            let status = node.run(tick)?;
            change(&mut memory, tick);
            Ok(if status == Status::Quiet { Status::Continue } else { status })
        })
    };
    wrap(inner, Arc::new(make))
}
