//! A running engine takes over another graph: nothing clicks, nothing is forgotten, nothing is left behind.

use std::sync::Arc;

use asperity_diagnostics::Source;
use asperity_engine::{Change, Finished, MAX_SWAPS, SwapError};
use asperity_graph::{GraphFile, compile};
use asperity_node::NodeKind;
use harness::counting::allocations;
use harness::graph::of_lines;
use harness::live::largest_step;

use crate::rig::{FADE, Rig, SINE, STEEPEST, TICK, apart, change, compiled, compiled_file, fresh, why};
use crate::tones::{tracked, tracked_calls};

#[test]
fn a_gain_changed_under_a_sine_fades_in_10_ms_without_a_click() {
    let with = |gain| format!("t: tone; g: scale(by: {gain:?}); out: probe; t -> g -> out");
    let (mut rig, report) = Rig::swapped(&with(1.0), 10, &with(-0.5));
    assert_eq!(report.to_string(), "`g` rebuilt (`by` changed), 2 nodes kept");
    assert_eq!(report.crossfades, 1);
    rig.run(1);
    assert_eq!((rig.engine.swaps(), rig.engine.is_fading()), (1, true));
    rig.run(9);
    let at = 10 * TICK;
    rig.is_smooth(0, 1.1 * SINE);
    let tone: Vec<f32> = (0..20 * TICK).map(|n| (n as f32 * 0.013_089_97).cos()).collect();
    let gain = |n: usize| rig.heard[n] / tone[n];
    assert!((gain(at) - 1.0).abs() < 1e-3, "it begins where it was: {}", gain(at));
    assert!((gain(at + FADE / 2) - 0.25).abs() < 0.01, "half way: {}", gain(at + FADE / 2));
    assert!((at + FADE..20 * TICK).all(|n| (rig.heard[n] + 0.5 * tone[n]).abs() < 1e-5), "and is there");
    assert_eq!(rig.controller.collect(), [Finished { number: 1, tick: 10, anew: vec![] }]);
    assert!(!rig.engine.is_fading());
}

#[test]
fn the_same_graph_again_changes_nothing() {
    let lines = "f: faulty; s: spsi; o: overlap_add; r: resample; d: delay(delay_ms: 7.0); out: probe; \
                 f.frame -> s -> o -> r -> d -> out";
    let mut rig = Rig::new(lines);
    assert!(rig.run(40).swap(lines).is_nothing());
    rig.run(40);
    assert_eq!(rig.heard, fresh(lines, 80));
    assert_eq!(rig.calls("s"), 80, "counts go on");
    assert_eq!(rig.controller.collect().len(), 1);
}

/// Both are rebuilt, and the fade is at the audio of the synthesis.
#[test]
fn phase_retrieval_swapped_with_its_synthesis_fades_audio() {
    let nodes = "o: overlap_add; r: resample; out: probe; f.frame -> s -> o -> r -> out";
    let with = |seed| format!("f: faulty; s: spsi(seed: {seed}); {nodes}");
    let mut rig = Rig::new(&with(1));
    rig.run(200);
    let own = largest_step(&rig.heard[100 * TICK..]);
    for seed in 2..12 {
        let report = rig.swap(&with(seed));
        assert!(why(&report, "s").is_some() && why(&report, "o").is_some(), "{report}");
        assert_eq!((change(&report, "r"), report.crossfades), (&Change::Kept, 1), "{report}");
        rig.run(100);
    }
    let peak = rig.heard[100 * TICK..].iter().fold(0.0_f32, |m, x| m.max(x.abs()));
    rig.is_smooth(0, own + 2.0 * peak * STEEPEST);
}

#[test]
fn a_filter_goes_on_from_the_state_of_the_one_before() {
    let with = |kind, part| format!("t: tone(hz: 0.0); p: {kind}(part: {part}); out: probe; t -> p -> out");
    for (kind, keeps) in [("one_pole", true), ("forgetful", false)] {
        let (mut rig, _) = Rig::swapped(&with(kind, 0.01), 100, &with(kind, 0.0005));
        rig.run(100);
        let least = rig.heard[100 * TICK..].iter().copied().fold(1.0, f32::min);
        assert_eq!(least > 0.999, keeps, "{kind}: {least}");
        rig.is_smooth(100 * TICK, 1.1 * STEEPEST);
    }
}

