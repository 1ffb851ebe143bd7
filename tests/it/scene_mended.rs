//! Scenes: what once went wrong.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::time::Duration;

use harness::{Ran, Room, graphs};

const WALL: &str = "stiffness: (stiffness_n_per_mm: 0.5)";
const FRAME: &str =
    "version: 1, seed: 3, input: stroke(extent_mm: 60, duration_s: 3), device: (damping_ns_per_m: 2)";
const SOUND: &str = "actuator: (profile: \"hapcoil_one\", handle_mass_g: 100), \
                     output: audio_out(volts_at_full_scale: 1, amps_per_volt: 1)";

/// Writes a scene of one tile.
fn write(dir: &Path, parts: &str, shape: &str, effects: &str) {
    let tile = format!("(shape: {shape}, effects: ({effects}))");
    fs::write(dir.join("s.ron"), format!("Scene(\n{parts},\nsurfaces: {{\"tile\": {tile}}},\n)\n")).unwrap();
}

const TILE: &str = "rectangle(size_mm: (100, 60))";

fn check(dir: &Room, more: &str) -> Ran {
    dir.run(&format!("check s.ron {more}"))
}

#[test]
fn parts_that_nothing_calls_for_are_looked_at_all_the_same() {
    let dir = Room::new();
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
        write(&dir, &format!("{FRAME},\n{part}"), TILE, WALL);
        let ran = check(&dir, "").refused(message);
        assert!(ran.err.starts_with("s.ron:3:"), "{part}: {}", ran.err);
    }
    write(&dir, &format!("{FRAME},\nnetwork: (library: {library:?})"), TILE, WALL);
    let text = dir.text("s.ron");
    dir.write("s.ron", text.replace("effects:", "material: \"canvass\", effects:"));
    check(&dir, "").refused("`canvas`").says(&["s.ron:4:"]);
}

/// Friction was computed, and nothing said that no device was there to render it.
#[test]
fn force_without_a_device_is_told_where_a_hand_strokes() {
    let dir = Room::new();
    let hand = FRAME.replace("stroke(extent_mm: 60, duration_s: 3)", "pointer_input()");
    let tone = "vibration: (frequency_hz: 120, amplitude_m_s2: 2)";
    for (frame, effects, told) in [
        (hand.as_str(), format!("{WALL}, {tone}, friction: dahl"), "the forces of `friction`"),
        (
            &hand,
            format!("{WALL}, {tone}, friction: dahl, viscosity: (viscosity_ns_per_m: 0.5)"),
            "`viscosity`",
        ),
        (&hand, WALL.to_owned(), "the forces of `stiffness`"),
        (&hand, format!("{WALL}, {tone}"), ""),
        (FRAME, format!("{WALL}, {tone}, friction: dahl"), ""),
    ] {
        write(&dir, &format!("{frame}, {SOUND}"), TILE, &effects);
        let ran = check(&dir, "").ok();
        let warned = ran.err.contains("no device renders");
        assert!(warned != told.is_empty() && ran.err.contains(told), "{effects}: {}", ran.err);
        // A stroke of a file feels nothing.
        if warned {
            dir.write("t.csv", harness::csv(0.1, |t| [t, 0.0, -1.0]));
            assert!(!check(&dir, "--input t.csv").err.contains("no device renders"));
        }
    }
    // The advice is understood.
    let advice = check(&dir, "").ok();
    assert_eq!(advice.err, "");
    let device = "device: (damping_ns_per_m: 2, output: haply_force())";
    let frame = hand.replace("device: (damping_ns_per_m: 2)", device).replace("pointer_input", "haply_input");
    write(&dir, &format!("{frame}, {SOUND}"), TILE, &format!("{WALL}, friction: dahl"));
    assert!(!check(&dir, "").ok().err.contains("no device renders"));
}

#[test]
fn tap_that_never_sounds_says_why() {
    let dir = Room::new();
    let tap = "tap: (sinusoids: [(frequency_hz: 180, decay_ms: 12, gain: 60)], min_speed_mm_s: 50)";
    let frame = FRAME.replace("stroke(extent_mm: 60, duration_s: 3)", "trajectory(file: \"t.csv\")");
    write(&dir, &format!("{frame}, {SOUND}"), TILE, &format!("{WALL}, {tap}"));
    // From 3 mm above down to 2 mm deep, at so many mm/s; 0: on the surface all the time.
    for (speed_mm_s, told) in [
        (0.0, "`tap`: no tap sounded: the stylus never came from the air"),
        (20.0, "`tap`: no tap sounded: the approach was below `min_speed_mm_s` in all of 1 contacts"),
        (100.0, ""),
    ] {
        let down = |t: f64| if speed_mm_s == 0.0 { -2.0 } else { (3.0 - speed_mm_s * t).max(-2.0) };
        dir.write("t.csv", harness::csv(0.5, |t| [10.0 * t, 0.0, down(t)]));
        let ran = dir.run("render s.ron --out o.wav").ok();
        assert!(ran.out.contains("no tap sounded") != told.is_empty(), "{speed_mm_s}: {}", ran.out);
        assert!(ran.out.contains(told), "{}", ran.out);
        let loud = dir.wav("o.wav").0.iter().any(|x| x.abs() > 1e-3);
        assert_eq!(loud, told.is_empty(), "{speed_mm_s}");
    }
}

