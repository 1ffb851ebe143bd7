//! A graph from a stranger: it runs no native code that the person does not know of, and writes over nothing.
#![cfg(unix)]

use std::fs;
use std::io::Write;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

use harness::live::Live;
use harness::{Room, asperity, graphs, plugins};

/// A graph of a stranger, with a plugin that touches a file as soon as it is loaded.
struct Stranger {
    dir: Room,
}

impl Stranger {
    fn new() -> Self {
        let dir = Room::new();
        fs::create_dir(dir.join("plugins")).unwrap();
        let plugin = dir.join("plugins/libtold.so");
        plugins::compile(&plugins::sources().join("told.c"), &plugin, &["-DTOUCH"]);
        let graph = r#"Graph(version: 1, plugins: ["plugins/libtold.so"],
            nodes: {"wave": (kind: "told", params: (from: 900000)), "guard": (kind: "limiter"),
            "out": (kind: "audio_out")},
            wires: [("wave", "guard"), ("guard", "out")])"#;
        dir.write("g.ron", graph);
        Self { dir }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.dir.join(name)
    }

    /// The program, which trusts nothing but what this folder's configuration says.
    fn program(&self) -> Command {
        let mut program = asperity(&self.dir);
        program.env_remove("ASPERITY_TRUST").env("XDG_CONFIG_HOME", self.path("config"));
        program
    }

    fn run(&self, args: &[&str]) -> (i32, String) {
        ran(self.program().args(args))
    }

    /// Whether the plugin's code ran since this was last asked.
    fn touched(&self) -> bool {
        fs::remove_file(self.path("touched")).is_ok()
    }

    #[track_caller]
    fn refuses(&self, args: &[&str]) -> String {
        let (code, said) = self.run(args);
        assert_eq!(code, 2, "{args:?}: {said}");
        let why = "the plugin `plugins/libtold.so` was not loaded: its folder is not trusted";
        assert!(said.contains(why) && said.contains("g.ron:1:") && said.contains("asperity trust"), "{said}");
        assert!(!self.touched(), "{args:?} ran native code");
        said
    }

    #[track_caller]
    fn renders(&self, program: &mut Command, more: &[&str]) {
        let (code, said) = ran(program.args(["render", "g.ron", "--seconds", "0.1"]).args(more));
        assert!(code == 0 && self.touched(), "{said}");
    }
}

fn ran(program: &mut Command) -> (i32, String) {
    let Output { status, stdout, stderr } = program.stdin(Stdio::null()).output().unwrap();
    let said = [stdout, stderr].concat();
    (status.code().unwrap_or(-1), String::from_utf8_lossy(&said).into_owned())
}

#[test]
fn no_command_loads_native_code_of_a_graph_that_is_not_trusted() {
    let it = Stranger::new();
    let said = it.refuses(&["check", "g.ron"]);
    assert!(said.contains("there is no node kind `told`"), "the rest is looked at: {said}");
    it.refuses(&["graph", "g.ron", "--svg", "g.svg"]);
    it.refuses(&["selftest", "g.ron"]);
    it.refuses(&["render", "g.ron", "--seconds", "0.1", "--out", "o.wav"]);
    it.refuses(&["run", "g.ron", "--device", "simulated:frames=256", "--seconds", "0.1"]);
    it.refuses(&["latency", "g.ron"]);
    assert!(!it.path("g.svg").exists() && !it.path("o.wav").exists());
}

#[test]
fn plugin_that_is_named_or_trusted_is_loaded() {
    let it = Stranger::new();
    it.renders(&mut it.program(), &["--plugin", "plugins/libtold.so"]);
    it.renders(it.program().env("ASPERITY_PLUGIN_PATH", "plugins"), &[]);
    it.renders(it.program().env("ASPERITY_TRUST", &*it.dir), &[]);
    it.refuses(&["check", "g.ron"]);
    let (code, said) = it.run(&["trust", "plugins"]);
    assert!(code == 0 && said.contains("graphs may load plugins from"), "{said}");
    it.renders(&mut it.program(), &[]);
    let (_, said) = it.run(&["trust"]);
    assert_eq!(said.trim(), it.path("plugins").canonicalize().unwrap().display().to_string());
    assert_eq!(it.run(&["trust", "plugins", "--remove"]).0, 0);
    assert_eq!(it.run(&["trust", "plugins", "--remove"]).0, 2);
    it.refuses(&["check", "g.ron"]);
}

#[test]
fn link_leads_out_of_a_trusted_folder_and_trust_does_not_follow() {
    let it = Stranger::new();
    fs::create_dir(it.path("mine")).unwrap();
    assert_eq!(it.run(&["trust", "mine"]).0, 0);
    std::os::unix::fs::symlink(it.path("plugins/libtold.so"), it.path("mine/libtold.so")).unwrap();
    let graph = fs::read_to_string(it.path("g.ron")).unwrap();
    for name in ["mine/libtold.so", "mine/../plugins/libtold.so"] {
        fs::write(it.path("g.ron"), graph.replace("plugins/libtold.so", name)).unwrap();
        let (code, said) = it.run(&["check", "g.ron"]);
        assert!(code == 2 && said.contains("is not trusted") && !it.touched(), "{name}: {said}");
    }
}

#[test]
fn folder_that_everybody_may_write_into_is_not_trusted() {
    let it = Stranger::new();
    let mode = std::os::unix::fs::PermissionsExt::from_mode(0o777);
    fs::set_permissions(it.path("plugins"), mode).unwrap();
    let (code, said) = it.run(&["trust", "plugins"]);
    assert!(code == 2 && said.contains("everybody on this machine may write into this folder"), "{said}");
    let (code, said) = it.run(&["trust", "g.ron"]);
    assert!(code == 2 && said.contains("this is no folder"), "{said}");
    it.refuses(&["check", "g.ron"]);
}

