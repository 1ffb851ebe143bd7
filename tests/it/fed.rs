//! Inputs that a host feeds to a graph, and time that passes without ticks.

use asperity_engine::{Controller, Engine};
use asperity_graph::GraphFile;
use asperity_node::{Buffer, Registry};
use harness::Room;

use crate::drive::{audio_of, control_of, node};

fn graph(lines: &str) -> GraphFile {
    let mut graph = harness::graph::of_lines(lines);
    graph.set("audio_hz=44100", "test").expect("a rate");
    graph
}

fn engine(lines: &str) -> (Controller, Engine) {
    Engine::controlled(harness::graph::compiled(&graph(lines), &registry()), Default::default())
}

fn registry() -> Registry {
    harness::registry()
}

fn output<'e>(engine: &'e Engine, id: &str, at: usize) -> &'e Buffer {
    engine.output(node(engine, id), at).expect("an output")
}

fn control(engine: &Engine, id: &str, at: usize) -> Vec<f64> {
    control_of(engine, id, at).0
}

fn audio(engine: &Engine, id: &str) -> Vec<f32> {
    audio_of(engine, id, 0)
}

const HAND: &str = "hand: osc_input; p: probe; hand.position -> p";

fn place(engine: &mut Engine, at: [f64; 3], valid: bool) -> bool {
    let hand = node(engine, "hand");
    engine.feed_control(hand, 0, &at, valid)
        && engine.feed_control(hand, 1, &[0.5], valid)
        && engine.feed_control(hand, 2, &[1.0], valid)
}

#[test]
fn what_the_host_has_not_given_is_not_to_be_trusted() {
    let (_c, mut engine) = engine(HAND);
    engine.tick();
    assert!(!output(&engine, "hand", 0).is_valid());
    assert!(place(&mut engine, [1.0, 2.0, 3.0], true));
    engine.tick();
    assert!(output(&engine, "hand", 0).is_valid());
    assert_eq!(control(&engine, "hand", 0), [1.0, 2.0, 3.0]);
    // It holds until something else is given.
    engine.tick();
    assert_eq!(control(&engine, "hand", 0), [1.0, 2.0, 3.0]);
    assert!(place(&mut engine, [1.0, 2.0, 3.0], false));
    engine.tick();
    assert!(!output(&engine, "hand", 0).is_valid());
    assert_eq!(control(&engine, "hand", 0), [1.0, 2.0, 3.0], "held");
}

#[test]
fn a_value_that_is_not_finite_is_not_taken() {
    let (_c, mut engine) = engine(HAND);
    assert!(place(&mut engine, [1.0, 2.0, 3.0], true));
    let hand = node(&engine, "hand");
    assert!(!engine.feed_control(hand, 0, &[f64::NAN, 0.0, 0.0], true));
    engine.tick();
    assert_eq!(control(&engine, "hand", 0), [1.0, 2.0, 3.0]);
    assert!(!output(&engine, "hand", 0).is_valid());
    assert_eq!(engine.faults(), 0, "the node did nothing wrong");
    for (node, input, count) in [(hand, 0, 2), (hand, 7, 3), (99, 0, 3)] {
        assert!(!engine.feed_control(node, input, &vec![0.0; count], true));
    }
}

#[test]
fn a_wire_takes_the_place_of_the_host() {
    let (_c, mut engine) =
        engine("t: stroke; hand: osc_input; p: probe; t -> hand.hand_position; hand.position -> p");
    assert_eq!(engine.schedule().host_fed().count(), 2, "force and stroke are the host's");
    let hand = node(&engine, "hand");
    assert!(!engine.feed_control(hand, 0, &[1.0, 2.0, 3.0], true));
    engine.tick();
    assert_eq!(control(&engine, "hand", 0), control(&engine, "t", 0));
}

#[test]
fn what_was_given_goes_on_through_a_swap_in_the_same_tick() {
    let (mut controller, mut engine) = engine(HAND);
    for k in 0..5 {
        assert!(place(&mut engine, [f64::from(k), 0.0, 0.0], true));
        engine.tick();
    }
    let other = graph("hand: osc_input(timeout_ms: 70.0); p: probe; hand.position -> p");
    let compiled = harness::graph::compiled(&other, &registry());
    let report = controller.swap(compiled, &[]).expect("it is sent");
    assert!(report.to_string().contains("`hand` rebuilt"), "{report}");
    for k in 5..20 {
        assert!(place(&mut engine, [f64::from(k), 0.0, 0.0], true));
        engine.tick();
        assert_eq!(control(&engine, "hand", 0), [f64::from(k), 0.0, 0.0]);
        assert!(output(&engine, "hand", 0).is_valid());
    }
    assert_eq!(engine.swaps(), 1);
}

