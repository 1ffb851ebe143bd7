//! A running engine takes over another graph: nothing clicks, nothing is forgotten, nothing is left behind.

use asperity_engine::{Change, Finished, MAX_SWAPS, ParameterError, SwapError, SwapReport};
use asperity_node::Buffer;
use harness::counting::allocations;
use harness::graph::of_lines;
use harness::live::largest_step;

use crate::rig::{FADE, Rig, SINE, STEEPEST, TICK, compiled, compiled_file, compiled_with};

fn change<'a>(report: &'a SwapReport, id: &str) -> &'a Change {
    &report.nodes.iter().find(|n| n.id == id).unwrap_or_else(|| panic!("no {id}: {report}")).change
}

fn is_rebuilt(report: &SwapReport, id: &str) -> bool {
    matches!(change(report, id), Change::Rebuilt { .. })
}

/// Output of a fresh engine in the last one of `ticks`.
fn fresh(lines: &str, ticks: u64) -> Vec<f32> {
    let mut rig = Rig::new(lines);
    rig.run(ticks as usize);
    rig.last().to_vec()
}

#[test]
fn a_gain_changed_under_a_sine_fades_in_10_ms_without_a_click() {
    let with = |gain| format!("t: tone\ng: scale(by: {gain:?})\nout: probe\nt -> g\ng -> out");
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
    let lines = "f: faulty\ns: spsi\no: overlap_add\nr: resample\nd: delay(delay_ms: 7.0)\nout: probe\n\
                 f.frame -> s\ns -> o\no -> r\nr -> d\nd -> out";
    let mut rig = Rig::new(lines);
    rig.run(40);
    assert!(rig.swap(lines).is_nothing());
    rig.run(40);
    let mut other = Rig::new(lines);
    other.run(80);
    assert_eq!(rig.heard, other.heard);
    assert_eq!(rig.calls("s"), 80, "counts go on");
    assert_eq!(rig.controller.collect().len(), 1);
}

/// Both are rebuilt, and the fade is at the audio of the synthesis.
#[test]
fn phase_retrieval_swapped_with_its_synthesis_fades_audio() {
    let with = |seed| {
        format!(
            "f: faulty\ns: spsi(seed: {seed})\no: overlap_add\nr: resample\nout: probe\n\
                 f.frame -> s\ns -> o\no -> r\nr -> out"
        )
    };
    let mut rig = Rig::new(&with(1));
    rig.run(200);
    let own = largest_step(&rig.heard[100 * TICK..]);
    for seed in 2..12 {
        let report = rig.swap(&with(seed));
        assert!(is_rebuilt(&report, "s") && is_rebuilt(&report, "o"), "{report}");
        assert_eq!((change(&report, "r"), report.crossfades), (&Change::Kept, 1), "{report}");
        rig.run(100);
    }
    let peak = rig.heard[100 * TICK..].iter().fold(0.0_f32, |m, x| m.max(x.abs()));
    let bound = own + 2.0 * peak * STEEPEST;
    rig.is_smooth(0, bound);
}

#[test]
fn a_filter_goes_on_from_the_state_of_the_one_before() {
    let with =
        |kind, part| format!("t: tone(hz: 0.0)\np: {kind}(part: {part})\nout: probe\nt -> p\np -> out");
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
    let with = |p| format!("t: taps({p})\nout: probe\nt -> out");
    let (mut rig, _) = Rig::swapped(&with("taps: 3"), 7, &with("taps: 3, fails_from: 1000"));
    rig.run(10);
    assert_eq!(rig.control("t"), 17.0, "it goes on counting");
    rig.swap(&with("taps: 4"));
    rig.run(10);
    assert_eq!(rig.control("t"), 10.0, "it begins anew");
    let anew: Vec<_> = rig.controller.collect().into_iter().map(|f| f.anew).collect();
    assert_eq!(anew, [vec![], vec!["t".to_owned()]]);
}

