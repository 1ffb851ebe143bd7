//! An installed program, which has its files with it.

use harness::{Room, asperity, files, graphs};

#[test]
fn shipped_files_are_found_in_an_empty_folder() {
    let dir = Room::new();
    let data = Room::new();
    let run = |args: &[&str]| {
        let done = asperity(&dir).env("XDG_DATA_HOME", &*data).args(args).output().unwrap();
        assert!(done.status.success(), "{args:?}: {}", String::from_utf8_lossy(&done.stderr));
        String::from_utf8(done.stdout).unwrap()
    };
    let here = graphs("heravi2024.ron").display().to_string();
    for (graph, out) in [("graphs/heravi2024.ron", "a.wav"), (here.as_str(), "b.wav")] {
        run(&["render", graph, "--seconds", "0.5", "--out", out]);
    }
    let wav = |name: &str| dir.bytes(name);
    assert!(wav("a.wav") == wav("b.wav"), "the shipped graph renders as the one in the repository");
    let materials = run(&["materials"]);
    assert!(materials.contains("canvas") && !materials.contains("(missing)"), "{materials}");
    run(&["check", "graphs/scenes/every_effect.ron"]);
    assert_eq!(dir.files(), ["a.wav", "b.wav"], "nothing is unpacked to the working directory");
    let unpacked = files(&data.join("asperity"));
    assert!(matches!(&unpacked[..], [one] if one.starts_with("shipped-")), "{unpacked:?}");
}

#[test]
fn file_in_the_working_directory_precedes_the_shipped() {
    let dir = Room::new();
    std::fs::create_dir(dir.join("graphs")).unwrap();
    dir.write("graphs/live.ron", "Graph(version: 1, nodes: {}, nires: [])");
    for (graph, says) in [
        ("graphs/live.ron", "graphs/live.ron:1:"),
        ("graphs/nowhere.ron", "graphs/nowhere.ron: error: cannot read this file"),
    ] {
        let ran = dir.run(&format!("check {graph}"));
        assert!(ran.code == 2 && ran.err.starts_with(says), "{graph}: {}", ran.err);
    }
}

#[test]
fn graph_of_the_readme_plays_a_shipped_model() {
    let room = Room::new();
    let readme = std::fs::read_to_string(harness::root().join("README.md")).unwrap();
    let graph = readme.split("```ron\n").nth(1).and_then(|rest| rest.split("```").next()).expect("a graph");
    room.write("mine.ron", graph);
    room.run("render mine.ron --seconds 1").ok();
    assert!(room.wav("felt.wav").0.iter().any(|x| x.abs() > 0.1));
    // A file of one's own beside the graph precedes the shipped one.
    std::fs::create_dir_all(room.join("graphs/models/surfaces")).unwrap();
    room.write("graphs/models/surfaces/materials.ron", "Library()");
    let ran = room.run("check mine.ron");
    assert!(ran.code == 2 && ran.err.contains("surfaces/materials.ron:1:"), "{}", ran.err);
}
