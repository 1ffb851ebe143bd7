//! Hard cases, one file per family. A case lives in `core/checks`, and `asperity selftest` runs it too. Here
//! it must hold for the shipped nodes and graphs, and fail for a mutant: a node that is broken on purpose.
//! Cases that look at no user's graph or kinds live here alone.
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
mod shapes;
mod stiff_walls;

use std::sync::Arc;

use asperity_checks::wrap::{Process, with_memory, wrap};
use asperity_checks::{Case, Effort, Found, Outcome, Stop, Subject, Verdict, cases};
use asperity_graph::GraphFile;
use asperity_node::{Descriptor, NodeKind, Setup, Tick};
use harness::graph::lowered;
use harness::registry;

/// The folder of the shipped graphs.
const GRAPHS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../graphs");

/// Effort of the cases; `ASPERITY_STABILITY=long` asks for the most.
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

/// The built-in kinds, perhaps with a graph.
fn subject(graph: Option<&GraphFile>) -> Subject<'_> {
    let subject = Subject::new(registry()).effort(effort());
    if let Some(graph) = graph { subject.graph(graph) } else { subject }
}

/// A mutant: the outputs of a kind are changed after each call. The change has a memory for each node, which
/// a reset leaves alone.
fn broken<'g, M: Default + Send + 'static>(
    subject: &Subject<'g>,
    kind: &str,
    change: impl Fn(&mut M, &mut Tick<'_>) + Clone + Send + Sync + 'static,
) -> Subject<'g> {
    subject.clone().with(with_memory(subject.kind(kind).expect("the kind"), change))
}

/// A mutant: the nodes of a kind are called in another way.
fn called<'g>(
    subject: &Subject<'g>,
    kind: &str,
    make: impl Fn(&Setup<'_>) -> Process + Send + Sync + 'static,
) -> Subject<'g> {
    subject.clone().with(wrap(subject.kind(kind).expect("the kind"), make))
}

/// A mutant: the samples of a kind's first output are changed a tick at a time, by the number of the tick.
fn sounding<'g>(
    subject: &Subject<'g>,
    kind: &str,
    change: impl Fn(&mut [f32], u64) + Clone + Send + Sync + 'static,
) -> Subject<'g> {
    broken(subject, kind, move |(): &mut (), tick| {
        let index = tick.index;
        change(tick.outputs.audio(0), index);
    })
}

/// A kind as of a plugin: like another, with another name and more in its descriptor.
fn plugin(
    like: &Arc<NodeKind>,
    name: &'static str,
    more: impl FnOnce(Descriptor) -> Descriptor,
) -> Arc<NodeKind> {
    let mut descriptor = like.descriptor().clone();
    (descriptor.kind, descriptor.role) = (name.into(), None);
    let (ports, prepare) = (like.clone(), like.clone());
    let kind = NodeKind::new(more(descriptor), move |setup| prepare.prepare(setup));
    Arc::new(kind.with_ports(move |config, _| ports.ports(config)))
}

/// Asserts that a case holds. Answers its figures.
fn holds(name: &str, subject: &Subject<'_>) -> String {
    let Outcome { verdict, found } = case(name).run(subject);
    assert_eq!(verdict, Verdict::Holds, "{name}: {found}");
    println!("{name}: {found}");
    found
}

/// Asserts that a case fails for a mutant, for a reason with these words. Its effort is `Full` at most.
fn fails(name: &str, mutant: &Subject<'_>, why: &str) {
    let brief = mutant.clone().effort(mutant.allowed().min(Effort::Full));
    let Outcome { verdict, found } = case(name).run(&brief);
    assert_eq!(verdict, Verdict::Fails, "{name} does not see the mutant: {found}");
    assert!(found.contains(why), "{name} fails for another reason: {found}");
}

/// Counts the bytes that readers and nodes hold.
#[global_allocator]
static ALLOCATOR: harness::counting::Counting = harness::counting::Counting;

/// A case that lives here alone.
type Own = fn(&Subject<'_>) -> Found;

/// Asserts that a case of this program holds.
fn passes(name: &str, case: Own, subject: &Subject<'_>) {
    match case(subject) {
        Ok(found) => println!("{name}: {found}"),
        Err(wrong) => panic!("{name}: {wrong:?}"),
    }
}

/// Asserts that a case of this program fails for a mutant, for a reason with these words.
fn breaks(name: &str, case: Own, mutant: &Subject<'_>, why: &str) {
    let brief = mutant.clone().effort(mutant.allowed().min(Effort::Full));
    match case(&brief) {
        Err(Stop::Failed(found)) => assert!(found.contains(why), "{name} fails for another reason: {found}"),
        other => panic!("{name} does not see the mutant: {other:?}"),
    }
}
