//! `render --watch` and `run --watch`: a graph, a plugin and a file that change while it plays.

use std::fs;
use std::path::Path;
use std::time::Duration;

use harness::alone::{beside_others, shared_stage};
use harness::live::{Live, largest_step, npy};
use harness::{json, plugins, wav};

use crate::edits::replace;

/// A slow wave of a plugin through a gain, in one file with the plugin beside it.
fn graph(gain: &str, extra: &str) -> String {
    format!(
        "Graph(version: 1, plugins: [\"libtold.so\"], nodes: {{\"wave\": (kind: \"told\"), \
         \"gain\": (kind: \"gain\", \
         params: (gain: {gain})), {extra} \"guard\": (kind: \"limiter\"), \"out\": (kind: \"audio_out\")}}, \
         wires: [(\"wave\", \"gain\"), (\"gain\", \"guard\"), (\"guard\", \"out\")])"
    )
}

/// Builds the plugin and puts it in its place at once.
fn build(dir: &Path, flag: &str) {
    let new = dir.join(".new");
    plugins::compile(&plugins::sources().join("told.c"), &new, &[flag]);
    fs::rename(new, dir.join("libtold.so")).unwrap();
}

#[test]
fn a_graph_and_its_plugin_change_while_it_plays_without_a_click() {
    let dir = &*shared_stage();
    build(dir, "-DAMPLITUDE=0.1f");
    fs::write(dir.join("g.ron"), graph("0.5", "")).unwrap();
    let args =
        "render g.ron --watch --limit-us 9000000 --seconds 600 --out o.wav --report r.json --plot p.svg";
    let args: Vec<&str> = args.split(' ').collect();
    let mut playing = Live::command(dir, &args);
    std::thread::sleep(Duration::from_millis(600));

    // A live parameter, then a plugin that was built anew, then a new node in between.
    fs::write(dir.join("g.ron"), graph("1.0", "")).unwrap();
    playing.says("g.ron changed: `gain.gain` set to 1, 4 nodes kept");
    build(dir, "-DAMPLITUDE=0.2f");
    playing.says("libtold.so changed: `wave` rebuilt");
    // What does not compile leaves the running graph alone and says why, with the place.
    let bad = graph("1.0", "").replace("(kind: \"gain\"", "(kind: \"gian\"");
    fs::write(dir.join("g.ron"), &bad).unwrap();
    playing.says("g.ron changed, and cannot be taken over:");
    playing.says("error: there is no node kind `gian`");
    playing.says("the running graph goes on");
    // Nor does a library that is no plugin any more.
    fs::write(dir.join("g.ron"), graph("1.0", "")).unwrap();
    playing.says("g.ron changed: nothing that is heard");
    let kept = fs::read(dir.join("libtold.so")).unwrap();
    replace(dir, "libtold.so", &kept[..kept.len() / 2]);
    playing.says("cannot be taken over:");
    playing.says("the running graph goes on");
    replace(dir, "libtold.so", &kept);
    playing.says("nothing that is heard");
    // What is written cannot change while it is.
    let other = graph("1.0", "").replace("\"out\"", "\"other\"");
    fs::write(dir.join("g.ron"), other).unwrap();
    playing.says("what this render writes would change");
    let rate = graph("1.0", "").replace("version: 1", "version: 1, tick_hz: 1000");
    fs::write(dir.join("g.ron"), rate).unwrap();
    playing.says("cannot go on at 1000");
    std::thread::sleep(Duration::from_millis(300));
    assert_eq!(playing.stop().code, 130);

    let (samples, _) = wav(&dir.join("o.wav"));
    let ticks = json(&dir.join("r.json"))["ticks"].as_u64().unwrap() as usize;
    assert!(ticks > 500 && samples.len() == 96 * ticks, "{} samples in {ticks} ticks", samples.len());
    // The loudest the wave gets is 0.2 at 0.01 rad a sample; a fade of 10 ms adds its own slope.
    let most = 0.2 * 0.01 + 0.3 / 480.0;
    assert!(largest_step(&samples) < most, "a click of {}", largest_step(&samples));
    let peak = |x: &[f32]| x.iter().fold(0.0_f32, |m, x| m.max(x.abs()));
    let (first, last) = (peak(&samples[4_800..19_200]), peak(&samples[samples.len() - 4_800..]));
    assert!((first - 0.05).abs() < 0.002, "{first} before");
    assert!((last - 0.2).abs() < 0.002, "{last} after a gain of 1 and a plugin twice as loud");
    let swaps = json(&dir.join("r.json"))["swaps"].as_array().unwrap().clone();
    assert_eq!(swaps.len(), 2, "{swaps:?}");
    let ticks: Vec<u64> = swaps.iter().map(|s| s["tick"].as_u64().unwrap()).collect();
    assert!(ticks[0] > 100 && ticks[1] > ticks[0], "{ticks:?}");
    assert!(json(&dir.join("r.json"))["faults"] == 0);
}

