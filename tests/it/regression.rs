//! Every bug found keeps a test here, named for what went wrong.

use std::process::Stdio;
use std::time::{Duration, Instant};

use harness::{Ran, Room, asperity, graphs, plugins, root};

/// Renders the shipped graph with these words.
fn render(dir: &Room, args: &str) -> Ran {
    dir.run(&format!("render graphs/heravi2024.ron {args}"))
}

/// Checks a graph of this text, which must be refused within 10 s.
fn refused(text: &str) -> String {
    let dir = Room::new();
    dir.write("g.ron", text);
    run_within(10, &dir, "check g.ron").refused("").err
}

#[test]
fn an_error_far_out_in_a_long_line_is_shown_and_does_not_panic() {
    let nodes: Vec<String> = (0..6000).map(|i| format!("\"n{i}\": (kind: \"gain\")")).collect();
    let text = format!("Graph(version: 1, nodes: {{{}, \"x\": (kind: \"gane\")}})", nodes.join(", "));
    let err = refused(&text);
    let column = text.find("\"gane\"").unwrap() + 1;
    assert!(err.contains(&format!("g.ron:1:{column}: error: there is no node kind `gane`")), "{err}");
    assert!(err.contains("did you mean `gain` or `sine`?") && err.len() < 1000, "{err}");
}

/// Neither a graph nor a scene nor what they, a plugin or a comparison read.
#[test]
fn nothing_that_is_read_is_written_over() {
    let dir = Room::new();
    dir.write("in.csv", harness::csv(0.02, |t| [100.0 * t, 0.0, -1.0]));
    dir.write("g.ron", harness::shipped_graph());
    std::fs::create_dir(dir.join("v")).unwrap();
    let picture = image::GrayImage::from_fn(64, 64, |x, y| image::Luma([((x * y) % 200) as u8]));
    picture.save(dir.join("h.png")).unwrap();
    for (from, to) in [
        (graphs("actuators/hapcoil_one.ron"), "p.ron"),
        (graphs("models/made_ar/rough.ron"), "ar.ron"),
        (root().join("tests/data/phase/texture_2500.mag.npy"), "v/a_2500.mag.npy"),
        (plugins::c("told"), "libtold.so"),
    ] {
        std::fs::copy(from, dir.join(to)).unwrap();
    }
    dir.write(
        "s.ron",
        r#"Scene(version: 1, input: stroke(duration_s: 3),
            actuator: (profile: "hapcoil_one", handle_mass_g: 100),
            output: audio_out(volts_at_full_scale: 1, amps_per_volt: 1), surfaces: {"tile": (
            shape: relief(heights: picture(file: "h.png", step_mm: 1, height_mm: 1)), effects: (
            stiffness: (stiffness_n_per_mm: 0.2), texture: autoregressive(model: "ar.ron")))})"#,
    );
    let read = ["in.csv", "g.ron", "s.ron", "h.png", "p.ron", "ar.ron", "v/a_2500.mag.npy", "libtold.so"];
    let before = read.map(|name| dir.bytes(name));
    let name = dir.file_name().unwrap().to_string_lossy();
    let lines = [
        "render g.ron --input in.csv --probe stylus.position=in.csv",
        "render g.ron --input in.csv --report ./in.csv",
        "render g.ron --report g.ron",
        &format!("render g.ron --plot ../{name}/g.ron"),
        "graph g.ron --svg g.ron",
        "graph g.ron --input in.csv --svg in.csv",
        "render g.ron --set limiter.profile=p.ron --report p.ron",
        "graph g.ron --plugin ./libtold.so --svg libtold.so",
        "render g.ron --seconds 0.1 --plugin ./libtold.so --report libtold.so",
        "render s.ron --report h.png",
        "render s.ron --plot ar.ron",
        "graph s.ron --svg h.png",
        "scene expand s.ron --out ar.ron",
        "scene expand s.ron --out h.png",
        "scene expand s.ron --out s.ron",
    ];
    let others = [
        ("invert --magnitudes v/a_2500.mag.npy --rate 2500 --out v/a_2500.mag.npy", "overwritten by --out"),
        ("compare -q --plugin ./libtold.so --csv libtold.so", "is there already"),
        ("compare -q --vectors v --svg v/a_2500.mag.npy", "is there already"),
    ];
    for (line, says) in lines.map(|line| (line, "overwritten")).into_iter().chain(others) {
        dir.run(line).refused(says);
        assert!(read.map(|name| dir.bytes(name)) == before, "{line}");
    }
    // And all that a scene reads is told of.
    let told = dir.run("scene explain s.ron --seconds 0.5").ok().out;
    let line = |name: &str| told.lines().find(|line| line.starts_with(name)).unwrap_or_default();
    let (picture, model) = (line("h.png"), line("ar.ron"));
    assert!(picture.contains(": loaded, ") && picture.contains(" us a tick: by `contact`"), "{told}");
    assert!(model.contains(": loaded, ") && model.contains("1 surface, by `autoregressive a`"), "{told}");
}

