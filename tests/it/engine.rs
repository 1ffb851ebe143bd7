//! The engine under nodes that behave, sleep, fail and panic: what flows on, and what is counted.

use asperity_engine::{Engine, FAULTS_BEFORE_QUARANTINE, Options};
use asperity_graph::compile;
use asperity_node::{Buffer, Fault};
use harness::graph;
use harness::live::largest_step;
use harness::nodes::{TestClock, registry};

use crate::drive::{audio_of as audio, control_of as control, node};

fn engine_with(nodes: &str, wires: &str, options: Options) -> Engine {
    Engine::new(graph::compiled(&graph::of_lines(&format!("{nodes}; {wires}")), &registry()), options)
}

fn engine(nodes: &str, wires: &str) -> Engine {
    engine_with(nodes, wires, Options::default())
}

/// Samples of a node's first output over so many ticks.
fn heard(e: &mut Engine, id: &str, ticks: usize) -> Vec<f32> {
    let tick = |_| {
        e.tick();
        audio(e, id, 0)
    };
    (0..ticks).flat_map(tick).collect()
}

#[test]
fn every_sample_passes_once_and_in_order_at_44100_and_48000() {
    for hz in [44_100, 48_000, 96_000, 8_000] {
        let text = format!(
            "Graph(version: 1, tick_hz: 700, audio_hz: {hz}, nodes: {{\"c\": (kind: \"counter\"), \
             \"p\": (kind: \"probe\")}}, wires: [(\"c.samples\", \"p\")])"
        );
        let mut e = graph::engine(&graph::parsed(text), &registry());
        assert_eq!(heard(&mut e, "c", 7000).len(), 10 * hz, "{hz} Hz");
    }
}

#[test]
fn a_nan_fades_within_10_ms_and_the_rest_goes_on() {
    let mut e = engine(
        "f: faulty(from: 10, to: 25, how: nan); g: gain; c: counter; p: probe; q: probe",
        "f.audio -> g -> p; c.samples -> q",
    );
    let mut out = Vec::new();
    for tick in 0..40 {
        e.tick();
        // It would go into quarantine after 8 faults; here the fade and the way back are looked at.
        out.extend(audio(&e, "g", 0));
        assert_eq!(audio(&e, "c", 0)[0], (tick * 96) as f32, "the counter must go on");
    }
    assert!(out.iter().all(|x| x.is_finite()));
    let step = largest_step(&out);
    assert!(step < 1.5 / 480.0, "step {step}: a fade over 480 samples has steps of 1/480");
    let silent = out.iter().position(|x| *x == 0.0).expect("it fades to nothing");
    assert!((10 * 96..=10 * 96 + 480).contains(&silent), "10 ms are 480 samples: {silent}");
    assert!(out[silent..].iter().all(|x| *x == 0.0), "in quarantine it stays silent");
    let faults = e.report(node(&e, "f")).unwrap();
    assert_eq!(
        (faults.faults, faults.last_fault, faults.quarantined),
        (FAULTS_BEFORE_QUARANTINE, Some(Fault::NotFinite), true)
    );
}

#[test]
fn a_control_of_a_failing_node_holds_and_is_not_trusted() {
    let mut e = engine(
        "f: faulty(from: 5, to: 8, how: \"nan control\"); g: gain(gain: 2.0); p: probe",
        "f.control -> g -> p",
    );
    for tick in 0..12 {
        e.tick();
        let k = if (5..8).contains(&tick) { 4.0 } else { f64::from(tick) };
        let valid = !(5..8).contains(&tick);
        assert_eq!(control(&e, "f", 1), (vec![k, -k], valid), "tick {tick}");
        assert_eq!(control(&e, "g", 0), (vec![2.0 * k, -2.0 * k], valid), "tick {tick}");
    }
}