#[test]
fn a_state_that_does_not_fit_is_left_and_told() {
    let with = |p| format!("t: taps({p}); out: probe; t -> out");
    let (mut rig, _) = Rig::swapped(&with("taps: 3"), 7, &with("taps: 3, fails_from: 1000"));
    assert_eq!(rig.run(10).control("t"), 17.0, "it goes on counting");
    rig.swap(&with("taps: 4"));
    assert_eq!(rig.run(10).control("t"), 10.0, "it begins anew");
    assert_eq!(rig.anew(), [vec![], vec!["t".to_owned()]]);
}

#[test]
fn nodes_are_inserted_removed_and_rewired_without_a_click() {
    let t = "t: tone; a: scale(by: 0.5); out: probe";
    let graphs = [
        format!("{t}; t -> a -> out"),
        "t: tone; out: probe; t -> out".to_owned(),
        format!("{t}; b: scale(by: -1.0); t -> a -> b -> out"),
        // The same two the other way round: each would have to run before the other while it fades.
        format!("{t}; b: scale(by: -1.0); t -> b -> a -> out"),
        format!("{t}; c: mix; t -> c.in1; a -> c.in2; t -> a; c -> out"),
        format!("{t}; c: mix; t -> c.in2; a -> c.in1; t -> a; c -> out"),
        "u: tone(hz: 70.0); c: mix; u -> c.in1; v: tone(hz: 40.0); v -> c.in2; out: probe; c -> out".into(),
    ];
    for from in &graphs {
        for to in &graphs {
            let (mut rig, _) = Rig::swapped(from, 11, to);
            rig.run(15);
            assert_eq!(rig.last(), &fresh(to, 26)[25 * TICK..], "{from}\nto\n{to}");
            // Of at most 1.5 in level, and that over half a fade's steepest.
            rig.is_smooth(0, 1.5 * SINE + 3.0 * STEEPEST);
            assert_eq!(rig.controller.collect().len(), 1);
        }
    }
}

/// A factor moves from one gain to another past a filter that stays; and a filter and a gain change places.
#[test]
fn nothing_is_heard_that_is_neither_the_old_graph_nor_the_new() {
    let moved = |a, b| {
        let gains = format!("a: scale(by: {a:?}); b: scale(by: {b:?})");
        format!("t: tone; {gains}; p: one_pole(part: 0.5); out: probe; t -> a -> p -> b -> out")
    };
    let nodes = "t: tone; a: scale(by: 1000.0); p: scale(by: 0.001); out: probe";
    for (from, to) in [
        (moved(1.0, 0.01), moved(0.01, 1.0)),
        (moved(0.01, 1.0), moved(1.0, 0.01)),
        (format!("{nodes}; t -> a -> p -> out"), format!("{nodes}; t -> p -> a -> out")),
    ] {
        let (mut rig, report) = Rig::swapped(&from, 20, &to);
        assert!(why(&report, "p").is_some() && report.crossfades == 1, "{report}");
        let worst = apart(&rig.run(20).heard, &fresh(&from, 40));
        assert!(worst < 1e-4, "the two graphs sound the same: {worst}");
    }
}

/// The control goes from the old value to the new one in steps, and its reader ends at the new one.
#[test]
fn swapped_control_steps_from_old_to_new_value() {
    for reader in ["waker", "deaf"] {
        let with = |value| format!("v: level(value: {value:?}); w: {reader}; out: probe; v -> w -> out");
        let (mut rig, _) = Rig::swapped(&with(2.0), 5, &with(12.0));
        let seen: Vec<f64> = (0..10).map(|_| rig.run(1).control("w")).collect();
        assert!(seen.windows(2).all(|w| w[1] >= w[0]), "{reader}: {seen:?}");
        assert_eq!(seen[9], 12.0, "{reader}: {seen:?}");
        if reader == "waker" {
            assert!(seen[0] > 2.0 && seen[0] < 4.0 && seen[2] > 7.0 && seen[4] == 12.0, "{seen:?}");
        }
        let calls = rig.calls("w");
        assert_eq!(rig.run(20).calls("w"), calls, "{reader} sleeps on when it has faded");
    }
}