#[cfg(unix)]
#[test]
fn a_link_is_followed_and_what_is_no_file_is_left_alone() {
    let dir = Room::new();
    dir.write("target.json", "old");
    std::os::unix::fs::symlink("target.json", dir.join("link.json")).unwrap();
    render(&dir, "--seconds 0.1 --report link.json").ok();
    assert!(dir.join("link.json").is_symlink() && dir.text("target.json").starts_with('{'));
    std::fs::create_dir(dir.join("d.wav")).unwrap();
    for output in ["--out d.wav", "--report /dev/null"] {
        render(&dir, &format!("--seconds 0.1 {output}")).refused("is not a file");
    }
}

#[test]
fn input_replaces_a_stroke_whose_wires_name_no_port() {
    let csv = graphs("trajectories/zigzag.csv").display().to_string();
    let line = format!("render graphs/voltage_amplifier.ron --input {csv} --seconds 1 --out o.wav");
    Room::new().run(&line).ok();
}

#[test]
fn a_probe_does_not_change_what_is_rendered() {
    let dir = Room::new();
    let [a, b] = ["", " --probe phase=p.npy --probe synthesis=s.npy --probe inverse=r.npy"].map(|probes| {
        render(&dir, &format!("--seconds 2 --out o.wav{probes}")).ok();
        dir.bytes("o.wav")
    });
    assert!(a == b);
}

#[test]
fn frames_too_rare_to_overlap_are_refused() {
    let dir = Room::new();
    render(&dir, "--set texture.every=49 --out o.wav").refused("too rarely to overlap");
    render(&dir, "--set texture.every=25 --seconds 2 --out o.wav").ok();
    assert!(dir.wav("o.wav").0.iter().all(|x| x.abs() < 0.6), "no explosion at a hop of half a window");
}

#[cfg(unix)]
#[test]
fn a_reader_that_goes_away_is_no_panic() {
    let dir = Room::new();
    let [closed, full] = ["/dev/null", "/dev/full"]
        .map(|file| move || Stdio::from(std::fs::OpenOptions::new().write(true).open(file).unwrap()));
    let mut nodes = asperity(&dir);
    let mut child =
        nodes.args(["nodes", "--json"]).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    drop(child.stdout.take());
    let out = child.wait_with_output().unwrap();
    assert!(!String::from_utf8_lossy(&out.stderr).contains("panicked"));
    let out = asperity(&dir).args(["check", "nowhere.ron"]).stdout(closed()).stderr(full()).output().unwrap();
    assert_eq!(out.status.code(), Some(2), "an error that cannot be told is still one");
    let out = asperity(&dir).args(["check", "graphs/heravi2024.ron"]).stdout(full()).output().unwrap();
    let err = String::from_utf8_lossy(&out.stderr);
    assert_eq!(out.status.code(), Some(1), "{err}");
    assert!(err.contains("cannot write to the standard output"), "{err}");
}

#[test]
fn clipping_at_the_card_is_told() {
    let dir = Room::new();
    render(&dir, "--set out.volts_at_full_scale=0.1 --seconds 3 --out o.wav --report r.json")
        .ok()
        .says(&["samples were cut at the card's full scale"]);
    assert!(dir.json("r.json")["output"]["clipped"].as_u64().unwrap() > 100);
}

#[test]
fn two_stages_set_to_different_actuators_are_named() {
    Room::new()
        .run("check graphs/heravi2024.ron --set limiter.handle_mass_g=50")
        .ok()
        .says(&["`inverse` and `limiter` are set to different actuators"]);
}

#[test]
fn an_error_from_the_command_line_names_the_assignment() {
    let dir = Room::new();
    let check = |sets: &str| dir.run(&format!("check graphs/heravi2024.ron {sets}"));
    check("--set motion.cutoff_hz=5 --set tick_hz=99")
        .refused("--set tick_hz:1:1: error: 99 Hz is out of range");
    check("--set texture.model=nowhere.onnx").says(&["relative to where the program runs"]);
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
    let dir = Room::new();
    render(&dir, "--seconds 0.1 --out O.WAV --probe motion.speed=V.NPY").ok();
    assert_eq!(dir.files(), ["O.WAV", "V.NPY"]);
}

