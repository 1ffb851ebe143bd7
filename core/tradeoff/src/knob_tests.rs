use asperity_diagnostics::{Source, ron};
use asperity_graph::compile;

use super::*;

const GRAPH: &str = r#"Graph(version: 1, nodes: {
    "stylus": (kind: "stroke"),
    "frames": (kind: "frames from memory"),
    "phase": (kind: "sample_commit", params: (frames: 3)),
    "rate": (kind: "resample"),
    "inverse": (kind: "actuator_inverse"),
    "limiter": (kind: "limiter"),
    "out": (kind: "audio_out", params: (amps_per_volt: 2.0)),
}, wires: [("frames", "phase"), ("phase", "rate"), ("rate", "inverse"), ("inverse", "limiter"),
    ("limiter.out", "out.in")])"#;

fn registry() -> Registry {
    let layout = asperity_node::FrameLayout {
        rate_hz: 2500,
        length: 250,
        bins: 101,
        frame_rate: asperity_node::FrameRate::new(500, 1).unwrap(),
    };
    let frames = std::sync::Arc::new(|_: u64, bins: &mut [f32]| {
        bins.fill(0.1);
        true
    });
    let mut registry = asperity_nodes::registry();
    registry.add(asperity_checks::played::Played::magnitudes("frames from memory", layout, frames));
    registry
}

fn knob(text: &str) -> Result<Knob, Diagnostic> {
    let source = Source::new("knob", text);
    Knob::parse(text, Place { span: asperity_diagnostics::Span { start: 0, end: text.len() }, source })
}

fn graph() -> GraphFile {
    GraphFile::parse(&Source::new("g.ron", GRAPH)).unwrap()
}

/// The graph with knobs turned, which must compile.
fn turned(turns: &[(&str, &str)]) -> Turned {
    let registry = registry();
    let mut turned = Turned { graph: graph(), guards: true };
    for (text, value) in turns {
        let knob = knob(text).unwrap();
        assert!(knob.fits(&turned.graph, &registry), "{text}");
        let value = ron::parse(&Source::new("value", *value)).unwrap();
        knob.turn(&mut turned, &value, &registry).unwrap();
    }
    let compiled = compile(&turned.graph, &registry, Default::default());
    assert!(compiled.is_ok(), "{turns:?}: {:?}", compiled.err());
    turned
}

fn ids(graph: &GraphFile) -> Vec<&str> {
    graph.nodes.iter().map(|n| n.id.as_str()).collect()
}

