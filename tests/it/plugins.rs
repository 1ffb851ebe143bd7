//! Plugins through the program: found, refused, run beside built-in nodes, contained.

use std::fs;
use std::path::Path;
use std::process::Command;

use asperity_accuracy::npy;
use asperity_loader::Plugin;
use harness::{Ran, Room, node, plugins, root, run};

/// Error of loading a file.
fn refusal(path: &Path) -> String {
    match Plugin::load(path) {
        Ok(plugin) => panic!("{} loads: {plugin:?}", path.display()),
        Err(e) => e.to_string(),
    }
}

/// Writes a graph `g.ron` that names plugins.
fn graph(dir: &Room, plugins: &[&Path], nodes: &str, wires: &str) {
    let plugins: Vec<_> = plugins.iter().map(|path| path.display().to_string()).collect();
    let text = format!("Graph(version: 1, plugins: {plugins:?}, nodes: {{\n{nodes}}},\nwires: [{wires}])");
    dir.write("g.ron", text);
}

/// A node that leads to an output behind a limiter.
const GUARDED: &str = "\"guard\": (kind: \"limiter\"), \"out\": (kind: \"audio_out\")";
const GUARDED_WIRES: &str = "(\"bad\", \"guard\"), (\"guard\", \"out\")";

fn lie(dir: &Room, number: u32) -> std::path::PathBuf {
    let to = dir.join(format!("lie{number}.so"));
    // Some lies are compiler warnings too.
    plugins::compile(&plugins::sources().join("lies.c"), &to, &[&format!("-DLIE={number}"), "-w"]);
    to
}

#[test]
fn a_plugin_that_lies_is_refused_and_says_where() {
    let dir = Room::new();
    for (number, says) in [
        (1, "kind 0 says it has 8 bytes"),
        (2, "flags are 0x40"),
        (3, "it says 9 of how it wakes"),
        (4, "there are two of input `in`"),
        (5, "4000000000 of input"),
        (6, "200 bins of a 250-point"),
        (7, "the name of a kind is NULL"),
        (9, "its name must be lower case"),
        (10, "input 0 says it has 7 bytes"),
        (11, "input 0 says it has 1048576 bytes"),
        (12, "port `in` carries 77"),
        (13, "the name of a port is NULL"),
        (14, "a name must be lower case"),
        (15, "port `in` has no unit"),
        (16, "port `in` carries 0 values"),
        (17, "port `in` carries 2147483648 values"),
        (18, "flags of port `in` are 0x40000000"),
        (19, "default of port `in` is not finite"),
        (20, "parameter 0 says it has 3 bytes"),
        (21, "parameter `gain` holds 99"),
        (22, "parameter \"\""),
        (23, "parameter `gain`"),
        (24, "parameter `gain`"),
        (25, "parameter `gain`"),
        (26, "parameter `gain`"),
        (27, "flags of parameter `gain` are 0x100000"),
        (28, "no function `set_parameter"),
        (29, "parameter `gain`"),
        (30, "input 0 is NULL"),
        (31, "no function `wants"),
        (32, "no function `absorb"),
        (33, "no function `create`"),
        (34, "no function `process`"),
        (35, "state_size, save and restore"),
        (36, "output `out` promises a limited signal"),
        (50, "its description says it has 4 bytes"),
        (51, "it offers 0 kinds"),
        (52, "it offers 4000000000 kinds"),
        (53, "the kind `honest` twice"),
        (55, "its list of kinds is NULL"),
        (56, "its name is NULL"),
        (57, "its version is not UTF-8"),
        (58, "it does not open with this program"),
        (60, "no symbol `asperity_entry`"),
        (61, "does not begin with Asperity's magic number"),
        (62, "its entry says it has 4 bytes"),
        (63, "version 2.1 of the plugin interface; this program has 1.1"),
        (64, "its entry has no `open`"),
    ] {
        let path = lie(&dir, number);
        let said = refusal(&path);
        assert!(said.contains(says) && said.contains("lie"), "lie {number}: {said}");
    }
    assert!(Plugin::load(lie(&dir, 0)).is_ok(), "the honest one loads");
}

