//! Every built-in node passes what every node must; the shipped graphs run.

use std::sync::Arc;

use asperity_checks::{Heap, Stop, Subject, Touched, node_cases, tick_time};
use asperity_graph::GraphFile;
use asperity_node::{NodeKind, Param, ParamKind};
use harness::counting::{bind, own};

/// Counts what this thread allocates.
struct Allocations;

impl Heap for Allocations {
    fn begin(&self) {
        bind(true);
    }
    fn end(&self) -> Touched {
        bind(false);
        let (taken, freed) = own();
        Touched { taken, freed }
    }
}

/// A kind with the parameters it must be given. Fewer random ticks than `asperity plugin check` has.
fn subject(kind: &Arc<NodeKind>) -> Subject<'static> {
    let file = |p: &str| harness::graphs(p).display().to_string();
    let mut subject = Subject::one(kind.clone());
    subject.ticks = 3000;
    subject.heap = Some(&Allocations);
    match &*kind.descriptor().kind {
        "texture_network" => subject
            .set("model", file("models/surfaces/texture.onnx"))
            .set("library", file("models/surfaces/materials.ron"))
            .set("material", "canvas"),
        "contact" => subject.set("scene", file("../tests/data/near.ron")),
        "file_out" => subject.set("file", "unused.wav"),
        kind => harness::effects(kind)
            .into_iter()
            .fold(subject, |subject, (name, value)| subject.set(name, value)),
    }
}

/// Known exceptions: no reset cools a coil, so the limiter keeps its heat in these cases.
fn is_meant(kind: &str, case: &str) -> bool {
    kind == "limiter" && matches!(case, "reset" | "garbage_state" | "live_parameters")
}

/// Runs some cases over all built-in kinds.
fn check(names: &[&str]) {
    let mut wrong = Vec::new();
    for kind in harness::registry().iter() {
        let name = &kind.descriptor().kind;
        let mut subjects = vec![(name.to_string(), subject(kind))];
        // Where a node may compute in double precision, it is checked in both.
        let wide =
            |p: &Param| matches!(&p.kind, ParamKind::Choice(words) if words.iter().any(|w| w == "f64"));
        if kind.descriptor().params.iter().any(|p| p.name == "precision" && wide(p)) {
            subjects.push((format!("{name} in f64"), subject(kind).set("precision", "f64")));
        }
        for (name, subject) in &subjects {
            for case in node_cases().iter().filter(|c| names.contains(&c.name) && !is_meant(name, c.name)) {
                let found = case.run(subject);
                println!("{name:20} {:16} {found:?}", case.name);
                if let Err(Stop::Failed(why)) = found {
                    wrong.push(format!("{name}: {}: {why}", case.name));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

#[test]
fn every_kind_declares_itself_well() {
    check(&["descriptor", "prepare"]);
}

#[test]
fn no_node_fails_on_any_input() {
    check(&["zero", "random", "steps", "denormal", "huge", "not_finite", "missing_frames", "random_ticks"]);
}

#[test]
fn every_node_runs_at_every_rate_and_layout() {
    check(&["rates", "layouts", "unconnected"]);
}

#[test]
fn every_node_writes_its_outputs_whole_and_nothing_else() {
    check(&["outputs"]);
}

#[test]
fn a_node_that_was_reset_is_as_a_fresh_one() {
    check(&["reset", "determinism", "cycle"]);
}

#[test]
fn a_node_that_slept_goes_on_as_it_says() {
    check(&["engine", "sleep"]);
}

#[test]
fn a_saved_state_goes_on_in_another_instance() {
    check(&["state", "garbage_state", "live_parameters"]);
}

#[test]
fn no_node_allocates_in_real_time() {
    Allocations.begin();
    drop(std::hint::black_box(vec![1_u8; 64]));
    assert_eq!(Allocations.end(), Touched { taken: 1, freed: 1 }, "the instrument must see an allocation");
    check(&["allocation"]);
}

#[test]
fn every_case_is_run_here() {
    let here = include_str!("conformance.rs");
    for case in node_cases() {
        let name = case.name;
        assert!(here.contains(&format!("{name:?}")), "{name} is not run over the built-in kinds");
    }
}

#[test]
fn the_time_of_a_tick_can_be_told() {
    let registry = harness::registry();
    let time = tick_time(&subject(registry.get("spsi").expect("spsi"))).unwrap();
    assert!(time.median_us > 0.0 && time.median_us <= time.p99_us && time.p99_us <= time.max_us, "{time:?}");
}

/// Runs a graph for a while without a fault.
fn runs(graph: &GraphFile, name: &str) {
    let mut engine = harness::graph::engine(graph, &harness::registry());
    (0..1000).for_each(|_| engine.tick());
    assert_eq!(engine.faults(), 0, "{name}");
}

#[test]
fn every_shipped_graph_says_what_it_shows_and_compiles() {
    let mut count = 0;
    for entry in std::fs::read_dir(harness::graphs("")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|e| e != "ron") {
            continue;
        }
        let (text, name) = (std::fs::read_to_string(&path).unwrap(), path.display().to_string());
        assert!(text.starts_with("// "), "{name} must begin with a comment");
        runs(&GraphFile::read(&path).unwrap(), &name);
        count += 1;
    }
    assert!(count > 0);
}

#[test]
fn the_graph_in_the_docs_compiles() {
    let name = "docs/how-to/write-a-graph-and-a-node.md";
    let page = std::fs::read_to_string(harness::root().join(name)).unwrap();
    let block = page.split("```ron\n").nth(1).and_then(|rest| rest.split("```").next()).expect("a graph");
    runs(&harness::graph::parsed(block), name);
}
