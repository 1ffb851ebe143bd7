//! `asperity run` with a scene: played as it is rendered, changed while it is played, and felt by a pen on
//! the page.

use std::fs;
use std::time::Duration;

use asperity_audio::simulated::Simulated;
use asperity_graph::{Compiled, GraphFile};
use asperity_live::SessionOptions;
use asperity_live::driver::Clock;
use harness::alone::{beside_others, shared_stage};
use harness::live::{Live, npy, rms};
use harness::stage::{by_hand, channel, offline, options, start, stop};
use harness::{graph, graphs, json};
use serde_json::Value;

use crate::edits::replace;
use crate::page::{Kept, loudest, with_browser};

/// A shipped scene as a graph.
fn lowered(name: &str) -> (GraphFile, Compiled) {
    let graph = graph::lowered(&graphs("scenes").join(name));
    let compiled = graph::compiled(&graph, &harness::registry());
    (graph, compiled)
}

#[test]
fn a_card_plays_a_scene_sample_by_sample_as_it_is_rendered() {
    let _alone = beside_others();
    for name in ["side_by_side.ron", "every_effect.ron"] {
        let card = Simulated::new(name, by_hand()).expect("a card");
        let session = start(lowered(name), SessionOptions { ..options(&card, Clock::Callback) });
        let frames = 5 * 48_000;
        for size in [64, 441, 1024, 97].iter().cycle() {
            card.step(*size);
            if card.played().len() >= 2 * frames {
                break;
            }
        }
        let heard = channel(&card.played(), 2, 0);
        stop(session, &card);
        let wanted = offline(lowered(name).1, heard.len()).swap_remove(0);
        let differs = heard.iter().zip(&wanted).position(|(y, x)| *y != f64::from(*x));
        assert_eq!(differs, None, "{name}");
        assert!(rms(&wanted[48_000..]) > 0.005, "{name}: {}", rms(&wanted));
    }
}

