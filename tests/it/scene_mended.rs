//! Scenes: what once went wrong.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::time::Duration;

use harness::{Ran, graphs, json, run, run_line, wav};

const WALL: &str = "stiffness: (stiffness_n_per_mm: 0.5)";
const FRAME: &str =
    "version: 1, seed: 3, input: stroke(extent_mm: 60, duration_s: 3), device: (damping_ns_per_m: 2)";
const SOUND: &str = "actuator: (profile: \"hapcoil_one\", handle_mass_g: 100), \
                     output: audio_out(volts_at_full_scale: 1, amps_per_volt: 1)";

/// Writes a scene of one tile.
fn write(dir: &Path, parts: &str, shape: &str, effects: &str) {
    let text =
        format!("Scene(\n{parts},\nsurfaces: {{\"tile\": (shape: {shape}, effects: ({effects}))}},\n)\n");
    fs::write(dir.join("s.ron"), text).unwrap();
}

const TILE: &str = "rectangle(size_mm: (100, 60))";

fn check(dir: &Path, more: &[&str]) -> Ran {
    run(dir, &[&["check", "s.ron"], more].concat())
}

#[test]
fn parts_that_nothing_calls_for_are_looked_at_all_the_same() {
    let dir = tempfile::tempdir().unwrap();
    let library = graphs("models/surfaces/materials.ron").display().to_string();
    for (part, message) in [
        ("gate: (speed_mm: 5)".to_owned(), "`speed_mm`"),
        ("gate: (speed_mm_s: -5)".to_owned(), "out of range"),
        ("network: (modle: \"m.onnx\")".to_owned(), "`modle`"),
        ("actuator: (profil: \"hapcoil_one\")".to_owned(), "`profil`"),
        ("phase: shaped_nose".to_owned(), "shaped_noise"),
        ("phase: gain".to_owned(), "`gain` retrieves no phase"),
        ("output: probe".to_owned(), "`probe` plays nothing"),
        ("output: gain".to_owned(), "`gain` plays nothing"),
    ] {
        write(dir.path(), &format!("{FRAME},\n{part}"), TILE, WALL);
        let ran = check(dir.path(), &[]).refused(message);
        assert!(ran.err.starts_with("s.ron:3:"), "{part}: {}", ran.err);
    }
    write(dir.path(), &format!("{FRAME},\nnetwork: (library: {library:?})"), TILE, WALL);
    let text = fs::read_to_string(dir.path().join("s.ron")).unwrap();
    fs::write(dir.path().join("s.ron"), text.replace("effects:", "material: \"canvass\", effects:")).unwrap();
    check(dir.path(), &[]).refused("`canvas`").says(&["s.ron:4:"]);
}

/// Without force the scene is refused; without output there is a warning.
#[test]
fn scene_without_force_or_sound_is_told() {
    let dir = tempfile::tempdir().unwrap();
    write(dir.path(), FRAME, TILE, "");
    check(dir.path(), &[]).refused("can be felt").says(&["s.ron:3:"]);
    write(dir.path(), FRAME, TILE, "vibration: (frequency_hz: 120, amplitude_m_s2: 2)");
    check(dir.path(), &[]).refused("output: audio_out");
    let tap = "tap: (sinusoids: [(frequency_hz: 180, decay_ms: 12, gain: 60)])";
    write(dir.path(), FRAME, TILE, &format!("{WALL}, {tap}"));
    check(dir.path(), &[]).ok().says(&["warning: s.ron:3:", "output: audio_out"]);
    assert_eq!(check(dir.path(), &["--strict"]).code, 2);
    // An effect that is written as a call is that effect, and no list of none.
    write(dir.path(), FRAME, TILE, &format!("{WALL}, texture: dahl()"));
    assert!(check(dir.path(), &[]).err.contains("`dahl`"));
    write(dir.path(), FRAME, TILE, &format!("{WALL}, texture: []"));
    assert!(check(dir.path(), &[]).err.contains("no textures"));
    // A file that is not there is told of once, whoever reads it.
    let gone = format!("{WALL}, texture: autoregressive(model: \"gone.ron\")");
    write(dir.path(), &format!("{FRAME}, {SOUND}"), "box(size_mm: (50, 50, 5))", &gone);
    let ran = check(dir.path(), &[]);
    assert_eq!((ran.code, ran.err.matches("error:").count()), (2, 1), "{}", ran.err);
}

#[test]
fn passivity_counts_the_rate_that_the_command_line_sets() {
    let dir = tempfile::tempdir().unwrap();
    write(dir.path(), &FRAME.replace(": 2)", ": 0.6)"), TILE, WALL);
    check(dir.path(), &["--strict"]).ok();
    check(dir.path(), &["--strict", "--set", "tick_hz=100"]).refused("2.500 N s/m").says(&["100 Hz"]);
    // Whoever wants to hear of errors alone does.
    for (more, warnings) in [(&[][..], 1), (&["--quiet"], 0)] {
        let args = ["render", "s.ron", "--set", "tick_hz=100", "--report", "r.json"];
        let ran = run(dir.path(), &[&args[..], more].concat()).ok();
        assert_eq!(ran.err.matches("warning").count(), warnings, "{}", ran.err);
    }
}

