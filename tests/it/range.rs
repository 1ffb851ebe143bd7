//! A network that is given what it was not trained on: held to the range, and said.

use harness::networks::{Layer, Net, Random, Spelling, Writer};
use harness::onnx::{ModelProto, StringStringEntryProto};
use harness::{Room, networks, node};
use serde_json::Value;

fn folder(mut network: ModelProto, trained: &[(&str, &str)]) -> Room {
    let dir = Room::new();
    let entry = |(k, v): &(&str, &str)| StringStringEntryProto { key: (*k).into(), value: (*v).into() };
    network.metadata_props = trained.iter().map(entry).collect();
    dir.write("m.onnx", networks::bytes(&network));
    dir
}

/// The same with a random network.
fn trained(trained: &[(&str, &str)]) -> Room {
    folder(networks::model(&Net::random(1), Spelling::default()), trained)
}

/// Two seconds over a hard floor of so much force at most: the summary, the facts of the network, the
/// samples.
fn render(dir: &Room, force: &str) -> (String, Value, Vec<f32>) {
    let ran = dir.run(&format!(
        "render graphs/heravi2024.ron --set texture.model=m.onnx --set floor.stiffness_n_per_mm=50 \
         --set floor.max_force_n={force} --seconds 2 --report r.json --out o.wav"
    ));
    let report = dir.json("r.json");
    assert_eq!(report["faults"], 0, "{report}");
    (ran.ok().out, node(&report, "texture")["facts"].clone(), dir.wav("o.wav").0)
}

#[test]
fn force_above_the_trained_range_is_clamped_and_reported() {
    let dir = trained(&[("force_max_n", "3.5"), ("speed_max_mm_s", "100000")]);
    let (said, facts, loud) = render(&dir, "35");
    let frames = facts["force_out_of_range"].as_u64().expect("a count");
    assert!(frames > 500, "{facts}");
    assert_eq!(facts["trained_force"], serde_json::json!({ "value": 3.5, "unit": "N" }));
    let held = format!("`texture`: {frames} frames with a force outside 0 to 3.5 N, held there");
    assert!(said.contains(&held) && !said.contains("with a speed above"), "{said}");
    let (said, facts, largest) = render(&dir, "3.5");
    assert_eq!((&facts["force_out_of_range"], &facts["velocity_out_of_range"]), (&0.into(), &0.into()));
    assert!(!said.contains("held there"), "{said}");
    assert!(loud == largest && loud.iter().any(|x| *x != 0.0));
}

#[test]
fn a_speed_beyond_the_trained_is_held_and_said() {
    let (said, facts, _) = render(&trained(&[("speed_max_mm_s", "20")]), "1");
    assert!(facts["velocity_out_of_range"].as_u64().is_some_and(|n| n > 100), "{facts}");
    assert!(said.contains("frames with a speed above 20 mm/s, held there"), "{said}");
    assert!(facts.get("trained_force").is_none());
}

#[test]
fn a_network_without_a_range_is_given_what_comes() {
    let (said, facts, _) = render(&trained(&[]), "35");
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
    let (said, facts, samples) = render(&folder(w.finish(&last), &[]), "1");
    let bad = facts["bad_magnitudes"].as_u64().expect("a count");
    assert!(bad > 1000, "{facts}");
    assert!(said.contains(&format!("{bad} magnitudes were negative or not finite")), "{said}");
    assert!(samples.iter().all(|x| x.is_finite()) && samples.iter().any(|x| *x != 0.0));
}

#[test]
fn a_range_that_is_none_is_refused_with_the_file() {
    trained(&[("force_max_n", "much")])
        .run("check graphs/heravi2024.ron --set texture.model=m.onnx")
        .refused("this model's `force_max_n` is \"much\"");
}