#[test]
fn a_frame_of_a_failing_node_is_zero() {
    let mut e = engine("f: faulty(from: 2, to: 3, how: \"inf frame\"); p: probe", "f.frame -> p");
    for tick in 0..4_u64 {
        e.tick();
        let Some(Buffer::Magnitude { bins, frame, valid }) = e.output(node(&e, "f"), 2) else {
            panic!("no frame")
        };
        // A zero is to be trusted: there is nothing left to fade.
        assert_eq!((bins[3], *valid), (if tick == 2 { 0.0 } else { 1.0 }, true), "tick {tick}");
        assert_eq!(*frame, Some((tick, tick * 5)));
    }
}

#[test]
fn a_panic_is_contained_counted_and_quarantined() {
    let mut e = engine(
        "f: faulty(from: 3, to: 1000, how: panic); c: counter; p: probe; q: probe",
        "f.audio -> p; c.tick -> q",
    );
    for _ in 0..100 {
        e.tick();
    }
    let report = e.report(node(&e, "f")).unwrap().clone();
    assert_eq!(report.faults, FAULTS_BEFORE_QUARANTINE);
    assert_eq!(report.calls, 3 + FAULTS_BEFORE_QUARANTINE, "a node in quarantine is not called");
    assert_eq!((report.last_fault, report.quarantined), (Some(Fault::Panicked), true));
    assert_eq!(control(&e, "c", 1).0, [99.0]);
    assert!(audio(&e, "f", 0).iter().all(|x| *x == 0.0));
}

#[test]
fn an_error_code_reaches_the_report() {
    let mut e = engine("f: faulty(from: 0, to: 1, how: error); p: probe", "f.audio -> p");
    e.tick();
    assert_eq!(e.report(node(&e, "f")).unwrap().last_fault, Some(Fault::Failed(42)));
}

#[test]
fn what_serves_a_closed_gate_alone_is_not_called() {
    let nodes = "c: counter; m: memory_restart; g: test_gate; p: probe; shared: counter; q: probe; \
                 n: memory_never; mix: mix(inputs: 3)";
    let wires = "c.samples -> m -> mix.in1; shared.samples -> mix.in2; shared.tick -> q; \
                 shared.samples -> n -> mix.in3; mix -> g -> p";
    let mut e = engine(nodes, wires);
    for _ in 0..10 {
        e.tick();
    }
    let calls = |id: &str| e.report(node(&e, id)).unwrap().calls;
    assert_eq!((calls("c"), calls("m"), calls("mix")), (7, 7, 7), "closed for 3 of 10 ticks");
    assert_eq!(calls("shared"), 10, "it serves a probe too");
    assert_eq!(calls("n"), 10, "it never sleeps");
    assert_eq!(calls("g"), 10);
    assert_eq!(e.report(node(&e, "m")).unwrap().slept, 3);
}

#[test]
fn a_node_wakes_as_it_says() {
    for (kind, after) in [("restart", 1.0), ("elapsed", 3.0 * 1000.0 + 4.0), ("resume", 4.0), ("never", 7.0)]
    {
        let nodes = format!("c: counter; m: memory_{kind}; g: test_gate; p: probe");
        let mut e = engine(&nodes, "c.samples -> m -> g -> p");
        assert_eq!(heard(&mut e, "g", 7)[6 * 96], after, "{kind}");
    }
}

#[test]
fn the_output_is_the_same_whether_nodes_sleep_or_not() {
    let nodes = "c: counter; m: memory_restart; g: test_gate; p: probe";
    let wires = "c.samples -> m -> g -> p";
    let [sleeping, awake] = [true, false].map(|sleep| {
        let mut e = engine_with(nodes, wires, Options { sleep, ..Options::default() });
        (heard(&mut e, "g", 12), e.report(node(&e, "m")).unwrap().calls)
    });
    assert_eq!(sleeping.0, awake.0);
    assert_eq!((sleeping.1, awake.1), (9, 12));
}