#[test]
fn overlap_add_comes_and_goes_with_phase_retrieval() {
    let before = turned(&[]).graph;
    let spsi = turned(&[("phase", r#"(kind: "spsi")"#)]).graph;
    assert_eq!(spsi.node("phase overlap_add").map(|n| n.kind.as_str()), Some("overlap_add"));
    assert_eq!(spsi.nodes.len(), before.nodes.len() + 1);
    // Another one that returns spectra changes nothing else.
    let vocoder = turned(&[("phase", r#"(kind: "spsi")"#), ("phase", r#"(kind: "phase_vocoder")"#)]).graph;
    assert_eq!(ids(&vocoder), ids(&spsi));
    let retrieval = r#"(kind: "sample_commit", params: (frames: 3))"#;
    let back = turned(&[("phase", r#"(kind: "spsi")"#), ("phase", retrieval)]).graph;
    assert_eq!(ids(&back), ids(&before));
    let nodes = |g: &GraphFile| g.nodes.iter().map(ToString::to_string).collect::<Vec<_>>();
    assert_eq!(nodes(&back), nodes(&before));
}

#[test]
fn wires_into_missing_ports_are_removed() {
    let text = r#"Graph(version: 1, nodes: {
        "stylus": (kind: "stroke"),
        "texture": (kind: "texture_network", params: (model: "m", library: "l", material: "a")),
        "phase": (kind: "shaped_noise"), "end": (kind: "probe"),
    }, wires: [("texture", "phase"), ("texture.pattern", "phase.pattern"),
        ("stylus.position", "phase.position"), ("phase", "end")])"#;
    let graph = GraphFile::parse(&Source::new("g.ron", text)).unwrap();
    let registry = asperity_nodes::registry();
    let into = |graph: &GraphFile| {
        let wires = graph.wires.iter().filter(|w| w.to.node == "phase");
        wires.map(|w| (w.from.port.clone(), w.to.port.clone())).collect::<Vec<_>>()
    };
    let replaced = |node: &str| {
        let mut graph = graph.clone();
        replace(&mut graph, "phase", &ron::parse(&Source::new("k.ron", node)).unwrap(), &registry).unwrap();
        into(&graph)
    };
    assert_eq!(replaced(r#"(kind: "sample_commit")"#), [(None, Some("magnitude".to_owned()))]);
    assert_eq!(replaced(r#"(kind: "shaped_noise", params: (seed: 7))"#).len(), 3);
}

#[test]
fn bypassed_limiter_turns_the_card_into_a_probe() {
    let bypassed = turned(&[("limiter", "bypassed")]).graph;
    assert!(bypassed.node("limiter").is_none());
    let out = bypassed.node("out").unwrap();
    assert!(out.kind == "probe" && out.params.is_empty());
    assert!(bypassed.wires.iter().any(|w| w.from.node == "inverse" && w.to.node == "out"));
    let kept = turned(&[("limiter", "kept")]).graph;
    assert_eq!(kept.to_string(), turned(&[]).graph.to_string());
    let rate = turned(&[("inverse", "bypassed"), ("limiter", "bypassed")]).graph;
    assert!(rate.wires.iter().any(|w| w.from.node == "rate" && w.to.node == "out"));
}

#[test]
fn parameters_rates_and_guards_are_set() {
    let all =
        turned(&[("phase.frames", "7"), ("frames.every", "1"), ("tick_hz", "1000"), ("guards", "false")]);
    let phase = all.graph.node("phase").unwrap();
    assert_eq!(phase.to_string(), r#""phase": (kind: "sample_commit", params: (frames: 7)),"#);
    assert_eq!((all.graph.tick_hz, all.guards), (1000, false));
    let rare = turned(&[("*.every", "2")]).graph;
    // Nodes with audio run in every tick.
    let two: Vec<&str> = rare.nodes.iter().filter(|n| n.every == 2).map(|n| n.id.as_str()).collect();
    assert_eq!(two, ["stylus", "frames"]);
    // Every node with the parameter and this choice.
    let drives = turned(&[("*.phase", r#""minimum""#)]).graph;
    assert!(drives.node("rate").unwrap().to_string().contains("phase: \"minimum\""));
    assert!(!drives.node("phase").unwrap().to_string().contains("minimum"));
    let none = turned(&[("*.phase", r#""sideways""#)]).graph;
    assert_eq!(none.to_string(), turned(&[]).graph.to_string());
}

#[test]
fn nearest_knob_is_suggested() {
    let base = LoadedGraph { registry: registry(), ..crate::testing::loaded("g", graph()) };
    for (text, want) in [
        ("phase.framez", "`phase.frames`"),
        ("phas.frames", "`phase.frames`"),
        ("limitr", "`limiter`"),
        ("tick_hzz", "`tick_hz`"),
        ("*.precison", "`*.precision`"),
        ("phase.evry", "`phase.every`"),
        ("*.evry", "`*.every`"),
    ] {
        let help = knob(text).unwrap().nearest(std::slice::from_ref(&base));
        assert_eq!(help, format!("did you mean {want}?"), "{text}");
        // The suggestion exists.
        assert!(knob(want.trim_matches('`')).unwrap().fits(&base.graph, &base.registry), "{want}");
    }
}

#[test]
fn invalid_knobs_and_values_are_refused() {
    let (registry, graph) = (registry(), graph());
    for text in ["", ".", "a.", ".b"] {
        assert!(knob(text).is_err(), "{text}");
    }
    for text in ["phase.frame", "nothing.frames", "nothing", "*.nothing"] {
        assert!(!knob(text).unwrap().fits(&graph, &registry), "{text}");
    }
    let value = |text: &str| ron::parse(&Source::new("value", text)).unwrap();
    for (name, text, want) in [
        ("phase", "gone", "a node cannot be set to `gone`"),
        ("phase", r#"(kind: "spsy")"#, "spsi"),
        ("guards", "3", "value:1"),
        ("tick_hz", "7", "value:1"),
        // As in a graph's file.
        ("phase.every", "0", "value:1"),
        ("phase.every", "1001", "1000"),
        ("stylus", "bypassed", "it has no input wire"),
    ] {
        let mut turned = Turned { graph: graph.clone(), guards: true };
        let e = knob(name).unwrap().turn(&mut turned, &value(text), &registry).unwrap_err();
        assert!(e.to_string().contains(want), "{name}={text}: {e}");
    }
    for (name, unknown) in [("phase", Some("mine")), ("phase.frames", None)] {
        let value = value(r#"(kind: "mine")"#);
        assert_eq!(knob(name).unwrap().unknown_kind(&value, &registry), unknown);
    }
}
