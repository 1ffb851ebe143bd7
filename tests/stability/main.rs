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
use asperity_checks::{Effort, Found, Stop, Subject, cases};
use asperity_graph::GraphFile;
use asperity_node::{Descriptor, NodeKind, Param, Setup, Tick};
use harness::registry;

/// The folder of the shipped graphs.
const GRAPHS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../graphs");

/// Counts the bytes that readers and nodes hold.
#[global_allocator]
static ALLOCATOR: harness::counting::Counting = harness::counting::Counting;

/// Effort of the cases; `ASPERITY_STABILITY=long` asks for the most.
fn effort() -> Effort {
    match std::env::var("ASPERITY_STABILITY").as_deref() {
        Ok("long") => Effort::Long,
        Ok("quick") => Effort::Quick,
        _ => Effort::Full,
    }
}

/// A shipped graph, or the graph of a shipped scene. Behind its name may be changes as for `--set`.
fn graph(name: &str) -> GraphFile {
    let mut words = name.split(' ');
    let path = harness::graphs(words.next().unwrap_or_default());
    let mut graph = match name.starts_with("scenes/") {
        true => harness::graph::lowered(&path),
        false => GraphFile::read(path).expect("a shipped graph"),
    };
    words.for_each(|change| graph.set(change, "the test").expect("a change"));
    graph
}

/// The built-in kinds, perhaps with a graph.
fn subject(graph: Option<&GraphFile>) -> Subject<'_> {
    let mut subject = Subject::new(registry()).effort(effort());
    subject.graph = graph;
    subject
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

/// A mutant: the values of a kind's first output are changed.
fn pushing<'g>(
    subject: &Subject<'g>,
    kind: &str,
    change: impl Fn(f64) -> f64 + Clone + Send + Sync + 'static,
) -> Subject<'g> {
    broken(subject, kind, move |(): &mut (), tick| {
        tick.outputs.control(0).iter_mut().for_each(|x| *x = change(*x));
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

/// Runs a case, by its name.
fn run(name: &str, subject: &Subject<'_>) -> Found {
    let case = cases().into_iter().find(|case| case.name == name);
    case.unwrap_or_else(|| panic!("there is no case `{name}`")).run(subject)
}

/// Asserts that a case holds. Answers its figures.
fn holds(name: &str, subject: &Subject<'_>) -> String {
    passes(name, |subject| run(name, subject), subject)
}

/// Asserts that a case holds for graphs: with full effort for the first, briefly for the others.
fn holds_on(name: &str, graphs: &[GraphFile]) {
    for (i, graph) in graphs.iter().enumerate() {
        let brief = i > 0 && effort() == Effort::Full;
        let subject = subject(Some(graph));
        holds(name, &if brief { subject.effort(Effort::Quick) } else { subject });
    }
}

/// Asserts that a case fails for a mutant, for a reason with these words. Its effort is `Full` at most.
fn fails(name: &str, mutant: &Subject<'_>, why: &str) {
    breaks(name, |subject| run(name, subject), mutant, why);
}

/// The same of a case that lives in this program alone.
fn passes(name: &str, case: impl Fn(&Subject<'_>) -> Found, subject: &Subject<'_>) -> String {
    let found = case(subject).unwrap_or_else(|wrong| panic!("{name}: {wrong:?}"));
    println!("{name}: {found}");
    found
}

/// The same of a case that lives in this program alone.
fn breaks(name: &str, case: impl Fn(&Subject<'_>) -> Found, mutant: &Subject<'_>, why: &str) {
    match case(&mutant.clone().effort(mutant.effort.min(Effort::Full))) {
        Err(Stop::Failed(found)) => assert!(found.contains(why), "{name} fails for another reason: {found}"),
        other => panic!("{name} does not see the mutant: {other:?}"),
    }
}

/// No case knows a value for a parameter that has to be set.
#[test]
fn kinds_with_a_required_parameter_are_left_out() {
    let built_in = subject(None);
    for (like, name, cases) in [
        ("actuator_inverse", "an_inverse", &["inverse_band", "inverse_off"][..]),
        ("limiter", "a_limiter", &["full_scale_at_resonance", "limiter_random"]),
        ("spsi", "learned_phase", &["uneven_hops", "rates_of_kinds"]),
        (
            "viscosity",
            "a_drag",
            &["friction_takes_energy", "friction_is_quiet_at_rest", "friction_inside_its_bound"],
        ),
    ] {
        let which = Param::text("which", "", "Which one.").required();
        let more = plugin(&built_in.kind(like).expect("the kind"), name, |d| d.param(which));
        let subject = built_in.clone().with(more).effort(Effort::Quick);
        for case in cases {
            let found = holds(case, &subject);
            assert!(!found.contains(name), "{case}: {found}");
        }
    }
}