#[test]
fn a_lie_that_shows_only_later_is_an_error_of_the_graph() {
    let dir = Room::new();
    for (number, says) in
        [(40, "cannot make an instance"), (41, "cannot be prepared"), (42, "negative denominator")]
    {
        let nodes = r#""it": (kind: "honest"), "s": (kind: "stroke"), "f": (kind: "virtual_floor"),
            "p": (kind: "probe")"#;
        let wires = r#"("s", "f"), ("f.force", "it"), ("f.force", "p")"#;
        graph(&dir, &[&lie(&dir, number)], nodes, wires);
        dir.run("check g.ron --no-prune").refused(says).says(&["g.ron:2:"]);
    }
}

#[test]
fn what_is_no_plugin_is_refused_before_any_of_it_runs() {
    let dir = Room::new();
    let at = |name: &str| dir.join(name);
    let good = fs::read(plugins::c("told")).unwrap();
    let write = |name: &str, bytes: &[u8]| {
        dir.write(name, bytes);
        refusal(&at(name))
    };
    assert!(refusal(&at("missing.so")).contains("cannot read this file: No such file"));
    assert!(refusal(&dir).contains("this is a folder; a regular file is needed"));
    assert!(write("text.so", b"hello, I am a text\n").contains("this is not a shared library"));
    assert!(write("empty.so", b"").contains("this file is empty"));
    for cut in [good.len() / 4, good.len() / 2, 3 * good.len() / 4] {
        let said = write("cut.so", &good[..cut]);
        assert!(said.contains("cut short") || said.contains("not a shared library"), "{said}");
    }
    // ELF header: class at byte 4, machine at 18.
    if cfg!(all(target_os = "linux", target_arch = "x86_64")) {
        let mut other = good.clone();
        other[18..20].copy_from_slice(&183_u16.to_le_bytes());
        let said = write("arm.so", &other);
        assert!(said.contains("another architecture: Aarch64") && said.contains("x86_64"), "{said}");
        let program = refusal(Path::new(env!("CARGO_BIN_EXE_asperity")));
        assert!(program.contains("not a plugin") || program.contains("program"), "{program}");
        let pe = write("windows.so", &[b"MZ".as_slice(), &[0; 400]].concat());
        assert!(pe.contains("not a shared library"), "{pe}");
    }
}

/// Errors point to the place in the graph.
#[test]
fn plugin_of_a_graph_is_found_by_file_or_name() {
    let dir = Room::new();
    fs::create_dir(dir.join("plugins")).unwrap();
    fs::copy(plugins::c("told"), dir.join("plugins/libtold.so")).unwrap();
    let named = |plugin: &str| {
        let nodes = format!("\"bad\": (kind: \"told\"), {GUARDED}");
        graph(&dir, &[plugin.as_ref()], &nodes, GUARDED_WIRES);
    };
    named("plugins/libtold.so");
    dir.run("check g.ron").ok();
    // From another folder: relative to the graph, not to where the program runs.
    run(Path::new("/"), &["check", dir.join("g.ron").to_str().unwrap()]).ok();
    named("told");
    dir.run("check g.ron")
        .refused("g.ron:1:29: error: there is no plugin `told`")
        .says(&["libtold.so", "ASPERITY_PLUGIN_PATH"]);
    let on_path = |folder: &str, line: &str| {
        let mut program = harness::asperity(&dir);
        program.env("ASPERITY_PLUGIN_PATH", dir.join(folder)).args(line.split(' '));
        Ran::of(&program.output().unwrap())
    };
    on_path("plugins", "check g.ron").ok();
    on_path("nowhere", "check g.ron").refused("there is no plugin `told`");
    on_path("nowhere", "nodes").ok().says(&["nowhere: cannot look for plugins here"]);
    named("plugins/libtld.so");
    dir.run("check g.ron").refused("libtld.so: error: cannot read this file").says(&["g.ron:1:29"]);
    // A kind that is there twice, and one that is built in.
    for (numbers, says) in [
        (&[8][..], "its kind `spsi` is there already: it is built in"),
        (&[0, 40], "its kind `honest` is there already"),
    ] {
        let lies = numbers.iter().map(|number| format!(" --plugin {}", lie(&dir, *number).display()));
        dir.run(&format!("nodes{}", lies.collect::<String>())).refused(says);
    }
    // One that merely lies on the path is left out, and the rest goes on.
    dir.write("plugins/libtext.so", "text");
    on_path("plugins", "nodes").ok().says(&["told", "libtext.so: this is not"]);
    on_path("plugins", "plugin list --json").ok().says(&["\"told\"", "this is not a shared library"]);
}