#[test]
fn a_node_that_dozes_is_woken_by_its_input() {
    let nodes = "f: faulty; g: test_gate(close: 2, open: 8); d: dozer; p: probe";
    let mut e = engine(nodes, "f.audio -> g -> d -> p");
    let levels: Vec<f32> = heard(&mut e, "d", 10).into_iter().skip(5).step_by(96).collect();
    assert_eq!(levels, [2.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0, 2.0]);
    // Two loud ticks, one in which it falls asleep, two after it was woken.
    assert_eq!(e.report(node(&e, "d")).unwrap().calls, 5);
}

#[test]
fn a_cycle_through_a_delay_gives_the_geometric_series() {
    let nodes = "f: faulty; sum: mix; half: gain(gain: 0.5); later: delay(delay_ms: 2.0); p: probe";
    let wires = "f.audio -> sum.in1; later -> sum.in2; sum -> half -> later; sum -> p";
    let mut e = engine(nodes, wires);
    for tick in 0..20 {
        e.tick();
        let expected = 2.0 - 0.5_f32.powi(tick);
        assert!(audio(&e, "sum", 0).iter().all(|x| (x - expected).abs() < 1e-6), "tick {tick}");
    }
}

#[test]
fn a_delay_is_exact_in_and_out_of_a_cycle() {
    for ms in [0.0, 0.02083334, 1.0, 2.0, 37.5] {
        let samples = (ms * 48.0_f64).round() as usize;
        let nodes = format!("c: counter; d: delay(delay_ms: {ms:?}); p: probe");
        let mut e = engine(&nodes, "c.samples -> d -> p");
        let out = heard(&mut e, "d", 30);
        let expected: Vec<f32> = (0..out.len()).map(|i| i.saturating_sub(samples) as f32).collect();
        assert_eq!(out, expected, "{ms} ms");
    }
}

#[test]
fn a_node_may_run_every_kth_tick_and_its_control_holds() {
    let nodes = "c: counter; h: gain every 4; p: probe";
    let mut e = engine(nodes, "c.tick -> h -> p");
    for tick in 0..400_u64 {
        e.tick();
        assert_eq!(control(&e, "h", 0).0, [(tick / 4 * 4) as f64]);
    }
    assert_eq!(e.report(node(&e, "h")).unwrap().calls, 100);
    assert_eq!(e.report(node(&e, "c")).unwrap().calls, 400);
}

#[test]
fn what_would_chop_the_signal_may_not_run_every_kth_tick() {
    let refused = |nodes: &str, wires: &str| {
        let graph = graph::of_lines(&format!("{nodes}; {wires}"));
        compile(&graph, &registry(), Default::default()).unwrap_err()[0].to_string()
    };
    let audio = refused("c: counter; g: gain every 2; p: probe", "c.samples -> g -> p");
    assert!(audio.contains("`g` carries audio and must run every tick"), "{audio}");
    let frames = refused("f: faulty; s: spsi every 2; p: probe", "f.frame -> s -> p");
    assert!(frames.contains("`s` runs every 2 ticks and would miss frames of `f`"), "{frames}");
}

#[test]
fn a_fault_before_falling_asleep_leaves_no_buzz() {
    let out = heard(&mut engine("f: sleeper; p: probe", "f -> p"), "f", 40);
    let step = largest_step(&out);
    assert!(step < 1.5 / 480.0, "step {step}");
    assert!(out[20 * 96..].iter().all(|x| *x == 0.0));
}

#[test]
fn a_changed_control_wakes_where_it_is_said_to() {
    // The floor's force changes while the stylus comes down and presses, and rests in the air before and
    // after.
    let nodes = "s: stroke(tremor_mm: 0.0, duration_s: 2.0, approach_s: 0.5); f: virtual_floor; \
                 w: waker; d: deaf; p: probe; q: probe";
    let wires = "s -> f; f.force -> w; f.force -> d; w -> p; d -> q";
    let mut e = engine(nodes, wires);
    let mut changes = 1;
    let mut before = 0.0;
    for tick in 0..1000 {
        e.tick();
        let force = control(&e, "f", 0).0[0];
        changes += u64::from(tick > 0 && force != before);
        before = force;
        assert_eq!(control(&e, "w", 0).0[0], force, "tick {tick}");
    }
    assert!(changes > 10, "the force must change: {changes}");
    assert_eq!(e.report(node(&e, "w")).unwrap().calls, changes, "once at the start, then at every change");
    assert_eq!(e.report(node(&e, "d")).unwrap().calls, 1, "a control that is not said to wake does not");
}

