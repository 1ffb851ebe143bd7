//! `asperity tradeoff` and `asperity choose`.

use harness::{Room, asperity, graphs, retrieving, run};
use serde_json::Value;

/// Writes a trade-off with one short stroke over one material.
fn tradeoff(dir: &Room, grids: &str) {
    let graph = retrieving().canonicalize().expect("the shipped graph");
    let paper = graphs("heravi2024.ron").canonicalize().expect("the shipped graph");
    let text = format!(
        r#"Tradeoff(
            version: 1,
            graph: {graph:?},
            baselines: [(name: "paper", graph: {paper:?})],
            strokes: [(name: "circle", shape: circle, speed_mm_s: 80.0, seconds: 1.5, approach_s: 0.1)],
            materials: ["canvas"],
            strength: 0.2,
            steps: 10,
            grids: [{grids}],
            times: (turns: 2, turn_ms: 40, batch: 3),
        )"#
    );
    dir.write("tradeoff.ron", text);
}

const TWO: &str = r#"(name: "phase", knobs: {"phase": [(kind: "spsi"), (kind: "no_such_kind")]}),
    (name: "frames", knobs: {"phase.frames": [1, 2]}),
    (name: "limiter", knobs: {"limiter": [kept, bypassed]}),
    (name: "guards", knobs: {"guards": [false]})"#;

/// A graph without a stylus.
const STILL: &str = r#"Graph(version: 1, nodes: {"tone": (kind: "sine"), "out": (kind: "probe")},
    wires: [("tone", "out")])"#;

const QUICK: [&str; 6] = ["tradeoff", "tradeoff.ron", "--out", "out", "--no-cases", "-q"];

/// The results in a folder.
fn stored(dir: &Room, folder: &str) -> Value {
    dir.json(&format!("{folder}/results.json"))
}

/// Runs the trade-off; its results.
fn traded(dir: &Room) -> Value {
    run(dir, &QUICK).ok();
    stored(dir, "out")
}

fn figure(results: &Value, name: &str, figure: &str) -> f64 {
    row(results, name)["figures"][figure].as_f64().expect("a figure")
}

fn names(results: &Value) -> Vec<String> {
    let rows = results["rows"].as_array().expect("rows");
    rows.iter().map(|r| r["name"].as_str().expect("a name").to_owned()).collect()
}

fn row<'r>(results: &'r Value, name: &str) -> &'r Value {
    let rows = results["rows"].as_array().expect("rows");
    rows.iter().find(|r| r["name"] == name).unwrap_or_else(|| panic!("no {name}"))
}

/// It reports the cost and the accuracy of each setting.
#[test]
fn tradeoff_measures_each_setting_and_resumes() {
    let dir = Room::new();
    tradeoff(&dir, TWO);
    let line = "tradeoff tradeoff.ron --out out --jobs 2 --no-cases";
    dir.run(line).ok().says(&["`no_such_kind` is left out", "D the default", "REPORT.md"]);
    let results = stored(&dir, "out");
    let found = names(&results);
    // Two frames and `kept` are the default, and no settings of their own.
    assert_eq!(
        found,
        ["default", "phase=spsi", "phase.frames=1", "limiter=bypassed", "guards=false", "paper"]
    );
    for name in &found {
        let row = row(&results, name);
        assert!(row["error"].is_null(), "{row}");
        let figures = "perceptual modulation spectrum repetition kurtosis steadiness convergence";
        for figure in figures.split(' ') {
            assert!(row["figures"][figure].is_f64(), "{name} has no {figure}: {row}");
        }
        assert!(row["time"]["p50_us"].as_f64() > Some(0.0) && row["time"]["ticks"].as_u64() >= Some(40));
        assert!(row["time"]["memory_kib"].as_f64().expect("memory") > 20.0);
        assert!(row["lag_ms"][1].as_f64().expect("a lag") > 3.0, "{row}");
    }
    // An idle tick lasts about as long as the default's.
    let median = |time: &Value| time["p50_us"].as_f64().expect("a median");
    let ratio = median(&results["idle"]) / median(&row(&results, "default")["time"]);
    assert!(ratio > 0.1, "{ratio}");
    // Settings that cannot be played cannot be chosen.
    assert!(row(&results, "limiter=bypassed")["fails"]["limiter"].is_string());
    assert!(row(&results, "guards=false")["fails"]["guards"].is_string());
    // Without guards a mild stroke sounds the same.
    let figures = |name: &str| row(&results, name)["figures"].clone();
    assert_eq!(figures("guards=false"), figures("default"));
    assert!(results["model"]["spectrum"].is_f64() && results["noise_floor"]["spectrum"].is_f64());
    let files = "results.csv REPORT.md perceptual_time.svg modulation_lag.svg convergence_time.svg";
    files.split(' ').for_each(|file| assert!(dir.join("out").join(file).exists(), "{file}"));
    let csv = dir.text("out/results.csv");
    assert_eq!(csv.lines().count(), 1 + found.len());

    // Once more: everything is known, and equal to the last digit, times too.
    dir.run(line).ok().says(&["6 settings"]);
    assert_eq!(stored(&dir, "out"), results);
}