/// The gate of a stroked surface that buzzes.
const SURFACE: &str = "hand: osc_input; motion: velocity; floor: virtual_floor; mic: audio_in
    gate: speed_gate; out: file_out(file: \"x.npy\")
    hand.position -> motion.position; hand.position -> floor; motion.speed -> gate.speed
    floor.force -> gate.force; mic -> gate.in; gate.out -> out";

#[test]
fn silent_hand_shuts_the_gate_within_its_fade() {
    let (_c, mut engine) = engine(SURFACE);
    let mic = node(&engine, "mic");
    let run = |engine: &mut Engine, k: u32, valid: bool| {
        assert!(place(engine, [0.2 * f64::from(k), 0.0, -2.0], valid));
        assert!(engine.feed_audio(mic, 0, true, |samples| samples.fill(0.5)));
        engine.tick();
        audio(engine, "out")
    };
    for k in 0..200 {
        run(&mut engine, k, true);
    }
    assert!(run(&mut engine, 200, true).iter().all(|x| *x == 0.5), "it is open");
    // Held where it was; the filter would take 40 ms to come below the gate's threshold.
    let faded: Vec<f32> = (0..5).flat_map(|_| run(&mut engine, 200, false)).collect();
    assert!(faded.windows(2).all(|w| w[1] <= w[0]), "it fades");
    assert!(run(&mut engine, 200, false).iter().all(|x| *x == 0.0), "within 10 ms it is shut");
    let calls = engine.report(mic).expect("it").calls;
    run(&mut engine, 200, false);
    assert_eq!(engine.report(mic).expect("it").calls, calls, "what is behind it sleeps");
    // It opens again by itself.
    for k in 201..240 {
        run(&mut engine, k, true);
    }
    assert!(run(&mut engine, 240, true).iter().all(|x| *x == 0.5));
}

/// Each tick has its own number of samples. A tick with a NaN is silent and invalid.
#[test]
fn fed_audio_has_the_ticks_length_and_is_finite() {
    let (_c, mut engine) =
        engine("mic: audio_in(full_scale: 2.0); out: file_out(file: \"x.npy\"); mic -> out");
    let mic = node(&engine, "mic");
    let mut sent = 0;
    for _ in 0..10 {
        let mut len = 0;
        assert!(engine.feed_audio(mic, 0, true, |samples| {
            len = samples.len();
            samples.iter_mut().for_each(|x| *x = 0.25);
        }));
        engine.tick();
        assert_eq!(audio(&engine, "out"), vec![0.5; len]);
        sent += len;
    }
    assert_eq!(sent, 882, "88 or 89 a tick");
    assert!(engine.feed_audio(mic, 0, true, |samples| samples[3] = f32::NAN));
    engine.tick();
    assert!(audio(&engine, "out").iter().all(|x| *x == 0.0));
    assert!(!output(&engine, "mic", 0).is_valid());
    assert_eq!(engine.faults(), 0);
    // Nothing was given: silence, and none of the samples before once more.
    assert!(engine.feed_audio(mic, 0, true, |samples| samples.fill(1.0)));
    engine.tick();
    assert!(audio(&engine, "out").iter().all(|x| *x == 2.0));
    engine.tick();
    assert!(audio(&engine, "out").iter().all(|x| *x == 0.0));
}

#[test]
fn skipped_ticks_go_by_for_every_node() {
    let zigzag = "t: trajectory; motion: velocity; p: probe; q: probe
        t.position -> motion.position; motion.speed -> p; t.position -> q";
    let (_c, mut all) = engine(zigzag);
    let (_d, mut some) = engine(zigzag);
    for _ in 0..300 {
        all.tick();
    }
    for _ in 0..100 {
        some.tick();
    }
    some.skip(0);
    some.skip(199);
    assert_eq!(some.next_tick(), 299);
    some.tick();
    assert_eq!(control(&some, "t", 0), control(&all, "t", 0), "the stroke went on");
    assert_eq!(some.report(node(&some, "t")).expect("it").calls, 101);
}

#[test]
fn a_stylus_that_is_put_down_elsewhere_has_not_flown_there() {
    let (_c, mut engine) = engine(
        "hand: osc_input; motion: velocity; p: probe
         hand.position -> motion.position; hand.stroke -> motion.stroke; motion.speed -> p",
    );
    let mut fastest: f64 = 0.0;
    for k in 0..200_u32 {
        let hand = node(&engine, "hand");
        let x = if k < 100 { 0.1 * f64::from(k) } else { 100.0 + 0.1 * f64::from(k) };
        engine.feed_control(hand, 0, &[x, 0.0, 0.0], true);
        engine.feed_control(hand, 1, &[0.5], true);
        engine.feed_control(hand, 2, &[f64::from(k / 100)], true);
        engine.tick();
        fastest = fastest.max(control(&engine, "motion", 1)[0]);
    }
    // 0.1 mm in 2 ms, and what a second-order Butterworth overshoots.
    assert!((50.0..53.0).contains(&fastest), "{fastest} mm/s");
}

/// A hand at 50 mm/s along x and 20 mm/s down, by the tick.
fn way(tick: u64) -> [f64; 3] {
    let t = tick as f64 / 500.0;
    [50.0 * t, 0.0, 10.0 - 20.0 * t]
}

const SPEED: &str = "hand: osc_input; motion: velocity; p: probe; q: probe
    hand.position -> motion.position; motion.speed -> p; motion.unfiltered -> q";

#[test]
fn a_stylus_that_moves_while_ticks_are_lost_is_no_faster() {
    for lost in [1, 3, 50, 5000] {
        let (_c, mut engine) = engine(SPEED);
        let mut fastest: f64 = 0.0;
        while engine.next_tick() < 6000 {
            if engine.next_tick() == 100 {
                engine.skip(lost);
            }
            let at = way(engine.next_tick());
            assert!(place(&mut engine, at, true));
            engine.tick();
            fastest = fastest.max(control(&engine, "motion", 1)[0]);
            if engine.next_tick() > 150 {
                // Nothing of it is left, and nothing stays.
                assert!((control(&engine, "motion", 1)[0] - 50.0).abs() < 0.01);
            }
        }
        // What a second-order Butterworth overshoots at the start.
        assert!((50.0..52.5).contains(&fastest), "{lost} lost: {fastest} mm/s");
    }
}

/// The first valid position after a gap makes no jump of the velocity.
#[test]
fn velocity_is_held_while_positions_are_invalid() {
    for gap in [1, 5, 200] {
        let (_c, mut engine) = engine(SPEED);
        for tick in 0..600 {
            let missing = (300..300 + gap).contains(&tick);
            // The host holds the last place.
            let at = if missing { way(299) } else { way(tick) };
            assert!(place(&mut engine, at, !missing));
            engine.tick();
            assert_eq!(output(&engine, "motion", 1).is_valid(), !missing);
            if tick >= 200 {
                let (speed, all) = (control(&engine, "motion", 1)[0], control(&engine, "motion", 3));
                assert!((speed - 50.0).abs() < 1e-3, "{gap}: {speed} mm/s in tick {tick}");
                assert!((all[0] - 50.0).abs() < 1e-6 && (all[2] + 20.0).abs() < 1e-6, "{gap}: {all:?}");
            }
        }
    }
}

#[test]
fn a_hand_that_is_first_heard_of_has_not_flown_there() {
    let (_c, mut engine) = engine(SPEED);
    for tick in 0..50 {
        assert!(tick < 10 || place(&mut engine, [80.0, -40.0, 5.0], true));
        engine.tick();
        assert_eq!(control(&engine, "motion", 1), [0.0]);
    }
}

#[test]
fn wall_reached_over_lost_ticks_or_a_gap_is_no_faster() {
    let dir = Room::new();
    let scene = dir.join("floor.ron");
    std::fs::write(
        &scene,
        "Scene(version: 1, input: stroke, surfaces: {\"a\": (shape: plane, \
         effects: (stiffness: (stiffness_n_per_mm: 0.5)))})",
    )
    .unwrap();
    let lines = format!(
        "hand: osc_input; contact: contact(scene: {:?}); p: probe
         hand.position -> contact.position; contact.approach -> p",
        scene.display().to_string()
    );
    // It is reached after 250 ticks.
    for (lost, from) in [(true, 240), (false, 240), (true, 100), (false, 100), (true, 249), (false, 249)] {
        let (_c, mut engine) = engine(&lines);
        let at = node(&engine, "contact");
        let output = engine.schedule().nodes[at].outputs.iter().position(|o| o.name == "approach").unwrap();
        let mut told = Vec::new();
        while engine.next_tick() < 400 {
            if lost && engine.next_tick() == from {
                engine.skip(60);
            }
            let tick = engine.next_tick();
            let missing = (from..from + 60).contains(&tick);
            let here = way(if missing { from - 1 } else { tick });
            assert!(place(&mut engine, here, !missing));
            engine.tick();
            told.extend(control(&engine, "contact", output).into_iter().filter(|v| *v > 0.0));
        }
        assert!(told.len() == 1 && (told[0] - 20.0).abs() < 1e-6, "lost {lost} from {from}: {told:?}");
    }
}
