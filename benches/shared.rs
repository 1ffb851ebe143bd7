//! A clock and the shipped graph, for several benches.
#![allow(dead_code, unreachable_pub, reason = "each bench uses a part of it")]

use std::time::Instant;

use asperity_engine::Clock;
use asperity_graph::{Compiled, GraphFile, Options, compile};

const GRAPH: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../graphs/heravi2024.ron");

/// A clock that starts now.
pub struct Wall(pub Instant);

impl Clock for Wall {
    fn now_ns(&self) -> u64 {
        self.0.elapsed().as_nanos() as u64
    }
}

/// The shipped graph with settings, under a stroke that never stops, so that no gate closes.
pub fn shipped(sets: &[&str]) -> Compiled {
    let mut graph = GraphFile::read(GRAPH).unwrap_or_else(|e| panic!("{e}"));
    let stylus = graph.nodes.iter_mut().find(|n| n.id == "stylus").expect("the stylus");
    stylus.kind = "stroke".into();
    stylus.params.clear();
    for set in ["stylus.shape=circle", "stylus.duration_s=100000"].iter().chain(sets) {
        graph.set(set, "bench").unwrap_or_else(|e| panic!("{e}"));
    }
    compile(&graph, &asperity_nodes::registry(), Options::default()).unwrap_or_else(|e| panic!("{}", e[0]))
}

/// Whether cargo only wants to know that the bench starts: `cargo test --benches` and `--list`.
pub fn only_starts() -> bool {
    std::env::args().any(|a| a == "--test" || a == "--list")
}