/// Accelerations of a tap on a tile, at a speed of approach, from places in steps of 0.055 mm.
fn tapped(dir: &Path, speed_mm_s: f64) -> f32 {
    let mut csv = String::from("t_s,x_mm,y_mm,z_mm\n");
    for k in 0..1000 {
        let z = (10.0 - speed_mm_s * f64::from(k) / 1000.0).max(-1.0);
        let _ = writeln!(csv, "{},0,0,{}", f64::from(k) / 1000.0, 0.055 * (z / 0.055).round());
    }
    fs::write(dir.join("t.csv"), csv).unwrap();
    let input = "trajectory(file: \"t.csv\", interpolation: linear)";
    let frame = FRAME.replace("stroke(extent_mm: 60, duration_s: 3)", input);
    let tap = "tap: (sinusoids: [(frequency_hz: 180, decay_ms: 12, gain: 60)], min_speed_mm_s: 1)";
    write(dir, &format!("tick_hz: 1000, {frame}, gain: 0.02, {SOUND}"), TILE, &format!("{WALL}, {tap}"));
    run(dir, &["render", "s.ron", "--out", "o.wav", "--quiet"]).ok();
    wav(&dir.join("o.wav")).0.iter().fold(0.0, |m, x| m.max(x.abs()))
}

#[test]
fn a_tap_is_heard_from_a_stylus_that_tells_its_place_in_steps() {
    let dir = tempfile::tempdir().unwrap();
    // At 55 and 110 mm/s every place is a whole number of steps, and one is the surface.
    let levels = [20.0, 33.0, 55.0, 80.0, 110.0].map(|speed| tapped(dir.path(), speed));
    assert!(levels.iter().all(|level| *level > 1e-5), "{levels:?}");
    assert!(levels[4] > 1.5 * levels[2], "{levels:?}");
}

#[test]
fn files_that_a_scene_reads_are_not_written_over() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    fs::copy(graphs("models/made_ar/rough.ron"), dir.join("m.ron")).unwrap();
    let picture = image::GrayImage::from_fn(64, 64, |x, y| image::Luma([((x * y) % 200) as u8]));
    picture.save(dir.join("h.png")).unwrap();
    let shape = "relief(heights: picture(file: \"h.png\", step_mm: 1, height_mm: 1))";
    let effects = format!("{WALL}, texture: autoregressive(model: \"m.ron\")");
    write(dir, &format!("{FRAME}, {SOUND}"), shape, &effects);
    let before = |name: &str| fs::read(dir.join(name)).unwrap();
    let files = ["m.ron", "h.png", "s.ron"].map(before);
    for line in [
        "render s.ron --report h.png",
        "render s.ron --plot m.ron",
        "graph s.ron --svg h.png",
        "scene expand s.ron --out m.ron",
        "scene expand s.ron --out h.png",
        "scene expand s.ron --out s.ron",
    ] {
        run_line(dir, line).refused("overwritten");
    }
    assert!(files == ["m.ron", "h.png", "s.ron"].map(before));
    // And all are told of.
    let told = run(dir, &["scene", "explain", "s.ron", "--seconds", "0.5"]).ok().out;
    let line = |name: &str| told.lines().find(|line| line.starts_with(name)).unwrap_or_default();
    let (picture, model) = (line("h.png"), line("m.ron"));
    assert!(picture.contains(": loaded, ") && picture.contains(" us a tick: by `contact`"), "{told}");
    assert!(model.contains(": loaded, ") && model.contains("1 surface, by `autoregressive a`"), "{told}");
}

#[test]
fn an_expanded_graph_finds_its_files_and_knows_its_scene() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    fs::create_dir(dir.join("sub")).unwrap();
    let sub = dir.join("sub");
    let lap = "waveform(segments: [(0, 0), (0.5, 4), (1, 0), (1.5, -4), (2, 0)])";
    write(&sub, &format!("{FRAME}, {SOUND}"), TILE, &format!("{WALL}, texture: {lap}"));
    fs::copy(graphs("trajectories/zigzag.csv"), dir.join("hand.csv")).unwrap();
    run(dir, &["scene", "expand", "sub/s.ron", "--input", "hand.csv", "--out", "sub/g.ron"]).ok();
    run(dir, &["check", "sub/g.ron"]).ok();
    // Where it stands may change, what it is made of not.
    let scene = fs::read_to_string(sub.join("s.ron")).unwrap();
    fs::write(sub.join("s.ron"), scene.replace("(100, 60)", "(90, 60)")).unwrap();
    run(dir, &["check", "sub/g.ron"]).ok();
    fs::write(sub.join("s.ron"), scene.replace("(0.5, 4)", "(0.5, 5)")).unwrap();
    run(dir, &["check", "sub/g.ron"]).refused("expand it again");
}

