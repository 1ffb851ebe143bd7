//! Which nodes of a running graph stay when it is changed, and which do not.

use std::sync::Arc;

use asperity_diagnostics::Source;
use asperity_engine::{Change, SwapReport};
use asperity_graph::{Compiled, GraphFile, compile};
use asperity_node::NodeKind;
use harness::graph::of_lines;
use harness::live::largest_step;

use crate::rig::{Rig, STEEPEST, TICK, compiled, compiled_file, compiled_with};

/// Why a node is rebuilt; nothing where it is not.
fn why(report: &SwapReport, id: &str) -> Option<String> {
    match &report.nodes.iter().find(|n| n.id == id).unwrap_or_else(|| panic!("no {id}: {report}")).change {
        Change::Rebuilt { why, .. } => Some(why.clone()),
        _ => None,
    }
}

/// Runs the one graph, then the other; what was said of the swap.
fn swapped(from: Compiled, to: Compiled) -> (Rig, SwapReport) {
    let mut rig = Rig::of(from);
    rig.run(7);
    let report = rig.controller.swap(to, &[]).expect("it is sent");
    rig.run(7);
    (rig, report)
}

#[test]
fn a_node_whose_code_was_built_anew_is_rebuilt() {
    let file = of_lines("t: tone\ns: scale\nout: probe\nt -> s\ns -> out");
    let built = |build| {
        let mut registry = crate::tones::with_tones(harness::nodes::registry());
        let scale = registry.get("scale").expect("the kind").clone();
        registry.add(Arc::new(NodeKind::clone(&scale).from_plugin("a plugin".into(), build)));
        compile(&file, &registry, Default::default()).expect("it compiles")
    };
    assert!(swapped(built(1), built(1)).1.is_nothing());
    let (_, report) = swapped(built(1), built(2));
    assert_eq!(why(&report, "s").as_deref(), Some("its code was built anew"));
    assert_eq!(why(&report, "t"), None);
}

#[test]
fn a_node_is_rebuilt_if_what_it_was_prepared_with_changed() {
    let tone = "t: tone\nv: level\nd: delay(delay_ms: 4.0)\nout: probe\n";
    let cases = [
        // Said in the graph, or left to the default: a node may ask.
        (
            "t: tone\nout: probe\nt -> out",
            "t: tone(level: 1.0)\nout: probe\nt -> out",
            "t",
            "`level` changed",
        ),
        (
            "t: tone\nv: level\ng: gain\nout: probe\nt -> g\ng -> out",
            "t: tone\nv: level\ng: gain\nout: probe\nv -> g\ng -> out",
            "g",
            "its ports have other types",
        ),
        (
            "c: counter\nout: probe\nc.samples -> out",
            "c: counter\nout: probe\np: probe\nc.samples -> out\nc.tick -> p",
            "c",
            "other ports of it are connected",
        ),
        (
            &format!("{tone}m: mix\nt -> m.in1\nd -> m.in2\nm -> d\nm -> out"),
            &format!("{tone}m: mix\nt -> m.in1\nt -> m.in2\nm -> d\nd -> out"),
            "d",
            "it stands otherwise in a cycle",
        ),
    ];
    for (from, to, id, expected) in cases {
        let (_, report) = swapped(compiled(from), compiled(to));
        assert_eq!(why(&report, id).as_deref(), Some(expected), "{report}");
    }
}

/// Another seed or rate rebuilds every node. Another folder of the graph file rebuilds nodes that name files.
#[test]
fn seed_or_pace_rebuilds_all_and_folder_only_file_nodes() {
    let text = |head: &str, every: u32, path: &str| {
        let nodes = format!(
            "\"v\": (kind: \"level\", params: (value: 3.0)), \"g\": (kind: \"gain\", every: {every}), \
             \"out\": (kind: \"probe\", params: (file: \"a.npy\"))"
        );
        let text = format!(
            "Graph(version: 1, {head} nodes: {{{nodes}}}, wires: [(\"v\", \"g\"), (\"g\", \"out\")])"
        );
        compiled_file(&GraphFile::parse(&Source::new(path, text)).expect("a graph"))
    };
    let report = |to| swapped(text("", 2, "a/x.ron"), to).1;
    assert!(report(text("", 2, "a/x.ron")).is_nothing());
    let mut rig = Rig::of(text("", 20, "a/x.ron"));
    rig.run(7);
    rig.controller.swap(text("", 30, "a/x.ron"), &[]).expect("it is sent");
    for tick in 7..70 {
        rig.tick();
        assert_eq!(rig.control("g"), 3.0, "tick {tick}: a control holds until its node runs");
    }
    assert_eq!(why(&report(text("", 4, "a/x.ron")), "g").as_deref(), Some("it runs more or less often"));
    assert_eq!(
        why(&report(text("seed: 7,", 2, "a/x.ron")), "v").as_deref(),
        Some("the graph has another seed")
    );
    let moved = report(text("", 2, "b/x.ron"));
    assert_eq!((why(&moved, "g"), why(&moved, "out").as_deref()), (None, Some("`file` changed")));
}

