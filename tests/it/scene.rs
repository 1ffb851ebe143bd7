//! Scenes through the program: only what is called for is built, run and paid for, and what is heard does
//! not depend on it.

use std::fmt::Write as _;

use harness::{Room, csv, graphs, node, run};
use serde_json::Value;

/// A shipped scene.
fn shipped(name: &str) -> String {
    format!("graphs/scenes/{name}.ron")
}

/// The shipped model and actuator, whatever folder a scene is in.
fn parts(audio_hz: u32) -> String {
    let models = graphs("models/surfaces").display().to_string();
    format!(
        "version: 1, tick_hz: 500, audio_hz: {audio_hz}, seed: 7,\n\
         network: (model: \"{models}/texture.onnx\", library: \"{models}/materials.ron\"),\n\
         phase: shaped_noise(precision: f32), motion: (cutoff_hz_per_mm_s: 1.0),\n\
         device: (damping_ns_per_m: 2), gain: 0.25, actuator: (profile: \"hapcoil_one\", handle_mass_g: \
         100.0),\n\
         output: audio_out(volts_at_full_scale: 1.0, amps_per_volt: 1.0),\n"
    )
}

const WALL: &str = "stiffness: (stiffness_n_per_mm: 0.5)";
const LOOP: &str =
    "texture: waveform(segments: [(0, 0), (0.5, 4), (1, 0), (1.5, -4), (2, 0)], reference_speed_mm_s: 80)";

/// Effects of a wall.
fn wall(more: &str) -> String {
    format!("{WALL}, {more}")
}

/// The texture of a shipped autoregressive model.
fn ar(name: &str) -> String {
    format!(
        "texture: autoregressive(model: {:?})",
        graphs(&format!("models/made_ar/{name}.ron")).display().to_string()
    )
}

/// A scene of tiles, and the stroke `t.csv`.
fn scene(audio_hz: u32, effects: &[&str]) -> String {
    format!("{}{STROKE}{}", parts(audio_hz), tiles(effects))
}

/// Tiles of 20 mm along x from -40 on, with these effects; all have a material.
fn tiles(effects: &[&str]) -> String {
    let mut out = String::from("surfaces: {\n");
    for (i, effects) in effects.iter().enumerate() {
        let x = -30 + 20 * i as i32;
        let material = ["canvas", "oak", "denim", "hessian"][i % 4];
        let _ = writeln!(
            out,
            "\"{i}\": (shape: rectangle(size_mm: (20, 60)), place_mm: ({x}, 0, 0), \
             material: \"{material}\", effects: ({effects})),"
        );
    }
    out.push_str("},\n");
    out
}

/// Down, along x at a speed, up and back through the air.
fn along(speed_mm_s: f64) -> String {
    csv(3.0, |t| {
        let moved = (t - 0.5).clamp(0.0, 1.5);
        let down = ((t - 0.3) / 0.1).clamp(0.0, 1.0) * ((2.3 - t) / 0.1).clamp(0.0, 1.0);
        [-38.0 + speed_mm_s * moved, 0.0, 3.0 - 5.0 * down]
    })
}

/// Writes a scene and its stroke, and renders it; the report.
fn rendered(dir: &Room, scene: &str, stroke: &str, more: &[&str]) -> Value {
    write_text(dir, scene);
    dir.write("t.csv", stroke);
    let mut args = vec!["render", "s.ron", "--out", "o.wav", "--report", "r.json", "--quiet"];
    args.extend(more);
    run(dir, &args).ok();
    dir.json("r.json")
}

const STROKE: &str = "input: trajectory(file: \"t.csv\", interpolation: linear),\n";

fn calls(report: &Value, id: &str) -> u64 {
    node(report, id)["calls"].as_u64().unwrap()
}

fn kinds(report: &Value) -> Vec<String> {
    let nodes = report["nodes"].as_array().unwrap().iter();
    nodes.map(|n| n["kind"].as_str().unwrap().to_owned()).collect()
}