#[test]
fn nodes_are_inserted_removed_and_rewired_without_a_click() {
    let t = "t: tone\na: scale(by: 0.5)\nout: probe\n";
    let graphs = [
        format!("{t}t -> a\na -> out"),
        "t: tone\nout: probe\nt -> out".to_owned(),
        format!("{t}b: scale(by: -1.0)\nt -> a\na -> b\nb -> out"),
        // The same two the other way round: each would have to run before the other while it fades.
        format!("{t}b: scale(by: -1.0)\nt -> b\nb -> a\na -> out"),
        format!("{t}c: mix\nt -> c.in1\na -> c.in2\nt -> a\nc -> out"),
        format!("{t}c: mix\nt -> c.in2\na -> c.in1\nt -> a\nc -> out"),
        "u: tone(hz: 70.0)\nc: mix\nu -> c.in1\nv: tone(hz: 40.0)\nv -> c.in2\nout: probe\nc -> out"
            .to_owned(),
    ];
    for from in &graphs {
        for to in &graphs {
            let (mut rig, _) = Rig::swapped(from, 11, to);
            rig.run(15);
            assert_eq!(rig.last(), fresh(to, 26), "{from}\nto\n{to}");
            // Of at most 1.5 in level, and that over half a fade's steepest.
            let bound = 1.5 * SINE + 3.0 * STEEPEST;
            rig.is_smooth(0, bound);
            assert_eq!(rig.controller.collect().len(), 1);
        }
    }
}

#[test]
fn nothing_is_heard_that_is_neither_the_old_graph_nor_the_new() {
    // A factor moves from one gain to another past a filter that stays; and a filter and a gain change
    // places.
    let moved = |a, b| {
        format!(
            "t: tone\na: scale(by: {a:?})\np: one_pole(part: 0.5)\nb: scale(by: {b:?})\nout: probe\n\
                 t -> a\na -> p\np -> b\nb -> out"
        )
    };
    let nodes = "t: tone\na: scale(by: 1000.0)\np: scale(by: 0.001)\nout: probe\n";
    let pairs = [
        (moved(1.0, 0.01), moved(0.01, 1.0)),
        (moved(0.01, 1.0), moved(1.0, 0.01)),
        (format!("{nodes}t -> a\na -> p\np -> out"), format!("{nodes}t -> p\np -> a\na -> out")),
    ];
    for (from, to) in pairs {
        let (mut rig, report) = Rig::swapped(&from, 20, &to);
        assert!(is_rebuilt(&report, "p") && report.crossfades == 1, "{report}");
        rig.run(20);
        let one = Rig::new(&from).run(40).heard.clone();
        let worst = rig.heard.iter().zip(&one).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(worst < 1e-4, "the two graphs sound the same: {worst}");
    }
}

/// The control goes from the old value to the new one in steps, and its reader ends at the new one.
#[test]
fn swapped_control_steps_from_old_to_new_value() {
    for reader in ["waker", "deaf"] {
        let with = |value| format!("v: level(value: {value:?})\nw: {reader}\nout: probe\nv -> w\nw -> out");
        let (mut rig, _) = Rig::swapped(&with(2.0), 5, &with(12.0));
        let mut seen = Vec::new();
        for _ in 0..10 {
            rig.tick();
            seen.push(rig.control("w"));
        }
        assert!(seen.windows(2).all(|w| w[1] >= w[0]), "{reader}: {seen:?}");
        assert_eq!(seen[9], 12.0, "{reader}: {seen:?}");
        if reader == "waker" {
            assert!(seen[0] > 2.0 && seen[0] < 4.0 && seen[2] > 7.0 && seen[4] == 12.0, "{seen:?}");
        }
        let calls = rig.calls("w");
        rig.run(20);
        assert_eq!(rig.calls("w"), calls, "{reader} sleeps on when it has faded");
    }
}

#[test]
fn what_sleeps_behind_a_closed_gate_sleeps_on_through_a_swap() {
    let with = |gain, close| {
        format!(
            "t: tone\ng: scale(by: {gain:?})\nm: memory_resume\nx: mix\ngate: test_gate(close: {close}, \
             open: 40)\n\
                 out: file_out(file: \"x.wav\")\nt -> g\ng -> x.in1\nt -> m\nm -> x.in2\nx -> gate\ngate \
                 -> out"
        )
    };
    let mut rig = Rig::new(&with(1.0, 3));
    rig.run(10);
    let (calls, heard) = (rig.calls("m"), rig.heard.len());
    let report = rig.swap(&with(0.25, 3));
    assert!(is_rebuilt(&report, "g") && *change(&report, "m") == Change::Kept, "{report}");
    rig.run(10);
    // The gate itself, too, with a parameter that leaves it closed.
    assert!(is_rebuilt(&rig.swap(&with(0.25, 2)), "gate"));
    rig.run(10);
    assert_eq!((rig.calls("m"), rig.calls("g")), (calls, 0), "nobody was woken");
    assert!(rig.heard[heard..].iter().all(|x| *x == 0.0));
    rig.run(11);
    let tone = fresh("t: tone\ng: scale(by: 0.25)\nout: probe\nt -> g\ng -> out", 41);
    let level = rig.calls("m") as f32;
    assert!(rig.last().iter().zip(tone).all(|(y, t)| (y - t - level).abs() < 1e-5), "and wakes as ever");
}