#[test]
fn rebuilt_plugin_is_swapped_in_while_a_card_plays() {
    let _alone = beside_others();
    let trial = || {
        let dir = tempfile::tempdir().unwrap();
        let dir = dir.path();
        build(dir, "-DAMPLITUDE=0.1f");
        let ear = "\"sent\": (kind: \"file_out\", params: (file: \"sent.npy\")),";
        let heard =
            graph("1.0", ear).replace("(\"guard\", \"out\")", "(\"guard\", \"out\"), (\"guard\", \"sent\")");
        fs::write(dir.join("g.ron"), heard).unwrap();
        let args = ["g.ron", "--device", "simulated:frames=256", "--watch", "--limit-us", "9000000"];
        let mut live = Live::start(dir, &[&args[..], &["--report", "r.json"]].concat());
        live.says("plays on");
        std::thread::sleep(Duration::from_millis(500));
        build(dir, "-DAMPLITUDE=-0.15f");
        live.says("libtold.so changed: `wave` rebuilt");
        std::thread::sleep(Duration::from_millis(500));
        // What does not load leaves it playing.
        replace(dir, "libtold.so", "no library");
        live.says("the running graph goes on");
        std::thread::sleep(Duration::from_millis(200));
        live.stop().ok();
        let (samples, report) = (npy(&dir.join("sent.npy")), json(&dir.join("r.json")));
        assert_eq!(report["faults"], 0);
        let peak = |x: &[f32]| x.iter().fold(0.0_f32, |m, x| m.max(x.abs()));
        let (first, last) = (peak(&samples[4_800..19_200]), peak(&samples[samples.len() - 4_800..]));
        assert!((first - 0.1).abs() < 0.004 && (last - 0.15).abs() < 0.004, "{first}, and then {last}");
        // Where time was lost the wave has a step of its own.
        if report["skipped_ticks"] != 0 || report["recording_gaps"] != 0 {
            return Err(format!("time was lost: {report}"));
        }
        Ok(largest_step(&samples))
    };
    let step = harness::live::told(trial);
    // The wave's own slope, and that of a fade from one amplitude to the other.
    assert!(step < 0.15 * 0.01 + 1.6 * 0.25 / 480.0, "a click of {step}");
}

#[test]
fn a_file_that_a_text_names_is_seen_to_change() {
    let dir = &*shared_stage();
    let made = |name: &str| fs::read(harness::graphs("models/made_ar").join(name)).unwrap();
    fs::write(dir.join("m.ron"), made("rough.ron")).unwrap();
    let graph = "Graph(version: 1, nodes: {\"hand\": (kind: \"stroke\"), \"motion\": (kind: \"velocity\"), \
                 \"floor\": (kind: \"virtual_floor\"), \
                 \"rub\": (kind: \"autoregressive\", params: (models: [\"autoregressive(model: \
                 \\\"m.ron\\\")\"])), \
                 \"inverse\": (kind: \"actuator_inverse\"), \"guard\": (kind: \"limiter\"), \
                 \"out\": (kind: \"audio_out\")}, \
                 wires: [(\"hand.position\", \"motion\"), (\"hand.position\", \"floor\"), \
                 (\"motion.speed\", \"rub.speed\"), \
                 (\"floor.force\", \"rub.force\"), (\"rub\", \"inverse\"), (\"inverse\", \"guard\"), \
                 (\"guard\", \"out\")])";
    fs::write(dir.join("g.ron"), graph).unwrap();
    // Nor is it written over.
    let over = harness::run(dir, &["render", "g.ron", "--seconds", "1", "--report", "m.ron"]);
    assert!(over.code == 2 && over.err.contains("`rub` reads this file"), "{}", over.err);
    let args = "render g.ron --watch --limit-us 9000000 --seconds 600 --out o.wav";
    let mut playing = Live::command(dir, &args.split(' ').collect::<Vec<_>>());
    std::thread::sleep(Duration::from_millis(600));
    replace(dir, "m.ron", made("smooth.ron"));
    playing.says("m.ron changed: `rub` rebuilt");
    replace(dir, "m.ron", "Autoregressive(");
    playing.says("cannot be taken over:");
    playing.says("the running graph goes on");
    assert_eq!(playing.stop().code, 130);
}

#[test]
fn plugin_that_is_damaged_or_meddles_does_not_come_into_a_run() {
    let dir = &*shared_stage();
    build(dir, "-DAMPLITUDE=0.1f");
    fs::write(dir.join("g.ron"), graph("1.0", "")).unwrap();
    let mut run = Live::start(dir, &["g.ron", "--watch", "--device", "simulated:frames=96"]);
    std::thread::sleep(Duration::from_millis(1500));
    build(dir, "-DTRAP");
    run.says("tried in another process, this plugin crashed by signal");
    build(dir, "-DHANDLER");
    run.says("this plugin does not leave the process as it was: it changed the handler of signal 11");
    build(dir, "-DAMPLITUDE=0.05f");
    run.says("its code was rebuilt");
    run.stop().ok();
}