fn check(dir: &Room, file: &str) -> Value {
    dir.run(&format!("check {file} --json")).json()
}

/// Writes a scene at 48 kHz of tiles with these effects.
fn write(dir: &Room, effects: &[&str]) {
    write_text(dir, &scene(48_000, effects));
}

fn write_text(dir: &Room, scene: &str) {
    dir.write("s.ron", format!("Scene(\n{scene})\n"));
}

#[test]
fn shipped_scenes_are_taken_wherever_a_graph_is() {
    let dir = Room::new();
    for scene in ["side_by_side", "twelve", "every_effect", "thousand"].map(shipped) {
        let checked = check(&dir, &scene);
        assert_eq!(checked["dropped"].as_array().unwrap().len(), 0, "{scene}");
        assert_eq!(checked["allocation_free"], true, "{scene}");
        dir.run(&format!("graph {scene} --svg g.svg")).ok();
        dir.run(&format!("render {scene} --seconds 4 --out o.wav --report r.json --quiet")).ok();
        assert_eq!(dir.json("r.json")["faults"], 0, "{scene}");
        let (samples, _) = dir.wav("o.wav");
        let loud = samples.iter().filter(|x| x.abs() > 0.003).count();
        assert!(loud * 10 > samples.len(), "{scene}: {loud} of {}", samples.len());
    }
}

#[test]
fn what_a_scene_expands_to_is_a_graph_that_sounds_the_same() {
    let dir = Room::new();
    let text = scene(48_000, &[&wall("texture: network, friction: dahl"), &wall(LOOP)]);
    rendered(&dir, &text, &along(25.0), &[]);
    let expanded = dir.run("scene expand s.ron").ok().out;
    assert!(expanded.starts_with("// What s.ron lowers to"), "{expanded}");
    dir.run("scene expand s.ron --out g.ron").ok();
    assert_eq!(dir.text("g.ron"), expanded);
    dir.run("render g.ron --out g.wav --quiet").ok();
    let bytes = |name: &str| dir.bytes(name);
    assert!(bytes("o.wav") == bytes("g.wav"));
    // Not over the scene itself, and not where its paths would mean other files.
    for (out, why) in [("s.ron", "overwritten"), ("..", "folder")] {
        dir.run(&format!("scene expand s.ron --out {out}")).refused(why);
    }
    dir.run("scene explain g.ron").refused("not a scene");
}

/// Sample for sample.
#[test]
fn plane_with_the_model_equals_the_shipped_graph() {
    let dir = Room::new();
    let scene = parts(48_000)
        .replace("seed: 7", "seed: 2024")
        .replace("gain: 0.25", "gain: 0.2")
        .replace("network: (", "network: (synthesis_hz: 2500, precision: int8, ")
        + STROKE
        + &format!(
            "surfaces: {{\"a\": (shape: plane, material: \"canvas\", effects: ({WALL}, \
             texture: network))}},\n"
        );
    let report = rendered(&dir, &scene, &along(60.0), &[]);
    assert!(calls(&report, "texture") > 300);
    let set = "--set stylus.interpolation=linear";
    dir.run(&format!("render graphs/texture.ron --input t.csv {set} --out g.wav --quiet")).ok();
    let (of_scene, of_graph) = (dir.wav("o.wav").0, dir.wav("g.wav").0);
    assert!(of_graph.iter().any(|x| x.abs() > 0.01));
    assert!(of_scene == of_graph);
}