/// The weights fill nearly all of the file; eight bytes in the middle of them make a NaN.
#[test]
fn a_model_with_a_nan_among_its_weights_is_refused_at_load() {
    let dir = Room::new();
    let mut bytes = std::fs::read(graphs("models/surfaces/texture.onnx")).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle..middle + 8].fill(0xff);
    dir.write("nan.onnx", bytes);
    render(&dir, "--set texture.model=nan.onnx --out o.wav")
        .refused("nan.onnx: error:")
        .says(&["not finite at element"]);
    assert_eq!(dir.files(), ["nan.onnx"]);
}

/// Runs the program, which must end by itself within so much processor time \[s\], and not wait for ever.
fn run_within(seconds: u64, dir: &Room, line: &str) -> Ran {
    let began = Instant::now();
    let out = std::fs::File::create(dir.join("out")).unwrap();
    let mut program = asperity(dir);
    harness::most_cpu_s(&mut program, seconds);
    let mut child = program.args(line.split(' ')).stdout(Stdio::null()).stderr(out).spawn().unwrap();
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        if began.elapsed().as_secs() > 60 * seconds {
            child.kill().unwrap();
            child.wait().unwrap();
            panic!("{line} waits");
        }
        std::thread::sleep(Duration::from_millis(10));
    };
    let code = status.code().unwrap_or_else(|| panic!("{line} took more than {seconds} s: {status}"));
    Ran { code, out: String::new(), err: dir.text("out") }
}

#[cfg(unix)]
#[test]
fn named_pipe_is_refused_by_every_reader() {
    let dir = Room::new();
    dir.write(
        "s.ron",
        r#"Scene(version: 1, input: stroke(), actuator: (profile: "hapcoil_one", handle_mass_g: 100),
        output: audio_out(volts_at_full_scale: 1, amps_per_volt: 1),
        surfaces: {"a": (shape: plane(), effects: (stiffness: (stiffness_n_per_mm: 0.5),
        texture: waveform(recording: (file: "pipe.wav", speed_mm_s: 50, full_scale_m_s2: 9))))})"#,
    );
    let channels = ["force_n", "speed_mm_s", "ax_m_s2"]
        .map(|name| format!("(quantity: \"{name}\", full_scale: 9),"))
        .concat();
    dir.write("recording.ron", format!("Recording(channels: [{channels}])"));
    for ending in ["wav", "onnx", "ron", "npy", "png", "so"] {
        plugins::must(std::process::Command::new("mkfifo").arg(dir.join(format!("pipe.{ending}"))));
    }
    let encode = format!("--library {} --dry-run", graphs("models/surfaces/materials.ron").display());
    let picture = graphs("models/surfaces/pictures/spark_eroded_plastic.jpg").display().to_string();
    for line in [
        "check s.ron",
        "check pipe.ron",
        "choose pipe.ron",
        &format!("encode pipe.png {encode}"),
        &format!("encode {picture} {encode} --encoder pipe.onnx"),
        "check graphs/heravi2024.ron --set texture.model=pipe.onnx",
        "fit-ar pipe.wav --out t.ron",
        "fit-ar pipe.npy --columns force_n --rate-hz 1000 --out t.ron",
        "invert --magnitudes pipe.npy --rate 2500 --out o.wav",
        "plugin check ./pipe.so",
    ] {
        run_within(5, &dir, line).refused("is a named pipe; a regular file is needed");
    }
    run_within(5, &dir, "choose /dev/zero").refused("this is a device; a regular file is needed");
}