/// The signal that a phase-retrieval node makes of the texture vector.
fn inverted(dir: &Room, kind: &str, plugin: &Path) -> Vec<f32> {
    let magnitudes = root().join("tests/data/phase/texture_2500.mag.npy");
    let files = format!("--plugin {} --magnitudes {}", plugin.display(), magnitudes.display());
    dir.run(&format!("invert --phase {kind} --rate 2500 --scale dft --out y.npy {files}")).ok();
    dir.npy("y.npy")
}

fn furthest(a: &[f32], b: &[f32]) -> f32 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

#[test]
fn the_same_node_in_rust_c_and_cpp_makes_the_same_signal() {
    let dir = Room::new();
    let rust = inverted(&dir, "my_phase", &plugins::rust("my_phase"));
    assert!(rust.iter().any(|x| x.abs() > 0.1));
    for library in plugins::templates(&dir, "phase", "my_phase") {
        let worst = furthest(&rust, &inverted(&dir, "my_phase", &library));
        assert!(worst < 1e-4, "{library:?} differs by {worst}");
    }
}

#[test]
fn a_filter_in_rust_c_and_cpp_softens_alike() {
    let dir = Room::new();
    let softened = |plugin: &Path| {
        let nodes = r#""t": (kind: "told"), "f": (kind: "my_filter"),
            "p": (kind: "probe", params: (file: "y.npy"))"#;
        graph(&dir, &[&plugins::c("told"), plugin], nodes, r#"("t", "f"), ("f", "p")"#);
        dir.run("render g.ron --seconds 0.5").ok();
        dir.npy("y.npy")
    };
    let rust = softened(&plugins::rust("my_filter"));
    // The gain of a one-pole low pass at 0.01 rad a sample, in closed form.
    let (a, w) = (0.9_f32, 0.01_f32);
    let gain = (1.0 - a) / ((1.0 - a * w.cos()).powi(2) + (a * w.sin()).powi(2)).sqrt();
    let peak = rust[2000..].iter().fold(0.0_f32, |m, x| m.max(x.abs()));
    assert!((peak / (0.1 * gain) - 1.0).abs() < 1e-3, "{peak} against {}", 0.1 * gain);
    for library in plugins::templates(&dir, "audio", "my_filter") {
        let worst = furthest(&rust, &softened(&library));
        assert!(worst < 1e-6, "{library:?} differs by {worst}");
    }
}

/// Renders a node of a plugin behind a limiter; samples, report and messages.
fn contained(plugin: &Path, node: &str, more: &str) -> (Vec<f32>, serde_json::Value, String) {
    let dir = Room::new();
    graph(&dir, &[plugin], &format!("\"bad\": ({node}), {GUARDED}"), GUARDED_WIRES);
    let ran = dir.run(&format!("render g.ron --out o.wav --report r.json {more}"));
    let (samples, _) = dir.wav("o.wav");
    (samples, dir.json("r.json"), ran.err)
}

#[test]
fn a_plugin_that_fails_is_faded_counted_and_the_chain_goes_on() {
    let told = |what: &str, from: u32, to: u32| {
        let node = format!("kind: \"told\", params: (from: {from}, to: {to}, what: {what})");
        contained(&plugins::c("told"), &node, "--seconds 1")
    };
    for what in ["error", "nan", "exception", "nonsense"] {
        let (good, ..) = told(what, 0, 0);
        let (samples, report, err) = told(what, 200, 202);
        assert!(samples.iter().all(|x| x.is_finite()), "{what}");
        let step = |x: &[f32]| x.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max);
        // The wave itself and a fade of 10 ms from its peak.
        assert!(step(&samples) < step(&good) + 0.1 / 480.0 * 1.5, "{what}: {}", step(&samples));
        let late = furthest(&good[good.len() - 4800..], &samples[samples.len() - 4800..]);
        assert!(late < 1e-3, "{what}: it goes on where it would have been, but for {late}");
        assert!(
            node(&report, "bad")["faults"] == 2 && !err.contains("panicked at"),
            "{what}: {report} {err}"
        );
        let (samples, report, _) = told(what, 200, 1_000_000);
        assert_eq!(node(&report, "bad")["faults"], 8, "{what}: quarantined after 8");
        assert!(samples[samples.len() / 2..].iter().all(|x| x.abs() < 1e-4), "{what} fades to silence");
    }
}