#[test]
fn what_sleeps_behind_a_closed_gate_sleeps_on_through_a_swap() {
    let with = |gain, close| {
        format!(
            "t: tone; g: scale(by: {gain:?}); m: memory_resume; x: mix; out: file_out(file: \"x.wav\"); \
             gate: test_gate(close: {close}, open: 40); t -> g -> x.in1; t -> m -> x.in2; x -> gate -> out"
        )
    };
    let mut rig = Rig::new(&with(1.0, 3));
    let (calls, heard) = (rig.run(10).calls("m"), rig.heard.len());
    let report = rig.swap(&with(0.25, 3));
    assert!(why(&report, "g").is_some() && *change(&report, "m") == Change::Kept, "{report}");
    // The gate itself, too, with a parameter that leaves it closed.
    assert!(why(&rig.run(10).swap(&with(0.25, 2)), "gate").is_some());
    rig.run(10);
    assert_eq!((rig.calls("m"), rig.calls("g")), (calls, 0), "nobody was woken");
    assert!(rig.heard[heard..].iter().all(|x| *x == 0.0));
    rig.run(11);
    let tone = fresh("t: tone; g: scale(by: 0.25); out: probe; t -> g -> out", 41);
    let level = rig.calls("m") as f32;
    let wanted: Vec<f32> = tone[40 * TICK..].iter().map(|t| t + level).collect();
    assert!(apart(rig.last(), &wanted) < 1e-5, "and wakes as ever");
}

#[test]
fn what_a_new_gate_would_silence_is_heard_until_it_has_faded() {
    let t = "t: tone; a: scale(by: 0.5); out: file_out(file: \"x.wav\")";
    let open = format!("{t}; t -> a -> out");
    let gated = format!("{t}; gate: test_gate(close: 0, open: 100); t -> a -> gate -> out");
    let (mut rig, _) = Rig::swapped(&open, 10, &gated);
    rig.run(10).is_smooth(0, SINE);
    assert_eq!((rig.calls("t"), rig.calls("a")), (15, 15), "they run for as long as it fades, and no longer");
    assert!(rig.last().iter().all(|x| *x == 0.0));
    rig.swap(&open);
    rig.run(10).is_smooth(0, SINE);
    assert_eq!(rig.last(), &fresh(&open, 30)[29 * TICK..]);
}

/// The gate that closes under the second swap is still closing under the third, and is closed before that has
/// faded. Its successor opens again.
#[test]
fn an_old_tone_fades_under_a_new_gate_though_the_old_one_closes() {
    let gated = |hz: &str, level: &str, speed: &str, out: &str| {
        format!(
            "n0: tone(hz: {hz}, level: {level}); v: level(value: {speed}); u: gain(unit: \"mm/s\"); \
             v -> u -> g.speed; g: speed_gate; n0.out -> g.in; out: file_out(file: \"x.wav\"); {out}"
        )
    };
    let mut rig = Rig::new("n0: tone(hz: 30.0, level: 1.0); out: file_out(file: \"x.wav\"); n0.out -> out");
    rig.run(40);
    rig.swap(&gated("30.0", "1.0", "6.0", "g.out -> out"));
    rig.swap(&gated("55.0", "0.5", "0.0", "g.out -> out"));
    rig.swap(&gated("30.0", "1.0", "10.0", "s: scale(by: 1.0); g.out -> s; s -> out"));
    rig.run(60).is_smooth(30 * TICK, 0.02);
}

