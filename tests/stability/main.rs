//! Hard cases that stay stable: one file a family. A case lives in `core/checks`, where `asperity selftest`
//! runs it too; here it must hold for what is shipped, and fail for a mutant that is broken on purpose. What
//! has no graph stands here alone.
#![allow(unreachable_pub, reason = "a test program has no outside")]

mod actuator;
mod autoregressive;
mod faults;
mod files;
mod filters_and_rates;
mod friction;
mod graphs;
mod motion;
mod networks;
mod phase;
mod readers;
mod stiff_walls;

use std::sync::Arc;

use asperity_checks::{Case, Effort, Outcome, Subject, Verdict, cases};
use asperity_graph::GraphFile;
use asperity_node::{Config, Descriptor, Diagnostic, NodeKind, Ports, Processor, Setup};
use harness::graph::lowered;

/// The folder of the shipped graphs.
const GRAPHS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../graphs");

/// Effort of the cases; `ASPERITY_STABILITY=long` asks for all there is.
fn effort() -> Effort {
    match std::env::var("ASPERITY_STABILITY").as_deref() {
        Ok("long") => Effort::Long,
        Ok("quick") => Effort::Quick,
        _ => Effort::Full,
    }
}

/// A case by its name.
fn case(name: &str) -> &'static Case {
    cases().into_iter().find(|case| case.name == name).unwrap_or_else(|| panic!("there is no case `{name}`"))
}

/// A shipped graph.
fn graph(name: &str) -> GraphFile {
    GraphFile::read(harness::graphs(name)).expect("a shipped graph")
}

/// The graph of a shipped scene.
fn scene(name: &str) -> GraphFile {
    lowered(&harness::graphs("scenes").join(name))
}

/// The built-in kinds, with a graph or without.
fn subject(graph: Option<&GraphFile>) -> Subject<'_> {
    let subject = Subject::new(asperity_nodes::registry()).effort(effort());
    if let Some(graph) = graph { subject.graph(graph) } else { subject }
}

/// The same kinds but for this one, without a graph.
fn mutated(subject: &Subject<'_>, kind: Arc<dyn NodeKind>) -> Subject<'static> {
    Subject::new(subject.registry().clone()).effort(subject.allowed()).with(kind)
}

/// A kind as a plugin may have it: as another, under another name, with more in its descriptor.
fn plugin(
    like: &Arc<dyn NodeKind>,
    name: &'static str,
    more: impl FnOnce(Descriptor) -> Descriptor,
) -> Arc<dyn NodeKind> {
    struct Plugin(Arc<dyn NodeKind>, Descriptor);

    impl NodeKind for Plugin {
        fn descriptor(&self) -> &Descriptor {
            &self.1
        }

        fn ports(&self, config: &Config<'_>) -> Result<Ports, Diagnostic> {
            self.0.ports(config)
        }

        fn prepare(&self, setup: &Setup<'_>) -> Result<Box<dyn Processor>, Diagnostic> {
            self.0.prepare(setup)
        }
    }

    let mut descriptor = like.descriptor().clone();
    descriptor.kind = name.into();
    Arc::new(Plugin(like.clone(), more(descriptor)))
}

/// A case holds; answers what it found.
fn holds(name: &str, subject: &Subject<'_>) -> String {
    let Outcome { verdict, found } = case(name).run(subject);
    assert_eq!(verdict, Verdict::Holds, "{name}: {found}");
    println!("{name}: {found}");
    found
}

/// A case fails for a mutant, for a reason in which these words stand; it has no more time for that than with
/// the other tests.
fn fails(name: &str, mutant: &Subject<'_>, why: &str) {
    let brief = mutant.clone().effort(mutant.allowed().min(Effort::Full));
    let Outcome { verdict, found } = case(name).run(&brief);
    assert_eq!(verdict, Verdict::Fails, "{name} does not see the mutant: {found}");
    assert!(found.contains(why), "{name} fails for another reason: {found}");
}

/// Counts the bytes that readers and nodes hold.
#[global_allocator]
static ALLOCATOR: harness::counting::Counting = harness::counting::Counting;
