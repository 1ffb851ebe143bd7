//! `asperity tradeoff` and `asperity choose`, as a user has them.

mod common;

use std::path::Path;

use common::{asperity, graphs, json, retrieving, run};
use serde_json::Value;

/// A study of a second of one stroke over one material.
fn study(dir: &Path, grids: &str) {
    let graph = retrieving().canonicalize().expect("the shipped graph");
    let paper = graphs("heravi2024.ron").canonicalize().expect("the shipped graph");
    let text = format!(
        r#"Study(
            version: 1,
            graph: {graph:?},
            marks: [(name: "paper", graph: {paper:?})],
            strokes: [(name: "circle", shape: circle, speed_mm_s: 80.0, seconds: 1.5, approach_s: 0.1)],
            materials: ["canvas"],
            strength: 0.2,
            steps: 10,
            grids: [{grids}],
            times: (turns: 2, turn_ms: 40, batch: 3),
        )"#
    );
    std::fs::write(dir.join("study.ron"), text).expect("a study");
}

const TWO: &str = r#"(name: "phase", knobs: {"phase": [(kind: "spsi"), (kind: "no_such_kind")]}),
    (name: "frames", knobs: {"phase.frames": [1, 2]}), (name: "limiter", knobs: {"limiter": [kept, bypassed]}),
    (name: "guards", knobs: {"guards": [false]})"#;

fn names(results: &Value) -> Vec<String> {
    let rows = results["rows"].as_array().expect("rows");
    rows.iter().map(|r| r["name"].as_str().expect("a name").to_owned()).collect()
}

fn row<'r>(results: &'r Value, name: &str) -> &'r Value {
    let rows = results["rows"].as_array().expect("rows");
    rows.iter().find(|r| r["name"] == name).unwrap_or_else(|| panic!("no {name}"))
}

#[test]
fn a_study_says_what_each_setting_costs_and_is_worth_and_goes_on_where_it_was() {
    let dir = tempfile::tempdir().expect("a folder");
    study(dir.path(), TWO);
    let args = ["tradeoff", "study.ron", "--out", "out", "--jobs", "2", "--no-cases"];
    let ran = run(dir.path(), &args).ok();
    assert!(ran.err.contains("`no_such_kind` is left out"), "{}", ran.err);
    assert!(ran.out.contains("D the default") && ran.out.contains("REPORT.md"), "{}", ran.out);
    let results = json(&dir.path().join("out/results.json"));
    let found = names(&results);
    // The default is two frames; what is turned to where it stands already is no setting of its own.
    assert_eq!(
        found,
        ["default", "phase=spsi", "phase.frames=1", "limiter=bypassed", "guards=false", "paper"]
    );
    for name in &found {
        let row = row(&results, name);
        assert!(row["error"].is_null(), "{row}");
        for figure in
            ["perceptual", "modulation", "spectrum", "repetition", "kurtosis", "steadiness", "convergence"]
        {
            assert!(row["figures"][figure].is_f64(), "{name} has no {figure}: {row}");
        }
        assert!(
            row["time"]["p50_us"].as_f64().expect("a time") > 0.0
                && row["time"]["ticks"].as_u64() >= Some(40)
        );
        assert!(row["time"]["memory_kib"].as_f64().expect("memory") > 20.0);
        assert!(row["lag_ms"][1].as_f64().expect("a lag") > 3.0, "{row}");
    }
    // What shows stalls lasts about as long as what may meet them.
    let median = |time: &Value| time["p50_us"].as_f64().expect("a median");
    let ratio = median(&results["empty"]) / median(&row(&results, "default")["time"]);
    assert!(ratio > 0.1, "{ratio}");
    // What cannot be played or be had cannot be chosen, and says why.
    assert!(row(&results, "limiter=bypassed")["fails"]["limiter"].is_string());
    assert!(row(&results, "guards=false")["fails"]["guards"].is_string());
    // Without a limiter, and without looking, the same comes out of so mild a stroke.
    let figures = |name: &str| row(&results, name)["figures"].clone();
    assert_eq!(figures("guards=false"), figures("default"));
    assert!(results["model"]["spectrum"].is_f64() && results["floor"]["spectrum"].is_f64());
    for file in
        ["results.csv", "REPORT.md", "perceptual_time.svg", "modulation_lag.svg", "convergence_time.svg"]
    {
        assert!(dir.path().join("out").join(file).exists(), "{file}");
    }
    let csv = std::fs::read_to_string(dir.path().join("out/results.csv")).expect("a table");
    assert_eq!(csv.lines().count(), 1 + found.len());

    // Once more: everything is there already, and is the same to the last digit, times too.
    let again = run(dir.path(), &args).ok();
    assert!(again.out.contains("6 settings"), "{}", again.out);
    assert_eq!(json(&dir.path().join("out/results.json")), results);
}