#[test]
fn a_live_parameter_is_set_in_the_next_tick_and_checked_before() {
    let with = |gain, fixed| {
        let gain = format!("live_gain(gain: {gain:?}, fixed: {fixed})");
        format!("t: tone(hz: 0.0); g: {gain}; out: probe; t -> g -> out")
    };
    let mut rig = Rig::new(&with(1.0, 0));
    rig.run(3);
    rig.controller.set_parameter("g", "gain", 0.25).unwrap();
    rig.controller.set_parameter("g", "sign", 1.0).unwrap();
    assert_eq!(rig.run(1).last(), [-0.25; TICK]);
    let mut set = |node, param, value| rig.controller.set_parameter(node, param, value).unwrap_err();
    assert_eq!(set("x", "gain", 1.0), "there is no node `x`");
    let live = "`g.fixed` cannot change while the node runs; what can: gain, sign";
    assert_eq!(set("g", "fixed", 1.0), live);
    assert_eq!(set("g", "gain", 2.5), "`gain` cannot be 2.5: it takes a number from 0.0 to 2.0");
    for (param, value) in [("gain", f64::NAN), ("sign", 0.5), ("sign", 2.0)] {
        assert!(set("g", param, value).contains("it takes a"));
    }
    // A graph in which only the live parameter differs keeps the node; one that agrees with what was set
    // sets nothing.
    assert_eq!(rig.swap(&with(0.25, 0)).to_string(), "`g.sign` set to 0, 3 nodes kept");
    let report = rig.swap(&with(0.75, 0));
    assert_eq!((change(&report, "g"), report.parameters[0].1), (&Change::Kept, 0.75));
    assert_eq!(rig.run(1).last(), [0.75; TICK]);
    // The built-in gain is live, and goes there in a straight line.
    let plain = "t: tone(hz: 0.0); g: gain; out: probe; t -> g -> out";
    let (mut built_in, report) = Rig::swapped(plain, 3, &plain.replace("gain", "gain(gain: -1.0)"));
    assert_eq!(report.to_string(), "`g.gain` set to -1, 3 nodes kept");
    assert_eq!(built_in.run(6).last(), [-1.0; TICK]);
    built_in.is_smooth(0, 2.1 / FADE as f32);
    // While it fades a value reaches the new node.
    assert!(why(&rig.swap(&with(0.75, 1)), "g").is_some());
    rig.run(1).controller.set_parameter("g", "gain", 0.5).unwrap();
    assert_eq!(rig.run(5).last(), [0.5; TICK]);
}

#[test]
fn a_delay_that_closes_a_cycle_keeps_what_is_on_its_way() {
    let with = |half| {
        format!(
            "f: faulty; sum: mix; half: scale(by: {half:?}); later: delay(delay_ms: 2.0); out: probe; \
             f.audio -> sum.in1; later -> sum.in2; sum -> half -> later; sum -> out"
        )
    };
    let is = |rig: &mut Rig, level: f32| {
        assert!(rig.run(40).last().iter().all(|x| (x - level).abs() < 1e-5));
        rig.is_smooth(39 * TICK, STEEPEST);
    };
    let (mut rig, report) = Rig::swapped(&with(0.5), 40, &with(0.2));
    assert!(why(&report, "half").is_some() && *change(&report, "later") == Change::Kept, "{report}");
    is(&mut rig, 1.25);
    // The delay itself, and the cycle cut.
    assert!(why(&rig.swap(&with(0.2).replace("2.0", "3.0")), "later").is_some());
    is(&mut rig, 1.25);
    rig.swap(&with(0.2).replace("later -> sum.in2;", ""));
    is(&mut rig, 1.0);
}

#[test]
fn a_sink_that_is_rebuilt_renamed_or_new_fades_too() {
    let with = |id, volts| {
        format!("t: tone; a: amps; {id}: audio_out(volts_at_full_scale: {volts:?}); t -> a -> {id}")
    };
    let (mut rig, _) = Rig::swapped(&with("other", 1.0), 10, &with("out", 1.0));
    rig.run(10);
    let renamed = apart(&rig.heard[..TICK], &fresh(&with("out", 1.0), 11)[10 * TICK..]);
    assert!(renamed < 1e-5, "a device that is renamed plays on: {renamed}");
    rig.swap(&with("out", 4.0));
    rig.run(10).is_smooth(0, SINE);
    assert_eq!(rig.last(), &fresh(&with("out", 4.0), 30)[29 * TICK..]);
    rig.swap(&format!("{}; new: file_out(file: \"x.wav\"); t -> new", with("out", 4.0)));
    let samples = rig.run(1).samples("new");
    assert!(samples[0].abs() < 1e-4 && samples[95].abs() > 0.03, "it fades in from silence: {samples:?}");
}

