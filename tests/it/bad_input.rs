//! Whatever is wrong with the input: file, line and column, what was found, what would fit, exit code 2, and
//! nothing left behind.

use harness::{Room, shipped_graph};

/// Edits of the shipped graph, each `old => new` on a line, and what the error says, split at `|`. It points
/// at the `^` of the edits.
type Case = (&'static str, &'static str);

const SPELLING: &[Case] = &[
    (r#""overlap_add" => ^"overlapp_add""#, "no node kind `overlapp_add`|did you mean `overlap_add`?"),
    ("cutoff_hz: 20.0 => ^cutof_hz: 20.0", "no parameter `cutof_hz`|did you mean `cutoff_hz`?"),
    (r#""motion.speed" => ^"motion.sped""#, "no output `sped`|did you mean `speed`?"),
    (r#""motion.speed" => ^"moton.speed""#, "no node `moton`|did you mean `motion`?"),
    (r#""motion.speed" => ^"motion""#, "has 4 outputs; name one|`motion.speed`"),
    ("zigzag.csv => zigzac.csv", "cannot find the file|did you mean `zigzag.csv`?"),
    (r#""canvas" => ^"canvs""#, "did you mean `canvas`?"),
];

const VALUES: &[Case] = &[
    ("cutoff_hz: 20.0 => cutoff_hz: ^-1.0", "-1 Hz is out of range|from 0 to 1000 Hz"),
    ("cutoff_hz: 20.0 => cutoff_hz: ^1e50", "out of range"),
    ("tick_hz: 500 => tick_hz: ^5", "5 Hz is out of range|from 100 to 4000 Hz"),
    ("cutoff_hz: 20.0 => cutoff_hz: ^400.0", "below 250 Hz"),
    ("cutoff_hz: 20.0 => cutoff_hz: ^NaN", "not a finite number"),
    ("cutoff_hz: 20.0 => cutoff_hz: ^inf", "not a finite number"),
    ("cutoff_hz: 20.0 => cutoff_hz: ^-inf", "not a finite number"),
    ("cutoff_hz: 20.0 => cutoff_hz: ^1e400", "not a finite number"),
    (r#"cutoff_hz: 20.0 => cutoff_hz: ^"20""#, r#"expected a number, found the text "20""#),
    (r#""floor": (kind: "virtual_floor" => "floor": (kind: ^7"#, "expected a text in quotes"),
    ("cutoff_hz: 20.0 => cutoff_hz: 20.0, ^cutoff_hz: 30.0", "`cutoff_hz` is given twice|the first"),
    (
        r#""phase": (kind: "spsi"), => "phase": (kind: "spsi"), ^"phase": (kind: "gain"),"#,
        "`phase` is given twice",
    ),
    ("synthesis_hz: 2500 => synthesis_hz: ^2503", "not a whole number of samples at 2503 Hz"),
    (
        "cutoff_hz: 20.0 => cutof_hz: 20.0\n\"spsi\" => \"spsy\"",
        "no parameter `cutof_hz`|no node kind `spsy`|2 errors",
    ),
];

const WIRES: &[Case] = &[
    // Units: what goes between is named.
    (
        r#"("gate.out", "inverse") => ("gate.out", ^"limiter")
        ("inverse", "limiter"), => "#,
        "m/s^2|`limiter.in` takes Audio|A or V|`actuator_inverse`",
    ),
    (
        r#"("phase", "synthesis") => ("texture", ^"synthesis")
        ("texture", "phase"), => "#,
        "carries Magnitude of 101 bins|takes Spectrum|nodes that fit between: `|`spsi`",
    ),
    // Rates: straight from 2500 Hz into the sound card's rate.
    (
        r#"("synthesis", "audio rate") => ("synthesis", "gate.in")
        ("audio rate", "gate.in"), =>
        ("limiter", "out") => ("limiter", ^"out")"#,
        "Audio at 2500 Hz|takes Audio at 48000 Hz|`resample`",
    ),
    (
        r#"("motion.velocity", "history.velocity") => ("motion.speed", ^"history.velocity")"#,
        "`motion.speed` carries Control x1|takes Control x2",
    ),
    // Nothing but a limiter reaches a device.
    (
        r#"("inverse", "limiter") => ("inverse", ^"out")
        ("limiter", "out"), => "#,
        "takes only the output of a limiter|put a `limiter` last",
    ),
    (
        r#""phase": (kind: "spsi"), => "phase": (kind: "spsi"), "a": (kind: "mix"), "b": (kind: "gain"),
        ("phase", "synthesis") => ("phase", "synthesis"), ("b", "a.in2"), ("a", "b"), ("a", "audio rate")
        ("synthesis", "audio rate") => ("synthesis", "a.in1")"#,
        "wait for each other|a -> b -> a|put a `delay` into the cycle",
    ),
    (
        r#"("phase", "synthesis") => ("phase", "synthesis"), ("phase", ^"synthesis.spectrum")"#,
        "two wires end at `synthesis.spectrum`|`mix`",
    ),
    (
        r#"("motion.speed", "gate.speed"), =>
        "gate": => ^"gate":"#,
        "`gate.speed` is required|Control x1 [mm/s]",
    ),
];

/// Renders a graph that is wrong, with `^` where the error must point. Old files stay, and no new ones come.
fn refused(graph: &str, says: &str) {
    let dir = Room::new();
    dir.write("g.ron", graph.replace('^', ""));
    dir.write("o.wav", "precious");
    let ran = dir.run("render g.ron --out o.wav --report r.json --plot p.svg").refused("");
    ran.says(&says.split('|').collect::<Vec<_>>());
    if let Some((before, _)) = graph.split_once('^') {
        let (line, column) = position(before);
        dir.run("check g.ron").refused(&format!("g.ron:{line}:{column}: error: "));
    }
    assert_eq!((dir.files(), dir.text("o.wav")), (vec!["g.ron".into(), "o.wav".into()], "precious".into()));
}

/// Line and column behind a text.
fn position(before: &str) -> (usize, usize) {
    (before.matches('\n').count() + 1, before.rsplit('\n').next().unwrap().chars().count() + 1)
}

fn all_refused(cases: &[Case]) {
    for (edits, says) in cases {
        let edited = edits.lines().fold(shipped_graph(), |graph, edit| {
            let (old, new) = edit.split_once("=>").expect("an edit");
            assert!(graph.contains(old.trim()), "`{old}` stands in the shipped graph");
            graph.replace(old.trim(), new.trim())
        });
        refused(&edited, says);
    }
}

#[test]
fn the_shipped_graph_is_right() {
    let dir = Room::new();
    dir.write("g.ron", shipped_graph());
    dir.run("check g.ron").ok();
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
    all_refused(&[("tick_hz: 500, => tick_hz 500,", "g.ron:|not valid RON")]);
    refused("", "g.ron:1:1|not valid RON");
    refused("Graph(version: ^2, nodes: {})", "unknown version");
    refused("Graph(version: 1, nodes: {})", "no sink");
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
        let dir = Room::new();
        dir.write("t.csv", format!("{head}{rows}0.006,0.3,0,-1\n"));
        dir.run("render graphs/heravi2024.ron --input t.csv --out o.wav")
            .refused(&format!("t.csv:{at}"))
            .says(&[says]);
        assert_eq!(dir.files(), ["t.csv"]);
    }
}

#[test]
fn a_model_that_is_none_is_refused() {
    // From a graph file, the place that names the model is shown.
    let graph = shipped_graph();
    let quote = graph.find("model:").expect("a model") + "model: ".len();
    let (line, column) = position(&graph[..quote]);
    let end = quote + 1 + graph[quote + 1..].find('"').expect("its end");
    for (name, bytes) in
        [("json.onnx", b"{\"a\": 1}".to_vec()), ("empty.onnx", vec![]), ("noise.onnx", (0..=255).collect())]
    {
        let dir = Room::new();
        dir.write(name, bytes);
        dir.run(&format!("render graphs/heravi2024.ron --set texture.model={name} --out o.wav"))
            .refused(name);
        assert_eq!(dir.files(), [name]);
        dir.write("g.ron", format!("{}\"{name}{}", &graph[..quote], &graph[end..]));
        dir.run("check g.ron")
            .refused(&format!("read by `texture` at g.ron:{line}:{column}"))
            .says(&["^^^", "model:"]);
    }
}

#[test]
fn what_stands_on_the_command_line_is_checked_too() {
    let dir = Room::new();
    for (args, says) in [
        ("--set motion.cutoff_hz=-3", "-3 Hz is out of range"),
        ("--set motion.cutof=3", "did you mean `cutoff_hz` or `cutoff_hz_per_mm_s`?"),
        ("--set moton.cutoff_hz=3", "did you mean `motion`?"),
        ("--set motion.cutoff_hz", "no `=`"),
        ("--set tick_hx=500", "did you mean `tick_hz`?"),
        ("--seconds -1", "out of range"),
        ("--seconds NaN", "out of range"),
        ("--probe motion.speed=x.txt", ".csv, .npy"),
        ("--probe motion.sped=x.csv", "did you mean `speed`?"),
        ("--probe nobody.speed=x.csv", "no node `nobody`"),
        ("--probe motion.speed=a.npy --probe motion.velocity=a.npy", "would write the same file as"),
        ("--input nowhere.csv", "cannot find the file"),
        ("--set audio_hz=192000 --seconds 5700", "a WAV file cannot hold 4377600000 bytes"),
    ] {
        dir.run(&format!("render graphs/heravi2024.ron --out o.wav {args}")).refused(says);
        assert!(dir.files().is_empty(), "{args}");
    }
    for (args, says) in [
        ("--out o.mp3", ".wav or .npy"),
        ("--out nowhere/o.wav", "nowhere/o.wav: error: the folder nowhere does not exist"),
        ("--out a.npy --probe motion.speed=a.npy", "would write the same file as"),
    ] {
        dir.run(&format!("render graphs/heravi2024.ron {args}")).refused(says);
        assert!(dir.files().is_empty(), "{args}");
    }
}