#[test]
fn baseline_is_compared_with_its_share_of_the_physics() {
    let dir = Room::new();
    tradeoff(&dir, "");
    let graph = graphs("heravi2024.ron").canonicalize().expect("the shipped graph");
    let baselines = format!("baselines: [(name: \"half\", graph: {graph:?}, strength: 0.5), ");
    dir.write("tradeoff.ron", dir.text("tradeoff.ron").replace("baselines: [", &baselines));
    let results = traded(&dir);
    // The error of the level is 6 dB smaller against half of the physics.
    let less = figure(&results, "paper", "level") - figure(&results, "half", "level");
    assert!((less - 6.02).abs() < 0.1, "{less} dB");
}

/// Writes a recording of 1.5 s along a line, with noise of this peak in m/s^2.
fn recording(dir: &Room, peak: f64) {
    let mut text = String::from("t_s,force_n,x_mm,y_mm,ax_m_s2\n");
    let mut seed = 1_u64;
    for n in 0..3000 {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        let noise = peak * ((seed >> 40) as f64 / f64::from(1_u32 << 23) - 1.0);
        let t = f64::from(n) / 2000.0;
        text += &format!("{t:.4},0.8,{:.4},0,{noise:.9}\n", 80.0 * t);
    }
    dir.write("mine.csv", text);
}

#[test]
fn setting_is_compared_with_a_recorded_stroke() {
    let dir = Room::new();
    let graph = retrieving().canonicalize().expect("the shipped graph");
    let write = |of: &str| {
        let text = format!(
            r#"Tradeoff(version: 1, graph: {graph:?}, steps: 10, times: (turns: 2, turn_ms: 40, batch: 3),
                strokes: [(name: "mine", recording: "mine.csv"{of})], materials: ["sandpaper P120"])"#
        );
        dir.write("tradeoff.ron", text);
    };
    recording(&dir, 30.0);
    write("");
    run(&dir, &QUICK).refused("the recording `mine` does not say its material");
    write(", material: \"canvas\"");
    let level = || {
        let results = traded(&dir);
        // It is played over its own material only.
        assert_eq!(results["materials"], serde_json::json!(["sandpaper P120", "canvas"]));
        let figures = &row(&results, "default")["figures"];
        assert!(figures["perceptual"].is_f64() && figures["precision"].is_f64(), "{figures}");
        figure(&results, "default", "level")
    };
    let quiet = level();
    // The file has changed, and is measured again: all bins are four times as large.
    recording(&dir, 120.0);
    let by = level() - quiet;
    assert!((by - 20.0 * 4_f64.log10()).abs() < 1e-3, "{by} dB");
}

