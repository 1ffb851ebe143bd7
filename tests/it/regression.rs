//! Every bug found keeps a test here, named for what went wrong.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use harness::{Ran, asperity, files, graphs, run};

fn heravi() -> String {
    graphs("heravi2024.ron").display().to_string()
}

/// Renders the shipped graph with these words.
fn render(dir: &tempfile::TempDir, args: &str) -> Ran {
    let graph = heravi();
    run(dir.path(), &["render", &graph].into_iter().chain(args.split(' ')).collect::<Vec<_>>())
}

/// Checks a graph of this text, which must be refused.
fn refused(text: &str) -> String {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("g.ron"), text).unwrap();
    let ran = run_within(10.0, dir.path(), &["check", "g.ron"]);
    assert_eq!(ran.code, 2, "{}", ran.err);
    ran.err
}

#[test]
fn a_wav_of_more_than_4_gib_is_refused_before_it_is_begun() {
    let dir = tempfile::tempdir().unwrap();
    render(&dir, "--set audio_hz=192000 --seconds 5700 --out a.wav")
        .refused("a WAV file cannot hold 4377600000 bytes");
    assert!(files(dir.path()).is_empty());
}

#[test]
fn an_error_far_out_in_a_long_line_is_shown_and_does_not_panic() {
    let nodes: Vec<String> = (0..6000).map(|i| format!("\"n{i}\": (kind: \"gain\")")).collect();
    let text = format!("Graph(version: 1, nodes: {{{}, \"x\": (kind: \"gane\")}})", nodes.join(", "));
    let err = refused(&text);
    let column = text.find("\"gane\"").unwrap() + 1;
    assert!(err.contains(&format!("g.ron:1:{column}: error: there is no node kind `gane`")), "{err}");
    assert!(err.contains("did you mean `gain`?") && err.len() < 1000, "{err}");
}

#[test]
fn what_a_render_reads_is_not_written_over() {
    let dir = tempfile::tempdir().unwrap();
    let csv = "t_s,x_mm,y_mm,z_mm\n0,0,0,-1\n0.01,1,0,-1\n0.02,2,0,-1\n";
    std::fs::write(dir.path().join("in.csv"), csv).unwrap();
    std::fs::write(dir.path().join("g.ron"), harness::shipped_graph()).unwrap();
    let profile = std::fs::read_to_string(graphs("actuators/hapcoil_one.ron")).unwrap();
    std::fs::write(dir.path().join("p.ron"), &profile).unwrap();
    let mags = std::fs::read(harness::root().join("tests/data/phase/texture_2500.mag.npy")).unwrap();
    std::fs::write(dir.path().join("m.npy"), &mags).unwrap();
    for args in [
        ["render", "g.ron", "--input", "in.csv", "--probe", "stylus.position=in.csv"].as_slice(),
        &["render", "g.ron", "--input", "in.csv", "--report", "./in.csv"],
        &["render", "g.ron", "--report", "g.ron"],
        &["render", "g.ron", "--plot", "../{}/g.ron"],
        &["graph", "g.ron", "--svg", "g.ron"],
        &["graph", "g.ron", "--input", "in.csv", "--svg", "in.csv"],
        &["render", "g.ron", "--set", "limiter.profile=p.ron", "--report", "p.ron"],
        &["invert", "--magnitudes", "m.npy", "--rate", "2500", "--out", "m.npy"],
    ] {
        let name = dir.path().file_name().unwrap().to_string_lossy().into_owned();
        let args: Vec<String> = args.iter().map(|a| a.replace("{}", &name)).collect();
        let ran = run(dir.path(), &args.iter().map(String::as_str).collect::<Vec<_>>());
        assert_eq!(ran.code, 2, "{args:?}: {}{}", ran.out, ran.err);
    }
    assert_eq!(std::fs::read_to_string(dir.path().join("p.ron")).unwrap(), profile);
    assert!(std::fs::read(dir.path().join("m.npy")).unwrap() == mags);
    assert_eq!(std::fs::read_to_string(dir.path().join("in.csv")).unwrap(), csv);
    assert_eq!(std::fs::read_to_string(dir.path().join("g.ron")).unwrap(), harness::shipped_graph());
}