/// A table on which a hand goes round without an end, with one texture of a file and one of a table.
fn table(friction: &str, right: &str) -> String {
    format!(
        "Scene(
    version: 1, seed: 5,
    input: stroke(extent_mm: 60, speed_mm_s: 120, duration_s: 600),
    device: (damping_ns_per_m: 2),
    actuator: (profile: \"hapcoil_one\", handle_mass_g: 100),
    output: audio_out(volts_at_full_scale: 1, amps_per_volt: 1),
    surfaces: {{
        \"left\": (shape: rectangle(size_mm: (40, 60)), place_mm: (-20, 0, 0), effects: (
            stiffness: (stiffness_n_per_mm: 0.5), friction: dahl(coefficient: {friction}),
            texture: autoregressive(model: \"m.ron\"))),
        \"right\": (shape: rectangle(size_mm: (40, 60)), place_mm: (20, 0, 0), effects: ({right})),
    }},
)
"
    )
}

const RIGHT: &str = "stiffness: (stiffness_n_per_mm: 0.5), texture: waveform(segments: [(0, 0), (0.5, 4), \
                     (1, 0), (1.5, -4), (2, 0)], reference_speed_mm_s: 80)";

fn made(name: &str) -> Vec<u8> {
    fs::read(graphs("models/made_ar").join(name)).expect("a made texture")
}

#[test]
fn a_scene_and_the_files_it_names_change_while_it_is_played() {
    let dir = &*shared_stage();
    fs::write(dir.join("s.ron"), table("0.3", RIGHT)).expect("a scene");
    fs::write(dir.join("m.ron"), made("rough.ron")).expect("a texture");
    let args = ["s.ron", "--device", "simulated:frames=256", "--watch", "--limit-us", "9000000"];
    let mut live = Live::start(dir, &[&args[..], &["--report", "r.json"]].concat());
    live.says("plays on");
    std::thread::sleep(Duration::from_millis(2500));
    replace(dir, "s.ron", table("0.2", RIGHT));
    let said = live.says("s.ron changed: ");
    assert!(said.contains("`friction`"), "{said}");
    replace(dir, "m.ron", made("smooth.ron"));
    let said = live.says("m.ron changed: ");
    assert!(said.contains("`autoregressive"), "{said}");
    // What is wrong leaves it playing, and says where it is wrong.
    replace(dir, "s.ron", table("0.2", "stifness: ()"));
    live.says("s.ron changed, and cannot be taken over:");
    let said = live.says("error: ");
    assert!(said.contains("`stifness`"), "{said}");
    live.says("the running graph goes on");
    replace(dir, "m.ron", b"Autoregressive(");
    replace(dir, "s.ron", table("0.2", RIGHT));
    live.says("m.ron");
    live.says("the running graph goes on");
    // An effect that nothing names any more goes, one that is new comes.
    let right = "stiffness: (stiffness_n_per_mm: 0.5), tap: (sinusoids: [(frequency_hz: 150, decay_ms: 20, \
                 gain: 20)])";
    replace(dir, "m.ron", made("smooth.ron"));
    replace(dir, "s.ron", table("0.2", right));
    let said = live.says("changed: ");
    assert!(said.contains("tap") && said.contains("waveform"), "{said}");
    std::thread::sleep(Duration::from_millis(500));
    live.stop().ok();
    let report = json(&dir.join("r.json"));
    assert_eq!(report["faults"], 0);
    let kinds: Vec<&str> =
        report["nodes"].as_array().expect("nodes").iter().filter_map(|n| n["kind"].as_str()).collect();
    assert!(kinds.contains(&"tap") && !kinds.contains(&"waveform"), "{kinds:?}");
}

fn calls(report: &Value, id: &str) -> u64 {
    let nodes = report["nodes"].as_array().expect("nodes");
    nodes.iter().find(|n| n["id"] == id).and_then(|n| n["calls"].as_u64()).expect("such a node")
}

#[test]
fn a_pen_on_the_page_feels_a_scene() {
    with_browser(felt_by_a_pen);
}

/// The shipped side_by_side, expanded to a graph so that what it sends can be recorded.
fn felt_by_a_pen(kept: &mut Kept) -> Result<(), String> {
    let dir = tempfile::tempdir().expect("a folder");
    let dir = dir.path();
    let scene = fs::read_to_string(graphs("scenes/side_by_side.ron")).expect("a shipped scene");
    fs::write(dir.join("s.ron"), scene.replace("\"../", &format!("\"{}/", graphs("").display())))
        .expect("a scene");
    harness::run(dir, &["scene", "expand", "s.ron", "--out", "g.ron"]).ok();
    let text = fs::read_to_string(dir.join("g.ron")).expect("a graph");
    let ear = "\"sent\": (kind: \"file_out\", params: (file: \"sent.npy\")),\n    },\n    wires: \
               [(\"limiter\", \"sent\"),";
    fs::write(dir.join("g.ron"), text.replacen("    },\n    wires: [", ear, 1)).expect("it is written");
    let args = ["g.ron", "--hand", "pointer", "--page", "--device", "simulated:frames=256"];
    let more = ["--report", "r.json", "--set", "stylus.timeout_ms=2000"];
    let mut live = Live::start(dir, &[&args[..], &more].concat());
    let url = live.says("the page: ");
    let mut pen = kept.pen(&url);
    pen.strokes(3.0, 120.0);
    pen.lifts();
    std::thread::sleep(Duration::from_millis(500));
    assert_eq!(pen.browser.complaints(), Vec::<String>::new());
    kept.take_back(pen);
    live.stop().ok();
    let report = json(&dir.join("r.json"));
    let ticks = report["ticks"].as_u64().unwrap_or(0);
    let (network, sent) = (calls(&report, "texture"), npy(&dir.join("sent.npy")));
    let loudest = loudest(&sent);
    println!("{network} calls of the network in {ticks} ticks, rms {loudest:.4} at most");
    if network < 300 {
        return Err(format!("the pen did not move as it was told: {network} calls in {ticks} ticks"));
    }
    assert!(network < ticks, "it ran while nothing was touched: {network} in {ticks}");
    assert!(loudest > 5e-3, "it is not heard: {loudest}");
    assert_eq!(report["faults"], 0);
    Ok(())
}