#[test]
fn effects_that_no_surface_has_add_no_node_and_load_nothing() {
    let dir = Room::new();
    dir.write("t.csv", along(25.0));
    let kinds_of = |effects: &[&str], parts: &str| {
        write_text(&dir, &format!("{parts}{STROKE}{}", tiles(effects)));
        kinds(&check(&dir, "s.ron"))
    };
    // The model is not even there.
    let absent = parts(48_000).replace("texture.onnx", "gone.onnx").replace("hapcoil_one", "gone.ron");
    let bare = kinds_of(&[WALL, WALL], &absent);
    assert_eq!(bare, ["trajectory", "velocity", "contact", "mix", "force_limiter", "probe"]);
    let texture = kinds_of(&[&wall(LOOP), WALL], &parts(48_000));
    for kind in ["texture_network", "action_history", "friction", "tap", "autoregressive", "relief", "magnet"]
    {
        assert!(!texture.iter().any(|k| k == kind), "{kind}");
    }
    let count = |kinds: &[String], kind: &str| kinds.iter().filter(|k| *k == kind).count();
    assert_eq!(count(&texture, "waveform"), 1, "there is nothing to go over into");
    let networks: Vec<&str> =
        (0..4).map(|_| "stiffness: (stiffness_n_per_mm: 0.5), texture: network").collect();
    let four = kinds_of(&networks, &parts(48_000));
    assert_eq!((count(&four, "texture_network"), count(&four, "contact")), (1, 1));
    dir.run("check s.ron").ok().says(&["canvas, oak, denim, hessian"]);
    // Every effect on its own adds its own nodes and no other's.
    for (effects, kind) in [
        ("friction: dahl", "friction"),
        ("tap: (sinusoids: [(frequency_hz: 180, decay_ms: 9, gain: 40)])", "tap"),
        ("vibration: (frequency_hz: 120, amplitude_m_s2: 2)", "vibration"),
        ("viscosity: (viscosity_ns_per_m: 1)", "viscosity"),
        ("magnet: (stiffness_n_per_mm: 0.2, max_force_n: 0.5, reach_mm: 4)", "magnet"),
        ("texture: relief(heights: made(surface: \"hessian\", side: 64))", "relief"),
    ] {
        let found = kinds_of(&[&format!("{WALL}, {effects}")], &parts(48_000));
        let all =
            ["friction", "tap", "vibration", "viscosity", "magnet", "relief", "waveform", "texture_network"];
        let built: Vec<&str> = all.into_iter().filter(|k| found.iter().any(|f| f == k)).collect();
        assert_eq!(built, [kind]);
    }
}

#[test]
fn a_thousand_tiles_lower_to_no_more_nodes_than_four_of_them() {
    let dir = Room::new();
    let thousand = check(&dir, &shipped("thousand"));
    let nodes = |checked: &Value| checked["nodes"].as_array().unwrap().len();
    let facts =
        &thousand["nodes"].as_array().unwrap().iter().find(|n| n["kind"] == "contact").unwrap()["facts"];
    assert_eq!((&facts["surfaces"], &facts["walls"]), (&Value::from(1000), &Value::from(1000)));
    let effects =
        [wall("friction: lugre, texture: network"), wall(LOOP), wall(&ar("rough")), wall("texture: network")];
    let effects: Vec<&str> = effects.iter().map(String::as_str).collect();
    dir.write("t.csv", along(25.0));
    write(&dir, &effects);
    assert_eq!(nodes(&thousand), nodes(&check(&dir, "s.ron")));
    let count = |kind: &str| kinds(&thousand).iter().filter(|k| *k == kind).count();
    assert_eq!((count("texture_network"), count("waveform"), count("autoregressive")), (1, 2, 2));
}