#[test]
fn a_mark_is_held_against_the_part_of_the_physics_that_it_says() {
    let dir = tempfile::tempdir().expect("a folder");
    study(dir.path(), "");
    let path = dir.path().join("study.ron");
    let text = std::fs::read_to_string(&path).expect("a study");
    let graph = graphs("heravi2024.ron").canonicalize().expect("the shipped graph");
    let marks = format!("marks: [(name: \"half\", graph: {graph:?}, strength: 0.5), ");
    std::fs::write(&path, text.replace("marks: [", &marks)).expect("a study");
    run(dir.path(), &["tradeoff", "study.ron", "--out", "out", "--no-cases", "-q"]).ok();
    let results = json(&dir.path().join("out/results.json"));
    let level = |name: &str| row(&results, name)["figures"]["level"].as_f64().expect("a level");
    // Far too quiet for all of the physics, and 6 dB less so for half of it.
    let less = level("paper") - level("half");
    assert!((less - 6.02).abs() < 0.1, "{less} dB");
}

/// A second and a half of a line over a surface, with noise of so many m/s^2 for what the tool felt.
fn recording(dir: &Path, peak: f64) {
    let mut text = String::from("t_s,force_n,x_mm,y_mm,ax_m_s2\n");
    let mut seed = 1_u64;
    for n in 0..3000 {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        let noise = peak * ((seed >> 40) as f64 / f64::from(1_u32 << 23) - 1.0);
        let t = f64::from(n) / 2000.0;
        text += &format!("{t:.4},0.8,{:.4},0,{noise:.9}\n", 80.0 * t);
    }
    std::fs::write(dir.join("mine.csv"), text).expect("a recording");
}

#[test]
fn a_setting_is_held_against_what_was_recorded_of_the_same_stroke() {
    let dir = tempfile::tempdir().expect("a folder");
    let graph = retrieving().canonicalize().expect("the shipped graph");
    let write = |of: &str| {
        let text = format!(
            r#"Study(version: 1, graph: {graph:?}, steps: 10, times: (turns: 2, turn_ms: 40, batch: 3),
                strokes: [(name: "mine", recording: "mine.csv"{of})], materials: ["sandpaper P120"])"#
        );
        std::fs::write(dir.path().join("study.ron"), text).expect("a study");
    };
    let args = ["tradeoff", "study.ron", "--out", "out", "--no-cases", "-q"];
    recording(dir.path(), 30.0);
    write("");
    let refused = run(dir.path(), &args);
    assert_eq!(refused.code, 2, "{}", refused.err);
    assert!(refused.err.contains("nothing says over which material `mine` was recorded"), "{}", refused.err);
    write(", material: \"canvas\"");
    let level = || {
        run(dir.path(), &args).ok();
        let results = json(&dir.path().join("out/results.json"));
        // It goes over its own material, and over no other.
        assert_eq!(results["materials"], serde_json::json!(["sandpaper P120", "canvas"]));
        let figures = &row(&results, "default")["figures"];
        assert!(figures["perceptual"].is_f64() && figures["precision"].is_f64(), "{figures}");
        figures["level"].as_f64().expect("a level")
    };
    let quiet = level();
    // What is kept of a file that has changed is not taken: all bins are four times as large.
    recording(dir.path(), 120.0);
    let by = level() - quiet;
    assert!((by - 20.0 * 4_f64.log10()).abs() < 1e-3, "{by} dB");
}