#[test]
fn what_a_new_gate_would_silence_is_heard_until_it_has_faded() {
    let t = "t: tone\na: scale(by: 0.5)\nout: file_out(file: \"x.wav\")\nt -> a\n";
    let open = format!("{t}a -> out");
    let gated = format!("{t}gate: test_gate(close: 0, open: 100)\na -> gate\ngate -> out");
    let (mut rig, _) = Rig::swapped(&open, 10, &gated);
    rig.run(10);
    rig.is_smooth(0, SINE);
    assert_eq!((rig.calls("t"), rig.calls("a")), (15, 15), "they run for as long as it fades, and no longer");
    assert!(rig.last().iter().all(|x| *x == 0.0));
    rig.swap(&open);
    rig.run(10);
    rig.is_smooth(0, SINE);
    assert_eq!(rig.last(), fresh(&open, 30));
}

#[test]
fn an_old_tone_fades_under_a_new_gate_though_the_old_one_closes() {
    let gated = |hz: &str, level: &str, speed: &str| {
        format!(
            "n0: tone(hz: {hz}, level: {level})\nv: level(value: {speed})\nu: gain(unit: \"mm/s\")\n\
             v -> u\nu -> g.speed\ng: speed_gate\nn0.out -> g.in\n"
        )
    };
    let out = "out: file_out(file: \"x.wav\")\n";
    let mut rig = Rig::new(&format!("n0: tone(hz: 30.0, level: 1.0)\n{out}n0.out -> out\n"));
    rig.run(40);
    // The gate that closes under the second swap is still closing under the third, and is closed before that
    // has faded. Its successor opens again.
    rig.swap(&format!("{}{out}g.out -> out\n", gated("30.0", "1.0", "6.0")));
    rig.swap(&format!("{}{out}g.out -> out\n", gated("55.0", "0.5", "0.0")));
    rig.swap(&format!("{}s: scale(by: 1.0)\n{out}g.out -> s\ns -> out\n", gated("30.0", "1.0", "10.0")));
    rig.run(60);
    let step = largest_step(&rig.heard[30 * TICK..]);
    assert!(step < 0.02, "a step of {step}");
}

#[test]
fn a_live_parameter_is_set_in_the_next_tick_and_checked_before() {
    let with = |gain, fixed| {
        format!(
            "t: tone(hz: 0.0)\ng: live_gain(gain: {gain:?}, fixed: {fixed})\nout: probe\nt -> g\ng -> out"
        )
    };
    let mut rig = Rig::new(&with(1.0, 0));
    rig.run(3);
    rig.controller.set_parameter("g", "gain", 0.25).unwrap();
    rig.controller.set_parameter("g", "sign", 1.0).unwrap();
    rig.run(1);
    assert_eq!(rig.last(), [-0.25; TICK]);
    let mut set = |node, param, value| rig.controller.set_parameter(node, param, value).unwrap_err();
    assert_eq!(set("x", "gain", 1.0), ParameterError::NoNode("x".into()));
    assert_eq!(
        set("g", "fixed", 1.0).to_string(),
        "`g.fixed` cannot change while the node runs; what can: gain, sign"
    );
    assert_eq!(set("g", "gain", 2.5).to_string(), "`gain` cannot be 2.5: it takes a number from 0.0 to 2.0");
    assert!(matches!(set("g", "gain", f64::NAN), ParameterError::OutOfRange { .. }));
    assert!(matches!(set("g", "sign", 0.5), ParameterError::OutOfRange { .. }));
    assert!(matches!(set("g", "sign", 2.0), ParameterError::OutOfRange { .. }));
    // A graph in which only the live parameter differs keeps the node; one that agrees with what was set
    // sets nothing.
    let report = rig.swap(&with(0.25, 0));
    assert_eq!(report.to_string(), "`g.sign` set to 0, 3 nodes kept");
    let report = rig.swap(&with(0.75, 0));
    assert_eq!((change(&report, "g"), report.parameters[0].value), (&Change::Kept, 0.75));
    rig.run(1);
    assert_eq!(rig.last(), [0.75; TICK]);
    // The built-in gain is live, and goes there in a straight line.
    let mut built_in = Rig::new("t: tone(hz: 0.0)\ng: gain\nout: probe\nt -> g\ng -> out");
    built_in.run(3);
    let report = built_in.swap("t: tone(hz: 0.0)\ng: gain(gain: -1.0)\nout: probe\nt -> g\ng -> out");
    assert_eq!(report.to_string(), "`g.gain` set to -1, 3 nodes kept");
    built_in.run(6);
    assert!(built_in.last() == [-1.0; TICK] && largest_step(&built_in.heard) < 2.1 / FADE as f32);
    // While it fades a value reaches the new node.
    assert!(is_rebuilt(&rig.swap(&with(0.75, 1)), "g"));
    rig.run(1);
    rig.controller.set_parameter("g", "gain", 0.5).unwrap();
    rig.run(5);
    assert_eq!(rig.last(), [0.5; TICK]);
}

