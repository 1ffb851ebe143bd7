//! The tick thread neither allocates nor frees.

use asperity_accuracy::timing::Recorder;
use asperity_engine::{Engine, Options};
use asperity_graph::GraphFile;
use harness::counting::allocations;
use harness::{any_node, graph};

/// Ticks of one run; `ASPERITY_LONG_TICKS` asks for more.
fn ticks() -> u64 {
    std::env::var("ASPERITY_LONG_TICKS").ok().and_then(|t| t.parse().ok()).unwrap_or(6_000)
}

#[test]
fn recorded_times_allocate_nothing() {
    let mut recorder = Recorder::new(3);
    let ((), count) = allocations(|| {
        for n in 0..3000 {
            recorder.tick(n * 1000);
            recorder.node(1, n);
        }
        recorder.reset();
    });
    assert_eq!(count, 0);
}

/// A change of a running graph saves, restores, sets and resets nodes on the tick thread.
#[test]
fn state_and_live_parameters_allocate_nothing() {
    for kind in harness::registry().iter() {
        let (mut old, mut new) = (any_node::prepared(kind, &[]), any_node::prepared(kind, &[]));
        let mut bytes = vec![0; old.state_size()];
        let live: Vec<usize> =
            (0..kind.descriptor().params.len()).filter(|&i| kind.descriptor().params[i].live).collect();
        let (restored, count) = allocations(|| {
            let len = old.save(&mut bytes).unwrap_or(0);
            let refused = !new.restore(&bytes[..len / 2]) || len == 0;
            live.iter().for_each(|i| new.set_parameter(*i, 0.5));
            let restored = new.restore(&bytes[..len]);
            new.reset();
            restored && refused
        });
        assert!(restored && count == 0, "{}", kind.descriptor().kind);
    }
}

/// Whole strokes over the shipped scenes: surfaces of all shapes, all effects, in contact and out of it.
#[test]
fn no_tick_of_a_scene_allocates() {
    for name in ["side_by_side.ron", "twelve.ron", "every_effect.ron", "thousand.ron"] {
        let graph = graph::lowered(&harness::graphs("scenes").join(name));
        let compiled = graph::compiled(&graph, &harness::registry());
        let most = compiled.schedule.duration_ticks().expect("a stroke that ends");
        let mut engine = Engine::new(compiled, Options::default());
        let ((), count) = allocations(|| (0..most).for_each(|_| engine.tick()));
        assert!(count == 0 && engine.faults() == 0, "{name}");
    }
}

#[test]
fn no_tick_of_the_shipped_graph_allocates() {
    for (name, synthesis_hz, tick_hz, audio_hz) in [
        ("heravi2024", 2500, 500, 48_000),
        ("heravi2024", 0, 500, 48_000),
        ("heravi2024", 2500, 1000, 44_100),
        ("heravi2024", 500, 500, 48_000),
        ("heravi2024_scatter", 2500, 500, 48_000),
        ("texture", 2500, 500, 48_000),
        ("texture", 0, 500, 48_000),
        ("texture", 2500, 1000, 44_100),
    ] {
        let mut graph = GraphFile::read(harness::graphs(&format!("{name}.ron"))).expect("the shipped graph");
        // A stroke without end, so that no node sleeps.
        let stylus = graph.nodes.iter_mut().find(|n| n.id == "stylus").expect("the stylus");
        stylus.kind = "stroke".into();
        stylus.params.clear();
        for set in [
            "stylus.shape=circle".to_owned(),
            "stylus.duration_s=1e6".to_owned(),
            format!("texture.synthesis_hz={synthesis_hz}"),
            format!("tick_hz={tick_hz}"),
            format!("audio_hz={audio_hz}"),
        ] {
            graph.set(&set, "--set").expect("a setting");
        }
        let compiled = graph::compiled(&graph, &harness::registry());
        assert!(compiled.schedule.allocating().is_empty());
        let mut engine = Engine::new(compiled, Options::default());
        // Asked outside: reading a variable allocates.
        let piece = ticks() / 100;
        // In pieces, so that a failure says when.
        for _ in 0..100 {
            let ((), count) = allocations(|| (0..piece).for_each(|_| engine.tick()));
            let tick = engine.next_tick();
            assert!(count == 0, "{name}: allocated before tick {tick} at {synthesis_hz} Hz");
        }
        assert_eq!(engine.faults(), 0);
        let network = engine.schedule().index_of("texture").expect("the network");
        let calls = engine.report(network).expect("a report").calls;
        assert!(calls > ticks() * 9 / 10, "the network must run nearly always: {calls}");
    }
}
