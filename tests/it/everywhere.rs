//! The same bits on every CPU: the shipped graphs rendered with every instruction set there is, and on an
//! emulated CPU that has few.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

use asperity_diagnostics::ron::Kind;
use asperity_graph::{GraphFile, NodeDecl, Setting};
use harness::graph::lowered;
use harness::servers::skipped;
use harness::{Ran, Room, asperity, graphs, retrieving, root};

/// Long enough for the hand to stroke, short enough for an emulator.
const SECONDS: &str = "2";
/// A CPU without AVX, FMA and F16C, as it is emulated: of 2008.
const OLD_CPU: &str = "Nehalem";
/// The hashes that are kept.
const KEPT: &str = "tests/data/renders.txt";

/// Graphs of a hand.
const HANDS: [&str; 4] = ["clip.ron", "live.ron", "haply.ron", "openhaptics.ron"];

/// A render: its name and what follows `asperity render`.
fn renders() -> BTreeMap<String, Vec<String>> {
    let mut all = BTreeMap::new();
    let mut add = |name: String, graph: &Path, more: &[&str]| {
        let args = [&[graph.to_str().unwrap()], more].concat();
        all.insert(name, args.into_iter().map(str::to_owned).collect());
    };
    let stroke = graphs("trajectories/zigzag.csv");
    let stroke = ["--input", stroke.to_str().unwrap()];
    for folder in ["", "scenes"] {
        for entry in std::fs::read_dir(graphs(folder)).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_some_and(|e| e == "ron") {
                let name = path.strip_prefix(graphs("")).unwrap().display().to_string();
                // A hand that is not there is a stroke from a file.
                let live = HANDS.contains(&name.as_str());
                add(name, &path, if live { &stroke } else { &[] });
            }
        }
    }
    for precision in ["f16", "int8", "f64"] {
        let set = format!("texture.precision={precision}");
        add(format!("heravi2024.ron {set}"), &graphs("heravi2024.ron"), &["--set", &set]);
    }
    add("sample_commit.ron".into(), &retrieving(), &[]);
    all
}

/// The samples of a render as a hash; none where they are all silent, which would prove nothing.
fn hash(mut program: Command, dir: &Room, args: &[String]) -> u32 {
    let wav = dir.join("out.wav");
    program.args(["render", "--quiet"]).args(args).args(["--seconds", SECONDS, "--out"]).arg(&wav);
    let out = program.output().expect("the program starts");
    assert!(out.status.success(), "{args:?}: {}", String::from_utf8_lossy(&out.stderr));
    let (samples, _) = harness::wav(&wav);
    assert!(samples.iter().any(|&x| x != 0.0), "{args:?} is silent");
    let bytes: Vec<u8> = samples.iter().flat_map(|x| x.to_bits().to_le_bytes()).collect();
    crc32fast::hash(&bytes)
}

fn kept() -> BTreeMap<String, u32> {
    let text = std::fs::read_to_string(root().join(KEPT)).expect("the kept hashes");
    let line = |line: &str| {
        let (hash, name) = line.split_once(' ').expect("a hash and a name");
        (name.to_owned(), u32::from_str_radix(hash, 16).expect("a hash"))
    };
    text.lines().filter(|l| !l.starts_with('#')).map(line).collect()
}

/// Kinds of the nodes of a graph or scene, and words that they are set to.
fn kinds(args: &[String]) -> BTreeSet<String> {
    let path = Path::new(&args[0]);
    let scene = path.parent().is_some_and(|folder| folder.ends_with("scenes"));
    let mut graph = if scene { lowered(path) } else { GraphFile::read(path).expect("a shipped graph") };
    args.iter().filter(|arg| arg.contains('=')).for_each(|set| graph.set(set, "test").expect("a setting"));
    let words = |node: &NodeDecl| {
        let word = |p: &&Setting| matches!(p.value.kind(), Kind::Word(_) | Kind::Text(_));
        let words = node.params.iter().filter(|p| p.name != "material").filter(word);
        words.map(|p| format!("{} {}: {}", node.kind, p.name, p.value)).collect::<Vec<_>>()
    };
    let words = graph.nodes.iter().flat_map(words).filter(|word| !word.contains(['/', '[']));
    words.chain(graph.nodes.iter().map(|node| node.kind.clone())).collect()
}

/// Of renders with the same nodes one, the richest first.
fn different() -> Vec<(String, Vec<String>)> {
    let mut all: Vec<_> = renders().into_iter().map(|(name, args)| (kinds(&args), name, args)).collect();
    all.sort_by_key(|(kinds, name, _)| (std::cmp::Reverse(kinds.len()), name.clone()));
    let mut seen = BTreeSet::new();
    all.retain(|(kinds, ..)| {
        let new = !kinds.is_subset(&seen);
        seen.extend(kinds.iter().cloned());
        new
    });
    all.into_iter().map(|(_, name, args)| (name, args)).collect()
}