#[test]
fn network_without_phase_is_as_loud_at_every_rate() {
    let dir = tempfile::tempdir().unwrap();
    let models = graphs("models/surfaces").display().to_string();
    let network = format!("network: (model: \"{models}/texture.onnx\", library: \"{models}/materials.ron\")");
    let level = |tick_hz: u32| {
        let parts = format!("tick_hz: {tick_hz}, {FRAME}, {network}, {SOUND}, gain: 0.2");
        let tile = format!("{TILE}, material: \"canvas\"");
        write(dir.path(), &parts, &tile, &format!("{WALL}, texture: network"));
        run(dir.path(), &["render", "s.ron", "--out", "o.wav", "--quiet"]).ok();
        let (x, _) = wav(&dir.path().join("o.wav"));
        (x.iter().map(|x| f64::from(x * x)).sum::<f64>() / x.len() as f64).sqrt()
    };
    let usual = level(500);
    assert!(usual > 1e-3);
    for tick_hz in [100, 210, 250, 700, 1000] {
        let ratio = level(tick_hz) / usual;
        assert!((0.6..1.6).contains(&ratio), "{ratio:.2} times as loud at {tick_hz} Hz");
    }
    // What the file says is as it says, with a warning where it is too near the end of a window.
    let text = fs::read_to_string(dir.path().join("s.ron")).unwrap();
    let phase = "phase: sample_commit(frames: 2, passes: 2),\nsurfaces:";
    fs::write(dir.path().join("s.ron"), text.replace("surfaces:", phase)).unwrap();
    for (tick_hz, emission, warnings) in [(250, -20, 1), (250, -12, 0), (500, -25, 0), (2000, -40, 1)] {
        let set = format!("phase.emission={emission}");
        let ran = check(dir.path(), &["--set", &format!("tick_hz={tick_hz}"), "--set", &set]).ok();
        assert_eq!(ran.err.matches("too loud").count(), warnings, "{tick_hz} Hz, {emission}: {}", ran.err);
    }
}

#[test]
fn the_picture_follows_a_scene_that_changes() {
    let dir = tempfile::tempdir().unwrap();
    let frame = FRAME.replace("duration_s: 3", "duration_s: 600");
    write(dir.path(), &frame, TILE, WALL);
    let mut child = harness::asperity(dir.path())
        .args("render s.ron --watch --limit-us 9000000 --seconds 600 --plot p.svg --report r.json".split(' '))
        .stderr(std::process::Stdio::null())
        .spawn()
        .unwrap();
    std::thread::sleep(Duration::from_millis(800));
    let text = fs::read_to_string(dir.path().join("s.ron")).unwrap();
    let text = text.replace("\"tile\"", "\"another\"").replace(WALL, &format!("{WALL}, friction: dahl"));
    fs::write(dir.path().join("new"), text).unwrap();
    fs::rename(dir.path().join("new"), dir.path().join("s.ron")).unwrap();
    std::thread::sleep(Duration::from_millis(1500));
    let killed = std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(killed.unwrap().success());
    harness::live::until("its end", || child.try_wait().unwrap().is_some());
    assert_eq!(json(&dir.path().join("r.json"))["swaps"].as_array().unwrap().len(), 1);
    let picture = fs::read_to_string(dir.path().join("p.svg")).unwrap();
    assert!(picture.contains(">another<") && !picture.contains(">tile<"), "the scene as it is now");
    assert!(picture.contains(">friction<"));
}

/// A loop of 0.5 or 1 mm stood at the same phase at every step of the stroke that is measured, and seemed
/// not to be late at all.
#[test]
fn loops_of_round_lengths_are_as_late_as_others() {
    let dir = tempfile::tempdir().unwrap();
    let names = [0.5, 1.0, 1.013].map(|length: f64| {
        let lap = format!("texture: waveform(segments: [(0, 0), ({}, 4), ({length}, 0)])", length / 2.0);
        write(dir.path(), &format!("{FRAME}, {SOUND}"), "plane", &format!("{WALL}, {lap}"));
        let name = format!("{length}.ron");
        fs::rename(dir.path().join("s.ron"), dir.path().join(&name)).unwrap();
        name
    });
    let args = [&["latency", "--json"][..], &names.each_ref().map(String::as_str)].concat();
    let told: serde_json::Value = serde_json::from_str(&run(dir.path(), &args).ok().out).unwrap();
    for graph in told["graphs"].as_array().unwrap() {
        // A tick and a quarter: half of the step has shown before the half of the way, a tick and a half
        // less a sample, that the node declares.
        let ms = graph["lag_ms"][1].as_f64().unwrap();
        assert!((ms - 2.5).abs() < 0.1, "{graph}");
        let items = graph["items"].as_array().unwrap();
        let told = |what: &str| items.iter().any(|item| item["what"].as_str().unwrap().contains(what));
        assert!(told("waveform a") && !told("motion"), "where a stylus is goes through no low-pass: {graph}");
    }
}