#[test]
fn a_node_that_runs_seldom_starts_in_a_tick_in_which_it_runs() {
    let mut rig = Rig::new("v: level(value: 3.0); out: probe; v -> out");
    rig.run(3).swap("v: level(value: 3.0); s: gain every 20; out: probe; v -> s -> out");
    for tick in 3..60 {
        rig.tick();
        assert_eq!((rig.engine.swaps(), rig.control("out")), (u64::from(tick >= 20), 3.0), "tick {tick}");
    }
    // Two that meet seldom do not wait for each other.
    rig.swap("v: level; a: gain every 23; b: gain every 29; out: probe; v -> a -> b -> out");
    assert_eq!(rig.run(1).engine.swaps(), 2);
}

#[test]
fn a_rebuilt_node_has_a_clean_record_and_a_kept_one_its_own() {
    let with = |to| {
        format!(
            "f: faulty(from: 3, to: {to}, how: error); k: faulty(from: 2, to: 4, how: error); \
             out: probe; p: probe; f.audio -> out; k.audio -> p"
        )
    };
    let mut rig = Rig::new(&with(1000));
    assert!(rig.run(20).report("f").quarantined);
    rig.swap(&with(10));
    assert_eq!(rig.run(20).last(), [1.0; TICK], "out of quarantine, and faded in");
    rig.is_smooth(20 * TICK - 1, 1.1 * STEEPEST);
    assert_eq!((rig.report("f").faults, rig.report("f").quarantined), (0, false));
    assert_eq!((rig.report("k").faults, rig.calls("k")), (2, 40));
    assert_eq!(rig.engine.faults(), 10, "those of a node that is gone still count");
}

#[test]
fn other_rates_are_refused_and_a_reset_ends_a_fade() {
    let lines = "t: tone; g: scale(by: 0.5); out: probe; t -> g -> out";
    let mut rig = Rig::new(lines);
    for (rates, wanted) in [
        ((1000, 48_000), SwapError::TickRate { running: 500, asked: 1000 }),
        ((500, 44_100), SwapError::AudioRate { running: 48_000, asked: 44_100 }),
    ] {
        let mut graph = of_lines(lines);
        (graph.tick_hz, graph.audio_hz) = rates;
        let refused = rig.controller.swap(compiled_file(&graph), &[]).unwrap_err();
        assert!(refused == wanted && refused.to_string().ends_with("start anew"), "{refused}");
    }
    let other = lines.replace("0.5", "0.75");
    rig.run(5).swap(&other);
    rig.run(2).engine.reset();
    rig.run(4);
    assert_eq!(rig.heard[7 * TICK..], fresh(&other, 4));
    assert_eq!(rig.controller.collect().len(), 1);
    drop(rig.engine);
    assert_eq!(rig.controller.swap(compiled(lines), &[]).unwrap_err(), SwapError::Stopped);
    assert!(rig.controller.set_parameter("g", "gain", 1.0).is_err());
}

#[test]
fn swaps_in_every_tick_wait_or_are_refused_without_a_leak() {
    let with = |version| {
        format!("t: tone; x: tracked(version: {version}); y: tracked; out: probe; t -> x -> y -> out")
    };
    let mut rig = Rig::new(&with(0));
    assert_eq!(tracked(), 2);
    let (mut sent, mut busy, mut over) = (0, 0, 0);
    for version in 1..=1000 {
        rig.tick();
        match rig.controller.swap(compiled(&with(version)), &[]) {
            Ok(_) => sent += 1,
            Err(SwapError::Busy) => busy += 1,
            Err(e) => panic!("{e}"),
        }
        over += rig.controller.collect().len();
        assert!(sent - over <= MAX_SWAPS);
        assert!(tracked() <= 2 * (2 + MAX_SWAPS as i64), "{}", tracked());
    }
    assert!(sent > 195 && busy > 700, "one in a fade of five ticks: {sent}, {busy}");
    rig.run(5 * MAX_SWAPS + 2);
    over += rig.controller.collect().len();
    assert_eq!((over, tracked()), (sent, 2));
    let worst = apart(&rig.heard, &fresh("t: tone; out: probe; t -> out", 1022));
    assert!(worst < 1e-6, "a node that passes on cannot be heard to be swapped: {worst}");
    drop(rig);
    assert_eq!(tracked(), 0);
}