#[test]
fn a_delay_that_closes_a_cycle_keeps_what_is_on_its_way() {
    let with = |half| {
        format!(
            "f: faulty\nsum: mix\nhalf: scale(by: {half:?})\nlater: delay(delay_ms: 2.0)\nout: probe\n\
                 f.audio -> sum.in1\nlater -> sum.in2\nsum -> half\nhalf -> later\nsum -> out"
        )
    };
    let (mut rig, report) = Rig::swapped(&with(0.5), 40, &with(0.2));
    assert!(is_rebuilt(&report, "half") && *change(&report, "later") == Change::Kept, "{report}");
    rig.run(40);
    assert!(rig.last().iter().all(|x| (x - 1.25).abs() < 1e-5));
    rig.is_smooth(39 * TICK, STEEPEST);
    // The delay itself, and the cycle cut.
    let longer = with(0.2).replace("2.0", "3.0");
    assert!(is_rebuilt(&rig.swap(&longer), "later"));
    rig.run(40);
    assert!(rig.last().iter().all(|x| (x - 1.25).abs() < 1e-5));
    rig.swap(&with(0.2).replace("later -> sum.in2\n", ""));
    rig.run(40);
    assert!(rig.last().iter().all(|x| (x - 1.0).abs() < 1e-6));
    rig.is_smooth(39 * TICK, STEEPEST);
}

#[test]
fn a_sink_that_is_rebuilt_renamed_or_new_fades_too() {
    let t = "t: tone\na: amps\nt -> a\n";
    let with = |id, volts| format!("{t}{id}: audio_out(volts_at_full_scale: {volts:?})\na -> {id}");
    let (mut rig, _) = Rig::swapped(&with("other", 1.0), 10, &with("out", 1.0));
    rig.run(10);
    let tone = fresh(&with("out", 1.0), 11);
    let renamed: Vec<_> = rig.heard[..TICK].iter().zip(tone).map(|(a, b)| (a - b).abs()).collect();
    assert!(renamed.iter().all(|d| *d < 1e-5), "a device that is renamed plays on: {renamed:?}");
    rig.swap(&with("out", 4.0));
    rig.run(10);
    rig.is_smooth(0, SINE);
    assert_eq!(rig.last(), fresh(&with("out", 4.0), 30));
    rig.swap(&format!("{}\nnew: file_out(file: \"x.wav\")\nt -> new", with("out", 4.0)));
    rig.run(1);
    let samples = rig.samples("new");
    assert!(samples[0].abs() < 1e-4 && samples[95].abs() > 0.03, "it fades in from silence: {samples:?}");
}

#[test]
fn a_node_that_runs_seldom_starts_in_a_tick_in_which_it_runs() {
    let mut rig = Rig::new("v: level(value: 3.0)\nout: probe\nv -> out");
    rig.run(3);
    let seldom = "v: level(value: 3.0)\ns: gain\nout: probe\nv -> s\ns -> out";
    rig.controller.swap(compiled_with(seldom, &["s.every=20"]), &[]).unwrap();
    for tick in 3..60 {
        rig.tick();
        assert_eq!(rig.engine.swaps(), u64::from(tick >= 20), "tick {tick}");
        let Some(Buffer::Control { values, .. }) = rig.engine.input(rig.node("out"), 0) else {
            panic!("no control")
        };
        assert_eq!(values[0], 3.0, "tick {tick}");
    }
    // Two that meet seldom do not wait for each other.
    let two = "v: level\na: gain\nb: gain\nout: probe\nv -> a\na -> b\nb -> out";
    rig.controller.swap(compiled_with(two, &["a.every=23", "b.every=29"]), &[]).unwrap();
    rig.run(1);
    assert_eq!(rig.engine.swaps(), 2);
}

