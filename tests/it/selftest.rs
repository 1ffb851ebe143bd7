//! `asperity selftest`: a user's graph and plugins against the hard cases.

use harness::{Ran, Room, plugins, run, shipped_graph};

fn selftest(line: &str) -> Ran {
    run(&harness::root(), &["selftest --quiet", line].join(" ").split(' ').collect::<Vec<_>>())
}

/// The shipped graph with a plugin's low-pass before the limiter, broken in one way or not at all, as words
/// of a command.
fn with_low_pass(dir: &Room, broken: &str) -> String {
    let library = plugins::broken(dir, broken);
    let text = shipped_graph()
        .replacen("nodes: {", "nodes: {\n\"mine\": (kind: \"low_pass\"),", 1)
        .replace("(\"inverse\", \"limiter\")", "(\"inverse\", \"mine.in\"), (\"mine\", \"limiter\")");
    assert!(text.contains("(\"mine\", \"limiter\")"));
    dir.write("graph.ron", text);
    format!("{} --plugin {}", dir.join("graph.ron").display(), library.display())
}

#[test]
fn graph_that_holds_prints_a_table_and_exits_with_0() {
    let ran =
        selftest("graphs/texture.ron --case teleport --verbose").ok().says(&["    hard: ", "    must: "]);
    let words = |line: &str| line.split_whitespace().take(3).map(str::to_owned).collect::<Vec<_>>();
    let mut lines = ran.out.lines();
    assert_eq!(words(lines.next().unwrap()), ["family", "case", "verdict"], "{}", ran.out);
    assert_eq!(words(lines.next().unwrap()), ["motion", "teleport", "holds"], "{}", ran.out);
    assert_eq!(lines.last(), Some("1 hold, 0 failed, 0 not applicable"));
}

#[test]
fn broken_plugin_fails_the_case_and_good_one_holds() {
    let dir = Room::new();
    for (broken, code, verdict) in [("WRITES_NAN", 1, "fails"), ("NOTHING", 0, "holds")] {
        let graph = with_low_pass(&dir, broken);
        let ran = selftest(&format!("{graph} --case teleport --json")).ends(code, &[]);
        let all: serde_json::Value = serde_json::from_str(&ran.out).expect("JSON");
        let case = &all["cases"][0];
        assert_eq!((&all["verdict"], &case["verdict"]), (&verdict.into(), &verdict.into()));
        assert!(case["case"] == "teleport" && case["must"].as_str().unwrap().contains("finite"), "{case}");
        let found = case["found"].as_str().unwrap();
        assert_eq!(found.contains("1 faults"), broken == "WRITES_NAN", "{found}");
    }
}

#[test]
fn unknown_names_are_refused_before_any_case_runs() {
    for (line, said) in [
        ("--case teleprot", "did you mean `teleport`?"),
        ("--family motoin", "did you mean `motion`?"),
        ("no_such.ron", "no_such.ron"),
        ("graphs/texture.ron --set gate.speed_mm_s=-1", "speed_mm_s"),
        ("--plugin no_such_plugin", "no_such_plugin"),
    ] {
        let ran = selftest(line).refused(said);
        assert_eq!(ran.out, "", "{line}");
    }
}

#[test]
fn graphs_that_a_case_cannot_look_at_are_told_of() {
    let ran = selftest("--family motion").ok().says(&[" more look at a graph"]);
    assert!(!ran.out.contains("teleport"), "{}", ran.out);
    // One that is asked for says so itself.
    selftest("--case teleport").ok().says(&["not applicable  no graph was given"]);
    selftest("graphs/scenes/side_by_side.ron --case teleport").ok().says(&["holds"]);
    let dir = Room::new();
    dir.write(
        "still.ron",
        r#"Graph(version: 1, nodes: {"s": (kind: "sine"), "p": (kind: "probe")}, wires: [("s", "p")])"#,
    );
    selftest(&format!("{} --case teleport", dir.join("still.ron").display()))
        .ok()
        .says(&["not applicable  nothing in this graph moves a stylus"]);
}