/// Textures sleep off the surface and at rest, friction off the surface, taps without a contact.
#[test]
fn effects_are_called_only_where_they_act() {
    let dir = Room::new();
    let tap = "tap: (sinusoids: [(frequency_hz: 180, decay_ms: 4, gain: 40)])";
    let effects = format!(
        "{WALL}, texture: [network, waveform(segments: [(0, 0), (0.5, 4), (1, 0)])], friction: dahl, {tap}"
    );
    let text = scene(48_000, &[&effects]);
    let ids = "texture,phase,audio rate,network level,waveform a,waveform a level,friction,tap";
    let ids: Vec<&str> = ids.split(',').collect();
    let all = |report: &Value| -> Vec<u64> { ids.iter().map(|id| calls(report, id)).collect() };
    // Over it, never down: not once.
    let over = csv(2.0, |t| [-38.0 + 15.0 * t, 0.0, 0.5]);
    let report = rendered(&dir, &text, &over, &[]);
    assert_eq!(all(&report)[..6], [0; 6], "{:?}", all(&report));
    // Friction lets go once, at the start, and so does a tap.
    assert!(all(&report)[6..].iter().all(|n| *n <= 1), "{:?}", all(&report));
    let ticks = report["ticks"].as_u64().unwrap();
    assert!(calls(&report, "contact") == ticks && calls(&report, "history") == ticks);

    // Down for 1 s and at rest there: a tap, friction, no texture.
    let press = csv(3.0, |t| [-30.0, 0.0, if (1.0..2.0).contains(&t) { -1.0 } else { 0.4 }]);
    let report = rendered(&dir, &text, &press, &[]);
    let found = all(&report);
    assert_eq!(found[..6], [0; 6], "{found:?}");
    assert!((500..=502).contains(&found[6]), "{found:?}");
    assert!((5..60).contains(&found[7]), "a tap of some ms: {found:?}");

    // Slower than the gate: nothing either. Faster: for as long as that.
    let creep = csv(3.0, |t| [-38.0 + 3.0 * t, 0.0, -1.0]);
    assert_eq!(all(&rendered(&dir, &text, &creep, &[]))[..6], [0; 6]);
    let report = rendered(&dir, &text, &along(12.0), &[]);
    let found = all(&report);
    // 1.5 s of motion, and what the low-pass and the gate's fade add.
    assert!(found[..6].iter().all(|n| (740..800).contains(n)), "{found:?}");
    // Not to sleep is to be called.
    let report = rendered(&dir, &text, &along(12.0), &["--no-sleep"]);
    assert!(ids.iter().all(|id| calls(&report, id) == report["ticks"].as_u64().unwrap()));
}

/// Compares the sound and the force of a scene with and without pruning and sleeping.
fn both_ways(dir: &Room, scene: &str, seconds: u32) {
    let [lean, whole] = ["", " --no-prune --no-sleep"].map(|way| {
        let probe = "--probe 'force limiter.force=f.npy'";
        dir.run(&format!("render {scene} --quiet --seconds {seconds} --out o.wav {probe}{way}")).ok();
        (dir.wav("o.wav").0, dir.npy("f.npy"))
    });
    assert!(lean.0.iter().any(|x| x.abs() > 0.003), "{scene} is silent");
    assert!(lean.0 == whole.0 && lean.1 == whole.1, "{scene}");
}

#[test]
fn sound_is_the_same_bits_with_everything_built_and_awake() {
    let dir = Room::new();
    for name in ["side_by_side", "every_effect", "thousand", "twelve"] {
        both_ways(&dir, &shipped(name), 4);
    }
    // At rates that do not divide, and with taps, rests and hops over an edge.
    let tap = "tap: (sinusoids: [(frequency_hz: 180, decay_ms: 9, gain: 40)])";
    let text = scene(
        44_100,
        &[
            &format!("{WALL}, friction: lugre, {LOOP}, {tap}"),
            &format!(
                "{WALL}, texture: [network, {}], \
                 vibration: (frequency_hz: 90, amplitude_m_s2: 1)",
                ar("ringing").replace("texture: ", "")
            ),
            &format!("{WALL}, texture: relief(heights: made(surface: \"hessian\", side: 64)), {tap}"),
        ],
    );
    let hops = csv(6.0, |t| {
        let x = -12.0 + 26.0 * (1.1 * t).sin() + 4.0 * (13.0 * t).sin();
        [x, 3.0 * t.cos(), -0.6 + 1.5 * (2.3 * t).sin()]
    });
    write_text(&dir, &text);
    dir.write("t.csv", hops);
    both_ways(&dir, "s.ron", 6);
}