#[cfg(unix)]
#[test]
fn a_link_is_followed_and_what_is_no_file_is_left_alone() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("target.json"), "old").unwrap();
    std::os::unix::fs::symlink("target.json", dir.path().join("link.json")).unwrap();
    render(&dir, "--seconds 0.1 --report link.json").ok();
    assert!(dir.path().join("link.json").is_symlink());
    assert!(std::fs::read_to_string(dir.path().join("target.json")).unwrap().starts_with('{'));
    std::fs::create_dir(dir.path().join("d.wav")).unwrap();
    for output in ["--out d.wav", "--report /dev/null"] {
        render(&dir, &format!("--seconds 0.1 {output}")).refused("is no file");
    }
}

#[test]
fn input_replaces_a_stroke_whose_wires_name_no_port() {
    let dir = tempfile::tempdir().unwrap();
    let graph = graphs("voltage_amplifier.ron").display().to_string();
    let csv = graphs("trajectories/zigzag.csv").display().to_string();
    run(dir.path(), &["render", &graph, "--input", &csv, "--seconds", "1", "--out", "o.wav"]).ok();
}

#[test]
fn a_probe_does_not_change_what_is_rendered() {
    let dir = tempfile::tempdir().unwrap();
    render(&dir, "--out a.wav").ok();
    render(&dir, "--out b.wav --probe phase=p.npy --probe synthesis=s.npy --probe inverse=r.npy").ok();
    let read = |n: &str| std::fs::read(dir.path().join(n)).unwrap();
    assert!(read("a.wav") == read("b.wav"));
}

#[test]
fn frames_too_rare_to_overlap_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    render(&dir, "--set texture.every=49 --out o.wav").refused("too rarely to overlap");
    render(&dir, "--set texture.every=25 --seconds 2 --out o.wav").ok();
    let (samples, _) = harness::wav(&dir.path().join("o.wav"));
    assert!(samples.iter().all(|x| x.abs() < 0.6), "no explosion at a hop of half a window");
}