#[test]
fn parts_of_a_study_are_put_together_and_the_best_can_be_pasted() {
    let dir = tempfile::tempdir().expect("a folder");
    study(
        dir.path(),
        r#"(name: "g", knobs: {"phase.frames": [1, 3], "tick_hz": [1000]}), (name: "p", knobs: {"phase": [(kind: "spsi")]})"#,
    );
    for part in ["1", "2"] {
        let shard = format!("{part}/2");
        let part = ["tradeoff", "study.ron", "--out", part, "--shard", &shard, "--no-cases", "-q"];
        run(dir.path(), &[&part[..], &["--set", "strength.gain=0.34"]].concat()).ok();
    }
    let parts = ["1", "2"].map(|p| json(&dir.path().join(p).join("results.json")));
    assert_eq!(names(&parts[0])[0], "default");
    assert_eq!(names(&parts[1])[0], "default");
    for (shards, want) in
        [(&["1", "1"][..], "shard 1 of 2 is there already"), (&["1", "gone"], "cannot read this file")]
    {
        let ran = run(dir.path(), &[&["tradeoff", "merge", "--out", "no"], shards].concat());
        assert!(ran.code == 2 && ran.err.contains(want), "{shards:?}: {}", ran.err);
    }
    let lost = run(dir.path(), &["tradeoff", "study.ron", "--out", "1", "--shard", "2/2", "--no-cases"]);
    assert!(lost.code == 2 && lost.err.contains("has the results of shard 1/2"), "{}", lost.err);
    std::fs::create_dir(dir.path().join("half")).expect("a folder");
    for out in ["1", "half/../1"] {
        let over = run(dir.path(), &["tradeoff", "merge", "2", "1/results.json", "--out", out]);
        assert!(over.code == 2 && over.err.contains("take the place of these results"), "{}", over.err);
    }
    assert_eq!(json(&dir.path().join("1/results.json")), parts[0]);
    let half = run(dir.path(), &["tradeoff", "merge", "1", "--out", "half", "-q"]).ok();
    assert!(half.err.contains("shards that are not there: 2 of 2"), "{}", half.err);
    let report = std::fs::read_to_string(dir.path().join("half/REPORT.md")).expect("a report");
    assert!(report.contains("Shards that are not here: 2 of 2"), "{report}");
    run(dir.path(), &["tradeoff", "merge", "1", "2", "--out", "all", "-q"]).ok();
    let all = json(&dir.path().join("all/results.json"));
    let mut found = names(&all);
    found.sort();
    assert_eq!(
        found,
        ["default", "paper", "phase.frames=1 tick_hz=1000", "phase.frames=3 tick_hz=1000", "phase=spsi"]
    );
    let load =
        |results: &Value, name: &str| row(results, name)["time"]["load_percent"].as_f64().expect("a load");
    let other = names(&parts[1])[1].clone();
    let factor = load(&parts[0], "default") / load(&parts[1], "default");
    assert!((load(&all, &other) / (load(&parts[1], &other) * factor) - 1.0).abs() < 1e-9);

    // The best of those at 1000 Hz, pasted into the graph by hand, is a graph that runs.
    let chosen = run(dir.path(), &["choose", "all", "--tick-hz", "1000"]).ok().out;
    assert!(
        chosen.contains("tick_hz: 1000,") && chosen.contains("\"phase\": (kind: \"sample_commit\""),
        "{chosen}"
    );
    // What the command line set is not in the graph's file.
    assert!(chosen.contains("\"strength\": (kind: \"gain\", params: (gain: 0.34)),"), "{chosen}");
    let line = chosen.lines().find(|l| l.contains("\"phase\":")).expect("a node");
    let text = std::fs::read_to_string(retrieving()).expect("the graph");
    let before = text.lines().find(|l| l.contains("\"phase\":")).expect("a node");
    let pasted = text.replace(before, line).replace("tick_hz: 500,", "tick_hz: 1000,");
    let models = format!("{}/", graphs("").canonicalize().expect("graphs").display());
    let pasted = pasted.replace("../../graphs/", &models);
    std::fs::write(dir.path().join("pasted.ron"), pasted).expect("a graph");
    run(dir.path(), &["check", "pasted.ron"]).ok();

    // Another kind of phase retrieval comes with the node that it needs behind it, and with wires.
    let spsi =
        run(dir.path(), &["choose", "all", "--by", "convergence", "--tick-hz", "500", "--json"]).ok().out;
    let spsi: Value = serde_json::from_str(&spsi).expect("JSON");
    assert!(spsi["fit"].as_u64() >= Some(2), "{spsi}");
    let none = run(dir.path(), &["choose", "all", "--budget-us", "0.01"]);
    assert!(none.code == 1 && none.err.contains("the quickest has ticks of"), "{}", none.err);
    let late = run(dir.path(), &["choose", "all", "--max-lag-ms", "0"]);
    assert!(late.code == 1 && late.err.contains("the soonest answers after"), "{}", late.err);
    let unknown = run(dir.path(), &["choose", "all", "--by", "spectrm"]);
    assert!(unknown.code == 2 && unknown.err.contains("spectrum"), "{}", unknown.err);
}