#[test]
fn a_controller_may_be_gone_before_its_swap_is_over() {
    let with = |version| format!("t: tone; x: tracked(version: {version}); out: probe; t -> x -> out");
    let mut rig = Rig::new(&with(0));
    (1..=MAX_SWAPS).for_each(|version| _ = rig.swap(&with(version)));
    let Rig { mut controller, mut engine, .. } = rig;
    assert_eq!(controller.swap(compiled(&with(9)), &[]), Err(SwapError::Busy));
    drop(controller);
    let ((), count) = allocations(|| (0..50).for_each(|_| engine.tick()));
    assert_eq!((count, engine.swaps()), (0, MAX_SWAPS as u64));
    drop(engine);
    assert_eq!(tracked(), 0);
}

#[test]
fn a_node_is_rebuilt_if_its_code_or_what_it_reads_changed() {
    let file = of_lines("t: tone; s: scale; out: probe; t -> s -> out");
    let built = |build| {
        let mut registry = crate::tones::with_tones(harness::nodes::registry());
        let scale = registry.get("scale").expect("the kind").clone();
        registry.add(Arc::new(NodeKind::clone(&scale).from_plugin("a plugin".into(), build)));
        compile(&file, &registry, Default::default()).expect("it compiles")
    };
    let mut rig = Rig::of(built(1));
    assert!(rig.run(7).swap_to(built(1), &[]).is_nothing());
    let report = rig.run(7).swap_to(built(2), &[]);
    assert_eq!((why(&report, "s"), why(&report, "t")), (Some("its code was rebuilt"), None));
    // A host says so.
    let report = rig.run(7).swap_to(built(2), &["t"]);
    assert_eq!(report.to_string(), "`t` rebuilt (its source changed), 2 nodes kept");
    rig.run(7);
}

#[test]
fn a_node_is_rebuilt_if_what_it_was_prepared_with_changed() {
    let gain = "t: tone; v: level; g: gain; out: probe; g -> out";
    let counter = "c: counter; out: probe; c.samples -> out";
    let tone = "t: tone; v: level; d: delay(delay_ms: 4.0); out: probe; m: mix; m -> d; t -> m.in1";
    for (from, to, id, expected) in [
        // Said in the graph, or left to the default: a node may ask.
        (
            "t: tone; out: probe; t -> out".to_owned(),
            "t: tone(level: 1.0); out: probe; t -> out".to_owned(),
            "t",
            "`level` changed",
        ),
        (format!("{gain}; t -> g"), format!("{gain}; v -> g"), "g", "its ports have other types"),
        (counter.to_owned(), format!("{counter}; p: probe; c.tick -> p"), "c", "its connections changed"),
        (
            format!("{tone}; d -> m.in2; m -> out"),
            format!("{tone}; t -> m.in2; d -> out"),
            "d",
            "its place in a cycle changed",
        ),
    ] {
        let (mut rig, report) = Rig::swapped(&from, 7, &to);
        assert_eq!(why(&report, id), Some(expected), "{report}");
        // A state is not handed on when ports differ.
        let anew = rig.run(7).anew().concat();
        assert!(id != "g" || anew == ["g", "out"], "{anew:?}");
    }
}

/// Another seed or rate rebuilds every node. Another folder of the graph file rebuilds nodes that name files.
#[test]
fn seed_or_pace_rebuilds_all_and_folder_only_file_nodes() {
    let text = |head: &str, every: u32, path: &str| {
        let text = format!(
            r#"Graph(version: 1, {head} nodes: {{"v": (kind: "level", params: (value: 3.0)),
            "g": (kind: "gain", every: {every}), "out": (kind: "probe", params: (file: "a.npy"))}},
            wires: [("v", "g"), ("g", "out")])"#
        );
        compiled_file(&GraphFile::parse(&Source::new(path, text)).expect("a graph"))
    };
    let report = |to| Rig::of(text("", 2, "a/x.ron")).run(7).swap_to(to, &[]);
    assert!(report(text("", 2, "a/x.ron")).is_nothing());
    let mut rig = Rig::of(text("", 20, "a/x.ron"));
    rig.run(7).swap_to(text("", 30, "a/x.ron"), &[]);
    for tick in 7..70 {
        assert_eq!(rig.run(1).control("g"), 3.0, "tick {tick}: a control holds until its node runs");
    }
    assert_eq!(why(&report(text("", 4, "a/x.ron")), "g"), Some("it runs more or less often"));
    let seed = report(text("seed: 7,", 2, "a/x.ron"));
    assert_eq!(why(&seed, "v"), Some("the graph has another seed"));
    let moved = report(text("", 2, "b/x.ron"));
    assert_eq!((why(&moved, "g"), why(&moved, "out")), (None, Some("`file` changed")));
}

