//! A network that is given what it was not trained on: held to the range, and said.

use std::path::Path;

use harness::networks::{Layer, Net, Random, Spelling, Writer};
use harness::onnx::{ModelProto, StringStringEntryProto};
use harness::{json, networks, run};
use serde_json::Value;

fn folder(mut network: ModelProto, trained: &[(&str, &str)]) -> tempfile::TempDir {
    let dir = tempfile::tempdir().expect("a folder");
    let entry = |(k, v): &(&str, &str)| StringStringEntryProto { key: (*k).into(), value: (*v).into() };
    network.metadata_props = trained.iter().map(entry).collect();
    std::fs::write(dir.path().join("m.onnx"), networks::bytes(&network)).expect("a file");
    std::fs::write(dir.path().join("g.ron"), harness::shipped_graph()).expect("a graph");
    dir
}

/// Two seconds over a hard floor of so much force at most: the summary, the facts of the network, the
/// samples.
fn render(dir: &Path, force: &str) -> (String, Value, Vec<f32>) {
    let args = format!(
        "render g.ron --set texture.model=m.onnx --set floor.stiffness_n_per_mm=50 \
         --set floor.max_force_n={force} --seconds 2 --report r.json --out o.wav"
    );
    let ran = run(dir, &args.split(' ').collect::<Vec<_>>()).ok();
    let report = json(&dir.join("r.json"));
    assert_eq!(report["faults"], 0, "{report}");
    let nodes = report["nodes"].as_array().expect("nodes");
    let facts = nodes.iter().find(|n| n["kind"] == "texture_network").expect("the network")["facts"].clone();
    (ran.out, facts, harness::wav(&dir.join("o.wav")).0)
}

#[test]
fn force_above_the_trained_range_is_clamped_and_reported() {
    let net = networks::model(&Net::random(1), Spelling::default());
    let dir = folder(net, &[("force_max_n", "3.5"), ("speed_max_mm_s", "100000")]);
    let (said, facts, loud) = render(dir.path(), "35");
    let frames = facts["force_out_of_range"].as_u64().expect("a count");
    assert!(frames > 500, "{facts}");
    assert_eq!(facts["trained_force"], serde_json::json!({ "value": 3.5, "unit": "N" }));
    assert!(
        said.contains(&format!("`texture`: {frames} frames with a force outside 0 to 3.5 N, held there")),
        "{said}"
    );
    assert!(!said.contains("with a speed above"), "{said}");
    let (said, facts, largest) = render(dir.path(), "3.5");
    assert_eq!((&facts["force_out_of_range"], &facts["velocity_out_of_range"]), (&0.into(), &0.into()));
    assert!(!said.contains("held there"), "{said}");
    assert!(loud == largest && loud.iter().any(|x| *x != 0.0));
}

#[test]
fn a_speed_beyond_the_trained_is_held_and_said() {
    let net = networks::model(&Net::random(1), Spelling::default());
    let (said, facts, _) = render(folder(net, &[("speed_max_mm_s", "20")]).path(), "1");
    assert!(facts["velocity_out_of_range"].as_u64().is_some_and(|n| n > 100), "{facts}");
    assert!(said.contains("frames with a speed above 20 mm/s, held there"), "{said}");
    assert!(facts.get("trained_force").is_none());
}

#[test]
fn a_network_without_a_range_is_given_what_comes() {
    let net = networks::model(&Net::random(1), Spelling::default());
    let (said, facts, _) = render(folder(net, &[]).path(), "35");
    assert_eq!((&facts["force_out_of_range"], &facts["velocity_out_of_range"]), (&0.into(), &0.into()));
    assert!(!said.contains("held there"), "{said}");
}

#[test]
fn negative_network_output_is_silent_and_counted() {
    let mut w = Writer::new(Spelling::default());
    let all = w.concat(&["force", "speed", "texture"]);
    let mut r = Random(5);
    let layer = Layer { weights: r.vector(286 * 100, 0.01), bias: r.vector(100, 1.0) };
    let last = w.product(&all, &layer);
    let dir = folder(w.finish(&last), &[]);
    let (said, facts, samples) = render(dir.path(), "1");
    let bad = facts["bad_magnitudes"].as_u64().expect("a count");
    assert!(bad > 1000, "{facts}");
    assert!(said.contains(&format!("{bad} magnitudes were negative or not finite")), "{said}");
    assert!(samples.iter().all(|x| x.is_finite()) && samples.iter().any(|x| *x != 0.0));
}

#[test]
fn a_range_that_is_none_is_refused_with_the_file() {
    let net = networks::model(&Net::random(1), Spelling::default());
    let dir = folder(net, &[("force_max_n", "much")]);
    run(dir.path(), &["check", "g.ron", "--set", "texture.model=m.onnx"])
        .refused("this model's `force_max_n` is \"much\"");
}