/// Messages of the program to a person at a terminal who types this.
fn at_a_terminal(it: &Stranger, types: &str) -> String {
    let mut program = Command::new("script");
    let line = format!("{} check g.ron", env!("CARGO_BIN_EXE_asperity"));
    program.args(["-qec", &line, "/dev/null"]).current_dir(&it.dir);
    program.env_remove("ASPERITY_TRUST").env("XDG_CONFIG_HOME", it.path("config")).env("ASPERITY_STATE", "");
    let mut child = program.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("script");
    child.stdin.take().unwrap().write_all(types.as_bytes()).unwrap();
    String::from_utf8_lossy(&child.wait_with_output().unwrap().stdout).into_owned()
}

#[cfg(target_os = "linux")]
#[test]
fn person_at_a_terminal_is_asked_once_for_a_folder() {
    let it = Stranger::new();
    let question = "g.ron asks for native code in";
    let said = at_a_terminal(&it, "n\n");
    assert!(said.contains(question) && said.contains("is not trusted") && !it.touched(), "{said}");
    let said = at_a_terminal(&it, "y\n");
    assert!(said.contains(question) && said.contains("order") && it.touched(), "{said}");
    let said = at_a_terminal(&it, "");
    assert!(!said.contains(question) && said.contains("order") && it.touched(), "{said}");
}

#[test]
fn edit_to_a_strangers_plugin_does_not_reach_the_run() {
    let it = Stranger::new();
    let strange = fs::read_to_string(it.path("g.ron")).unwrap();
    let own = r#"Graph(version: 1, nodes: {"wave": (kind: "sine"), "guard": (kind: "limiter"),
       "out": (kind: "audio_out")},
        wires: [("wave", "guard"), ("guard", "out")])"#;
    fs::write(it.path("p.ron"), own).unwrap();
    let mut program = it.program();
    program.args(["run", "p.ron", "--watch", "--device", "simulated:frames=256"]);
    let mut live = Live::of(program);
    std::thread::sleep(std::time::Duration::from_millis(800));
    fs::write(it.path("p.ron"), strange).unwrap();
    live.says("its folder is not trusted");
    assert!(!it.touched());
    live.stop().ok();
}

/// A graph that wants a file written.
fn writing(file: &str) -> String {
    format!(
        r#"Graph(version: 1, nodes: {{"wave": (kind: "sine"),
           "probe": (kind: "probe", params: (file: {file:?}))}},
            wires: [("wave", "probe")])"#
    )
}

const RENDER: [&str; 4] = ["render", "g.ron", "--seconds", "0.1"];

#[test]
fn graph_does_not_write_over_a_file_that_asperity_did_not_make() {
    let it = Stranger::new();
    fs::create_dir(it.path("work")).unwrap();
    let outside = it.path("precious.csv");
    fs::write(&outside, "mine").unwrap();
    let here = |args: &[&str]| ran(it.program().current_dir(it.path("work")).args(args));
    std::os::unix::fs::symlink(&outside, it.path("work/link.csv")).unwrap();
    fs::write(it.path("work/own.csv"), "mine").unwrap();
    let outside_name = outside.display().to_string();
    for (file, why) in [
        (outside_name.as_str(), "outside of the working directory"),
        ("../precious.csv", "outside of the working directory"),
        ("../new.csv", "outside of the working directory"),
        ("link.csv", "outside of the working directory"),
        ("own.csv", "write over own.csv, which Asperity did not make"),
    ] {
        fs::write(it.path("work/g.ron"), writing(file)).unwrap();
        for args in [&RENDER[..], &["run", "g.ron", "--clock", "timer", "--seconds", "0.1"]] {
            let (code, said) = here(args);
            assert!(code == 2 && said.contains(why) && said.contains("g.ron:"), "{file} {args:?}: {said}");
        }
    }
    assert_eq!(fs::read_to_string(&outside).unwrap(), "mine");
    assert_eq!(fs::read_to_string(it.path("work/own.csv")).unwrap(), "mine");
    assert!(!it.path("new.csv").exists());
    // What the command line says is the person's own word.
    assert_eq!(here(&[&RENDER[..], &["--set", "probe.file=\"../new.csv\""]].concat()).0, 0);
    assert_eq!(here(&[&RENDER[..], &["--overwrite"]].concat()).0, 0);
    assert_ne!(fs::read_to_string(it.path("work/own.csv")).unwrap(), "mine");
    assert!(it.path("new.csv").exists());
}

#[test]
fn graph_writes_over_its_own_file_until_a_person_changes_it() {
    let it = Stranger::new();
    fs::write(it.path("g.ron"), writing("p.csv")).unwrap();
    for _ in 0..2 {
        let (code, said) = it.run(&RENDER);
        assert_eq!(code, 0, "{said}");
    }
    let mut text = fs::read_to_string(it.path("p.csv")).unwrap();
    text.push_str("# a note of mine\n");
    fs::write(it.path("p.csv"), &text).unwrap();
    let (code, said) = it.run(&RENDER);
    assert!(code == 2 && said.contains("which Asperity did not make"), "{said}");
    assert_eq!(fs::read_to_string(it.path("p.csv")).unwrap(), text);
}

#[test]
fn shipped_graphs_ask_for_no_trust() {
    let it = Stranger::new();
    let graph = graphs("heravi2024.ron").display().to_string();
    assert_eq!(it.run(&["check", &graph]).0, 0);
}