#[test]
fn a_rebuilt_node_has_a_clean_record_and_a_kept_one_its_own() {
    let with = |to| {
        format!(
            "f: faulty(from: 3, to: {to}, how: error)\nk: faulty(from: 2, to: 4, how: error)\n\
                             out: probe\np: probe\nf.audio -> out\nk.audio -> p"
        )
    };
    let mut rig = Rig::new(&with(1000));
    rig.run(20);
    assert!(rig.engine.report(rig.node("f")).unwrap().quarantined);
    rig.swap(&with(10));
    rig.run(20);
    assert_eq!(rig.last(), [1.0; TICK], "out of quarantine, and faded in");
    rig.is_smooth(20 * TICK - 1, 1.1 * STEEPEST);
    let report = |id| rig.engine.report(rig.node(id)).unwrap().clone();
    assert_eq!((report("f").faults, report("f").quarantined), (0, false));
    assert_eq!((report("k").faults, report("k").calls), (2, 40));
    assert_eq!(rig.engine.faults(), 10, "those of a node that is gone still count");
}

#[test]
fn what_a_host_says_has_changed_is_rebuilt() {
    let lines = "t: tone\nu: tone\nm: mix\nout: probe\nt -> m.in1\nu -> m.in2\nm -> out";
    let mut rig = Rig::new(lines);
    rig.run(3);
    let report = rig.controller.swap(compiled(lines), &["u".to_owned()]).unwrap();
    assert_eq!(report.to_string(), "`u` rebuilt (what it reads changed), 3 nodes kept");
    rig.run(3);
}

#[test]
fn other_rates_are_refused_and_a_reset_ends_a_fade() {
    let lines = "t: tone\ng: scale(by: 0.5)\nout: probe\nt -> g\ng -> out";
    let mut rig = Rig::new(lines);
    let rates = |tick_hz, audio_hz| {
        let mut graph = of_lines(lines);
        (graph.tick_hz, graph.audio_hz) = (tick_hz, audio_hz);
        compiled_file(&graph)
    };
    let refused = rig.controller.swap(rates(1000, 48_000), &[]).unwrap_err();
    assert_eq!(refused, SwapError::TickRate { running: 500, asked: 1000 });
    assert_eq!(
        rig.controller.swap(rates(500, 44_100), &[]).unwrap_err().to_string(),
        "runs at an audio rate of 48000 Hz and cannot go on at 44100 Hz: start anew"
    );
    rig.run(5);
    let other = lines.replace("0.5", "0.75");
    rig.swap(&other);
    rig.run(2);
    rig.engine.reset();
    rig.run(4);
    assert_eq!(rig.heard[7 * TICK..], *Rig::new(&other).run(4).heard);
    assert_eq!(rig.controller.collect().len(), 1);
    drop(rig.engine);
    assert_eq!(rig.controller.swap(compiled(lines), &[]).unwrap_err(), SwapError::Stopped);
    assert!(rig.controller.set_parameter("g", "gain", 1.0).is_err());
}

#[test]
fn swaps_in_every_tick_wait_or_are_refused_without_a_leak() {
    let with = |version| {
        format!("t: tone\nx: tracked(version: {version})\ny: tracked\nout: probe\nt -> x\nx -> y\ny -> out")
    };
    let mut rig = Rig::new(&with(0));
    assert_eq!(crate::tones::tracked(), 2);
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
        assert!(crate::tones::tracked() <= 2 * (2 + MAX_SWAPS as i64), "{}", crate::tones::tracked());
    }
    assert!(sent > 195 && busy > 700, "one in a fade of five ticks: {sent}, {busy}");
    rig.run(5 * MAX_SWAPS + 2);
    over += rig.controller.collect().len();
    assert_eq!((over, crate::tones::tracked()), (sent, 2));
    let tone: Vec<f32> = Rig::new("t: tone\nout: probe\nt -> out").run(1022).heard.clone();
    let worst = rig.heard.iter().zip(&tone).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(worst < 1e-6, "a node that passes on cannot be heard to be swapped: {worst}");
    drop(rig);
    assert_eq!(crate::tones::tracked(), 0);
}

#[test]
fn a_controller_may_be_gone_before_its_swap_is_over() {
    let with = |version| format!("t: tone\nx: tracked(version: {version})\nout: probe\nt -> x\nx -> out");
    let Rig { mut controller, mut engine, .. } = Rig::new(&with(0));
    for version in 1..=MAX_SWAPS {
        controller.swap(compiled(&with(version)), &[]).unwrap();
    }
    assert_eq!(controller.swap(compiled(&with(9)), &[]), Err(SwapError::Busy));
    drop(controller);
    let ((), count) = allocations(|| (0..50).for_each(|_| engine.tick()));
    assert_eq!((count, engine.swaps()), (0, MAX_SWAPS as u64));
    drop(engine);
    assert_eq!(crate::tones::tracked(), 0);
}