/// All of them on the best instruction set, and on the others those with other nodes.
#[test]
fn shipped_renders_have_the_kept_bits_on_every_instruction_set() {
    let dir = Room::new();
    let found: BTreeMap<String, u32> =
        renders().into_iter().map(|(name, args)| (name, hash(asperity(&dir), &dir, &args))).collect();
    if std::env::var_os("ASPERITY_WRITE_RENDERS").is_some() {
        let mut text =
            String::from("# CRC-32 of the samples of the shipped renders, the same on every CPU.\n");
        found.iter().for_each(|(name, hash)| text.push_str(&format!("{hash:08x} {name}\n")));
        std::fs::write(root().join(KEPT), text).unwrap();
    }
    let kept = kept();
    let other = |(name, hash): (&String, &u32)| (kept.get(name) != Some(hash)).then(|| name.clone());
    let changed: Vec<String> = found.iter().filter_map(other).collect();
    assert!(
        changed.is_empty() && found.len() == kept.len(),
        "these sound otherwise than before: {changed:?}. If that is meant, ASPERITY_WRITE_RENDERS=1 keeps it."
    );
    for (name, args) in different() {
        for isa in asperity_dsp::Isa::available().skip(1).map(asperity_dsp::Isa::name) {
            let mut program = asperity(&dir);
            program.env("ASPERITY_ISA", isa);
            assert_eq!(hash(program, &dir, &args), found[&name], "{name} differs on {isa}");
        }
    }
}

/// An emulator is slow: two at a time.
#[test]
fn shipped_renders_have_the_kept_bits_on_a_cpu_of_2008() {
    let Some(emulator) = emulator() else { return };
    let (all, kept) = (different(), kept());
    let check = |part: usize| {
        let dir = Room::new();
        for (name, args) in all.iter().skip(part).step_by(2) {
            println!("{name}");
            let hash = hash(on_old_cpu(&emulator, &dir), &dir, args);
            assert_eq!(Some(&hash), kept.get(name), "{name} differs");
        }
    };
    std::thread::scope(|s| {
        s.spawn(|| check(1));
        check(0);
    });
}

/// tract has kernels of its own for each CPU. docs/explanation/accuracy.md says how far it may differ.
#[test]
fn network_by_tract_stays_within_its_tolerance_on_an_old_cpu() {
    let Some(emulator) = emulator() else { return };
    let dir = Room::new();
    let graph = graphs("heravi2024.ron").display().to_string();
    let render = |mut program: Command, name: &str| {
        program.args(["render", &graph, "--set", "texture.executor=tract"]);
        program.args(["--seconds", SECONDS, "--out", name]);
        let out = program.output().expect("the program starts");
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        dir.wav(name).0
    };
    let old = on_old_cpu(&emulator, &dir);
    let (here, there) = (render(asperity(&dir), "here.wav"), render(old, "there.wav"));
    let peak = here.iter().fold(0.0_f32, |peak, x| peak.max(x.abs()));
    let off = here.iter().zip(&there).fold(0.0_f32, |off, (a, b)| off.max((a - b).abs()));
    assert!(peak > 0.01 && here.len() == there.len() && off < 1e-4 * peak, "{off} of {peak}");
}

/// The program on the emulated CPU.
fn on_old_cpu(emulator: &Path, dir: &Room) -> Command {
    let mut program = Command::new(emulator);
    program.args(["-cpu", OLD_CPU]).arg(asperity(dir).get_program());
    program.current_dir(dir).env("ASPERITY_STATE", "");
    program
}

/// The emulator, where it is installed.
fn emulator() -> Option<PathBuf> {
    if !cfg!(all(target_os = "linux", target_arch = "x86_64")) {
        skipped("a CPU of 2008 is emulated on Linux and x86-64 only");
        return None;
    }
    let path = std::env::var_os("PATH").unwrap_or_default();
    let found = std::env::split_paths(&path).map(|dir| dir.join("qemu-x86_64")).find(|file| file.exists());
    if found.is_none() {
        skipped("qemu-x86_64 is not installed: apt-get install qemu-user");
    }
    found
}

#[test]
fn report_says_which_instructions_computed_it() {
    let dir = Room::new();
    dir.run("render graphs/heravi2024.ron --seconds 0.1 --report r.json --portable")
        .ok()
        .says(&["by portable; every CPU gives the same bits"]);
    assert_eq!(dir.json("r.json")["instructions"], "portable");
    // By tract other CPUs may give other bits, and that is said.
    dir.run("render graphs/heravi2024.ron --seconds 0.1 --set texture.executor=tract")
        .ok()
        .says(&["`texture` runs by tract, which other CPUs round otherwise"]);
}

#[test]
fn weights_of_any_precision_run_without_vector_instructions() {
    let dir = Room::new();
    for precision in ["f16", "int8"] {
        let set = format!("texture.precision={precision}");
        dir.run(&format!("render graphs/heravi2024.ron --seconds 0.1 --portable --set {set}"))
            .ok()
            .says(&[&format!("packed {precision} on portable")]);
    }
}

#[test]
fn unknown_instruction_set_is_refused() {
    let dir = Room::new();
    Ran::of(&asperity(&dir).args(["nodes"]).env("ASPERITY_ISA", "avx3").output().unwrap())
        .refused("ASPERITY_ISA: error: there is no instruction set `avx3`");
}
