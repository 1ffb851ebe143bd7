//! Cost of a hot swap of the shipped graph, in one run: plain ticks, the tick of the takeover, ticks while
//! it fades; and what it costs the control thread.

use std::time::Instant;

use asperity_accuracy::timing::Timing;
use asperity_engine::{Engine, Options};
use asperity_graph::{GraphFile, compile};

const GRAPH: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../graphs/heravi2024.ron");

/// The shipped graph under a stroke that never stops, with something set.
fn graph(set: &str) -> GraphFile {
    let mut graph = GraphFile::read(GRAPH).unwrap_or_else(|e| panic!("{e}"));
    let stylus = graph.nodes.iter_mut().find(|n| n.id == "stylus").expect("the stylus");
    stylus.kind = "stroke".into();
    stylus.params.clear();
    for set in ["stylus.shape=circle", "stylus.duration_s=100000", set] {
        graph.set(set, "bench").unwrap_or_else(|e| panic!("{e}"));
    }
    graph
}

fn row(name: &str, timing: &Timing) {
    let s = timing.summary();
    let us = |ns: u64| ns as f64 / 1e3;
    println!("  {name:<28} {:>10.2} {:>10.2}", us(s.p50_ns), us(s.p99_ns));
}

/// Goes back and forth between two graphs.
fn measure(title: &str, sets: [&str; 2], swaps: usize) {
    let registry = asperity_nodes::registry();
    let compiled = |k: usize| {
        compile(&graph(sets[k % 2]), &registry, asperity_graph::Options::default())
            .unwrap_or_else(|e| panic!("{}", e[0]))
    };
    let (mut controller, mut engine) = Engine::controlled(compiled(0), Options::default());
    (0..1000).for_each(|_| engine.tick());
    let new = || Timing::new(3);
    let (mut plain, mut takeover, mut fading, mut after, mut plan) = (new(), new(), new(), new(), new());
    let timed = |engine: &mut Engine, timing: &mut Timing| {
        let t = Instant::now();
        engine.tick();
        timing.record(t.elapsed().as_nanos() as u64);
    };
    for k in 1..=swaps {
        let next = compiled(k);
        (0..20).for_each(|_| engine.tick());
        (0..20).for_each(|_| timed(&mut engine, &mut plain));
        let t = Instant::now();
        controller.swap(next, &[]).unwrap_or_else(|e| panic!("{e}"));
        plan.record(t.elapsed().as_nanos() as u64);
        // What planning left in the caches is not what a tick finds there.
        timed(&mut engine, &mut takeover);
        (1..5).for_each(|_| timed(&mut engine, &mut fading));
        timed(&mut engine, &mut after);
        controller.collect();
    }
    println!("\n{title}");
    println!("  {:<28} {:>10} {:>10}", "", "p50 us", "p99 us");
    row("plain tick", &plain);
    row("takeover, the first faded", &takeover);
    row("the other ticks of the fade", &fading);
    row("the tick that ends it", &after);
    row("plan and parts (control)", &plan);
}

fn main() {
    // `cargo test --benches` and `--list` only want to know that it starts.
    if std::env::args().any(|a| a == "--test" || a == "--list") {
        return;
    }
    measure("phase retrieval and synthesis are rebuilt", ["phase.seed=1", "phase.seed=2"], 300);
    measure("every node behind the stylus is rebuilt", ["seed=1", "seed=2"], 300);
}