#[cfg(unix)]
#[test]
fn a_reader_that_goes_away_is_no_panic() {
    let dir = tempfile::tempdir().unwrap();
    let mut child = asperity(dir.path())
        .args(["nodes", "--json"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let out = child.wait_with_output().unwrap();
    assert!(!String::from_utf8_lossy(&out.stderr).contains("panicked"));
    let full = || std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let out = asperity(dir.path()).args(["check", "nowhere.ron"]).stderr(full()).output().unwrap();
    assert_eq!(out.status.code(), Some(2), "an error that cannot be told is still one");
    let full = full();
    let out =
        asperity(dir.path()).args(["check", &heravi()]).stdout(full).stderr(Stdio::piped()).output().unwrap();
    let err = String::from_utf8_lossy(&out.stderr);
    assert_eq!(out.status.code(), Some(1), "{err}");
    assert!(err.contains("cannot write to the standard output"), "{err}");
}

#[test]
fn clipping_at_the_card_is_told() {
    let dir = tempfile::tempdir().unwrap();
    let ran = render(&dir, "--set out.volts_at_full_scale=0.1 --out o.wav --report r.json").ok();
    assert!(ran.out.contains("samples were cut at the card's full scale"), "{}", ran.out);
    assert!(harness::json(&dir.path().join("r.json"))["output"]["clipped"].as_u64().unwrap() > 100);
}

#[test]
fn two_stages_set_to_different_actuators_are_named() {
    let dir = tempfile::tempdir().unwrap();
    let ran = run(dir.path(), &["check", &heravi(), "--set", "limiter.handle_mass_g=50"]).ok();
    assert!(ran.err.contains("`inverse` and `limiter` are set to different actuators"), "{}", ran.err);
}

#[test]
fn an_error_from_the_command_line_names_the_assignment() {
    let dir = tempfile::tempdir().unwrap();
    run(dir.path(), &["check", &heravi(), "--set", "motion.cutoff_hz=5", "--set", "tick_hz=99"])
        .refused("--set tick_hz:1:1: error: 99 Hz is out of range");
    let ran = run(dir.path(), &["check", &heravi(), "--set", "texture.model=nowhere.onnx"]);
    assert!(ran.err.contains("relative to where the program runs"), "{}", ran.err);
}

#[test]
fn a_wire_between_units_says_what_leads_from_one_to_the_other() {
    let graph = harness::shipped_graph()
        .replace("(\"motion.speed\", \"gate.speed\")", "(\"floor.force\", \"gate.speed\")");
    let err = refused(&graph);
    assert!(err.contains("a `gain` with `unit: \"mm/s\"`"), "{err}");
}

#[test]
fn what_stands_in_a_file_does_not_reach_the_terminal_raw() {
    let err = refused("Graph(version: 1, nodes: {\"a\": (kind: \"st\\u{1b}[31mroke\u{202e}\")})");
    assert!(!err.contains('\u{1b}') && !err.contains('\u{202e}'), "{err:?}");
}

#[test]
fn endings_are_known_in_capitals_too() {
    let dir = tempfile::tempdir().unwrap();
    render(&dir, "--seconds 0.1 --out O.WAV --probe motion.speed=V.NPY").ok();
    assert_eq!(files(dir.path()), ["O.WAV", "V.NPY"]);
}

#[test]
fn a_model_with_a_nan_among_its_weights_is_refused_at_load() {
    let dir = tempfile::tempdir().unwrap();
    let mut bytes = std::fs::read(graphs("models/surfaces/texture.onnx")).unwrap();
    // The weights fill nearly all of the file; four bytes in the middle of them make a NaN wherever a float
    // begins.
    let middle = bytes.len() / 2;
    bytes[middle..middle + 8].fill(0xff);
    std::fs::write(dir.path().join("nan.onnx"), bytes).unwrap();
    let ran = render(&dir, "--set texture.model=nan.onnx --out o.wav");
    assert_eq!(ran.code, 2, "{}{}", ran.out, ran.err);
    assert!(ran.err.contains("nan.onnx: error:") && ran.err.contains("not finite at element"), "{}", ran.err);
    assert_eq!(files(dir.path()), ["nan.onnx"]);
}

/// Runs the program, which must end by itself in so many seconds.
fn run_within(seconds: f64, dir: &Path, args: &[&str]) -> Ran {
    let out = std::fs::File::create(dir.join("out")).unwrap();
    let mut child = asperity(dir).args(args).stdout(Stdio::null()).stderr(out).spawn().unwrap();
    let began = Instant::now();
    let code = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status.code().unwrap_or(-1);
        }
        if began.elapsed().as_secs_f64() > seconds {
            child.kill().unwrap();
            child.wait().unwrap();
            panic!("{args:?} took more than {seconds} s");
        }
        std::thread::sleep(Duration::from_millis(10));
    };
    Ran { code, out: String::new(), err: std::fs::read_to_string(dir.join("out")).unwrap() }
}

#[cfg(unix)]
#[test]
fn named_pipe_is_refused_by_every_reader() {
    let dir = tempfile::tempdir().unwrap();
    let scene = r#"Scene(version: 1, input: stroke(), actuator: (profile: "hapcoil_one", handle_mass_g: 100),
        output: audio_out(volts_at_full_scale: 1, amps_per_volt: 1),
        surfaces: {"a": (shape: plane(), effects: (stiffness: (stiffness_n_per_mm: 0.5),
        texture: waveform(recording: (file: "pipe.wav", speed_mm_s: 50, full_scale_m_s2: 9))))})"#;
    std::fs::write(dir.path().join("s.ron"), scene).unwrap();
    let channel = |name| format!("(quantity: \"{name}\", full_scale: 9),");
    let channels: String = ["force_n", "speed_mm_s", "ax_m_s2"].map(channel).concat();
    std::fs::write(dir.path().join("recording.ron"), format!("Recording(channels: [{channels}])")).unwrap();
    for name in ["pipe.wav", "pipe.onnx", "pipe.ron", "pipe.npy", "pipe.png", "pipe.so"] {
        assert!(Command::new("mkfifo").arg(dir.path().join(name)).status().unwrap().success());
    }
    let surfaces = graphs("models/surfaces");
    let library = surfaces.join("materials.ron").display().to_string();
    let picture = surfaces.join("pictures/spark_eroded_plastic.jpg").display().to_string();
    for args in [
        ["check", "s.ron"].as_slice(),
        &["check", "pipe.ron"],
        &["choose", "pipe.ron"],
        &["encode", "pipe.png", "--library", &library, "--dry-run"],
        &["encode", &picture, "--library", &library, "--dry-run", "--encoder", "pipe.onnx"],
        &["check", &heravi(), "--set", "texture.model=pipe.onnx"],
        &["fit-ar", "pipe.wav", "--out", "t.ron"],
        &["fit-ar", "pipe.npy", "--columns", "force_n", "--rate-hz", "1000", "--out", "t.ron"],
        &["invert", "--magnitudes", "pipe.npy", "--rate", "2500", "--out", "o.wav"],
        &["plugin", "check", "./pipe.so"],
    ] {
        let ran = run_within(5.0, dir.path(), args);
        assert!(ran.err.contains("is a named pipe; a regular file is needed"), "{args:?}: {}", ran.err);
        assert_eq!(ran.code, 2, "{args:?}: {}", ran.err);
    }
    run_within(5.0, dir.path(), &["choose", "/dev/zero"])
        .refused("this is a device; a regular file is needed");
}

