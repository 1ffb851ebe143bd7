//! Graphs and rows for tests.

use std::path::Path;
use std::sync::Arc;

use asperity_diagnostics::Source;
use asperity_graph::GraphFile;

use crate::figure::{Figure, Figures};
use crate::results::{Machine, Results, Row, Time, VERSION};
use crate::{Job, LoadedGraph, Tradeoff};

pub(crate) fn graph_of(path: &str, nodes: &str, wires: &str) -> GraphFile {
    let text = format!("Graph(version: 1, nodes: {{{nodes}}}, wires: [{wires}])");
    GraphFile::parse(&Source::new(path, text)).unwrap()
}

/// A graph, loaded with the built-in kinds.
pub(crate) fn loaded(name: &str, graph: GraphFile) -> LoadedGraph {
    LoadedGraph {
        name: name.into(),
        file: graph.clone(),
        graph,
        registry: asperity_nodes::registry(),
        strength: 1.0,
        plugins: Vec::new(),
    }
}

pub(crate) fn tradeoff(path: &str, fields: &str) -> Tradeoff {
    let source: Arc<Source> = Source::new(path, format!("Tradeoff(version: 1, {fields})"));
    Tradeoff::parse(&source).unwrap()
}

pub(crate) fn job<'a>(tradeoff: &'a Tradeoff, bases: &'a [LoadedGraph], folder: &'a Path) -> Job<'a> {
    Job {
        tradeoff,
        bases,
        baselines: &[],
        jobs: 1,
        shard: (0, 1),
        folder,
        machine: Machine { cpu: "any".into(), cores: 2, system: "any".into(), build: "1".into() },
        program: "p",
        cases: true,
    }
}

pub(crate) fn row(name: &str) -> Row {
    Row {
        name: name.into(),
        key: name.into(),
        graph: "g.ron".into(),
        tick_hz: 500,
        cases: 1,
        ..Row::default()
    }
}

/// A row with a load in per cent (20 us for each in a tick of 500 Hz), an error of the level and a lag.
pub(crate) fn measured(name: &str, load_percent: f64, level: f64, lag: f64) -> Row {
    let p50_us = 20.0 * load_percent;
    let time =
        Time { load_percent, p50_us, p99_us: p50_us, p999_us: 1.5 * p50_us, ticks: 1000, ..Time::default() };
    Row {
        figures: Figures::from([(Figure::Level, level)]),
        lag_ms: Some([lag - 5.0, lag, lag + 5.0]),
        time: Some(time),
        ..row(name)
    }
}

pub(crate) fn default_row(load_percent: f64, level: f64, lag: f64) -> Row {
    Row { default: true, ..measured("default", load_percent, level, lag) }
}

/// Results with these rows, and a noise floor of 0.1 dB for the level.
pub(crate) fn results(rows: Vec<Row>) -> Results {
    Results {
        version: VERSION,
        tradeoff: "s.ron".into(),
        digest: "d".into(),
        seed: 1,
        strokes: vec!["circle (5 s)".into()],
        materials: vec!["canvas".into()],
        shards: vec![(1, 1)],
        cases: 3,
        noise_floor: Figures::from([(Figure::Level, 0.1)]),
        lag_noise_floor_ms: Some(1.0),
        load_noise_floor: Some(1.02),
        model: Figures::from([(Figure::Level, 0.3)]),
        idle: Some(Time { p999_us: 2.0, ..Time::default() }),
        rows,
        ..Results::default()
    }
}
