//! Compiled graphs: order, gates, cycles, latency, dropped nodes. Schedules are plain data.

use asperity_engine::{Engine, Options};
use asperity_graph::{Compiled, Schedule, Step, compile};
use asperity_node::{Buffer, Latency};
use harness::graph;
use proptest::prelude::*;

fn compiled(nodes: &str, wires: &str) -> Result<Compiled, String> {
    compile(&graph::of_lines(&format!("{nodes}; {wires}")), &harness::registry(), Default::default())
        .map_err(|e| e.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))
}

fn schedule(nodes: &str, wires: &str) -> Schedule {
    compiled(nodes, wires).unwrap_or_else(|e| panic!("{e}")).schedule
}

/// The ways in which a node is wanted, each as gates joined by +.
fn gate_sets(s: &Schedule, id: &str) -> Vec<String> {
    let node = &s.nodes[s.index_of(id).unwrap()];
    let way = |way: &Vec<usize>| {
        let mut ids: Vec<&str> = way.iter().map(|&g| s.nodes[g].id.as_str()).collect();
        ids.sort();
        ids.join("+")
    };
    let mut ways: Vec<String> = node.gate_sets.iter().map(way).collect();
    ways.sort();
    ways
}

/// A texture, whose sound `to` these nodes and wires work on, and the motion that it follows.
fn textured(nodes: &str, wires: &str) -> [String; 2] {
    let file = |p: &str| harness::graphs(p).display().to_string();
    let network = format!(
        "texture_network(model: {:?}, library: {:?}, material: \"oak\")",
        file("models/surfaces/texture.onnx"),
        file("models/surfaces/materials.ron")
    );
    [
        format!(
            "s: stroke; m: velocity; f: virtual_floor; h: action_history; t: {network}; tp: spsi; \
             to: overlap_add; {nodes}"
        ),
        format!(
            "s -> m; s -> f; f.force -> h.force; m.velocity -> h.velocity; h.force -> t.force; \
             h.velocity -> t.velocity; t -> tp -> to; {wires}"
        ),
    ]
}

fn gated(nodes: &str, wires: &str) -> Schedule {
    let [nodes, wires] = textured(nodes, wires);
    schedule(&nodes, &wires)
}

/// Whether these steps come in this order.
fn in_order(s: &Schedule, steps: &[(fn(usize) -> Step, &str)]) -> bool {
    let at = |(step, id): &(fn(usize) -> Step, &str)| {
        let step = step(s.index_of(id).unwrap());
        s.steps.iter().position(|x| *x == step).unwrap()
    };
    steps.is_sorted_by_key(at)
}

#[test]
fn a_gate_is_asked_before_what_it_lets_sleep() {
    let s = gated("g: speed_gate; p: probe", "to -> g.in; m.speed -> g.speed; g.out -> p");
    for id in ["t", "tp", "to"] {
        assert_eq!(gate_sets(&s, id), ["g"], "{id}");
    }
    for id in ["s", "m", "f", "h", "g", "p"] {
        assert!(gate_sets(&s, id).is_empty(), "{id}");
    }
    let steps: [(fn(usize) -> Step, &str); 5] = [
        (Step::Process, "m"),
        (Step::Wants, "g"),
        (Step::Process, "t"),
        (Step::Process, "to"),
        (Step::Process, "g"),
    ];
    assert!(in_order(&s, &steps));
}

/// Both gates let the nodes before them sleep.
#[test]
fn second_gate_in_a_row_is_asked_only_if_the_first_is_open() {
    let s = gated(
        "a: speed_gate; b: speed_gate; p: probe",
        "to -> a.in; a.out -> b.in; m.speed -> a.speed; m.speed -> b.speed; b.out -> p",
    );
    assert_eq!((gate_sets(&s, "t"), gate_sets(&s, "a")), (vec!["a+b".into()], vec!["b".into()]));
    assert!(in_order(&s, &[(Step::Wants, "b"), (Step::Wants, "a")]));
}

#[test]
fn what_two_gates_share_sleeps_while_both_are_closed() {
    let s = gated(
        "a: speed_gate; b: speed_gate; p: probe; q: probe",
        "to -> a.in; to -> b.in; m.speed -> a.speed; m.speed -> b.speed; a.out -> p; b.out -> q",
    );
    assert_eq!(gate_sets(&s, "t"), ["a", "b"]);
}

