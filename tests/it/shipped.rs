//! An installed program, which has its files with it.

use harness::{asperity, files, graphs};

#[test]
fn shipped_files_are_found_in_an_empty_folder() {
    let dir = tempfile::tempdir().unwrap();
    let data = tempfile::tempdir().unwrap();
    let run = |args: &[&str]| {
        let done = asperity(dir.path()).env("XDG_DATA_HOME", data.path()).args(args).output().unwrap();
        assert!(done.status.success(), "{args:?}: {}", String::from_utf8_lossy(&done.stderr));
        String::from_utf8(done.stdout).unwrap()
    };
    let here = graphs("heravi2024.ron").display().to_string();
    for (graph, out) in [("graphs/heravi2024.ron", "a.wav"), (here.as_str(), "b.wav")] {
        run(&["render", graph, "--seconds", "0.5", "--out", out]);
    }
    let wav = |name: &str| std::fs::read(dir.path().join(name)).unwrap();
    assert!(wav("a.wav") == wav("b.wav"), "the shipped graph renders as the one in the repository");
    assert!(run(&["materials"]).contains("canvas"));
    run(&["check", "graphs/scenes/every_effect.ron"]);
    assert_eq!(files(dir.path()), ["a.wav", "b.wav"], "nothing is unpacked to the working directory");
    let unpacked = files(&data.path().join("asperity"));
    assert!(matches!(&unpacked[..], [one] if one.starts_with("shipped-")), "{unpacked:?}");
}

#[test]
fn file_in_the_working_directory_precedes_the_shipped() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::create_dir(dir.path().join("graphs")).unwrap();
    std::fs::write(dir.path().join("graphs/live.ron"), "Graph(version: 1, nodes: {}, nires: [])").unwrap();
    for (graph, says) in [
        ("graphs/live.ron", "graphs/live.ron:1:"),
        ("graphs/nowhere.ron", "graphs/nowhere.ron: error: cannot read this file"),
    ] {
        let ran = harness::run(dir.path(), &["check", graph]);
        assert!(ran.code == 2 && ran.err.starts_with(says), "{graph}: {}", ran.err);
    }
}