/// No step is larger than those of the steady signals.
#[test]
fn sleeping_waking_and_crossing_make_no_step() {
    let dir = Room::new();
    let other = LOOP.replace("(0.5, 4)", "(0.3, 5)");
    for pair in [
        [wall(LOOP), wall(&other)],
        [wall("texture: network"), wall("texture: network")],
        [wall(&ar("rough")), wall(LOOP)],
        [
            wall("texture: relief(heights: made(surface: \"hessian\", side: 64), gain: 0.3)"),
            wall(&ar("rough")),
        ],
        [wall("vibration: (frequency_hz: 150, amplitude_m_s2: 3)"), wall(LOOP)],
    ] {
        let text = scene(48_000, &[&pair[0], &pair[1]]);
        // Acceleration, before the actuator's filters could hide anything.
        let probe = ["--probe", "acceleration.out=a.npy", "--seconds", "3"];
        let largest = |stroke: &str| -> f64 {
            rendered(&dir, &text, stroke, &probe);
            f64::from(harness::live::largest_step(&dir.npy("a.npy")))
        };
        // To and fro without a jump of speed; at rest where it turns anyway, off it and down again.
        let phase = |t: f64, rests: bool| {
            let t = if rests { t - (t - 2.2).clamp(0.0, 0.4) } else { t };
            8.0 * (std::f64::consts::TAU * 1.25 * t).sin()
        };
        let up = |t: f64, from: f64, to: f64| {
            ((t - from) / 0.02).clamp(0.0, 1.0) * ((to - t) / 0.02).clamp(0.0, 1.0)
        };
        let height = |t: f64| -2.0 + 2.5 * (up(t, 0.9, 1.2) + up(t, 1.9, 1.97));
        let steady = |middle: f64| csv(3.0, |t| [middle + phase(t, false), 0.0, -2.0]);
        let steady = largest(&steady(-30.0)).max(largest(&steady(-10.0)));
        let hops = |middle: f64| csv(3.0, |t| [middle + phase(t, true), 0.0, height(t)]);
        let found = largest(&hops(-30.0)).max(largest(&hops(-10.0)));
        // Noise is drawn anew at each place, and its largest step with it. Else found: 1.0011 times at most.
        let most = if pair.iter().any(|effects| effects.contains("network")) { 1.25 } else { 1.01 };
        assert!(steady > 0.0 && found <= most * steady, "{pair:?}: {found} of {steady}");
        // Over the edge as well: of two that sound at 0.7 each the steps may add.
        let found = largest(&csv(3.0, |t| [-20.0 + phase(t, true), 0.0, height(t)]));
        assert!(found <= 1.5 * steady, "{pair:?}: {found} of {steady} over the edge");
    }
}

#[test]
fn scene_error_has_its_place_and_nothing_is_written() {
    let dir = Room::new();
    dir.write("t.csv", along(25.0));
    let line = |text: &str, what: &str| text[..text.find(what).unwrap()].matches('\n').count() + 1;
    let wall_network = wall("texture: network");
    for (effects, from, to, message) in [
        (wall_network.as_str(), "canvas", "canvass", "did you mean"),
        (&wall_network, "texture: network", "texture: netwrk", "did you mean `network`"),
        (&wall_network, "stiffness: (", "stifness: (", "stiffness"),
        (&wall_network, "stiffness_n_per_mm: 0.5", "stiffness_n_per_mm: 500", "out of range"),
        (&wall_network, "size_mm: (20, 60)", "size_mm: (20, 0)", "rectangle"),
        (&wall_network, "hapcoil_one", "hapcoil_two", "hapcoil_one"),
        (&wall_network, "handle_mass_g", "handle_mass_kg", "handle_mass_g"),
        (&wall_network, "trajectory(", "trajektory(", "trajectory"),
        (&wall_network, "shaped_noise(", "shaped_nose(", "shaped_noise"),
        (&wall_network, "stiffness: (stiffness_n_per_mm: 0.5), ", "", "does not push back"),
        (&wall_network, "texture: network", "texture: [network, network]", "two network textures"),
        (&wall_network, "material: \"canvas\", ", "", "without a material"),
        (&wall_network, "texture: network", "texture: autoregressive(model: \"gone.ron\")", "gone.ron"),
    ] {
        let scene = format!("Scene(\n{})\n", scene(48_000, &[effects]));
        assert!(scene.contains(from), "{from}");
        let bad = scene.replacen(from, to, 1);
        dir.write("s.ron", &bad);
        let ran = dir.run("render s.ron --out o.wav");
        let place = format!("s.ron:{}:", line(&scene, from));
        assert!(ran.code == 2 && ran.err.contains(message), "{to}: {}", ran.err);
        // A file that is not there is told of first, and then who asks for it.
        let says = if message == "gone.ron" { ran.err.contains(&place) } else { ran.err.starts_with(&place) };
        assert!(says, "{place} {to}: {}", ran.err);
    }
    assert_eq!(dir.files(), ["s.ron", "t.csv"]);
}