/// Without force the scene is refused; without output there is a warning.
#[test]
fn scene_without_force_or_sound_is_told() {
    let dir = Room::new();
    write(&dir, FRAME, TILE, "");
    check(&dir, "").refused("can be felt").says(&["s.ron:3:"]);
    write(&dir, FRAME, TILE, "vibration: (frequency_hz: 120, amplitude_m_s2: 2)");
    check(&dir, "").refused("output: audio_out");
    let tap = "tap: (sinusoids: [(frequency_hz: 180, decay_ms: 12, gain: 60)])";
    write(&dir, FRAME, TILE, &format!("{WALL}, {tap}"));
    check(&dir, "").ok().says(&["warning: s.ron:3:", "output: audio_out"]);
    assert_eq!(check(&dir, "--strict").code, 2);
    // An effect that is written as a call is that effect, and no list of none.
    write(&dir, FRAME, TILE, &format!("{WALL}, texture: dahl()"));
    assert!(check(&dir, "").err.contains("`dahl`"));
    write(&dir, FRAME, TILE, &format!("{WALL}, texture: []"));
    assert!(check(&dir, "").err.contains("an empty list of textures"));
    // A file that is not there is told of once, whoever reads it.
    let gone = format!("{WALL}, texture: autoregressive(model: \"gone.ron\")");
    write(&dir, &format!("{FRAME}, {SOUND}"), "box(size_mm: (50, 50, 5))", &gone);
    let ran = check(&dir, "");
    assert_eq!((ran.code, ran.err.matches("error:").count()), (2, 1), "{}", ran.err);
}

#[test]
fn passivity_counts_the_rate_that_the_command_line_sets() {
    let dir = Room::new();
    write(&dir, &FRAME.replace(": 2)", ": 0.6)"), TILE, WALL);
    check(&dir, "--strict").ok();
    check(&dir, "--strict --set tick_hz=100").refused("2.500 N s/m").says(&["100 Hz"]);
    // Whoever wants to hear of errors alone does.
    for (more, warnings) in [("", 1), ("--quiet", 0)] {
        let ran = dir.run(&format!("render s.ron --set tick_hz=100 --report r.json {more}")).ok();
        assert_eq!(ran.err.matches("warning").count(), warnings, "{}", ran.err);
    }
}

/// Accelerations of a tap on a tile, at a speed of approach, from places in steps of 0.055 mm.
fn tapped(dir: &Room, speed_mm_s: f64) -> f32 {
    let mut csv = String::from("t_s,x_mm,y_mm,z_mm\n");
    for k in 0..1000 {
        let z = (10.0 - speed_mm_s * f64::from(k) / 1000.0).max(-1.0);
        let _ = writeln!(csv, "{},0,0,{}", f64::from(k) / 1000.0, 0.055 * (z / 0.055).round());
    }
    dir.write("t.csv", csv);
    let input = "trajectory(file: \"t.csv\", interpolation: linear)";
    let frame = FRAME.replace("stroke(extent_mm: 60, duration_s: 3)", input);
    let tap = "tap: (sinusoids: [(frequency_hz: 180, decay_ms: 12, gain: 60)], min_speed_mm_s: 1)";
    write(dir, &format!("tick_hz: 1000, {frame}, gain: 0.02, {SOUND}"), TILE, &format!("{WALL}, {tap}"));
    dir.run("render s.ron --out o.wav --quiet").ok();
    dir.wav("o.wav").0.iter().fold(0.0, |m, x| m.max(x.abs()))
}

#[test]
fn a_tap_is_heard_from_a_stylus_that_tells_its_place_in_steps() {
    let dir = Room::new();
    // At 55 and 110 mm/s every place is a whole number of steps, and one is the surface.
    let levels = [20.0, 33.0, 55.0, 80.0, 110.0].map(|speed| tapped(&dir, speed));
    assert!(levels.iter().all(|level| *level > 1e-5), "{levels:?}");
    assert!(levels[4] > 1.5 * levels[2], "{levels:?}");
}

#[test]
fn an_expanded_graph_finds_its_files_and_knows_its_scene() {
    let dir = Room::new();
    let dir = &dir;
    fs::create_dir(dir.join("sub")).unwrap();
    let sub = dir.join("sub");
    let lap = "waveform(segments: [(0, 0), (0.5, 4), (1, 0), (1.5, -4), (2, 0)])";
    write(&sub, &format!("{FRAME}, {SOUND}"), TILE, &format!("{WALL}, texture: {lap}"));
    fs::copy(graphs("trajectories/zigzag.csv"), dir.join("hand.csv")).unwrap();
    dir.run("scene expand sub/s.ron --input hand.csv --out sub/g.ron").ok();
    dir.run("check sub/g.ron").ok();
    // Where it stands may change, what it is made of not.
    let scene = fs::read_to_string(sub.join("s.ron")).unwrap();
    fs::write(sub.join("s.ron"), scene.replace("(100, 60)", "(90, 60)")).unwrap();
    dir.run("check sub/g.ron").ok();
    fs::write(sub.join("s.ron"), scene.replace("(0.5, 4)", "(0.5, 5)")).unwrap();
    dir.run("check sub/g.ron").refused("expand it again");
}

