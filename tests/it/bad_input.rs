//! Whatever is wrong with the input: file, line and column, what was found, what would fit, exit code 2, and
//! nothing left behind.

use harness::{files, graphs, run, shipped_graph};

/// A graph that is right, in which one thing is then made wrong.
fn good() -> String {
    shipped_graph()
}

/// Renders a graph that is wrong. `place` is where the error must point: the text under the caret begins
/// there.
fn refused(graph: &str, place: Option<&str>, says: &[&str]) {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("g.ron"), graph).unwrap();
    let ran =
        run(dir.path(), &["render", "g.ron", "--out", "o.wav", "--report", "r.json", "--plot", "p.svg"]);
    assert_eq!(ran.code, 2, "{}{}", ran.out, ran.err);
    if let Some(place) = place {
        let at = graph.find(place).unwrap_or_else(|| panic!("{place} is not in the graph"));
        let line = graph[..at].matches('\n').count() + 1;
        let column = graph[..at].rsplit('\n').next().unwrap().chars().count() + 1;
        let wanted = format!("g.ron:{line}:{column}: error: ");
        assert!(ran.err.contains(&wanted), "expected {wanted} in:\n{}", ran.err);
    }
    for text in says {
        assert!(ran.err.contains(text), "expected `{text}` in:\n{}", ran.err);
    }
    assert!(!ran.err.contains("panicked"), "{}", ran.err);
    assert_eq!(files(dir.path()), ["g.ron"], "nothing may be left behind");
}

/// Replaces the one occurrence of a text.
fn with(old: &str, new: &str) -> String {
    let graph = good();
    assert_eq!(graph.matches(old).count(), 1, "`{old}` must stand in the shipped graph once");
    graph.replace(old, new)
}

#[test]
fn the_shipped_graph_is_right() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("g.ron"), good()).unwrap();
    run(dir.path(), &["check", "g.ron"]).ok();
}

/// Edits of the shipped graph, where the error must point if it has a place, and what it must say.
type Case = (&'static [(&'static str, &'static str)], Option<&'static str>, &'static [&'static str]);