#[test]
fn unpassive_stiffness_is_a_warning_and_an_error_if_strict() {
    let dir = Room::new();
    dir.write("t.csv", along(25.0));
    let stiff = "stiffness: (stiffness_n_per_mm: 5)";
    write(&dir, &[stiff, stiff, WALL]);
    let ran = dir.run("check s.ron").ok();
    assert_eq!(ran.err.matches("warning").count(), 1, "once for both: {}", ran.err);
    ran.says(&["warning", "s.ron:", "N/mm"]);
    dir.run("check s.ron --strict").refused("error").says(&["N/mm"]);
    // 0.5 N/mm at 500 Hz asks for 0.5 N s/m of the device.
    write(&dir, &[WALL]);
    let ran = dir.run("check s.ron --strict").ok();
    assert!(!ran.err.contains("warning"), "{}", ran.err);
}

#[test]
fn explain_tells_if_and_why_an_effect_is_built_and_its_cost() {
    let dir = Room::new();
    let text = scene(48_000, &[&format!("{WALL}, friction: dahl, {LOOP}"), WALL, "", &wall(LOOP)]);
    rendered(&dir, &text, &along(25.0), &[]);
    let told = dir.run("scene explain s.ron").ok().out;
    for line in ["network", "tap", "magnet", "autoregressive"] {
        let line = told.lines().find(|l| l.starts_with(line)).unwrap_or_else(|| panic!("{line}: {told}"));
        assert!(line.contains(" no ") && line.contains("no surface has it"), "{line}");
    }
    assert!(told.contains("texture.onnx: not loaded: no surface has a network texture"), "{told}");
    assert!(told.contains("no effect: it cannot be felt"), "{told}");
    let report = dir.json("r.json");
    let json = dir.run("scene explain s.ron --json").json();
    let effect = |name: &str| {
        json["effects"].as_array().unwrap().iter().find(|e| e["effect"] == name).cloned().unwrap()
    };
    assert!(effect("waveform")["built"] == true && effect("relief")["built"] == false, "{json}");
    assert!(effect("waveform")["us_per_tick"].as_f64().unwrap() > 0.0);
    assert_eq!(effect("relief")["us_per_tick"], 0.0);
    assert!(effect("friction")["why"].as_str().unwrap().contains("1 surface, 1 setting"));
    assert!(effect("waveform")["why"].as_str().unwrap().contains("2 surfaces, 1 setting"));
    // 25 mm/s for 1.5 s from x = -38: 18 mm on the first tile.
    let touched = json["surfaces"][0]["ticks_touched"].as_u64().unwrap();
    assert!(touched > 0);
    for (name, most) in
        [("stiffness", json["ticks"].as_u64().unwrap()), ("friction", touched), ("waveform", 2 * touched)]
    {
        let active = effect(name)["ticks_active"].as_u64().unwrap();
        assert!(2 * active > touched && active <= most, "{name}: {active}, touched {touched}");
    }
    assert_eq!(effect("damping")["ticks_active"], 0);
    let friction = node(&json, "friction")["calls"].as_u64().unwrap();
    assert_eq!(friction, calls(&report, "friction"), "as a render counts them");
    assert_eq!(json["surfaces"][2]["effects"].as_array().unwrap().len(), 0);
}