#[test]
fn network_without_phase_is_as_loud_at_every_rate() {
    let dir = Room::new();
    let models = graphs("models/surfaces").display().to_string();
    let network = format!("network: (model: \"{models}/texture.onnx\", library: \"{models}/materials.ron\")");
    let level = |tick_hz: u32| {
        let parts = format!("tick_hz: {tick_hz}, {FRAME}, {network}, {SOUND}, gain: 0.2");
        let tile = format!("{TILE}, material: \"canvas\"");
        write(&dir, &parts, &tile, &format!("{WALL}, texture: network"));
        dir.run("render s.ron --out o.wav --quiet").ok();
        let (x, _) = dir.wav("o.wav");
        (x.iter().map(|x| f64::from(x * x)).sum::<f64>() / x.len() as f64).sqrt()
    };
    let usual = level(500);
    assert!(usual > 1e-3);
    for tick_hz in [100, 210, 1000] {
        let ratio = level(tick_hz) / usual;
        assert!((0.6..1.6).contains(&ratio), "{ratio:.2} times as loud at {tick_hz} Hz");
    }
    // What the file says is as it says, with a warning where it is too near the end of a window.
    let text = dir.text("s.ron");
    let phase = "phase: sample_commit(frames: 2, passes: 2),\nsurfaces:";
    dir.write("s.ron", text.replace("surfaces:", phase));
    for (tick_hz, emission, warnings) in [(250, -20, 1), (250, -12, 0), (500, -25, 0), (2000, -40, 1)] {
        let set = format!("phase.emission={emission}");
        let ran = check(&dir, &format!("--set tick_hz={tick_hz} --set {set}")).ok();
        assert_eq!(ran.err.matches("too loud").count(), warnings, "{tick_hz} Hz, {emission}: {}", ran.err);
    }
}

#[test]
fn the_picture_follows_a_scene_that_changes() {
    let dir = Room::new();
    let frame = FRAME.replace("duration_s: 3", "duration_s: 600");
    write(&dir, &frame, TILE, WALL);
    let mut child = harness::asperity(&dir)
        .args("render s.ron --watch --limit-us 9000000 --seconds 600 --plot p.svg --report r.json".split(' '))
        .stderr(std::process::Stdio::null())
        .spawn()
        .unwrap();
    std::thread::sleep(Duration::from_millis(800));
    let text = dir.text("s.ron");
    let text = text.replace("\"tile\"", "\"another\"").replace(WALL, &format!("{WALL}, friction: dahl"));
    dir.write("new", text);
    fs::rename(dir.join("new"), dir.join("s.ron")).unwrap();
    std::thread::sleep(Duration::from_millis(1500));
    let killed = std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(killed.unwrap().success());
    harness::live::until("its end", || child.try_wait().unwrap().is_some());
    assert_eq!(dir.json("r.json")["swaps"].as_array().unwrap().len(), 1);
    let picture = dir.text("p.svg");
    assert!(picture.contains(">another<") && !picture.contains(">tile<"), "the scene as it is now");
    assert!(picture.contains(">friction<"));
}

/// A loop of 0.5 or 1 mm stood at the same phase at every step of the stroke that is measured, and seemed
/// not to be late at all.
#[test]
fn loops_of_round_lengths_are_as_late_as_others() {
    let dir = Room::new();
    let names = [1.0, 1.013].map(|length: f64| {
        let lap = format!("texture: waveform(segments: [(0, 0), ({}, 4), ({length}, 0)])", length / 2.0);
        write(&dir, &format!("{FRAME}, {SOUND}"), "plane", &format!("{WALL}, {lap}"));
        let name = format!("{length}.ron");
        fs::rename(dir.join("s.ron"), dir.join(&name)).unwrap();
        name
    });
    let told = dir.run(&format!("latency --json {}", names.join(" "))).json();
    for graph in told["graphs"].as_array().unwrap() {
        // A tick and a quarter: half of the step has shown before the half of the way, a tick and a half
        // less a sample, that the node declares.
        let ms = graph["latency"]["response_lag_ms"][1].as_f64().unwrap();
        assert!((ms - 2.5).abs() < 0.3, "{graph}");
        let items = graph["items"].as_array().unwrap();
        let told = |what: &str| items.iter().any(|item| item["what"].as_str().unwrap().contains(what));
        assert!(told("waveform a") && !told("motion"), "where a stylus is goes through no low-pass: {graph}");
    }
}
