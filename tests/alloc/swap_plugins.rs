//! A plugin that is built again and again while it plays: a thousand swaps of real libraries.

use std::fs;
use std::sync::Arc;

use asperity_engine::{CROSSFADE_S, Engine, Options};
use asperity_graph::Compiled;
use asperity_loader::{Loader, Plugin, loaded_copies};
use asperity_node::{Buffer, FactValue, NodeKind};
use harness::alone::apart;
use harness::counting::{Who, assert_it_counts, bind, look, own, touched};
use harness::{graph, plugins};

/// A wave of the plugin, delayed, so that something with a state stands behind it.
const GRAPH: &str = "Graph(version: 1, nodes: {\"wave\": (kind: \"told\"), \
                     \"late\": (kind: \"delay\", params: (delay_ms: 3.0)), \
                     \"end\": (kind: \"probe\")}, wires: [(\"wave\", \"late\"), (\"late\", \"end\")])";

fn compiled(plugin: &Plugin) -> Compiled {
    let mut registry = harness::registry();
    for kind in plugin.kinds() {
        assert!(registry.add(Arc::<NodeKind>::clone(kind)).is_none());
    }
    graph::compiled(&graph::parsed(GRAPH), &registry)
}

/// Number of instances that the library of the running wave has made and not destroyed.
fn instances(engine: &mut Engine) -> u64 {
    let wave = engine.schedule().index_of("wave").unwrap();
    match &engine.facts(wave)[0].value {
        FactValue::Count(n) => *n,
        other => panic!("{other}"),
    }
}

#[test]
fn thousand_plugin_swaps_neither_click_leak_nor_allocate() {
    // It counts the allocations of every thread, and the libraries that the process has loaded.
    if apart(harness::test_name!(), &[]).is_some() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("libtold.so");
    // Two builds of one file, in turn, as someone who compares two versions would have it.
    let builds: Vec<Vec<u8>> = ["0.1f", "0.13f"]
        .iter()
        .map(|amplitude| {
            plugins::compile(
                &plugins::sources().join("told.c"),
                &file,
                &[&format!("-DAMPLITUDE={amplitude}")],
            );
            fs::read(&file).unwrap()
        })
        .collect();
    let mut loader = Loader::default();
    let mut load = |k: usize| {
        fs::write(&file, &builds[k % 2]).unwrap();
        loader.load(&file).unwrap()
    };
    let before = loaded_copies();
    let (mut controller, mut engine) = Engine::controlled(compiled(&load(0)), Options::default());
    let end = engine.schedule().index_of("end").unwrap();
    let (mut last, mut steepest, mut peak) = (0.0_f32, 0.0_f32, 0.0_f32);
    let mut taken = 0;
    assert_it_counts(Who::Everyone);
    for k in 1..=1000 {
        if k == 200 {
            look(Who::Everyone);
        }
        controller.swap(compiled(&load(k)), &[]).unwrap();
        for _ in 0..8 {
            bind(true);
            engine.tick();
            bind(false);
            assert_eq!(own(), (0, 0), "the engine took or gave back memory on the tick thread");
            // Ids stay, and with them the order: what is read is the probe's input throughout.
            let Some(Buffer::Audio { samples, len, .. }) = engine.input(end, 0) else { panic!("no audio") };
            for x in &samples[..*len] {
                steepest = steepest.max((x - last).abs());
                peak = peak.max(x.abs());
                last = *x;
            }
        }
        taken += controller.collect().len();
    }
    look(Who::Nobody);
    let (allocated, freed) = touched();
    println!("{allocated} allocations, {freed} freed");
    assert!(allocated > 800 && allocated.abs_diff(freed) < 20, "{allocated} allocations, {freed} freed");
    assert_eq!((taken, engine.faults()), (1000, 0));
    // The wave's own slope, and that of a fade from one amplitude to the other.
    let most = 0.13 * 0.01 + 1.6 * 0.03 / (48_000.0 * CROSSFADE_S as f32);
    assert!(steepest < most && steepest > 0.001, "a step of {steepest}, where {most} is the most");
    assert!((peak - 0.13).abs() < 0.001, "{peak}");
    assert_eq!(instances(&mut engine), 1, "every instance but the one that runs has been destroyed");
    assert_eq!(loaded_copies() - before, 2, "each build is loaded once, however often it comes back");
}
