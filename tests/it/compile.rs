//! Compiled graphs: order, gates, cycles, latency, dropped nodes. Schedules are plain data.

use asperity_diagnostics::Source;
use asperity_engine::{Engine, Options};
use asperity_graph::{Compiled, GraphFile, Schedule, Step, compile};
use asperity_node::{Buffer, Latency};
use proptest::prelude::*;

fn compiled(text: &str) -> Result<Compiled, String> {
    let graph = GraphFile::parse(&Source::new("g.ron", text)).map_err(|e| e.to_string())?;
    compile(&graph, &harness::registry(), Default::default())
        .map_err(|e| e.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))
}

fn schedule(nodes: &str, wires: &str) -> Schedule {
    match compiled(&format!("Graph(version: 1, nodes: {{{nodes}}}, wires: [{wires}])")) {
        Ok(c) => c.schedule,
        Err(e) => panic!("{e}"),
    }
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

/// A sound to work on: a floor's force held as audio needs a source of audio, which a delay line's silence is
/// not.
const SOUND: &str = "\"s\": (kind: \"stroke\"), \"m\": (kind: \"velocity\"), \
                     \"f\": (kind: \"virtual_floor\"), \
                     \"h\": (kind: \"action_history\"), ";

fn texture(id: &str) -> String {
    let file = |p: &str| harness::graphs(p).display().to_string();
    format!(
        "\"{id}\": (kind: \"texture_network\", params: (model: {:?}, library: {:?}, material: \"oak\")), \
         \"{id}p\": (kind: \"spsi\"), \"{id}o\": (kind: \"overlap_add\"), ",
        file("models/surfaces/texture.onnx"),
        file("models/surfaces/materials.ron")
    )
}

fn texture_wires(id: &str) -> String {
    format!(
        "(\"h.force\", \"{id}.force\"), (\"h.velocity\", \"{id}.velocity\"), (\"{id}\", \"{id}p\"), \
         (\"{id}p\", \"{id}o\"), "
    )
}

const MOTION_WIRES: &str =
    "(\"s\", \"m\"), (\"s\", \"f\"), (\"f.force\", \"h.force\"), (\"m.velocity\", \"h.velocity\"), ";

#[test]
fn a_gate_is_asked_before_what_it_lets_sleep() {
    let s = schedule(
        &format!("{SOUND}{}\"g\": (kind: \"speed_gate\"), \"p\": (kind: \"probe\")", texture("t")),
        &format!(
            "{MOTION_WIRES}{}(\"to\", \"g.in\"), (\"m.speed\", \"g.speed\"), (\"g.out\", \"p\")",
            texture_wires("t")
        ),
    );
    for id in ["t", "tp", "to"] {
        assert_eq!(gate_sets(&s, id), ["g"], "{id}");
    }
    for id in ["s", "m", "f", "h", "g", "p"] {
        assert!(gate_sets(&s, id).is_empty(), "{id}");
    }
    let at = |step: Step| s.steps.iter().position(|x| *x == step).unwrap();
    let i = |id: &str| s.index_of(id).unwrap();
    assert!(at(Step::Process(i("m"))) < at(Step::Wants(i("g"))));
    assert!(at(Step::Wants(i("g"))) < at(Step::Process(i("t"))));
    assert!(at(Step::Process(i("to"))) < at(Step::Process(i("g"))));
}

/// Both gates let the nodes before them sleep.
#[test]
fn second_gate_in_a_row_is_asked_only_if_the_first_is_open() {
    let s = schedule(
        &format!(
            "{SOUND}{}\"a\": (kind: \"speed_gate\"), \"b\": (kind: \"speed_gate\"), \"p\": (kind: \"probe\")",
            texture("t")
        ),
        &format!(
            "{MOTION_WIRES}{}(\"to\", \"a.in\"), (\"a.out\", \"b.in\"), (\"m.speed\", \"a.speed\"), \
             (\"m.speed\", \"b.speed\"), \
             (\"b.out\", \"p\")",
            texture_wires("t")
        ),
    );
    assert_eq!(gate_sets(&s, "t"), ["a+b"]);
    assert_eq!(gate_sets(&s, "a"), ["b"]);
    let at = |step: Step| s.steps.iter().position(|x| *x == step).unwrap();
    let i = |id: &str| s.index_of(id).unwrap();
    assert!(at(Step::Wants(i("b"))) < at(Step::Wants(i("a"))));
}

#[test]
fn what_two_gates_share_sleeps_while_both_are_closed() {
    let s = schedule(
        &format!(
            "{SOUND}{}\"a\": (kind: \"speed_gate\"), \"b\": (kind: \"speed_gate\"), \
             \"p\": (kind: \"probe\"), \"q\": (kind: \"probe\")",
            texture("t")
        ),
        &format!(
            "{MOTION_WIRES}{}(\"to\", \"a.in\"), (\"to\", \"b.in\"), (\"m.speed\", \"a.speed\"), \
             (\"m.speed\", \"b.speed\"), \
             (\"a.out\", \"p\"), (\"b.out\", \"q\")",
            texture_wires("t")
        ),
    );
    assert_eq!(gate_sets(&s, "t"), ["a", "b"]);
}

#[test]
fn what_a_gate_is_asked_with_does_not_sleep_behind_it() {
    // The texture's level drives the gate too, by way of a node that turns it into a speed: it must run.
    let s = schedule(
        &format!(
            "{SOUND}{}\"a\": (kind: \"speed_gate\"), \"b\": (kind: \"speed_gate\"), \
             \"p\": (kind: \"probe\"), \"g\": (kind: \"gain\", params: (unit: \"N\"))",
            texture("t")
        ),
        &format!(
            "{MOTION_WIRES}{}(\"to\", \"a.in\"), (\"a.out\", \"b.in\"), (\"a.active\", \"g\"), \
             (\"g\", \"b.force\"), \
             (\"m.speed\", \"a.speed\"), (\"m.speed\", \"b.speed\"), (\"b.out\", \"p\")",
            texture_wires("t")
        ),
    );
    // Gate b asks gate a's answer, so a is needed whatever b says; the texture is needed while a is open.
    assert!(gate_sets(&s, "a").is_empty());
    assert_eq!(gate_sets(&s, "t"), ["a"]);
}

#[test]
fn latency_adds_up_along_each_path() {
    // A diamond: 10 ms one way, 25 ms the other, 5 ms behind both.
    let s = schedule(
        "\"s\": (kind: \"stroke\"), \"f\": (kind: \"virtual_floor\"), \
         \"a\": (kind: \"delay\", params: (delay_ms: 10.0)), \
         \"b\": (kind: \"delay\", params: (delay_ms: 25.0)), \"m\": (kind: \"mix\"), \
         \"c\": (kind: \"delay\", params: (delay_ms: 5.0)), \"p\": (kind: \"probe\"), \
         \"q\": (kind: \"probe\")",
        "(\"s\", \"f\"), (\"f.force\", \"a\"), (\"f.force\", \"b\"), (\"a\", \"m.in1\"), \
         (\"b\", \"m.in2\"), (\"m\", \"c\"), \
         (\"c\", \"p\"), (\"f.depth\", \"q\")",
    );
    // A tick is 2 ms: 25 ms are 12.5 ticks, rounded away from zero, and 5 ms are 2.5.
    let path = |to: &str| s.paths.iter().find(|p| s.nodes[p.to].id == to).unwrap();
    let (least, most) = (Latency::ratio(10 + 6, 1000), Latency::ratio(26 + 6, 1000));
    assert_eq!((path("p").least, path("p").most), (least, most));
    let through: Vec<&str> = path("p").through.iter().map(|&i| s.nodes[i].id.as_str()).collect();
    assert_eq!(through, ["s", "f", "b", "m", "c", "p"]);
    assert_eq!(path("q").most, Latency::ZERO);
    assert_eq!(s.latency(), most);
}

#[test]
fn a_delay_cuts_only_the_cycle_it_is_in() {
    let s = schedule(
        "\"s\": (kind: \"stroke\"), \"f\": (kind: \"virtual_floor\"), \"out\": (kind: \"delay\"), \
         \"in\": (kind: \"delay\"), \
         \"m\": (kind: \"mix\"), \"p\": (kind: \"probe\")",
        "(\"s\", \"f\"), (\"f.force\", \"out\"), (\"out\", \"m.in1\"), (\"in\", \"m.in2\"), \
         (\"m\", \"in\"), (\"m\", \"p\")",
    );
    let closes = |id: &str| s.nodes[s.index_of(id).unwrap()].closes_cycle;
    assert!(closes("in") && !closes("out"));
    assert_eq!(s.steps.last(), Some(&Step::Absorb(s.index_of("in").unwrap())));
}

#[test]
fn a_delay_shorter_than_a_tick_cannot_close_a_cycle() {
    let nodes = "\"s\": (kind: \"stroke\"), \"f\": (kind: \"virtual_floor\"), \
                 \"d\": (kind: \"delay\", params: (delay_ms: \
                 0.5)), \"m\": (kind: \"mix\"), \"p\": (kind: \"probe\")";
    let wires =
        "(\"s\", \"f\"), (\"f.force\", \"m.in1\"), (\"d\", \"m.in2\"), (\"m\", \"d\"), (\"m\", \"p\")";
    let error = compiled(&format!("Graph(version: 1, nodes: {{{nodes}}}, wires: [{wires}])")).unwrap_err();
    assert!(error.contains("shorter than a tick") && error.contains("at least 2.0000 ms"), "{error}");
}

#[test]
fn a_type_settles_backwards_and_through_many_nodes() {
    // Only the far end says what flows: the unconnected sum takes its type from the gate's output side.
    let n = 2000;
    let mut nodes =
        String::from("\"s\": (kind: \"stroke\"), \"f\": (kind: \"virtual_floor\"), \"p\": (kind: \"probe\")");
    let mut wires = String::from("(\"s\", \"f\"), (\"f.force\", \"n0\")");
    // Declared from the last to the first, which is the worst order for whatever goes by the order of the
    // file.
    for i in (0..n).rev() {
        nodes.push_str(&format!(", \"n{i}\": (kind: \"gain\")"));
    }
    for i in (1..n).rev() {
        wires.push_str(&format!(", (\"n{}\", \"n{i}\")", i - 1));
    }
    wires.push_str(&format!(", (\"n{}\", \"p\")", n - 1));
    let s = schedule(&nodes, &wires);
    assert_eq!(s.nodes.len(), n + 3);
    assert_eq!(s.nodes[s.index_of("n1999").unwrap()].outputs[0].port.to_string(), "Control x1 [N]");
}

#[test]
fn a_wrong_rate_is_found_whatever_the_order_of_the_wires() {
    // The synthesis runs at 2500 Hz and is wired to the sound card's rate without a `resample`.
    let nodes = format!(
        "{SOUND}{}\"g\": (kind: \"speed_gate\"), \"i\": (kind: \"actuator_inverse\"), \
         \"l\": (kind: \"limiter\"), \
         \"o\": (kind: \"audio_out\")",
        texture("t")
    );
    let wires = format!(
        "{MOTION_WIRES}{}(\"to\", \"g.in\"), (\"m.speed\", \"g.speed\"), (\"g.out\", \"i\"), \
         (\"i\", \"l\"), (\"l\", \"o\")",
        texture_wires("t")
    );
    let mut list: Vec<&str> = wires.split_inclusive("), ").collect();
    for _ in 0..2 {
        let wires = list.join(", ").replace(", , ", ", ");
        let error =
            compiled(&format!("Graph(version: 1, nodes: {{{nodes}}}, wires: [{wires}])")).unwrap_err();
        assert!(
            error.contains("`l.out` carries Audio at 2500 Hz") && error.contains("Audio at 48000 Hz"),
            "{error}"
        );
        list.reverse();
    }
}

#[test]
fn a_schedule_is_plain_data_that_can_be_compared() {
    let text = |gain: f64| {
        format!(
            "Graph(version: 1, nodes: {{\"s\": (kind: \"stroke\"), \"f\": (kind: \"virtual_floor\"), \
             \"g\": (kind: \"gain\", \
             params: (gain: {gain:?})), \"p\": (kind: \"probe\")}}, wires: [(\"s\", \"f\"), \
             (\"f.force\", \"g\"), (\"g\", \"p\")])"
        )
    };
    let s = |gain| compiled(&text(gain)).unwrap().schedule;
    assert_eq!(s(0.5), s(0.5));
    assert_ne!(s(0.5), s(0.25));
}

#[test]
fn pruning_off_keeps_what_can_run_and_refuses_nothing_more() {
    let text = "Graph(version: 1, nodes: {\"s\": (kind: \"stroke\"), \"f\": (kind: \"virtual_floor\"), \
                \"p\": (kind: \"probe\"), \"idle\": (kind: \"gain\"), \"loose\": (kind: \"mix\"), \
                \"after\": (kind: \"gain\")}, wires: \
                [(\"s\", \"f\"), (\"f.force\", \"p\"), (\"f.depth\", \"idle\"), (\"loose\", \"after\")])";
    let graph = GraphFile::parse(&Source::new("g.ron", text)).unwrap();
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
    let mut nodes: Vec<String> = (0..many).map(|i| format!("\"s{i}\": (kind: \"sine\")")).collect();
    nodes.extend((0..inputs).map(|i| format!("\"m{i}\": (kind: \"mix\", params: (inputs: 64))")));
    nodes.extend((0..long).map(|i| format!("\"g{i}\": (kind: \"gain\")")));
    nodes.extend((0..many).map(|i| format!("\"p{i}\": (kind: \"probe\")")));
    let mut wires: Vec<(String, String)> =
        (0..many).map(|i| (format!("s{i}"), format!("m{}.in{}", i / 63, i % 63 + 1))).collect();
    wires.extend((1..inputs).map(|i| (format!("m{}", i - 1), format!("m{i}.in64"))));
    wires.push((format!("m{}", inputs - 1), "g0".to_owned()));
    wires.extend((1..long).map(|i| (format!("g{}", i - 1), format!("g{i}"))));
    wires.extend((0..many).map(|i| (format!("g{}", long - 1), format!("p{i}"))));
    let wires: Vec<String> = wires.iter().map(|(a, b)| format!("({a:?}, {b:?})")).collect();
    let s = schedule(&nodes.join(", "), &wires.join(", "));
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
    let nodes: Vec<String> = (0..1000).map(|i| format!("\"g{i}\": (kind: \"gain\")")).collect();
    let wires: Vec<String> = (1..1000).map(|i| format!("(\"g{}x\", \"g{i}\")", i - 1)).collect();
    let text = format!("Graph(version: 1, nodes: {{{}}}, wires: [{}])", nodes.join(", "), wires.join(", "));
    let graph = GraphFile::parse(&Source::new("g.ron", text)).unwrap();
    let errors = compile(&graph, &harness::registry(), Default::default()).unwrap_err();
    assert_eq!(errors.len(), 999);
    assert_eq!(errors[7].help.as_deref(), Some("did you mean `g7`?"));
    assert!(errors.iter().all(|e| e.message.starts_with("there is no node `g") && e.place.is_some()));
    assert_eq!(errors.iter().filter(|e| e.help.is_some()).count(), 100);
}

/// Of thousands of gates in a row each kept the list of all those behind it.
#[test]
fn of_many_gates_in_a_row_a_node_waits_for_the_last_alone() {
    let gates = 300;
    let mut nodes = vec![
        "\"s\": (kind: \"sine\")".to_owned(),
        "\"hand\": (kind: \"stroke\")".to_owned(),
        "\"v\": (kind: \"velocity\")".to_owned(),
        "\"out\": (kind: \"file_out\", params: (file: \"x.wav\"))".to_owned(),
    ];
    nodes.extend((0..gates).map(|i| format!("\"q{i}\": (kind: \"speed_gate\")")));
    let mut wires = vec![("hand".to_owned(), "v".to_owned()), ("s".to_owned(), "q0.in".to_owned())];
    wires.extend((0..gates).map(|i| ("v.speed".to_owned(), format!("q{i}.speed"))));
    wires.extend((1..gates).map(|i| (format!("q{}.out", i - 1), format!("q{i}.in"))));
    wires.push((format!("q{}.out", gates - 1), "out".to_owned()));
    let wires: Vec<String> = wires.iter().map(|(a, b)| format!("({a:?}, {b:?})")).collect();
    let s = schedule(&nodes.join(", "), &wires.join(", "));
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
        let mut nodes = vec!["\"s\": (kind: \"stroke\")".to_owned(), "\"f\": (kind: \
                              \"virtual_floor\")".to_owned(), "\"p\": (kind: \"probe\")".to_owned()];
        for (i, kind) in kinds.iter().enumerate() {
            nodes.push(match kind {
                0 => format!("\"n{i}\": (kind: \"mix\", params: (inputs: 3, gains: [0.5, -0.25, 0.125]))"),
                1 => format!("\"n{i}\": (kind: \"gain\", params: (gain: 0.5))"),
                _ => format!("\"n{i}\": (kind: \"delay\", params: (delay_ms: {}.0))", 2 + i),
            });
        }
        let mut wires = vec!["(\"s\", \"f\")".to_owned(), "(\"n0\", \"p\")".to_owned()];
        for (from, to, input) in edges {
            let to = to % kinds.len();
            let input = if kinds[to] == 0 { format!("n{to}.in{}", input + 1) } else { format!("n{to}") };
            let from = if from < kinds.len() { format!("n{from}") } else { "f.force".to_owned() };
            wires.push(format!("(\"{from}\", \"{input}\")"));
        }
        let text = |nodes: &[String], wires: &[String]| {
            format!("Graph(version: 1, nodes: {{{}}}, wires: [{}])", nodes.join(", "), wires.join(", "))
        };
        let forward = compiled(&text(&nodes, &wires));
        nodes.reverse();
        wires.reverse();
        match (forward, compiled(&text(&nodes, &wires))) {
            (Ok(a), Ok(b)) => prop_assert_eq!(run(a, 300), run(b, 300)),
            (Err(a), Err(b)) => prop_assert!(a.contains("g.ron:1:") && b.contains("g.ron:1:"), "{a}\n{b}"),
            (a, b) => prop_assert!(false, "one order compiles: {:?} {:?}", a.err(), b.err()),
        }
    }
}
