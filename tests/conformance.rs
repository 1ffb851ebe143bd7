//! Every built-in node, by what its descriptor says: it declares itself well, takes any input of its ports' types
//! at any rate, and is after a reset as it was when fresh.

#[path = "common/any_node.rs"]
mod any_node;
mod common;

use any_node::{SIGNALS, engine, graph, run};
use asperity_graph::GraphFile;

#[test]
fn every_kind_declares_itself_well() {
    for kind in asperity_nodes::registry().iter() {
        if let Err(e) = kind.descriptor().check() {
            panic!("{e}");
        }
    }
}

#[test]
fn no_node_fails_on_any_finite_input() {
    for kind in asperity_nodes::registry().iter() {
        for signal in SIGNALS {
            let mut e = engine(&graph(kind.as_ref(), signal, 500, 48_000));
            let out = run(&mut e, 300);
            assert_eq!(e.faults(), 0, "{} on {signal}", kind.descriptor().kind);
            assert!(!out.is_empty() || kind.descriptor().outputs.is_empty());
        }
    }
}

#[test]
fn every_node_runs_at_every_rate() {
    for kind in asperity_nodes::registry().iter() {
        for (tick_hz, audio_hz) in [
            (100, 8_000),
            (250, 44_100),
            (500, 44_100),
            (700, 22_050),
            (1000, 96_000),
            (4000, 8_000),
            (4000, 192_000),
            (333, 48_000),
        ] {
            let mut e = engine(&graph(kind.as_ref(), "random", tick_hz, audio_hz));
            run(&mut e, 120);
            assert_eq!(
                e.faults(),
                0,
                "{} at {tick_hz} Hz ticks, {audio_hz} Hz audio",
                kind.descriptor().kind
            );
        }
    }
}

#[test]
fn a_node_that_was_reset_is_as_a_fresh_one() {
    for kind in asperity_nodes::registry().iter() {
        // A limiter keeps the heat of the coil, which no reset cools; a limited input has one before it.
        let d = kind.descriptor();
        if d.kind == "limiter" || d.inputs.iter().any(|p| p.limited) {
            continue;
        }
        let mut e = engine(&graph(kind.as_ref(), "random", 500, 44_100));
        let fresh = run(&mut e, 200);
        e.reset();
        let again = run(&mut e, 200);
        assert!(fresh == again, "{}", kind.descriptor().kind);
        assert!(
            fresh == run(&mut engine(&graph(kind.as_ref(), "random", 500, 44_100)), 200),
            "{}",
            kind.descriptor().kind
        );
    }
}

#[test]
fn every_shipped_graph_says_what_it_shows_and_compiles() {
    let mut count = 0;
    for entry in std::fs::read_dir(common::graphs("")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|e| e != "ron") {
            continue;
        }
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.starts_with("// "), "{} must begin with a comment", path.display());
        let mut e = engine(&GraphFile::read(&path).unwrap());
        for _ in 0..1000 {
            e.tick();
        }
        assert_eq!(e.faults(), 0, "{}", path.display());
        count += 1;
    }
    assert!(count > 0);
}

#[test]
fn the_graph_in_the_readme_compiles() {
    let readme = std::fs::read_to_string(common::root().join("README.md")).unwrap();
    let block = readme.split("```ron\n").nth(1).and_then(|rest| rest.split("```").next()).expect("a graph");
    let graph = GraphFile::parse(&asperity_source::Source::new("README.md", block)).unwrap();
    let mut e = engine(&graph);
    for _ in 0..1000 {
        e.tick();
    }
    assert_eq!(e.faults(), 0);
}