const SPELLING: &[Case] = &[
    (
        &[(r#""overlap_add""#, r#""overlapp_add""#)],
        Some(r#""overlapp_add""#),
        &["no node kind `overlapp_add`", "did you mean `overlap_add`?"],
    ),
    (
        &[("cutoff_hz: 20.0", "cutof_hz: 20.0")],
        Some("cutof_hz"),
        &["`velocity` has no parameter `cutof_hz`", "did you mean `cutoff_hz`?"],
    ),
    (
        &[(r#""motion.speed""#, r#""motion.sped""#)],
        Some(r#""motion.sped""#),
        &["no output `sped`", "did you mean `speed`?"],
    ),
    (
        &[(r#""motion.speed""#, r#""moton.speed""#)],
        Some(r#""moton.speed""#),
        &["no node `moton`", "did you mean `motion`?"],
    ),
    (
        &[(r#""motion.speed""#, r#""motion""#)],
        Some(r#""motion", "gate"#),
        &["has 4 outputs; say which", "`motion.speed`"],
    ),
    (&[("zigzag.csv", "zigzac.csv")], None, &["cannot find the file", "did you mean `zigzag.csv`?"]),
    (&[(r#""canvas""#, r#""canvs""#)], Some(r#""canvs""#), &["did you mean `canvas`?"]),
];

const VALUES: &[Case] = &[
    (
        &[("cutoff_hz: 20.0", "cutoff_hz: -1.0")],
        Some("-1.0"),
        &["-1 Hz is out of range", "from 0 to 1000 Hz"],
    ),
    (&[("cutoff_hz: 20.0", "cutoff_hz: 1e50")], Some("1e50"), &["out of range"]),
    (&[("tick_hz: 500", "tick_hz: 5")], Some("5,"), &["5 Hz is out of range", "from 100 to 4000 Hz"]),
    (&[("cutoff_hz: 20.0", "cutoff_hz: 400.0")], Some("400.0"), &["below 250 Hz"]),
    (&[("cutoff_hz: 20.0", "cutoff_hz: NaN")], Some("NaN"), &["not a finite number"]),
    (&[("cutoff_hz: 20.0", "cutoff_hz: inf")], Some("inf"), &["not a finite number"]),
    (&[("cutoff_hz: 20.0", "cutoff_hz: -inf")], Some("-inf"), &["not a finite number"]),
    (&[("cutoff_hz: 20.0", "cutoff_hz: 1e400")], Some("1e400"), &["not a finite number"]),
    (
        &[("cutoff_hz: 20.0", r#"cutoff_hz: "20""#)],
        Some(r#""20""#),
        &[r#"expected a number, found the text "20""#],
    ),
    (
        &[(r#""floor": (kind: "virtual_floor""#, r#""floor": (kind: 7"#)],
        Some("7"),
        &["expected a text in quotes"],
    ),
    (
        &[("cutoff_hz: 20.0", "cutoff_hz: 20.0, cutoff_hz: 30.0")],
        Some("cutoff_hz: 30.0"),
        &["`cutoff_hz` stands here twice", "the first"],
    ),
    (
        &[(
            r#""phase": (kind: "spsi"),"#,
            "\"phase\": (kind: \"spsi\"),\n        \"phase\": (kind: \"gain\"),",
        )],
        Some(r#""phase": (kind: "gain")"#),
        &["`phase` stands here twice"],
    ),
    (
        &[("synthesis_hz: 2500", "synthesis_hz: 2503")],
        Some("2503"),
        &["not a whole number of samples at 2503 Hz"],
    ),
    (
        &[("cutoff_hz: 20.0", "cutof_hz: 20.0"), (r#""spsi""#, r#""spsy""#)],
        None,
        &["no parameter `cutof_hz`", "no node kind `spsy`", "2 errors"],
    ),
];

const WIRES: &[Case] = &[
    // Units: what goes between is named.
    (
        &[(r#"("gate.out", "inverse")"#, r#"("gate.out", "limiter")"#), (r#"("inverse", "limiter"),"#, "")],
        Some("\"limiter\"),\n"),
        &["m/s^2", "`limiter.in` takes Audio", "A or V", "`actuator_inverse`"],
    ),
    (
        &[(r#"("phase", "synthesis")"#, r#"("texture", "synthesis")"#), (r#"("texture", "phase"),"#, "")],
        Some("\"synthesis\"),\n"),
        &["carries Magnitude of 101 bins", "takes Spectrum", "what goes between: `", "`spsi`"],
    ),
    // Rates: straight from 2500 Hz into the sound card's rate.
    (
        &[
            (r#"("synthesis", "audio rate")"#, r#"("synthesis", "gate.in")"#),
            (r#"("audio rate", "gate.in"),"#, ""),
        ],
        Some("\"out\"),\n    ],"),
        &["Audio at 2500 Hz", "takes Audio at 48000 Hz", "`resample`"],
    ),
    (
        &[(r#"("motion.velocity", "history.velocity")"#, r#"("motion.speed", "history.velocity")"#)],
        Some(r#""history.velocity""#),
        &["`motion.speed` carries Control x1", "takes Control x2"],
    ),
    // Nothing but a limiter reaches a device.
    (
        &[(r#"("inverse", "limiter")"#, r#"("inverse", "out")"#), (r#"("limiter", "out"),"#, "")],
        Some("\"out\"),\n"),
        &["takes only what a limiter lets through", "put a `limiter` last"],
    ),
    (
        &[
            (
                r#""phase": (kind: "spsi"),"#,
                r#""phase": (kind: "spsi"), "a": (kind: "mix"), "b": (kind: "gain"),"#,
            ),
            (
                r#"("synthesis", "audio rate")"#,
                r#"("synthesis", "a.in1"), ("b", "a.in2"), ("a", "b"), ("a", "audio rate")"#,
            ),
        ],
        None,
        &["wait for each other", "a -> b -> a", "put a `delay` into the cycle"],
    ),
    (
        &[(r#"("phase", "synthesis")"#, r#"("phase", "synthesis"), ("phase", "synthesis.spectrum")"#)],
        Some(r#""synthesis.spectrum""#),
        &["two wires end at `synthesis.spectrum`", "`mix`"],
    ),
    (
        &[(r#"("motion.speed", "gate.speed"),"#, "")],
        Some(r#""gate": (kind"#),
        &["nothing is wired to `gate.speed`", "Control x1 [mm/s]"],
    ),
];

fn all_refused(cases: &[Case]) {
    for (edits, place, says) in cases {
        let ((old, new), rest) = (edits[0], &edits[1..]);
        let graph = rest.iter().fold(with(old, new), |graph, (old, new)| graph.replace(old, new));
        refused(&graph, *place, says);
    }
}

#[test]
fn misspelt_name_is_refused_with_the_nearest() {
    all_refused(SPELLING);
}

#[test]
fn wrong_value_is_refused_with_what_would_fit() {
    all_refused(VALUES);
}

#[test]
fn wrong_wire_is_refused_with_what_would_fit() {
    all_refused(WIRES);
}

#[test]
fn syntax_errors_say_where() {
    refused(&with("tick_hz: 500,", "tick_hz 500,"), None, &["g.ron:", "not valid RON"]);
    refused("", None, &["g.ron:1:1", "not valid RON"]);
    refused("Graph(version: 2, nodes: {})", Some("2"), &["unknown version"]);
    refused("Graph(version: 1, nodes: {})", None, &["no sink"]);
}

#[test]
fn a_bad_trajectory_points_into_the_csv() {
    let head = "t_s,x_mm,y_mm,z_mm\n0.0,0,0,-1\n0.002,0.1,0,-1\n";
    for (rows, at, says) in [
        ("0.001,0.2,0,-1\n", "4:1", "clock"),
        ("5.0,0.2,0,-1\n5.002,0.2,0,-1\n#", "4:1", "gap"),
        ("0.004,NaN,0,-1\n", "4:7", "finite"),
        ("0.004,zwei,0,-1\n", "4:7", "number"),
        ("0.004,0.2,0\n", "4:", "a row of 3 cells"),
    ] {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("t.csv"), format!("{head}{rows}0.006,0.3,0,-1\n")).unwrap();
        let graph = graphs("heravi2024.ron");
        let ran = run(dir.path(), &["render", graph.to_str().unwrap(), "--input", "t.csv", "--out", "o.wav"]);
        assert_eq!(ran.code, 2, "{rows}: {}{}", ran.out, ran.err);
        assert!(ran.err.contains(&format!("t.csv:{at}")), "{rows}: {}", ran.err);
        assert!(ran.err.contains(says), "{rows}: {}", ran.err);
        assert_eq!(files(dir.path()), ["t.csv"]);
    }
}

#[test]
fn a_model_that_is_none_is_refused() {
    for (name, bytes) in
        [("json.onnx", b"{\"a\": 1}".to_vec()), ("empty.onnx", vec![]), ("noise.onnx", (0..=255).collect())]
    {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join(name), bytes).unwrap();
        let graph = graphs("heravi2024.ron");
        let set = format!("texture.model={name}");
        let ran = run(dir.path(), &["render", graph.to_str().unwrap(), "--set", &set, "--out", "o.wav"]);
        assert_eq!(ran.code, 2, "{}{}", ran.out, ran.err);
        assert!(ran.err.contains(name) && !ran.err.contains("panicked"), "{}", ran.err);
        assert_eq!(files(dir.path()), [name]);
        // From a graph file, the place that names the model is shown.
        let g = with("models/surfaces/texture_mean.onnx", "MODEL");
        let at = g.find("MODEL").unwrap();
        let quote = g[..at].rfind('"').unwrap();
        let g = format!("{}\"{name}\"{}", &g[..quote], &g[at + "MODEL\"".len()..]);
        std::fs::write(dir.path().join("g.ron"), &g).unwrap();
        let ran = run(dir.path(), &["check", "g.ron"]);
        let line = g[..quote].matches('\n').count() + 1;
        let column = quote - g[..quote].rfind('\n').unwrap();
        assert!(ran.err.contains(&format!("read by `texture` at g.ron:{line}:{column}")), "{}", ran.err);
        assert!(ran.err.contains("^^^") && ran.err.contains("model:"), "{}", ran.err);
    }
}

#[test]
fn what_stands_on_the_command_line_is_checked_too() {
    let dir = tempfile::tempdir().unwrap();
    let graph = graphs("heravi2024.ron");
    let graph = graph.to_str().unwrap();
    for (args, says) in [
        (vec!["--set", "motion.cutoff_hz=-3"], "-3 Hz is out of range"),
        (vec!["--set", "motion.cutof=3"], "did you mean `cutoff_hz`?"),
        (vec!["--set", "moton.cutoff_hz=3"], "did you mean `motion`?"),
        (vec!["--set", "motion.cutoff_hz"], "no `=`"),
        (vec!["--set", "tick_hx=500"], "did you mean `tick_hz`?"),
        (vec!["--seconds", "-1"], "out of range"),
        (vec!["--seconds", "NaN"], "out of range"),
        (vec!["--probe", "motion.speed=x.txt"], ".csv or .npy"),
        (vec!["--probe", "motion.sped=x.csv"], "did you mean `speed`?"),
        (vec!["--probe", "nobody.speed=x.csv"], "no node `nobody`"),
        (vec!["--input", "nowhere.csv"], "cannot find the file"),
    ] {
        let mut all = vec!["render", graph, "--out", "o.wav"];
        all.extend(&args);
        let ran = run(dir.path(), &all);
        assert_eq!(ran.code, 2, "{args:?}: {}{}", ran.out, ran.err);
        assert!(ran.err.contains(says), "{args:?}: expected `{says}` in {}", ran.err);
        assert!(files(dir.path()).is_empty(), "{args:?}");
    }
    run(dir.path(), &["render", graph, "--out", "o.mp3"]).refused(".wav or .npy");
    run(dir.path(), &["render", graph, "--out", "nowhere/o.wav"])
        .refused("nowhere/o.wav: error: cannot write here");
    assert!(files(dir.path()).is_empty());
}
