//! A graph from a stranger: it runs no native code that the person does not know of, and writes over nothing.
#![cfg(unix)]

use std::fs;
use std::io::Write;
use std::process::{Command, Stdio};

use harness::live::Live;
use harness::{Ran, Room, asperity, plugins};

/// A graph of a stranger, with a plugin that touches a file as soon as it is loaded.
struct Stranger {
    dir: Room,
}

impl std::ops::Deref for Stranger {
    type Target = Room;

    fn deref(&self) -> &Room {
        &self.dir
    }
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

    /// The program, which trusts nothing but what this folder's configuration says.
    fn program(&self) -> Command {
        let mut program = asperity(&self.dir);
        program.env_remove("ASPERITY_TRUST").env("XDG_CONFIG_HOME", self.join("config"));
        program
    }

    fn run(&self, line: &str) -> Ran {
        ran(self.program().args(line.split(' ')))
    }

    /// Whether the plugin's code ran since this was last asked.
    fn touched(&self) -> bool {
        fs::remove_file(self.join("touched")).is_ok()
    }

    #[track_caller]
    fn refuses(&self, line: &str) -> Ran {
        let why = "the plugin `plugins/libtold.so` was not loaded: its folder is not trusted";
        let said = self.run(line).refused(why).says(&["g.ron:1:", "asperity trust"]);
        assert!(!self.touched(), "{line} ran native code");
        said
    }

    #[track_caller]
    fn renders(&self, program: &mut Command, more: &[&str]) {
        ran(program.args(["render", "g.ron", "--seconds", "0.1"]).args(more)).ok();
        assert!(self.touched());
    }
}

fn ran(program: &mut Command) -> Ran {
    Ran::of(&program.stdin(Stdio::null()).output().unwrap())
}

#[test]
fn no_command_loads_native_code_of_a_graph_that_is_not_trusted() {
    let it = Stranger::new();
    // The rest is looked at.
    it.refuses("check g.ron").says(&["there is no node kind `told`"]);
    for line in [
        "graph g.ron --svg g.svg",
        "selftest g.ron",
        "render g.ron --seconds 0.1 --out o.wav",
        "run g.ron --device simulated:frames=256 --seconds 0.1",
        "latency g.ron",
    ] {
        it.refuses(line);
    }
    assert!(!it.join("g.svg").exists() && !it.join("o.wav").exists());
}

#[test]
fn plugin_that_is_named_or_trusted_is_loaded() {
    let it = Stranger::new();
    it.renders(&mut it.program(), &["--plugin", "plugins/libtold.so"]);
    it.renders(it.program().env("ASPERITY_PLUGIN_PATH", "plugins"), &[]);
    it.renders(it.program().env("ASPERITY_TRUST", &**it), &[]);
    it.refuses("check g.ron");
    it.run("trust plugins").ok().says(&["graphs may load plugins from"]);
    it.renders(&mut it.program(), &[]);
    let trusted = it.join("plugins").canonicalize().unwrap().display().to_string();
    assert_eq!(it.run("trust").out.trim(), trusted);
    it.run("trust plugins --remove").ok();
    it.run("trust plugins --remove").refused("");
    it.refuses("check g.ron");
}

#[test]
fn link_leads_out_of_a_trusted_folder_and_trust_does_not_follow() {
    let it = Stranger::new();
    fs::create_dir(it.join("mine")).unwrap();
    it.run("trust mine").ok();
    std::os::unix::fs::symlink(it.join("plugins/libtold.so"), it.join("mine/libtold.so")).unwrap();
    let graph = it.text("g.ron");
    for name in ["mine/libtold.so", "mine/../plugins/libtold.so"] {
        it.write("g.ron", graph.replace("plugins/libtold.so", name));
        it.run("check g.ron").refused("is not trusted");
        assert!(!it.touched(), "{name}");
    }
}

#[test]
fn folder_that_everybody_may_write_into_is_not_trusted() {
    let it = Stranger::new();
    let mode = std::os::unix::fs::PermissionsExt::from_mode(0o777);
    fs::set_permissions(it.join("plugins"), mode).unwrap();
    it.run("trust plugins").refused("everybody on this machine may write into this folder");
    it.run("trust g.ron").refused("this is no folder");
    it.refuses("check g.ron");
}

/// Messages of the program to a person at a terminal who types this.
fn at_a_terminal(it: &Stranger, types: &str) -> String {
    let mut program = Command::new("script");
    let line = format!("{} check g.ron", env!("CARGO_BIN_EXE_asperity"));
    program.args(["-qec", &line, "/dev/null"]).current_dir(&it.dir);
    program.env_remove("ASPERITY_TRUST").env("XDG_CONFIG_HOME", it.join("config")).env("ASPERITY_STATE", "");
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
    let strange = it.text("g.ron");
    let own = r#"Graph(version: 1, nodes: {"wave": (kind: "sine"), "guard": (kind: "limiter"),
       "out": (kind: "audio_out")},
        wires: [("wave", "guard"), ("guard", "out")])"#;
    it.write("p.ron", own);
    let mut program = it.program();
    program.args(["run", "p.ron", "--watch", "--device", "simulated:frames=256"]);
    let mut live = Live::of(program);
    std::thread::sleep(std::time::Duration::from_millis(800));
    it.write("p.ron", strange);
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

#[test]
fn graph_does_not_write_over_a_file_that_asperity_did_not_make() {
    let it = Stranger::new();
    fs::create_dir(it.join("work")).unwrap();
    it.write("precious.csv", "mine");
    it.write("work/own.csv", "mine");
    std::os::unix::fs::symlink(it.join("precious.csv"), it.join("work/link.csv")).unwrap();
    let here = |line: &str| ran(it.program().current_dir(it.join("work")).args(line.split(' ')));
    let outside = "outside of the working directory";
    for (file, why) in [
        (&*it.join("precious.csv").display().to_string(), outside),
        ("../precious.csv", outside),
        ("../new.csv", outside),
        ("link.csv", outside),
        ("own.csv", "write over own.csv, which Asperity did not make"),
    ] {
        it.write("work/g.ron", writing(file));
        for line in [RENDER, "run g.ron --clock timer --seconds 0.1"] {
            here(line).refused(why).says(&["g.ron:"]);
        }
    }
    assert_eq!((it.text("precious.csv"), it.text("work/own.csv")), ("mine".into(), "mine".into()));
    assert!(!it.join("new.csv").exists());
    // What the command line says is the person's own word.
    here(&format!("{RENDER} --set probe.file=\"../new.csv\"")).ok();
    here(&format!("{RENDER} --overwrite")).ok();
    assert!(it.text("work/own.csv") != "mine" && it.join("new.csv").exists());
}

#[test]
fn graph_writes_over_its_own_file_until_a_person_changes_it() {
    let it = Stranger::new();
    it.write("g.ron", writing("p.csv"));
    it.run(RENDER).ok();
    it.run(RENDER).ok();
    let text = it.text("p.csv") + "# a note of mine\n";
    it.write("p.csv", &text);
    it.run(RENDER).refused("which Asperity did not make");
    assert_eq!(it.text("p.csv"), text);
}

const RENDER: &str = "render g.ron --seconds 0.1";

#[test]
fn shipped_graphs_ask_for_no_trust() {
    Stranger::new().run("check graphs/heravi2024.ron").ok();
}
