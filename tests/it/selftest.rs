//! `asperity selftest`: a user's graph and plugins against the hard cases.

use std::path::PathBuf;

use harness::{Ran, plugins, run, shipped_graph};

fn selftest(args: &[&str]) -> Ran {
    run(&harness::root(), &[&["selftest", "--quiet"], args].concat())
}

/// The shipped graph with a plugin's low-pass before the limiter, broken in one way or not at all.
fn with_low_pass(dir: &tempfile::TempDir, broken: &str) -> (PathBuf, PathBuf) {
    let library = dir.path().join(format!("{}{}", broken.to_lowercase(), std::env::consts::DLL_SUFFIX));
    let source = plugins::sources().join("node.c");
    plugins::compile(&source, &library, &[&format!("-DBREAK={broken}"), "-std=c11"]);
    let graph = dir.path().join("graph.ron");
    let text = shipped_graph()
        .replacen("nodes: {", "nodes: {\n\"mine\": (kind: \"low_pass\"),", 1)
        .replace("(\"inverse\", \"limiter\")", "(\"inverse\", \"mine.in\"), (\"mine\", \"limiter\")");
    assert!(text.contains("(\"mine\", \"limiter\")"));
    std::fs::write(&graph, text).unwrap();
    (graph, library)
}

#[test]
fn graph_that_holds_prints_a_table_and_exits_with_0() {
    let ran = selftest(&["graphs/texture.ron", "--case", "teleport"]).ok();
    let lines: Vec<&str> = ran.out.lines().collect();
    let words = |line: &str| line.split_whitespace().take(3).map(str::to_owned).collect::<Vec<_>>();
    assert_eq!(words(lines[0]), ["family", "case", "verdict"], "{}", ran.out);
    assert_eq!(words(lines[1]), ["motion", "teleport", "holds"], "{}", ran.out);
    assert_eq!(lines.last().copied(), Some("1 hold, 0 failed, 0 not applicable"));
    let told = selftest(&["graphs/texture.ron", "--case", "teleport", "--verbose"]).ok();
    assert!(told.out.contains("    hard: ") && told.out.contains("    must: "), "{}", told.out);
}

#[test]
fn broken_plugin_fails_the_case_and_good_one_holds() {
    let dir = tempfile::tempdir().unwrap();
    for (broken, code, verdict) in [("WRITES_NAN", 1, "fails"), ("NOTHING", 0, "holds")] {
        let (graph, library) = with_low_pass(&dir, broken);
        let paths = [graph, library].map(|p| p.display().to_string());
        let ran = selftest(&[&paths[0], "--plugin", &paths[1], "--case", "teleport", "--json"]);
        assert_eq!(ran.code, code, "{broken}: {}\n{}", ran.out, ran.err);
        let all: serde_json::Value = serde_json::from_str(&ran.out).expect("JSON");
        assert_eq!(all["verdict"], verdict);
        assert_eq!(
            (&all["cases"][0]["case"], &all["cases"][0]["verdict"]),
            (&"teleport".into(), &verdict.into())
        );
        assert!(all["cases"][0]["must"].as_str().is_some_and(|must| must.contains("finite")));
        let found = all["cases"][0]["found"].as_str().unwrap();
        assert_eq!(found.contains("1 faults"), broken == "WRITES_NAN", "{found}");
    }
}

#[test]
fn unknown_names_are_refused_before_any_case_runs() {
    for (args, said) in [
        (vec!["--case", "teleprot"], "did you mean `teleport`?"),
        (vec!["--family", "motoin"], "did you mean `motion`?"),
        (vec!["no_such.ron"], "no_such.ron"),
        (vec!["graphs/texture.ron", "--set", "gate.speed_mm_s=-1"], "speed_mm_s"),
        (vec!["--plugin", "no_such_plugin"], "no_such_plugin"),
    ] {
        let ran = selftest(&args);
        assert!(
            ran.code == 2 && ran.err.contains(said) && ran.out.is_empty(),
            "{args:?}: {}\n{}",
            ran.out,
            ran.err
        );
    }
}

#[test]
fn cases_of_graphs_are_skipped_without_a_graph() {
    let ran = selftest(&["--family", "motion"]).ok();
    assert!(!ran.out.contains("teleport") && ran.out.contains(" more look at a graph"), "{}", ran.out);
    // One that is asked for says so itself.
    let ran = selftest(&["--case", "teleport"]).ok();
    assert!(ran.out.contains("not applicable  no graph was given"), "{}", ran.out);
}

#[test]
fn scene_is_checked_and_graph_without_stylus_is_not() {
    let ran = selftest(&["graphs/scenes/side_by_side.ron", "--case", "teleport"]).ok();
    assert!(ran.out.contains("holds"), "{}", ran.out);
    let dir = tempfile::tempdir().unwrap();
    let graph = dir.path().join("still.ron");
    let text = "Graph(version: 1, nodes: {\"s\": (kind: \"sine\"), \"p\": (kind: \"probe\")}, \
                wires: [(\"s\", \"p\")])";
    std::fs::write(&graph, text).unwrap();
    let ran = selftest(&[&graph.display().to_string(), "--case", "teleport"]).ok();
    assert!(ran.out.contains("not applicable  nothing in this graph moves a stylus"), "{}", ran.out);
}