/// The kept node ends its crossfade at the other output of the same node.
#[test]
fn kept_node_reading_another_output_ends_at_it() {
    let with = |output| {
        format!(
            "c: counter\nw: waker\ng: gain(unit: \"N\")\np: probe\nout: probe\nq: probe\nc.tick -> \
             p\nc.calls -> q\nc.{output} -> g\ng -> w\nw -> out"
        )
    };
    let (rig, report) = swapped(compiled(&with("tick")), compiled(&with("calls")));
    assert_eq!((report.crossfades, why(&report, "g")), (1, None), "{report}");
    assert_eq!(rig.control("w"), 14.0, "calls, not the tick");
}

#[test]
fn state_is_not_handed_on_when_ports_differ() {
    let nodes = "t: tone\nv: level\ng: gain\nout: probe\n";
    let (mut rig, _) =
        swapped(compiled(&format!("{nodes}t -> g\ng -> out")), compiled(&format!("{nodes}v -> g\ng -> out")));
    assert_eq!(rig.controller.collect()[0].anew, ["g", "out"]);
}

#[test]
fn who_reads_a_sink_hears_what_its_host_hears() {
    let with = |volts| {
        format!(
            "t: tone\na: amps\nout: audio_out(volts_at_full_scale: {volts:?})\nf: file_out(file: \
             \"x.wav\")\nt -> a\na -> out\nout.samples -> f"
        )
    };
    let (mut rig, _) = Rig::swapped(&with(1.0), 7, &with(4.0));
    for _ in 0..7 {
        rig.tick();
        assert_eq!(rig.last(), &rig.samples("f")[..TICK]);
    }
}

#[test]
fn a_fade_keeps_awake_what_it_hears_and_nothing_else() {
    // `a` is heard until the new gate has faded it out; `t` serves an old gate that is closed.
    let gate = "test_gate(close: 0, open: 100)";
    let head = format!("t: tone\ng: {gate}\na: tracked\nout: file_out(file: \"x.wav\")\nt -> g\ng -> a\n");
    let (rig, _) = swapped(
        compiled(&format!("{head}a -> out")),
        compiled(&format!("{head}h: {gate}\na -> h\nh -> out")),
    );
    assert_eq!((rig.calls("t"), rig.calls("a")), (0, 12));
}

#[test]
fn an_old_node_sleeps_on_behind_gates_that_are_gone() {
    let gate = "test_gate(close: 0, open: 100)";
    let head = |version| {
        format!(
            "t: tone\na: tracked(version: {version})\nh: {gate}\nout: file_out(file: \"x.wav\")\nt -> a\na \
             -> h\nh -> out\n"
        )
    };
    let from = format!("{}g: {gate}\nother: file_out(file: \"y.wav\")\na -> g\ng -> other", head(1));
    let before = crate::tones::tracked_calls();
    swapped(compiled(&from), compiled(&head(2)));
    assert_eq!(crate::tones::tracked_calls() - before, 0);
}

#[test]
fn a_gate_opens_in_its_tick_also_while_something_else_fades() {
    let with = |by| {
        format!(
            "t: tone\na: tracked\nh: test_gate(close: 0, open: 12)\nout: file_out(file: \"x.wav\")\nu: tone\n\
                 s: scale(by: {by:?})\nother: file_out(file: \"y.wav\")\nt -> a\na -> h\nh -> out\nu -> \
                 s\ns -> other"
        )
    };
    let (mut rig, _) = Rig::swapped(&with(1.0), 10, &with(2.0));
    rig.run(4);
    assert_eq!((rig.engine.is_fading(), rig.calls("a")), (true, 2));
}

#[test]
fn a_node_that_slept_is_told_how_long_although_it_was_rebuilt() {
    let lines = "t: tone\nm: memory_elapsed\ng: test_gate(close: 3, \
                 open: 40)\nout: file_out(file: \"x.wav\")\nt -> m\nm -> g\ng -> out";
    let mut rig = Rig::new(lines);
    rig.run(10);
    rig.controller.swap(compiled(lines), &["m".to_owned()]).expect("it is sent");
    rig.run(31);
    assert_eq!(rig.last()[0], 37.0 * 1000.0 + 1.0);
}

#[test]
fn gate_rebuilt_between_two_questions_holds_its_answer() {
    let lines = "t: taps\ng: shut\nq: gain\nout: probe\nt -> g\ng -> q\nq -> out";
    let text = || compiled_with(lines, &["g.every=3"]);
    let mut rig = Rig::of(text());
    rig.run(10);
    rig.controller.swap(text(), &["g".to_owned()]).expect("it is sent");
    rig.run(1);
    assert_eq!(rig.calls("t"), 0);
}