#[test]
fn shards_merge_and_the_choice_can_be_pasted() {
    let dir = Room::new();
    tradeoff(
        &dir,
        r#"(name: "g", knobs: {"phase.frames": [1, 3], "tick_hz": [1000]}),
        (name: "p", knobs: {"phase": [(kind: "spsi")]})"#,
    );
    for part in ["1", "2"] {
        let shard = format!("--out {part} --shard {part}/2");
        dir.run(&format!("tradeoff tradeoff.ron {shard} --no-cases -q --set strength.gain=0.34")).ok();
    }
    let parts = ["1", "2"].map(|p| stored(&dir, p));
    assert!(parts.iter().all(|part| names(part)[0] == "default"));
    std::fs::create_dir(dir.join("half")).expect("a folder");
    for (line, why) in [
        ("merge --out no 1 1", "shard 1 of 2 is given twice"),
        ("merge --out no 1 gone", "cannot read this file"),
        ("tradeoff.ron --out 1 --shard 2/2 --no-cases", "has the results of shard 1/2"),
        ("merge 2 1/results.json --out 1", "would be overwritten by the merged"),
        ("merge 2 1/results.json --out half/../1", "would be overwritten by the merged"),
    ] {
        dir.run(&format!("tradeoff {line}")).refused(why);
    }
    assert_eq!(stored(&dir, "1"), parts[0]);
    dir.run("tradeoff merge 1 --out half -q").ok().says(&["missing shards: 2 of 2"]);
    let report = dir.text("half/REPORT.md");
    assert!(report.contains("Missing shards: 2 of 2"), "{report}");
    dir.run("tradeoff merge 1 2 --out all -q").ok();
    let all = stored(&dir, "all");
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

    // The best setting at 1000 Hz, pasted into the graph, runs.
    let chosen = dir.run("choose all --tick-hz 1000").ok().out;
    assert!(
        chosen.contains("tick_hz: 1000,") && chosen.contains("\"phase\": (kind: \"sample_commit\""),
        "{chosen}"
    );
    // Changes by --set are in the fragment.
    assert!(chosen.contains("\"strength\": (kind: \"gain\", params: (gain: 0.34)),"), "{chosen}");
    let line = chosen.lines().find(|l| l.contains("\"phase\":")).expect("a node");
    let text = std::fs::read_to_string(retrieving()).expect("the graph");
    let before = text.lines().find(|l| l.contains("\"phase\":")).expect("a node");
    let pasted = text.replace(before, line).replace("tick_hz: 500,", "tick_hz: 1000,");
    let models = format!("{}/", graphs("").canonicalize().expect("graphs").display());
    let pasted = pasted.replace("../../graphs/", &models);
    dir.write("pasted.ron", pasted);
    dir.run("check pasted.ron").ok();

    let spsi = dir.run("choose all --by convergence --tick-hz 500 --json").ok().out;
    let spsi: Value = serde_json::from_str(&spsi).expect("JSON");
    assert!(spsi["fit"].as_u64() >= Some(2), "{spsi}");
    for (line, code, says) in [
        ("--budget-us 0.01", 1, "the shortest tick:"),
        ("--max-lag-ms 0", 1, "the shortest response lag:"),
        ("--by spectrm", 2, "spectrum"),
    ] {
        dir.run(&format!("choose all {line}")).ends(code, &[says]);
    }
}