#[test]
fn a_mark_does_not_outlive_the_sleep_of_its_node() {
    // The wave is marked in tick 3, where its control fails; from tick 4 on its gate is closed and it sleeps.
    let nodes = "f: faulty(from: 3, to: 4, how: \"nan control\"); n: faulty; w: marked; \
                 g: test_gate(close: 4, open: 50); p: probe; c: gain(unit: \"1\")";
    let wires = "n.audio -> w.in; f.control -> w.control; w -> c -> g -> p";
    let mut e = engine(nodes, wires);
    for tick in 0..20 {
        e.tick();
        let gate = e.output(node(&e, "g"), 0).expect("audio");
        assert_eq!(gate.is_valid(), tick != 3, "tick {tick}");
    }
}

#[test]
fn a_tail_rings_out_after_the_input_and_no_longer() {
    let nodes = "f: faulty; g: test_gate(close: 5, open: 50); t: tail3; p: probe";
    let mut e = engine(nodes, "f.audio -> g -> t -> p");
    let loud = heard(&mut e, "t", 20).iter().rposition(|x| *x != 0.0);
    assert_eq!(loud, Some(8 * 96 - 1), "five loud ticks and a tail of three");
}

/// Loudest sample of each tick at the output of `last`, fed by a wave that rests on a control which fails in
/// ticks 200 to 206.
fn level_after_a_failing_control(last: &str) -> Vec<f32> {
    let nodes = format!(
        "f: faulty(from: 200, to: 207, how: \"nan control\"); n: faulty; w: marked; last: {last}; \
         p: probe"
    );
    let wires = "n.audio -> w.in; f.control -> w.control; w -> last -> p";
    let heard = heard(&mut engine(&nodes, wires), "last", 300);
    heard.chunks(96).map(|tick| tick.iter().fold(0.0_f32, |m, x| m.max(x.abs()))).collect()
}

#[test]
fn limiter_and_audio_out_fade_when_a_control_failed() {
    for last in ["limiter", "audio_out"] {
        let level = level_after_a_failing_control(last);
        assert!(level[199] > 0.0 && level[206] == 0.0, "{last}: {} {}", level[199], level[206]);
        assert!(level[299] > 0.5 * level[199], "{last}: and it comes back");
    }
}

#[test]
fn a_mix_adds_audio_and_controls_each_with_its_gain() {
    let nodes = "f: faulty; a: mix(inputs: 3, gains: [0.5, -2.0]); c: mix(gains: [3.0, 0.25]); \
                 p: probe; q: probe";
    let wires = "f.audio -> a.in1; f.audio -> a.in2; f.audio -> a.in3; f.control -> c.in1; \
                 f.control -> c.in2; a -> p; c -> q";
    let mut e = engine(nodes, wires);
    for tick in 0..5 {
        e.tick();
        assert!(audio(&e, "a", 0).iter().all(|x| *x == 0.5 - 2.0 + 1.0), "a gain left out is 1");
        assert_eq!(control(&e, "c", 0).0, [3.25 * f64::from(tick), -3.25 * f64::from(tick)]);
    }
}

#[test]
fn after_a_reset_the_same_samples_come_again() {
    let mut e = engine("s: stroke; v: velocity; p: probe", "s -> v; v.speed -> p");
    let mut run = || {
        let tick = |_| {
            e.tick();
            control(&e, "v", 1).0[0].to_bits()
        };
        let out: Vec<u64> = (0..500).map(tick).collect();
        e.reset();
        out
    };
    let first = run();
    assert!(first.iter().any(|x| *x != 0));
    assert_eq!(first, run());
}