#[test]
fn a_plugin_that_takes_too_long_is_faded_counted_and_taken_out() {
    // Each call sleeps for 30 ms where 15 may be taken: far beyond what a busy machine adds to an honest
    // call.
    let render = |to: u32| {
        let told = format!("kind: \"told\", params: (from: 20, to: {to}, what: overrun)");
        let (samples, report, _) = contained(&plugins::c("told"), &told, "--seconds 0.5 --limit-us 15000");
        (samples, node(&report, "bad").clone())
    };
    let (samples, bad) = render(22);
    assert!(bad["faults"].as_u64().unwrap() >= 2 && bad["quarantined"] == false, "{bad}");
    assert_eq!(bad["last_fault"], "took longer than it may");
    assert!(samples[12_000..].iter().any(|x| x.abs() > 0.05), "it goes on");
    let (samples, bad) = render(1_000_000);
    assert!(bad["faults"] == 8 && bad["quarantined"] == true, "{bad}");
    assert!(samples[12_000..].iter().all(|x| x.abs() < 1e-3), "silent once it is taken out");
}

#[test]
fn a_panic_in_a_plugin_is_silent_and_contained() {
    let (samples, report, err) = contained(
        &plugins::rust("asperity-test-panics"),
        "kind: \"panics\", params: (at: 200)",
        "--seconds 1",
    );
    assert!(samples.iter().all(|x| x.is_finite()) && samples.iter().any(|x| x.abs() > 0.01));
    assert!(node(&report, "bad")["faults"] == 1 && !err.contains("as told"), "{report} {err}");
}

#[test]
fn a_panic_while_a_plugin_is_prepared_is_an_error_of_the_graph() {
    let dir = Room::new();
    let node = r#""bad": (kind: "panics", params: (early: true)), "p": (kind: "probe")"#;
    graph(&dir, &[&plugins::rust("asperity-test-panics")], node, r#"("bad", "p")"#);
    dir.run("check g.ron")
        .refused("the node panicked while it was prepared: as told, early")
        .says(&["g.ron:2:"]);
}

#[test]
fn a_new_plugin_in_every_language_builds_and_is_found() {
    let dir = Room::new();
    // What stands in a folder for Rust is checked by building it, beside the other builds.
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).join("new");
    for (like, language) in
        ["phase", "audio", "effect"].iter().flat_map(|like| ["c", "cpp", "rust"].map(|l| (like, l)))
    {
        let name = format!("one_{language}_{like}");
        dir.run(&format!("plugin new {name} --lang {language} --like {like}")).ok();
        let (mut build, library) = if language == "rust" {
            let mut cargo = Command::new(env!("CARGO"));
            cargo.args(["build", "--locked"]).env("CARGO_TARGET_DIR", &target);
            (cargo, target.join("debug").join(asperity_loader::file_name(&name)))
        } else {
            (Command::new("make"), dir.join(format!("{name}/lib{name}.so")))
        };
        plugins::must(build.current_dir(dir.join(&name)));
        let ran = dir.run(&format!("nodes {name} --plugin {}", library.display())).ok();
        assert!(ran.out.starts_with(&name), "{}", ran.out);
    }
    let before = dir.files();
    for (name, says) in [
        ("one_c_phase", "this is there already"),
        ("One", "cannot be the name"),
        ("fn", "means something"),
        ("spsi", "built-in kind `spsi`"),
        ("griffin_lim", "built-in kind `griffin_lim`"),
        ("../x/../y z", "cannot be the name"),
        ("no/such/folder/mine", "cannot make this folder"),
    ] {
        run(&dir, &["plugin", "new", name]).refused(says);
    }
    assert_eq!(dir.files(), before, "nothing is left behind");
}