/// The kept node ends its crossfade at the other output of the same node.
#[test]
fn kept_node_reading_another_output_ends_at_it() {
    let with = |output| {
        format!(
            "c: counter; w: waker; g: gain(unit: \"N\"); p: probe; out: probe; q: probe; \
             c.tick -> p; c.calls -> q; c.{output} -> g -> w -> out"
        )
    };
    let (mut rig, report) = Rig::swapped(&with("tick"), 7, &with("calls"));
    assert_eq!((report.crossfades, why(&report, "g")), (1, None), "{report}");
    assert_eq!(rig.run(7).control("w"), 14.0, "calls, not the tick");
}

#[test]
fn who_reads_a_sink_hears_what_its_host_hears() {
    let with = |volts| {
        format!(
            "t: tone; a: amps; out: audio_out(volts_at_full_scale: {volts:?}); f: file_out(file: \"x.wav\"); \
             t -> a -> out; out.samples -> f"
        )
    };
    let (mut rig, _) = Rig::swapped(&with(1.0), 7, &with(4.0));
    for _ in 0..7 {
        rig.tick();
        assert_eq!(rig.last(), &rig.samples("f")[..TICK]);
    }
}

/// `a` is heard until the new gate has faded it out; `t` serves an old gate that is closed.
#[test]
fn a_fade_keeps_awake_what_it_hears_and_nothing_else() {
    let gate = "test_gate(close: 0, open: 100)";
    let head = format!("t: tone; g: {gate}; a: tracked; out: file_out(file: \"x.wav\"); t -> g -> a");
    let (mut rig, _) =
        Rig::swapped(&format!("{head}; a -> out"), 7, &format!("{head}; h: {gate}; a -> h -> out"));
    rig.run(7);
    assert_eq!((rig.calls("t"), rig.calls("a")), (0, 12));
}

#[test]
fn an_old_node_sleeps_on_behind_gates_that_are_gone() {
    let gate = "test_gate(close: 0, open: 100)";
    let head = |version| {
        let nodes = format!("t: tone; a: tracked(version: {version}); h: {gate}");
        format!("{nodes}; out: file_out(file: \"x.wav\"); t -> a -> h -> out")
    };
    let from = format!("{}; g: {gate}; other: file_out(file: \"y.wav\"); a -> g -> other", head(1));
    let before = tracked_calls();
    Rig::swapped(&from, 7, &head(2)).0.run(7);
    assert_eq!(tracked_calls() - before, 0);
}

#[test]
fn a_gate_opens_in_its_tick_also_while_something_else_fades() {
    let with = |by| {
        format!(
            "t: tone; a: tracked; h: test_gate(close: 0, open: 12); out: file_out(file: \"x.wav\"); u: tone; \
             s: scale(by: {by:?}); other: file_out(file: \"y.wav\"); t -> a -> h -> out; u -> s -> other"
        )
    };
    let (mut rig, _) = Rig::swapped(&with(1.0), 10, &with(2.0));
    rig.run(4);
    assert_eq!((rig.engine.is_fading(), rig.calls("a")), (true, 2));
}

#[test]
fn a_node_that_slept_is_told_how_long_although_it_was_rebuilt() {
    let lines = "t: tone; m: memory_elapsed; g: test_gate(close: 3, open: 40); \
                 out: file_out(file: \"x.wav\"); t -> m -> g -> out";
    let mut rig = Rig::new(lines);
    rig.run(10).swap_to(compiled(lines), &["m"]);
    assert_eq!(rig.run(31).last()[0], 37.0 * 1000.0 + 1.0);
}