#[test]
fn what_a_gate_is_asked_with_does_not_sleep_behind_it() {
    // The texture's level drives the gate too, by way of a node that turns it into a speed: it must run.
    let s = gated(
        "a: speed_gate; b: speed_gate; p: probe; g: gain(unit: \"N\")",
        "to -> a.in; a.out -> b.in; a.active -> g -> b.force; m.speed -> a.speed; m.speed -> b.speed; \
         b.out -> p",
    );
    // Gate b asks gate a's answer, so a is needed whatever b says; the texture is needed while a is open.
    assert!(gate_sets(&s, "a").is_empty());
    assert_eq!(gate_sets(&s, "t"), ["a"]);
}

#[test]
fn latency_adds_up_along_each_path() {
    // A diamond: 10 ms one way, 25 ms the other, 5 ms behind both.
    let s = schedule(
        "s: stroke; f: virtual_floor; a: delay(delay_ms: 10.0); b: delay(delay_ms: 25.0); m: mix; \
         c: delay(delay_ms: 5.0); p: probe; q: probe",
        "s -> f; f.force -> a; f.force -> b; a -> m.in1; b -> m.in2; m -> c -> p; f.depth -> q",
    );
    // A tick is 2 ms: 25 ms are 12.5 ticks, rounded away from zero, and 5 ms are 2.5.
    let path = |to: &str| s.paths.iter().find(|p| s.nodes[p.to].id == to).unwrap();
    let most = Latency::ratio(26 + 6, 1000);
    assert_eq!(path("p").most, most);
    let through: Vec<&str> = path("p").through.iter().map(|&i| s.nodes[i].id.as_str()).collect();
    assert_eq!(through, ["s", "f", "b", "m", "c", "p"]);
    assert_eq!(path("q").most, Latency::ZERO);
    assert_eq!(s.latency(), most);
    // The slowest path to any sink is the same one, since nothing here is early.
    assert_eq!((s.slowest().latency, s.slowest().through), (most, path("p").through.clone()));
}

/// Early samples were added up with late ones: a graph had -39 ms.
#[test]
fn early_samples_and_openers_of_a_gate_delay_nothing() {
    let s = gated(
        "a: speed_gate; d: delay(delay_ms: 10.0); c: delay(delay_ms: 4.0); p: probe",
        "to -> c -> a.in; m.speed -> d -> a.speed; a.out -> p",
    );
    let path = s.slowest();
    assert_eq!(path.latency, Latency::ratio(4, 1000));
    let through: Vec<&str> = path.through.iter().map(|&i| s.nodes[i].id.as_str()).collect();
    assert!(through.contains(&"c") && !through.contains(&"d"), "{through:?}");
}

#[test]
fn a_delay_cuts_only_the_cycle_it_is_in() {
    let s = schedule(
        "s: stroke; f: virtual_floor; out: delay; in: delay; m: mix; p: probe",
        "s -> f; f.force -> out -> m.in1; in -> m.in2; m -> in; m -> p",
    );
    let closes = |id: &str| s.nodes[s.index_of(id).unwrap()].closes_cycle;
    assert!(closes("in") && !closes("out"));
    assert_eq!(s.steps.last(), Some(&Step::Absorb(s.index_of("in").unwrap())));
}

#[test]
fn a_delay_shorter_than_a_tick_cannot_close_a_cycle() {
    let nodes = "s: stroke; f: virtual_floor; d: delay(delay_ms: 0.5); m: mix; p: probe";
    let wires = "s -> f; f.force -> m.in1; d -> m.in2; m -> d; m -> p";
    let error = compiled(nodes, wires).unwrap_err();
    assert!(error.contains("shorter than a tick") && error.contains("at least 2.0000 ms"), "{error}");
}