#[test]
fn what_is_wrong_with_a_study_is_said_with_its_place_and_nothing_is_written() {
    let dir = tempfile::tempdir().expect("a folder");
    for (grids, want) in [
        (r#"(name: "g", knobs: {"phase.frame": [1]})"#, "no graph has `phase.frame` to turn"),
        (r#"(name: "g", knobs: {"phase.frame": [1]})"#, "did you mean `phase.frames`?"),
        (r#"(name: "g", knobs: {"nothing": [kept]})"#, "no graph has `nothing` to turn"),
        (r#"(name: "g", knobs: {"phase": [gone]})"#, "`gone` is nothing to turn a node to"),
        (r#"(name: "g", knobs: {"phase.frames": []})"#, "nothing to turn this to"),
        (r#"(name: "g", knobs: {".": [1]})"#, "is no knob"),
        (r#"(name: "g")"#, "knobs"),
    ] {
        study(dir.path(), grids);
        let ran = run(dir.path(), &["tradeoff", "study.ron", "--out", "out"]);
        assert_eq!(ran.code, 2, "{grids}: {}", ran.err);
        assert!(ran.err.contains(want) && ran.err.contains("study.ron"), "{grids}: {}", ran.err);
        assert!(!dir.path().join("out").exists(), "{grids}");
    }
    // A value that a node refuses is a setting that does not run, and says why; the others do.
    study(dir.path(), r#"(name: "g", knobs: {"phase.frames": [5, 0]})"#);
    run(dir.path(), &["tradeoff", "study.ron", "--out", "out", "--no-cases", "-q"]).ok();
    let results = json(&dir.path().join("out/results.json"));
    assert!(
        row(&results, "phase.frames=0")["error"].as_str().expect("why").contains("out of range"),
        "{results}"
    );
    assert!(row(&results, "default")["error"].is_null());
    for (args, want) in [
        (&["tradeoff", "study.ron", "study.ron", "--out", "o"][..], "a second study"),
        (&["tradeoff", "--out", "o"], "there is no graph to study"),
        (&["tradeoff", "study.ron", "--out", "o", "--shard", "3/2"], "is no part"),
        (&["tradeoff", "gone.ron", "--out", "o"], "gone.ron"),
        (&["tradeoff", "merge", "gone", "--out", "o"], "cannot read this file"),
        (&["choose", "study.ron"], "these are no results"),
    ] {
        let ran = run(dir.path(), args);
        assert!(ran.code == 2 && ran.err.contains(want), "{args:?}: {}", ran.err);
    }
}

#[test]
fn names_are_looked_at_before_anything_runs() {
    let dir = tempfile::tempdir().expect("a folder");
    let text = |from: &str, to: &str| {
        study(dir.path(), TWO);
        let path = dir.path().join("study.ron");
        let text = std::fs::read_to_string(&path).expect("a study");
        assert!(text.contains(from), "{from}");
        std::fs::write(path, text.replace(from, to)).expect("a study");
    };
    let gone = "named here";
    for (from, to, want) in [
        ("[\"canvas\"]", "[\"canvsa\"]", "did you mean `canvas`?"),
        ("name: \"paper\"", "name: \"default\"", "is no name for a mark"),
        ("marks: [", "marks: [(name: \"paper\", graph: \"g.ron\"), ", "stands here twice"),
        ("sample_commit.ron", "no_such_graph.ron", gone),
        ("heravi2024.ron", "no_such_graph.ron", gone),
        ("speed_mm_s: 80.0", "speed_mm_s: -1.0", "`speed_mm_s` is -1"),
        ("seconds: 1.5", "seconds: 0.1", "`seconds` is 0.1"),
        ("seconds: 1.5", "seconds: 1e6", "at most 600"),
    ] {
        text(from, to);
        let ran = run(dir.path(), &["tradeoff", "study.ron", "--out", "out"]);
        assert!(
            ran.code == 2 && ran.err.contains(want) && ran.err.contains("study.ron"),
            "{to}: {}",
            ran.err
        );
        assert!(!dir.path().join("out").exists(), "{to}");
    }
}

#[test]
fn a_study_of_which_no_setting_runs_is_a_failure() {
    let dir = tempfile::tempdir().expect("a folder");
    let graph = r#"Graph(version: 1, nodes: {"tone": (kind: "sine"), "out": (kind: "probe")}, wires: [("tone", "out")])"#;
    std::fs::write(dir.path().join("still.ron"), graph).expect("a graph");
    let text = r#"Study(version: 1, graph: "still.ron", strokes: [(name: "circle", seconds: 1.5)])"#;
    std::fs::write(dir.path().join("study.ron"), text).expect("a study");
    let ran = run(dir.path(), &["tradeoff", "study.ron", "--out", "out", "--no-cases"]);
    assert!(ran.code == 1 && ran.err.contains("nothing in this graph moves a stylus"), "{}", ran.err);
}

#[test]
fn the_shipped_study_leaves_out_what_ones_own_graph_has_not_and_says_so_before_it_runs() {
    let dir = tempfile::tempdir().expect("a folder");
    // Nothing in it moves, so that all settings fail at once: what is looked at is what is left out.
    let graph = r#"Graph(version: 1, nodes: {"tone": (kind: "sine"), "out": (kind: "probe")}, wires: [("tone", "out")])"#;
    std::fs::write(dir.path().join("still.ron"), graph).expect("a graph");
    let ran = run(dir.path(), &["tradeoff", "still.ron", "--out", "out", "--no-cases"]);
    assert_eq!(ran.code, 1, "{}", ran.err);
    for knob in ["phase", "texture.bins"] {
        assert!(ran.err.contains(&format!("`{knob}` is left out")), "{knob}: {}", ran.err);
    }
    let results = json(&dir.path().join("out/results.json"));
    assert!(names(&results).contains(&"tick_hz=1000".to_owned()), "{results}");
    let report = std::fs::read_to_string(dir.path().join("out/REPORT.md")).expect("a report");
    assert!(report.contains("`texture.bins` is left out"), "{report}");
}

#[test]
fn a_scene_is_held_against_the_studys_material_where_its_surfaces_are() {
    let dir = tempfile::tempdir().expect("a folder");
    study(dir.path(), "");
    let scene = std::fs::read_to_string(graphs("scenes/side_by_side.ron")).expect("the shipped scene");
    let folder = graphs("scenes").canonicalize().expect("the folder").display().to_string();
    let scene = scene.replace("\"../", &format!("\"{folder}/../"));
    // The same, but what is on the other side, and which side comes first.
    std::fs::write(dir.path().join("a.ron"), &scene).expect("a scene");
    let other = scene
        .replace("sandpaper P80", "oak")
        .replace("material: \"canvas\"", "material: \"leather grain, fine\"");
    std::fs::write(dir.path().join("b.ron"), other).expect("a scene");
    let mut figures = Vec::new();
    for (name, out) in [("a.ron", "a"), ("b.ron", "b")] {
        let ran = run(dir.path(), &["tradeoff", "study.ron", name, "--out", out, "--no-cases"]).ok();
        assert!(ran.err.contains("`circle` is made") && ran.err.contains("`left`"), "{}", ran.err);
        let results = json(&dir.path().join(out).join("results.json"));
        let row = row(&results, "default").clone();
        assert!(row["error"].is_null() && row["lag_ms"][1].is_f64(), "{row}");
        let level = row["figures"]["level"].as_f64().expect("a level");
        assert!(level < 4.0, "{row}");
        figures.push(row["figures"].clone());
        let report = std::fs::read_to_string(dir.path().join(out).join("REPORT.md")).expect("a report");
        let links = report.split("](").skip(1).filter_map(|l| l.split(')').next());
        for link in links.filter(|l| l.ends_with(".svg")) {
            assert!(dir.path().join(out).join(link).exists(), "{link}");
        }
    }
    assert_eq!(figures[0], figures[1]);
}

#[cfg(unix)]
#[test]
fn a_study_that_is_interrupted_says_so_and_goes_on_later() {
    let dir = tempfile::tempdir().expect("a folder");
    study(
        dir.path(),
        r#"(name: "g", knobs: {"phase.frames": [1, 2, 3, 4, 6, 7, 8, 9], "phase.passes": [1, 2]})"#,
    );
    let args = ["tradeoff", "study.ron", "--out", "out", "--no-cases", "-q"];
    let child = asperity(dir.path()).args(args).spawn().expect("it starts");
    // As soon as something is kept.
    while parts(dir.path(), "figures-").len() < 2 {
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    let killed = std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(killed.expect("kill").success());
    let ended = child.wait_with_output().expect("it ends");
    assert_eq!(ended.status.code(), Some(130));
    let results = json(&dir.path().join("out/results.json"));
    let some = names(&results).len();
    assert!((1..17).contains(&some), "{some}");
    run(dir.path(), &args).ok();
    let results = json(&dir.path().join("out/results.json"));
    assert_eq!(names(&results).len(), 17);
    assert!(results["rows"].as_array().expect("rows").iter().all(|r| r["time"].is_object()));
    assert_eq!(results["unfinished"], 0);
    // What is finished is not lost where the same command is stopped at once, nor where it is one whose
    // parts are all new.
    let code = interrupted(dir.path(), &args);
    assert!(matches!(code, Some(0 | 130)), "{code:?}");
    assert_eq!(json(&dir.path().join("out/results.json")), results);
    let code = interrupted(dir.path(), &[&args[..], &["--set", "strength.gain=0.34"]].concat());
    assert_eq!(code, Some(130));
    assert_eq!(json(&dir.path().join("out/results.json")), results);
}

/// Exit code of a study that is interrupted as soon as it has its folder; none where it did not end by itself.
#[cfg(unix)]
fn interrupted(dir: &Path, args: &[&str]) -> Option<i32> {
    let lock = || {
        let lock = std::fs::metadata(dir.join("out/kept/.lock")).expect("a lock");
        lock.modified().expect("a time")
    };
    let before = lock();
    let mut child = asperity(dir).args(args).spawn().expect("it starts");
    // It may be over before that is seen.
    while lock() == before && child.try_wait().expect("it runs").is_none() {
        std::thread::sleep(std::time::Duration::from_micros(200));
    }
    let killed = std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(killed.is_ok());
    child.wait().expect("it ends").code()
}

/// Names of finished parts of `out`, with what tells a file that was written anew.
fn parts(dir: &Path, prefix: &str) -> Vec<(String, std::time::SystemTime)> {
    let Ok(entries) = std::fs::read_dir(dir.join("out/kept")) else { return Vec::new() };
    let parts =
        entries.map(|e| e.expect("an entry")).filter(|e| e.file_name().to_string_lossy().starts_with(prefix));
    let mut all: Vec<_> = parts
        .map(|e| {
            (
                e.file_name().to_string_lossy().into_owned(),
                e.metadata().and_then(|m| m.modified()).expect("a time"),
            )
        })
        .collect();
    all.sort();
    all
}

#[test]
fn after_a_change_what_it_touches_is_run_again_and_nothing_else() {
    let dir = tempfile::tempdir().expect("a folder");
    let profile = graphs("actuators/hapcoil_one.ron");
    std::fs::copy(&profile, dir.path().join("mine.ron")).expect("a profile");
    let grid = |frames: &str| {
        format!(
            r#"(name: "g", knobs: {{"phase.frames": [{frames}]}}), (name: "h", knobs: {{"inverse.profile": ["mine.ron"]}})"#
        )
    };
    study(dir.path(), &grid("1"));
    let args = ["tradeoff", "study.ron", "--out", "out", "--no-cases", "-q"];
    run(dir.path(), &args).ok();
    let all = |prefix: &str| parts(dir.path(), prefix);
    let (figures, batches) = (all("figures-"), all("batch-"));
    assert_eq!((figures.len(), batches.len()), (4, 2));
    // A comment, and a value more: what is there stays.
    let text = std::fs::read_to_string(dir.path().join("study.ron")).expect("the study");
    std::fs::write(dir.path().join("study.ron"), format!("// Mine.\n{text}")).expect("a study");
    run(dir.path(), &args).ok();
    assert_eq!((all("figures-"), all("batch-")), (figures.clone(), batches.clone()));
    study(dir.path(), &grid("1, 3"));
    run(dir.path(), &args).ok();
    let more = all("figures-");
    assert!(more.len() == 5 && figures.iter().all(|part| more.contains(part)));
    assert!(batches.iter().all(|part| all("batch-").contains(part)));
    // A file that one setting alone reads.
    let heavier = std::fs::read_to_string(&profile).expect("a profile").replace("g: 4.4,", "g: 5.4,");
    std::fs::write(dir.path().join("mine.ron"), heavier).expect("a profile");
    run(dir.path(), &args).ok();
    let now = all("figures-");
    assert_eq!(now.iter().filter(|part| !more.contains(part)).count(), 1);
    std::fs::write(dir.path().join("mine.ron"), "nothing").expect("a profile");
    run(dir.path(), &args).ok();
    let results = json(&dir.path().join("out/results.json"));
    assert!(row(&results, "inverse.profile=mine.ron")["error"].is_string(), "{results}");
    std::fs::copy(&profile, dir.path().join("mine.ron")).expect("a profile");
    run(dir.path(), &args).ok();
    let results = json(&dir.path().join("out/results.json"));
    assert!(row(&results, "inverse.profile=mine.ron")["error"].is_null(), "{results}");
}

/// Once, a digit that was changed in a kept part went into the results.
#[test]
fn kept_part_changed_by_hand_is_measured_again() {
    let dir = tempfile::tempdir().expect("a folder");
    study(dir.path(), "");
    let args = ["tradeoff", "study.ron", "--out", "out", "--no-cases"];
    run(dir.path(), &args).ok();
    let results = json(&dir.path().join("out/results.json"));
    let changed: Vec<String> = ["figures-", "batch-"]
        .iter()
        .map(|prefix| {
            let name = parts(dir.path(), prefix)[0].0.clone();
            let path = dir.path().join("out/kept").join(&name);
            let text = std::fs::read_to_string(&path).expect("a part");
            let at = text.rfind(|c: char| c.is_ascii_digit()).expect("a digit");
            let other = if &text[at..=at] == "1" { "2" } else { "1" };
            std::fs::write(&path, format!("{}{other}{}", &text[..at], &text[at + 1..])).expect("a part");
            name
        })
        .collect();
    let again = run(dir.path(), &args).ok();
    for name in &changed {
        let said: Vec<&str> = again.err.lines().filter(|line| line.contains(name.as_str())).collect();
        assert!(said.len() == 1 && said[0].contains("measured again"), "{}", again.err);
    }
    let now = json(&dir.path().join("out/results.json"));
    for name in names(&results) {
        assert_eq!(row(&now, &name)["figures"], row(&results, &name)["figures"]);
    }
    assert!(!run(dir.path(), &args).ok().err.contains("measured again"));
}