#[test]
fn gate_rebuilt_between_two_questions_holds_its_answer() {
    let lines = "t: taps; g: shut every 3; q: gain; out: probe; t -> g -> q -> out";
    let mut rig = Rig::new(lines);
    rig.run(10).swap_to(compiled(lines), &["g"]);
    assert_eq!(rig.run(1).calls("t"), 0);
}

#[test]
fn a_node_in_quarantine_hands_nothing_on() {
    let with = |from| format!("t: taps(fails_from: {from}); out: probe; t -> out");
    let (mut rig, _) = Rig::swapped(&with(3), 20, &with(1000));
    assert_eq!(rig.run(10).control("t"), 10.0, "it may have left anything behind");
    assert_eq!(rig.anew(), [["t"]]);
    // One that fails at once holds what the one before it put out last.
    rig.swap(&with(30));
    rig.run(3);
    assert_eq!((rig.control("t"), rig.engine.faults()), (10.0, 8 + 3));
}

#[test]
fn live_parameter_wakes_a_node_and_swap_calls_sleeper_once() {
    let lines = "v: live_level(value: 2.0); w: waker; out: probe; v -> w -> out";
    let mut rig = Rig::new(lines);
    for (calls, value) in [(1, 2.0), (2, 7.0), (3, 2.0)] {
        rig.controller.set_parameter("v", "value", value).expect("it is live");
        rig.run(5);
        assert_eq!((rig.calls("v"), rig.calls("w"), rig.control("w")), (calls, calls, value));
    }
    rig.swap_to(compiled(lines), &["v"]);
    rig.run(20);
    let what = "what has another source and the same value is not news";
    assert_eq!((rig.calls("w"), rig.control("w")), (4, 2.0), "{what}");
}

#[test]
fn marks_pass_a_crossfade_as_the_new_signal_has_them() {
    let with = |control, wave| {
        format!(
            "f: faulty; k: faulty(to: 1000, how: \"nan control\"); c: mix; v: marked; w: marked; a: mix; \
             p: probe; q: probe; r: probe; s: probe; t: probe; z: probe; o: probe; f.audio -> v.in; \
             f.audio -> w.in; f.control -> v.control; k.control -> w.control; {control}.control -> c.in1; \
             {wave} -> a.in1; c -> p; a -> q; f.control -> r; k.control -> s; v -> t; w -> z; k.audio -> o"
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
    let head = "f: faulty; t: tail3; out: file_out(file: \"x.wav\"); t -> out";
    let gate = "g: test_gate(close: 0, open: 100); f.audio -> g -> t";
    let (mut rig, _) = Rig::swapped(&format!("{head}; f.audio -> t"), 7, &format!("{head}; {gate}"));
    assert_eq!(rig.run(27).calls("t"), 7 + 5 + 3);
}

#[test]
fn no_step_enters_a_delay_that_goes_on_or_begins_anew() {
    let step = |from: &str, to: &str| {
        let (mut rig, _) = Rig::swapped(from, 20, to);
        let anew = rig.run(40).anew().concat().contains(&"d".to_owned());
        assert_eq!(anew, to.contains("late"), "a node that hands nothing on is told to have begun anew");
        let heard = &rig.heard[20 * TICK - 1..];
        (largest_step(heard), heard.iter().copied().fold(1.0, f32::min))
    };
    let level = |level: f32, node: &str| {
        format!("t: tone(hz: 0.0, level: {level:?}); d: {node}; out: probe; t -> d -> out")
    };
    let [three, two] = ["delay(delay_ms: 3.0)", "delay(delay_ms: 2.0)"];
    let (went, least) = step(&level(1.0, three), &level(1.0, two));
    assert!(went < 1e-6 && least > 0.999, "what is adopted is not faded in: {went}, {least}");
    let (went, least) = step(&level(1.0, three), &level(0.5, two));
    let what = "another source is faded to, not from silence";
    assert!(went < STEEPEST && least > 0.499, "{what}: {went}, {least}");
    let [one, two] = ["late(version: 1)", "late(version: 2)"];
    let (went, least) = step(&level(1.0, one), &level(1.0, two));
    assert!(went < 1.1 * STEEPEST && least < 0.1, "what forgets fades out and in: {went}, {least}");
    let (went, _) = step(&level(1.0, one), &level(0.5, two));
    assert!(went < 1.1 * STEEPEST, "also from another source: {went}");
}