#[test]
fn a_node_in_quarantine_hands_nothing_on() {
    let with = |from| format!("t: taps(fails_from: {from})\nout: probe\nt -> out");
    let (mut rig, _) = Rig::swapped(&with(3), 20, &with(1000));
    rig.run(10);
    assert_eq!(rig.control("t"), 10.0, "it may have left anything behind");
    assert_eq!(rig.controller.collect()[0].anew, ["t"]);
    // One that fails at once holds what the one before it put out last.
    rig.swap(&with(30));
    rig.run(3);
    assert_eq!((rig.control("t"), rig.engine.faults()), (10.0, 8 + 3));
}

#[test]
fn live_parameter_wakes_a_node_and_swap_calls_sleeper_once() {
    let lines = "v: live_level(value: 2.0)\nw: waker\nout: probe\nv -> w\nw -> out";
    let mut rig = Rig::new(lines);
    rig.run(5);
    assert_eq!((rig.calls("v"), rig.calls("w")), (1, 1));
    rig.controller.set_parameter("v", "value", 7.0).expect("it is live");
    rig.run(5);
    assert_eq!((rig.calls("v"), rig.calls("w"), rig.control("w")), (2, 2, 7.0));
    rig.controller.set_parameter("v", "value", 2.0).expect("it is live");
    rig.run(5);
    rig.controller.swap(compiled(lines), &["v".to_owned()]).expect("it is sent");
    rig.run(20);
    assert_eq!(
        (rig.calls("w"), rig.control("w")),
        (4, 2.0),
        "what has another source and the same value is not news"
    );
}

#[test]
fn marks_pass_a_crossfade_as_the_new_signal_has_them() {
    let with = |control, wave| {
        format!(
            "f: faulty\nk: faulty(to: 1000, how: \"nan control\")\nc: mix\nv: marked\nw: marked\na: mix\n\
                 p: probe\nq: probe\nr: probe\ns: probe\nt: probe\nf.audio -> v.in\nf.audio -> \
                 w.in\nf.control -> v.control\n\
                 k.control -> w.control\n{control}.control -> c.in1\n{wave} -> a.in1\nc -> p\na -> q\n\
                 f.control -> r\nk.control -> s\nv -> t\nz: probe\nw -> z\no: probe\nk.audio -> o"
        )
    };
    let mut rig = Rig::new(&with("f", "v"));
    rig.run(3);
    let valid = |rig: &Rig, id| rig.engine.output(rig.node(id), 0).expect("an output").is_valid();
    for (sources, trusted) in [(("k", "w"), false), (("f", "v"), true)] {
        let report = rig.swap(&with(sources.0, sources.1));
        assert_eq!((report.crossfades, why(&report, "c"), why(&report, "a")), (2, None, None), "{report}");
        for _ in 0..8 {
            rig.run(1);
            assert_eq!((valid(&rig, "c"), valid(&rig, "a")), (trusted, trusted));
        }
    }
}

#[test]
fn a_tail_is_counted_from_the_end_of_the_fade() {
    let head = "f: faulty\nt: tail3\nout: file_out(file: \"x.wav\")\nt -> out\n";
    let gate = "g: test_gate(close: 0, open: 100)\nf.audio -> g\ng -> t";
    let (mut rig, _) = swapped(compiled(&format!("{head}f.audio -> t")), compiled(&format!("{head}{gate}")));
    rig.run(20);
    assert_eq!(rig.calls("t"), 7 + 5 + 3);
}

#[test]
fn no_step_enters_a_delay_that_goes_on_or_begins_anew() {
    let step = |from: &str, to: &str, ticks: usize| {
        let (mut rig, _) = Rig::swapped(from, 20, to);
        rig.run(ticks);
        let anew = rig.controller.collect().into_iter().flat_map(|f| f.anew).any(|id| id == "d");
        assert_eq!(anew, to.contains("late"), "a node that hands nothing on is told to have begun anew");
        let heard = &rig.heard[20 * TICK - 1..];
        (largest_step(heard), heard.iter().copied().fold(1.0, f32::min))
    };
    let level = |hz, level, node| {
        format!("t: tone(hz: {hz:?}, level: {level:?})\nd: {node}\nout: probe\nt -> d\nd -> out")
    };
    let delay = |ms: f64| level(0.0, 1.0, format!("delay(delay_ms: {ms:?})"));
    let (went, least) = step(&delay(3.0), &delay(2.0), 40);
    assert!(went < 1e-6 && least > 0.999, "what is adopted is not faded in: {went}, {least}");
    let other = delay(2.0).replace("level: 1.0", "level: 0.5");
    let (went, least) = step(&delay(3.0), &other, 40);
    assert!(
        went < STEEPEST && least > 0.499,
        "another source is faded to, not from silence: {went}, {least}"
    );
    let late = |value, version| level(0.0, value, format!("late(version: {version})"));
    let (went, least) = step(&late(1.0, 1), &late(1.0, 2), 40);
    assert!(went < 1.1 * STEEPEST && least < 0.1, "what forgets fades out and in: {went}, {least}");
    let (went, _) = step(&late(1.0, 1), &late(0.5, 2), 40);
    assert!(went < 1.1 * STEEPEST, "also from another source: {went}");
}