#[test]
fn a_type_settles_backwards_and_through_many_nodes() {
    // Only the far end says what flows. Declared from the last to the first, which is the worst order for
    // whatever goes by the order of the file.
    let gains: String = (0..2000).rev().map(|i| format!("n{i}: gain; ")).collect();
    let wires: String = (1..2000).rev().map(|i| format!("n{} -> n{i}; ", i - 1)).collect();
    let s = schedule(
        &format!("s: stroke; f: virtual_floor; p: probe; {gains}"),
        &format!("s -> f; f.force -> n0; {wires} n1999 -> p"),
    );
    assert_eq!(s.nodes.len(), 2003);
    assert_eq!(s.nodes[s.index_of("n1999").unwrap()].outputs[0].port.to_string(), "Control x1 [N]");
}

#[test]
fn a_wrong_rate_is_found_whatever_the_order_of_the_wires() {
    // The synthesis runs at 2500 Hz and is wired to the sound card's rate without a `resample`.
    let [nodes, wires] = textured(
        "g: speed_gate; i: actuator_inverse; l: limiter; o: audio_out",
        "to -> g.in; m.speed -> g.speed; g.out -> i -> l -> o",
    );
    let reversed: Vec<&str> = wires.split("; ").collect();
    let reversed = reversed.into_iter().rev().collect::<Vec<_>>().join("; ");
    for wires in [wires, reversed] {
        let error = compiled(&nodes, &wires).unwrap_err();
        assert!(
            error.contains("`l.out` carries Audio at 2500 Hz") && error.contains("Audio at 48000 Hz"),
            "{error}"
        );
    }
}

#[test]
fn a_schedule_is_plain_data_that_can_be_compared() {
    let s = |gain: f64| {
        let nodes = format!("s: stroke; f: virtual_floor; g: gain(gain: {gain:?}); p: probe");
        schedule(&nodes, "s -> f; f.force -> g -> p")
    };
    assert_eq!(s(0.5), s(0.5));
    assert_ne!(s(0.5), s(0.25));
}

#[test]
fn pruning_off_keeps_what_can_run_and_refuses_nothing_more() {
    let graph = graph::of_lines(
        "s: stroke; f: virtual_floor; p: probe; idle: gain; loose: mix; after: gain
         s -> f; f.force -> p; f.depth -> idle; loose -> after",
    );
    let options = asperity_graph::Options { prune: false };
    let s = compile(&graph, &harness::registry(), options).expect("it compiles").schedule;
    assert!(s.index_of("idle").is_some() && s.index_of("loose").is_none() && s.index_of("after").is_none());
    assert_eq!(s.dropped.len(), 2);
}

/// A hundred sources before a chain and a hundred sinks behind it took a gigabyte to list their paths.
#[test]
fn many_paths_over_a_long_chain_stay_short() {
    let (many, long) = (100, 2000);
    let inputs = (many - 1) / 63 + 1;
    let nodes = |count: usize, name: &str, kind: &str| -> String {
        (0..count).map(|i| format!("{name}{i}: {kind}; ")).collect()
    };
    let nodes = nodes(many, "s", "sine")
        + &nodes(inputs, "m", "mix(inputs: 64)")
        + &nodes(long, "g", "gain")
        + &nodes(many, "p", "probe");
    let mut wires: String = (0..many).map(|i| format!("s{i} -> m{}.in{}; ", i / 63, i % 63 + 1)).collect();
    wires.extend((1..inputs).map(|i| format!("m{} -> m{i}.in64; ", i - 1)));
    wires += &format!("m{} -> g0; ", inputs - 1);
    wires.extend((1..long).map(|i| format!("g{} -> g{i}; ", i - 1)));
    wires.extend((0..many).map(|i| format!("g{} -> p{i}; ", long - 1)));
    let s = schedule(&nodes, &wires);
    assert_eq!(s.paths.len(), many * many);
    let named: usize = s.paths.iter().map(|p| p.through.len()).sum();
    assert!((long + 100_000..150_000).contains(&named), "{named}");
    let whole = |p: &&asperity_graph::PathLatency| p.through.len() > long;
    assert!(s.paths.iter().filter(whole).count() >= 40, "the first name all their nodes");
    for path in &s.paths {
        assert_eq!((path.through.first(), path.through.last()), (Some(&path.from), Some(&path.to)));
    }
}