#[test]
fn graph_of_20000_errors_is_checked_at_once() {
    let nodes = |kind: fn(usize) -> String| -> String {
        (0..20_000).map(|i| format!("\"n{i}\": (kind: \"{}\"),\n", kind(i))).collect()
    };
    let wires = |wire: fn(usize) -> String| -> String { (0..20_000).map(wire).collect() };
    let gains = nodes(|_| "gain".into());
    for (errors, nodes, wires) in [
        ("20,000", nodes(|i| format!("unknown_kind_{i}")), String::new()),
        ("40,000", gains.clone(), wires(|i| format!("(\"x{i}\", \"y{i}\"),\n"))),
        ("19,999", gains.clone(), wires(|_| "(\"n0\", \"n1\"),\n".into())),
        ("20,000", gains.clone(), wires(|i| format!("(\"n0\", \"n{i}.nowhere\"),\n"))),
        (
            "20,000",
            gains.replace("gain", "velocity"),
            wires(|i| format!("(\"n{i}.speed\", \"n{i}.position\"),\n")),
        ),
    ] {
        let text = format!("Graph(version: 1, nodes: {{{nodes}}}, wires: [{wires}])");
        let err = refused(&text);
        assert_eq!(err.matches(" error: ").count(), 50, "{errors}");
        assert!(err.ends_with(&format!("{errors} errors; nothing was started, nothing written\n")));
        let more = if errors == "20,000" { "... and 19,950 more errors" } else { "... and " };
        assert!(err.contains(more), "{}", &err[err.len() - 200..]);
    }
}

#[test]
fn long_name_in_an_error_is_cut() {
    let err = refused(&format!("Graph(version: 1, nodes: {{\"a\": (kind: \"{}\")}})", "k".repeat(4_000)));
    assert!(err.contains(&format!("there is no node kind `{}…`", "k".repeat(80))), "{err}");
}

#[cfg(unix)]
#[test]
fn limit_on_open_files_is_named() {
    let dir = tempfile::tempdir().unwrap();
    let heravi = heravi();
    let base = ["render", &heravi, "--seconds", "0.1", "--out", "o.wav"];
    for (most, more) in [(5, &["--probe", "motion.speed=v.csv", "--report", "r.json"][..]), (4, &[])] {
        let ran = harness::run_under(dir.path(), &format!("ulimit -n {most}"), &[&base, more].concat());
        assert!(
            ran.err.contains("Too many open files") && ran.err.contains("`ulimit -n 1024`"),
            "{}",
            ran.err
        );
        assert_eq!(ran.code, 1, "{}", ran.err);
    }
}

#[test]
fn tradeoff_of_a_wrong_setting_leaves_no_folder() {
    let dir = tempfile::tempdir().unwrap();
    for (set, says) in [("motion.cutoff_hz=1e9", "out of range"), ("motion.nope=3", "no parameter `nope`")] {
        run(dir.path(), &["tradeoff", &heravi(), "--out", "found", "--set", set]).refused(says);
        assert!(files(dir.path()).is_empty(), "{set}");
    }
}