#[test]
fn slow_call_fades_out_is_counted_and_quarantined() {
    let limited = Options { limit_ns: Some(100_000), ..Options::default() };
    let mut e = engine_with(
        "s: slow(from: 10, to: 1000); p: probe; q: slow; r: probe",
        "s.out -> p; q.out -> r",
        limited,
    );
    let mut out = Vec::new();
    for tick in 0..40 {
        e.tick_timed(&TestClock, &mut []);
        out.extend(audio(&e, "s", 0));
        let held = if tick < 10 { f64::from(tick) } else { 9.0 };
        assert_eq!(control(&e, "s", 1), (vec![held], tick < 10), "tick {tick}");
        assert_eq!(audio(&e, "q", 0)[95], 1.0, "the quick one goes on");
    }
    let step = largest_step(&out);
    assert!(step < 1.5 / 480.0, "step {step}");
    assert_eq!((out[10 * 96 - 1], out[15 * 96]), (1.0, 0.0), "10 ms from the first tick that was late");
    let slow = e.report(node(&e, "s")).unwrap();
    assert_eq!((slow.faults, slow.last_fault), (FAULTS_BEFORE_QUARANTINE, Some(Fault::Overrun)));
    assert_eq!((slow.calls, slow.quarantined), (10 + FAULTS_BEFORE_QUARANTINE, true));
    assert_eq!(e.report(node(&e, "q")).unwrap().faults, 0);
}

#[test]
fn without_a_clock_or_a_limit_nothing_takes_too_long() {
    let graph = "s: slow(to: 1000); p: probe";
    let mut unlimited = engine(graph, "s.out -> p");
    let limited = Options { limit_ns: Some(100_000), ..Options::default() };
    let mut without_clock = engine_with(graph, "s.out -> p", limited);
    for _ in 0..20 {
        unlimited.tick_timed(&TestClock, &mut []);
        without_clock.tick();
    }
    assert_eq!((unlimited.faults(), without_clock.faults()), (0, 0));
}

/// Every other fault is contained as with guards.
#[test]
fn without_guards_only_non_finite_values_go_on() {
    let faulty =
        |id: &str, how: &str| format!("{id}: faulty(from: 3, to: 4, how: \"{how}\"); p_{id}: probe; ");
    let ids = [("a", "nan"), ("c", "nan control"), ("m", "inf frame"), ("x", "panic"), ("e", "error")];
    let nodes: String = ids.iter().map(|(id, how)| faulty(id, how)).collect();
    let nodes = nodes + "w: gain(unit: \"A\"); l: limiter; p: probe";
    let wires: String = ids.iter().map(|(id, _)| format!("{id}.control -> p_{id}; ")).collect();
    let wires = wires + "a.audio -> w -> l -> p";
    for check_finite in [true, false] {
        let mut e = engine_with(&nodes, &wires, Options { check_finite, ..Options::default() });
        for tick in 0..20 {
            e.tick();
            if tick == 3 {
                assert_eq!(audio(&e, "a", 0).iter().all(|y| y.is_finite()), check_finite);
                // The first value is the tick's number, the second none.
                let (values, valid) = control(&e, "c", 1);
                let held = (values[0], values[1].is_nan(), valid);
                assert_eq!(held, if check_finite { (2.0, false, false) } else { (3.0, true, true) });
                assert_eq!(control(&e, "x", 1), (vec![2.0, -2.0], false), "a panic");
                assert_eq!(control(&e, "e", 1), (vec![2.0, -2.0], false), "an error");
            }
            assert!(
                audio(&e, "l", 0).iter().all(|y| y.is_finite()),
                "the limiter trusts nobody, tick {tick}"
            );
        }
        let faults = |id: &str| e.report(node(&e, id)).expect("a node").last_fault;
        for (id, fault) in [("x", Fault::Panicked), ("e", Fault::Failed(42))] {
            assert_eq!(faults(id), Some(fault));
        }
        assert_eq!(["a", "c", "m"].map(faults), [check_finite.then_some(Fault::NotFinite); 3]);
    }
}