/// Each of thousands of wrong names was held against each of thousands of right ones, for most of a minute.
#[test]
fn thousand_wrong_names_are_all_told_and_a_hundred_guessed() {
    let nodes: String = (0..1000).map(|i| format!("g{i}: gain; ")).collect();
    let wires: String = (1..1000).map(|i| format!("g{}x -> g{i}; ", i - 1)).collect();
    let graph = graph::of_lines(&(nodes + &wires));
    let errors = compile(&graph, &harness::registry(), Default::default()).unwrap_err();
    assert_eq!(errors.len(), 999);
    assert_eq!(errors[7].help.as_deref(), Some("did you mean `g7`, `g70`, `g71`, `g72` or `g73`?"));
    assert!(errors.iter().all(|e| e.message.starts_with("there is no node `g") && e.place.is_some()));
    assert_eq!(errors.iter().filter(|e| e.help.is_some()).count(), 100);
}

/// Of thousands of gates in a row each kept the list of all those behind it.
#[test]
fn of_many_gates_in_a_row_a_node_waits_for_the_last_alone() {
    let gates = 300;
    let mut nodes = String::from("s: sine; hand: stroke; v: velocity; out: file_out(file: \"x.wav\"); ");
    nodes.extend((0..gates).map(|i| format!("q{i}: speed_gate; ")));
    let mut wires = String::from("hand -> v; s -> q0.in; ");
    wires.extend((0..gates).map(|i| format!("v.speed -> q{i}.speed; ")));
    wires.extend((1..gates).map(|i| format!("q{}.out -> q{i}.in; ", i - 1)));
    let s = schedule(&nodes, &format!("{wires} q{}.out -> out", gates - 1));
    assert_eq!(gate_sets(&s, "q299"), [""; 0]);
    assert_eq!(gate_sets(&s, "q297"), ["q298+q299"]);
    let most = s.nodes.iter().flat_map(|n| &n.gate_sets).map(Vec::len).max();
    assert_eq!(most, Some(64));
    assert_eq!(s.nodes[s.index_of("s").unwrap()].gate_sets.len(), 1);
}

/// Values of a probe's input over some ticks.
fn run(compiled: Compiled, ticks: usize) -> Vec<u64> {
    let mut engine = Engine::new(compiled, Options::default());
    let probe = engine.schedule().index_of("p").unwrap();
    let mut out = Vec::new();
    for _ in 0..ticks {
        engine.tick();
        if let Some(Buffer::Control { values, .. }) = engine.input(probe, 0) {
            out.extend(values.iter().map(|x| x.to_bits()));
        }
    }
    assert_eq!(engine.faults(), 0);
    out
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    /// A random graph of sums, gains and delays: if it compiles it runs, twice the same, and the order of the
    /// file does not matter; if not, it says why.
    #[test]
    fn any_graph_that_compiles_runs_and_any_other_says_why(
        kinds in prop::collection::vec(0..3_u8, 1..12),
        edges in prop::collection::vec((0..14_usize, 0..12_usize, 0..3_usize), 0..24),
    ) {
        let mut nodes = vec!["s: stroke; f: virtual_floor; p: probe".to_owned()];
        for (i, kind) in kinds.iter().enumerate() {
            nodes.push(match kind {
                0 => format!("n{i}: mix(inputs: 3, gains: [0.5, -0.25, 0.125])"),
                1 => format!("n{i}: gain(gain: 0.5)"),
                _ => format!("n{i}: delay(delay_ms: {}.0)", 2 + i),
            });
        }
        let mut wires = vec!["s -> f; n0 -> p".to_owned()];
        for (from, to, input) in edges {
            let to = to % kinds.len();
            let input = if kinds[to] == 0 { format!("n{to}.in{}", input + 1) } else { format!("n{to}") };
            let from = if from < kinds.len() { format!("n{from}") } else { "f.force".to_owned() };
            wires.push(format!("{from} -> {input}"));
        }
        let forward = compiled(&nodes.join("; "), &wires.join("; "));
        nodes.reverse();
        wires.reverse();
        match (forward, compiled(&nodes.join("; "), &wires.join("; "))) {
            (Ok(a), Ok(b)) => prop_assert_eq!(run(a, 300), run(b, 300)),
            (Err(a), Err(b)) => {
                prop_assert!(a.contains("test.ron:1:") && b.contains("test.ron:1:"), "{a}\n{b}")
            }
            (a, b) => prop_assert!(false, "one order compiles: {:?} {:?}", a.err(), b.err()),
        }
    }
}