/// Runs the program on a file in 3 GiB of addresses, beyond which it would be aborted.
#[cfg(unix)]
fn in_few_addresses(text: &str, args: &[&str]) -> Ran {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("g.ron"), text).unwrap();
    harness::run_under(dir.path(), "ulimit -v 3145728", args)
}

/// Delays of 10 s at 192 kHz hold 7.3 MiB each: 1,000 of them were ended by signal 6.
#[cfg(unix)]
#[test]
fn delays_beyond_memory_are_refused_at_one_of_them() {
    let delays: String =
        (0..1000).map(|i| format!("\"d{i}\": (kind: \"delay\", params: (delay_ms: 10000.0)),\n")).collect();
    let wires: String = (1..1000).map(|i| format!("(\"d{}\", \"d{i}\"), ", i - 1)).collect();
    let text = format!(
        "Graph(version: 1, audio_hz: 192000, nodes: {{\"s\": (kind: \"sine\"), \"p\": (kind: \"probe\"),\n\
         {delays}}}, wires: [(\"s\", \"d0\"), {wires}(\"d999\", \"p\")])"
    );
    let ran = in_few_addresses(&text, &["check", "g.ron", "--memory", "500MiB"]);
    assert_eq!(ran.code, 2, "{}", ran.err);
    let line: usize = ran.err.strip_prefix("g.ron:").and_then(|e| e.split(':').next()?.parse().ok()).unwrap();
    // Each takes 15 MiB.
    assert!((25..45).contains(&line), "{}", ran.err);
    assert!(ran.err.contains("error: not enough memory") && ran.err.contains("`--memory`"), "{}", ran.err);
    assert_eq!(ran.err.matches(" error: ").count(), 1, "{}", ran.err);
}

/// A value takes about 140 bytes while a text is read: a list of 60 million numbers took 8 GB.
#[cfg(unix)]
#[test]
fn list_beyond_memory_is_refused_before_it_is_read() {
    let text = format!("Graph(version: 1, nodes: {{}}, wires: [{}])", "0,".repeat(5_000_000));
    let ran = in_few_addresses(&text, &["check", "g.ron", "--memory", "100MiB"]);
    assert_eq!(ran.code, 2, "{}", ran.err);
    assert!(ran.err.starts_with("g.ron: error: not enough memory"), "{}", ran.err);
}

/// Every list of names, every error and every wire had a copy of it.
#[cfg(unix)]
#[test]
fn name_of_20_mb_is_refused_at_its_place() {
    let long = "n".repeat(20_000_000);
    for text in [
        format!("Graph(version: 1, nodes: {{\n\"{long}\": (kind: \"sine\")}})"),
        format!("Graph(version: 1, nodes: {{\"a\": (kind:\n\"{long}\")}})"),
        format!("Graph(version: 1,\n{long}: 1)"),
        format!("Scene(version: 1, input:\n{long})"),
        format!("Scene(version: 1, input:\n{long}())"),
        format!("Scene(version: 1, input:\nr#\"{long}\"#)"),
    ] {
        let ran = in_few_addresses(&text, &["check", "g.ron"]);
        assert_eq!(ran.code, 2, "{}", ran.err);
        assert!(ran.err.starts_with("g.ron:2:1: error: this name or text is too long"), "{}", ran.err);
        assert!(ran.err.len() < 1000, "{}", ran.err.len());
    }
}

#[cfg(unix)]
#[test]
fn network_beyond_memory_is_refused_by_its_file() {
    let graph = graphs("texture.ron").display().to_string();
    let ran = in_few_addresses("", &["--memory", "12MiB", "check", &graph]);
    assert_eq!(ran.code, 2, "{}", ran.err);
    assert!(
        ran.err.contains("texture.onnx: error: node ") && ran.err.contains("not enough memory"),
        "{}",
        ran.err
    );
}

#[test]
fn memory_without_its_unit_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    for wrong in ["4", "GiB", "0MiB", "-1GiB", "4GB", "99999999999999GiB"] {
        run(dir.path(), &["nodes", &format!("--memory={wrong}")]).refused("such as 500MiB or 4GiB");
    }
    run(dir.path(), &["nodes", "--memory", "500MiB"]).ok();
}