#[test]
fn errors_have_a_place_and_nothing_is_written() {
    let dir = Room::new();
    let knobs = |text: &str| format!("grids: [(name: \"g\", knobs: {{{text}}})]");
    for (from, to, want) in [
        ("grids: []", &*knobs(r#""phase.frame": [1]"#), "no graph has the knob `phase.frame`"),
        ("grids: []", &knobs(r#""phase.frame": [1]"#), "did you mean `phase.frames`?"),
        ("grids: []", &knobs(r#""nothing": [kept]"#), "no graph has the knob `nothing`"),
        ("grids: []", &knobs(r#""phase": [gone]"#), "a node cannot be set to `gone`"),
        ("grids: []", &knobs(r#""phase.frames": []"#), "this knob has no values"),
        ("grids: []", &knobs(r#"".": [1]"#), "is not a knob"),
        ("grids: []", "grids: [(name: \"g\")]", "knobs"),
        ("[\"canvas\"]", "[\"canvsa\"]", "did you mean `canvas`?"),
        ("name: \"paper\"", "name: \"default\"", "a baseline cannot be named"),
        ("baselines: [", "baselines: [(name: \"paper\", graph: \"g.ron\"), ", "is used twice"),
        ("Tradeoff(", "Study(", "write `Tradeoff(...)`"),
        ("sample_commit.ron", "no_such_graph.ron", "named here"),
        ("heravi2024.ron", "no_such_graph.ron", "named here"),
        ("speed_mm_s: 80.0", "speed_mm_s: -1.0", "`speed_mm_s` is -1"),
        ("seconds: 1.5", "seconds: 0.1", "`seconds` is 0.1"),
        ("seconds: 1.5", "seconds: 1e6", "at most 600"),
    ] {
        tradeoff(&dir, "");
        let text = dir.text("tradeoff.ron");
        assert!(text.contains(from), "{from}");
        dir.write("tradeoff.ron", text.replace(from, to));
        dir.run("tradeoff tradeoff.ron --out out").refused(want).says(&["tradeoff.ron"]);
        assert!(!dir.join("out").exists(), "{to}");
    }
    // A value that a node refuses is a row with an error; the others run.
    tradeoff(&dir, r#"(name: "g", knobs: {"phase.frames": [5, 0]})"#);
    let results = traded(&dir);
    let why = row(&results, "phase.frames=0")["error"].as_str().expect("why");
    assert!(why.contains("out of range"), "{results}");
    assert!(row(&results, "default")["error"].is_null());
    for (line, want) in [
        ("tradeoff tradeoff.ron tradeoff.ron --out o", "a second trade-off file"),
        ("tradeoff --out o", "no graph is given"),
        ("tradeoff tradeoff.ron --out o --shard 3/2", "is not a shard"),
        ("tradeoff gone.ron --out o", "gone.ron"),
        ("tradeoff merge gone --out o", "cannot read this file"),
        ("choose tradeoff.ron", "these are no results"),
    ] {
        dir.run(line).refused(want);
    }
}

#[test]
fn tradeoff_without_a_running_setting_fails() {
    let dir = Room::new();
    dir.write("still.ron", STILL);
    let text = r#"Tradeoff(version: 1, graph: "still.ron", strokes: [(name: "circle", seconds: 1.5)])"#;
    dir.write("tradeoff.ron", text);
    dir.run("tradeoff tradeoff.ron --out out --no-cases").ends(1, &["nothing in this graph moves a stylus"]);
}

/// The warning comes before the study runs.
#[test]
fn shipped_tradeoff_skips_knobs_that_a_graph_lacks() {
    let dir = Room::new();
    // A graph without a stylus: all settings fail at once.
    dir.write("still.ron", STILL);
    let ran = dir.run("tradeoff still.ron --out out --no-cases").ends(1, &[]);
    for knob in ["phase", "texture.bins"] {
        assert!(ran.err.contains(&format!("`{knob}` is left out")), "{knob}: {}", ran.err);
    }
    let results = stored(&dir, "out");
    assert!(names(&results).contains(&"tick_hz=1000".to_owned()), "{results}");
    let report = dir.text("out/REPORT.md");
    assert!(report.contains("`texture.bins` is left out"), "{report}");
}

#[test]
fn scene_is_measured_on_its_first_surface() {
    let dir = Room::new();
    tradeoff(&dir, "");
    let scene = std::fs::read_to_string(graphs("scenes/side_by_side.ron")).expect("the shipped scene");
    let folder = graphs("scenes").canonicalize().expect("the folder").display().to_string();
    let scene = scene.replace("\"../", &format!("\"{folder}/../"));
    // In b the other surface and the material of the first differ.
    dir.write("a.ron", &scene);
    let other = scene
        .replace("sandpaper P80", "oak")
        .replace("material: \"canvas\"", "material: \"leather grain, fine\"");
    dir.write("b.ron", other);
    let mut figures = Vec::new();
    for (name, out) in [("a.ron", "a"), ("b.ron", "b")] {
        dir.run(&format!("tradeoff tradeoff.ron {name} --out {out} --no-cases"))
            .ok()
            .says(&["`circle` is shrunk", "`left`"]);
        let results = stored(&dir, out);
        let row = row(&results, "default").clone();
        assert!(row["error"].is_null() && row["lag_ms"][1].is_f64(), "{row}");
        let level = row["figures"]["level"].as_f64().expect("a level");
        assert!(level < 4.0, "{row}");
        figures.push(row["figures"].clone());
        let report = dir.text(format!("{out}/REPORT.md"));
        let links = report.split("](").skip(1).filter_map(|l| l.split(')').next());
        for link in links.filter(|l| l.ends_with(".svg")) {
            assert!(dir.join(out).join(link).exists(), "{link}");
        }
    }
    assert_eq!(figures[0], figures[1]);
}

#[cfg(unix)]
#[test]
fn interrupted_tradeoff_resumes() {
    let dir = Room::new();
    tradeoff(
        &dir,
        r#"(name: "g", knobs: {"phase.frames": [1, 2, 3, 4, 6, 7, 8, 9], "phase.passes": [1, 2]})"#,
    );
    let child = asperity(&dir).args(QUICK).spawn().expect("it starts");
    // As soon as two parts are finished.
    while parts(&dir).len() < 2 {
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    let killed = std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(killed.expect("kill").success());
    let ended = child.wait_with_output().expect("it ends");
    assert_eq!(ended.status.code(), Some(130));
    let results = stored(&dir, "out");
    let some = names(&results).len();
    assert!((1..17).contains(&some), "{some}");
    let results = traded(&dir);
    assert_eq!(names(&results).len(), 17);
    assert!(results["rows"].as_array().expect("rows").iter().all(|r| r["time"].is_object()));
    assert_eq!(results["unfinished"], 0);
    // Results stay where the same command is stopped at once, and where another one has finished nothing.
    let code = interrupted(&dir, &QUICK);
    assert!(matches!(code, Some(0 | 130)), "{code:?}");
    assert_eq!(stored(&dir, "out"), results);
    let code = interrupted(&dir, &[&QUICK[..], &["--set", "strength.gain=0.34"]].concat());
    assert_eq!(code, Some(130));
    assert_eq!(stored(&dir, "out"), results);
}

/// Exit code of a run that is interrupted as soon as it opens its folder; none of one that was killed.
#[cfg(unix)]
fn interrupted(dir: &Room, args: &[&str]) -> Option<i32> {
    let opened = || std::fs::metadata(dir.join("out/progress.jsonl")).and_then(|m| m.modified()).ok();
    let before = opened();
    let mut child = asperity(dir).args(args).spawn().expect("it starts");
    // It may be over before that is seen.
    while opened() == before && child.try_wait().expect("it runs").is_none() {
        std::thread::sleep(std::time::Duration::from_micros(200));
    }
    let killed = std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(killed.is_ok());
    child.wait().expect("it ends").code()
}

/// Finished parts of `out`.
fn parts(dir: &Room) -> Vec<String> {
    let text = std::fs::read_to_string(dir.join("out/progress.jsonl")).unwrap_or_default();
    text.lines().skip(1).map(str::to_owned).collect()
}

#[test]
fn changed_input_is_measured_again() {
    let dir = Room::new();
    let profile = graphs("actuators/hapcoil_one.ron");
    std::fs::copy(&profile, dir.join("mine.ron")).expect("a profile");
    let grid = |frames: &str| {
        format!(
            r#"(name: "g", knobs: {{"phase.frames": [{frames}]}}),
            (name: "h", knobs: {{"inverse.profile": ["mine.ron"]}})"#
        )
    };
    tradeoff(&dir, &grid("1"));
    traded(&dir);
    let first = parts(&dir);
    // Four settings, and two batches of at most three.
    assert_eq!(first.len(), 6);
    // The same again is read.
    traded(&dir);
    assert_eq!(parts(&dir), first);
    tradeoff(&dir, &grid("1, 3"));
    traded(&dir);
    let more = parts(&dir);
    assert_eq!(more.len(), 7);
    // A file that one setting reads.
    let heavier = std::fs::read_to_string(&profile).expect("a profile").replace("g: 4.4,", "g: 5.4,");
    dir.write("mine.ron", heavier);
    traded(&dir);
    let now = parts(&dir);
    let settings = |parts: &[String]| parts.iter().filter(|p| p.contains("\"Setting\"")).cloned().collect();
    let (before, after): (Vec<String>, Vec<String>) = (settings(&more), settings(&now));
    // All are measured again; the accuracy of one differs.
    assert_eq!((after.len(), after.iter().filter(|part| !before.contains(part)).count()), (5, 1));
    let mine = || row(&traded(&dir), "inverse.profile=mine.ron")["error"].clone();
    dir.write("mine.ron", "nothing");
    assert!(mine().is_string());
    std::fs::copy(&profile, dir.join("mine.ron")).expect("a profile");
    assert!(mine().is_null());
}

#[test]
fn damaged_part_is_measured_again() {
    let dir = Room::new();
    tradeoff(&dir, "");
    let results = traded(&dir);
    let path = dir.join("out/progress.jsonl");
    let text = std::fs::read_to_string(&path).expect("parts");
    std::fs::write(&path, &text[..text.len() - 20]).expect("parts");
    let now = traded(&dir);
    for name in names(&results) {
        assert_eq!(row(&now, &name)["figures"], row(&results, &name)["figures"]);
    }
    assert_eq!(parts(&dir).len(), text.lines().count() - 1);
}