#[test]
fn graph_of_20000_errors_is_checked_at_once() {
    let count = 20_000;
    let nodes =
        |kind: &str| -> String { (0..count).map(|i| format!("\"n{i}\": (kind: \"{kind}\"),\n")).collect() };
    let wires = |wire: fn(usize) -> String| -> String { (0..count).map(wire).collect() };
    for (errors, nodes, wires) in [
        ("20,000", nodes("unknown_kind"), String::new()),
        ("40,000", nodes("gain"), wires(|i| format!("(\"x{i}\", \"y{i}\"),\n"))),
        ("19,999", nodes("gain"), wires(|_| "(\"n0\", \"n1\"),\n".into())),
        ("20,000", nodes("gain"), wires(|i| format!("(\"n0\", \"n{i}.nowhere\"),\n"))),
    ] {
        let err = refused(&format!("Graph(version: 1, nodes: {{{nodes}}}, wires: [{wires}])"));
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
    let dir = Room::new();
    let graph = graphs("heravi2024.ron").display().to_string();
    let base = ["render", &graph, "--seconds", "0.1", "--out", "o.wav"];
    for (most, more) in [(5, &["--probe", "motion.speed=v.csv", "--report", "r.json"][..]), (4, &[])] {
        harness::run_under(&dir, &format!("ulimit -n {most}"), &[&base, more].concat())
            .ends(1, &["Too many open files", "`ulimit -n 1024`"]);
    }
}

#[test]
fn tradeoff_of_a_wrong_setting_leaves_no_folder() {
    let dir = Room::new();
    for (set, says) in [("motion.cutoff_hz=1e9", "out of range"), ("motion.nope=3", "no parameter `nope`")] {
        dir.run(&format!("tradeoff graphs/heravi2024.ron --out found --set {set}")).refused(says);
        assert!(dir.files().is_empty(), "{set}");
    }
}

/// Runs the program on a file in 3 GiB of addresses, beyond which it would be aborted.
#[cfg(unix)]
fn in_few_addresses(text: &str, args: &[&str]) -> Ran {
    let dir = Room::new();
    dir.write("g.ron", text);
    harness::run_under(&dir, "ulimit -v 3145728", args)
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
    let ran = in_few_addresses(&text, &["check", "g.ron", "--memory", "500MiB"])
        .refused("error: not enough memory")
        .says(&["`--memory`"]);
    let line: usize = ran.err.strip_prefix("g.ron:").and_then(|e| e.split(':').next()?.parse().ok()).unwrap();
    // Each takes 15 MiB.
    assert!((25..45).contains(&line) && ran.err.matches(" error: ").count() == 1, "{}", ran.err);
}

/// A value takes about 140 bytes while a text is read: a list of 60 million numbers took 8 GB.
#[cfg(unix)]
#[test]
fn list_beyond_memory_is_refused_before_it_is_read() {
    let text = format!("Graph(version: 1, nodes: {{}}, wires: [{}])", "0,".repeat(5_000_000));
    in_few_addresses(&text, &["check", "g.ron", "--memory", "100MiB"])
        .refused("g.ron: error: not enough memory");
}

/// Every list of names, every error and every wire had a copy of it.
#[cfg(unix)]
#[test]
fn name_of_20_mb_is_refused_at_its_place() {
    let long = "n".repeat(20_000_000);
    for (before, after) in [
        ("Graph(version: 1, nodes: {\n\"", "\": (kind: \"sine\")})"),
        ("Graph(version: 1, nodes: {\"a\": (kind:\n\"", "\")})"),
        ("Graph(version: 1,\n", ": 1)"),
        ("Scene(version: 1, input:\n", ")"),
        ("Scene(version: 1, input:\n", "())"),
        ("Scene(version: 1, input:\nr#\"", "\"#)"),
    ] {
        let ran = in_few_addresses(&format!("{before}{long}{after}"), &["check", "g.ron"])
            .refused("g.ron:2:1: error: this name or text is too long");
        assert!(ran.err.len() < 1000, "{}", ran.err.len());
    }
}

#[cfg(unix)]
#[test]
fn network_beyond_memory_is_refused_by_its_file() {
    let graph = graphs("texture.ron").display().to_string();
    in_few_addresses("", &["--memory", "12MiB", "check", &graph])
        .refused("texture.onnx: error: node ")
        .says(&["not enough memory"]);
}

#[test]
fn memory_without_its_unit_is_refused() {
    let dir = Room::new();
    for wrong in ["4", "GiB", "0MiB", "-1GiB", "4GB", "99999999999999GiB"] {
        dir.run(&format!("nodes --memory={wrong}")).refused("such as 500MiB or 4GiB");
    }
    dir.run("nodes --memory 500MiB").ok();
}

#[test]
fn caret_stands_under_its_word_behind_wide_characters() {
    let dir = Room::new();
    let graph = "Graph(version: 1, nodes: {\n\t\"日本語テスト\": (kind: \"prob\"),\n}, wires: [])";
    dir.write("g.ron", graph);
    // A tab takes a column, each of the six characters two.
    let marks = format!("      │ {}^^^^^^ unknown kind\n", " ".repeat(1 + 14 + 9));
    dir.run("check g.ron").refused(&marks);
}