#[test]
fn the_readme_of_a_new_plugin_names_what_is_there() {
    let dir = Room::new();
    dir.run("plugin new mine --lang cpp").ok();
    let readme = dir.text("mine/README.md");
    for gone in ["my_phase", "LIBRARY", "LANGUAGE", "SOURCE"] {
        assert!(!readme.contains(gone), "{gone} is left in: {readme}");
    }
    for there in ["mine.cpp", "./libmine.so", "in C++"] {
        assert!(readme.contains(there), "{there}: {readme}");
    }
}

#[test]
fn a_minimal_node_takes_no_more_than_25_lines() {
    let lines = |file: &str, fence: &str, end: &str| {
        let text = fs::read_to_string(root().join(file)).unwrap();
        let block =
            text.split(fence).nth(1).and_then(|rest| rest.split(end).next()).expect("a block of code");
        assert!(block.contains("impl Node for"), "{file}: {block}");
        block.lines().count()
    };
    // Both are compiled as documentation tests.
    assert!(lines("docs/how-to/write-a-graph-and-a-node.md", "```rust\n", "```") <= 25);
    assert!(lines("plugins/sdk/src/lib.rs", "//! ```\n", "//! ```") <= 25);
}

#[test]
fn plugin_that_exits_is_no_success() {
    let dir = Room::new();
    fs::copy(plugins::c("told"), dir.join("libtold.so")).unwrap();
    let nodes = format!("\"bad\": (kind: \"told\", params: (from: 50, to: 51, what: \"exit\")), {GUARDED}");
    graph(&dir, &["libtold.so".as_ref()], &nodes, GUARDED_WIRES);
    for command in [
        &["render", "g.ron", "--seconds", "1", "--out", "o.wav"][..],
        &["run", "g.ron", "--device", "simulated:frames=96"],
    ] {
        run(&dir, command).ends(1, &["called exit()"]);
        assert!(!dir.join("o.wav").exists());
    }
}

#[test]
fn rounding_that_a_plugin_changed_does_not_reach_other_nodes() {
    let dir = Room::new();
    // A filter rounds in every sample: with another rounding it would put out something else.
    let right = |from: u32| {
        let nodes = format!(
            r#""bad": (kind: "told", params: (from: {from}, to: 1000000, what: rounding)), {GUARDED},
            "tone": (kind: "sine", params: (frequency_hz: 200, amplitude: 0.05)),
            "other": (kind: "limiter"), "right": (kind: "file_out", params: (file: "right.npy"))"#
        );
        let wires = format!(r#"{GUARDED_WIRES}, ("tone", "other"), ("other", "right")"#);
        graph(&dir, &[&plugins::c("told")], &nodes, &wires);
        dir.run("render g.ron --seconds 1 --out left.wav").ok();
        (npy::read(dir.join("right.npy")).unwrap().values, dir.wav("left.wav").0)
    };
    let (rounded, untouched) = (right(100), right(900_000));
    assert!(rounded == untouched);
}
