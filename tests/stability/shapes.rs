//! Graphs of 1 to 5000 nodes in shapes with a known output.

use std::sync::Arc;

use asperity_checks::played::Played;
use asperity_checks::{Found, Rig, Subject, ensure};
use asperity_graph::GraphFile;
use asperity_node::{Role, Unit};

use crate::{breaks, broken, passes, subject};

/// Ticks of each run.
const TICKS: u64 = 24;
/// The kind that plays a control of 1.
const ONE: &str = "one from memory";
/// Inputs of a `mix`, at most.
const MIX: usize = 64;
/// How many sources and sinks the widest shape has.
const MANY: usize = 100;

/// A shape of a number of nodes or a few more, and the value at its sinks in a tick.
struct Shape {
    name: &'static str,
    make: fn(usize) -> Sketch,
    stated: fn(usize, u64) -> f64,
}

const SHAPES: [Shape; 5] = [
    Shape { name: "chain", make: chain, stated: |_, _| 1.0 },
    Shape { name: "fan", make: fan, stated: |_, _| 1.0 },
    Shape { name: "diamonds", make: diamonds, stated: |_, _| 1.0 },
    Shape { name: "loops", make: loops, stated: settling },
    Shape { name: "many to many", make: many_to_many, stated: |_, _| 1.0 },
];

/// A graph that is built.
struct Sketch(GraphFile);

impl Sketch {
    fn node(mut self, id: &str, kind: &str, params: &[(&str, &str)]) -> Self {
        self.0.add_node(id, kind, params, "the test").expect("a new id");
        self
    }

    fn wire(mut self, from: &str, to: &str) -> Self {
        self.0.add_wire(from, to, "the test");
        self
    }
}

/// A graph with a source of 1.
fn begun() -> Sketch {
    Sketch(GraphFile::empty("the test")).node("one", ONE, &[])
}

/// Gains of 2 and 1/2 in a row.
fn chain(nodes: usize) -> Sketch {
    let (mut graph, last) = run_of(begun(), "one".into(), nodes.saturating_sub(2));
    graph = graph.node("out", "probe", &[]);
    graph.wire(&last, "out")
}

/// A number of gains behind `from` with a product of 1. Answers the last of them.
fn run_of(mut graph: Sketch, from: String, nodes: usize) -> (Sketch, String) {
    let mut last = from;
    for i in 0..nodes {
        let gain = if nodes % 2 == 1 && i + 1 == nodes { "1.0" } else { ["2.0", "0.5"][i % 2] };
        let id = format!("g{i}");
        graph = graph.node(&id, "gain", &[("gain", gain)]).wire(&last, &id);
        last = id;
    }
    (graph, last)
}

/// The mean of many, by mixes of mixes.
fn mean(mut graph: Sketch, mut ends: Vec<String>) -> (Sketch, String) {
    let mut level = 0;
    while ends.len() > 1 {
        let (all, mut next) = (ends.len() as f64, Vec::new());
        for (k, some) in ends.chunks(MIX).enumerate() {
            let id = format!("m{level} {k}");
            // The ends are equal, so the mean of means is their mean.
            let weight =
                format!("[{}]", vec![format!("{:?}", 1.0 / some.len() as f64); some.len()].join(", "));
            graph = graph.node(&id, "mix", &[("inputs", &some.len().to_string()), ("gains", &weight)]);
            for (i, end) in some.iter().enumerate() {
                graph = graph.wire(end, &format!("{id}.in{}", i + 1));
            }
            next.push(id);
        }
        assert!((next.len() as f64) < all, "the mixes make no tree");
        (ends, level) = (next, level + 1);
    }
    (graph, ends.pop().unwrap_or_default())
}

/// One into many, and all into one.
fn fan(nodes: usize) -> Sketch {
    let wide = nodes.saturating_sub(2).max(1) * (MIX - 1) / MIX + 1;
    let mut graph = begun();
    let mut ends = Vec::new();
    for i in 0..wide {
        let id = format!("g{i}");
        graph = graph.node(&id, "gain", &[]).wire("one", &id);
        ends.push(id);
    }
    let (graph, last) = mean(graph, ends);
    graph.node("out", "probe", &[]).wire(&last, "out")
}

/// Two ways from node to node, again and again: 2^n paths.
fn diamonds(nodes: usize) -> Sketch {
    let (mut graph, mut last) = (begun(), "one".to_owned());
    for i in 0..(nodes / 3).max(1) {
        let [a, b, sum] = ["a", "b", "s"].map(|side| format!("{side}{i}"));
        graph = graph
            .node(&a, "gain", &[("gain", "0.25")])
            .node(&b, "gain", &[("gain", "0.75")])
            .node(&sum, "mix", &[])
            .wire(&last, &a)
            .wire(&last, &b)
            .wire(&a, &format!("{sum}.in1"))
            .wire(&b, &format!("{sum}.in2"));
        last = sum;
    }
    graph.node("out", "probe", &[]).wire(&last, "out")
}

/// Number of loops in so many nodes.
fn loops_in(nodes: usize) -> usize {
    (nodes / 2).max(1)
}

/// Loops in a row: y is half of x and half of y a tick before.
fn loops(nodes: usize) -> Sketch {
    let (mut graph, mut last) = (begun(), "one".to_owned());
    for i in 0..loops_in(nodes) {
        let [sum, later] = ["s", "d"].map(|part| format!("{part}{i}"));
        graph = graph
            .node(&sum, "mix", &[("gains", "[0.5, 0.5]")])
            .node(&later, "delay", &[("delay_ms", "2.0")])
            .wire(&last, &format!("{sum}.in1"))
            .wire(&later, &format!("{sum}.in2"))
            .wire(&sum, &later);
        last = sum;
    }
    graph.node("out", "probe", &[]).wire(&last, "out")
}

/// The output of the last loop in a tick: the probability that n coins, each thrown until heads, take n +
/// tick throws at most.
fn settling(nodes: usize, tick: u64) -> f64 {
    // By the probability of each number of tails before the n-th head.
    let n = loops_in(nodes) as f64;
    let mut chance = 0.5_f64.powf(n);
    let mut sum = chance;
    for tails in 1..=tick {
        chance *= (n + tails as f64 - 1.0) / tails as f64 / 2.0;
        sum += chance;
    }
    sum
}

/// The mean of a hundred sources, through a chain to a hundred sinks.
fn many_to_many(nodes: usize) -> Sketch {
    let many = MANY.min(nodes / 4).max(1);
    let (mut graph, mut ends) = (begun(), vec!["one".to_owned()]);
    for i in 1..many {
        let id = format!("source {i}");
        graph = graph.node(&id, ONE, &[]);
        ends.push(id);
    }
    let (graph, first) = mean(graph, ends);
    let (mut graph, last) = run_of(graph, first, nodes.saturating_sub(2 * many + many / MIX + 1).max(1));
    for i in 0..many {
        let id = if i == 0 { "out".to_owned() } else { format!("out {i}") };
        graph = graph.node(&id, "probe", &[]).wire(&last, &id);
    }
    graph
}

/// Runs every shape. One node alone is refused, as nobody hears it. Each other graph loads and runs without
/// a fault, and gives its known value within 10^-6. The schedule has at most 3 steps per node, and its lists
/// of paths name at most 20 nodes per node and 2 10^5 more.
fn sizes(subject: &Subject<'_>) -> Found {
    let one = [Played::control(ONE, 1, Unit::NEWTON, Arc::new(|_, out| out.fill(1.0)))];
    let sizes = subject.by_effort(
        &[1, 10, 300][..],
        &[1, 2, 3, 10, 100, 1000, 5000],
        &[1, 2, 3, 5, 10, 30, 100, 300, 1000, 3000, 5000],
    );
    let refused = subject.compiled(&begun().0, &one).err();
    ensure!(
        refused.as_ref().is_some_and(|why| why.contains("sink")),
        "a node that nobody hears is not refused: {}",
        refused.unwrap_or_default()
    );
    let (mut most, mut worst, mut named) = (0, 0.0_f64, 0);
    for shape in &SHAPES {
        for size in sizes {
            let place = format!("{} of {size}", shape.name);
            let mut rig = Rig::of(subject, &(shape.make)(*size).0, &one).map_err(|e| e.after(&place))?;
            let nodes = rig.schedule.nodes.len();
            let steps = rig.schedule.steps.len();
            ensure!(steps <= 3 * nodes, "{place}: {steps} steps for {nodes} nodes");
            let paths: usize = rig.schedule.paths.iter().map(|p| p.through.len()).sum();
            ensure!(paths <= 20 * nodes + 200_000, "{place}: paths of {paths} nodes for {nodes}");
            let sinks: Vec<usize> = rig.schedule.with_role(Role::Probe).map(|(i, _)| i).collect();
            rig.run(TICKS, |rig, tick| {
                for &sink in &sinks {
                    let got = match rig.engine.input(sink, 0) {
                        Some(asperity_node::Buffer::Control { values, .. }) => values.first().copied(),
                        _ => None,
                    };
                    let stated = (shape.stated)(*size, tick);
                    let off = got.map_or(f64::INFINITY, |got| (got - stated).abs());
                    worst = worst.max(off);
                    ensure!(off <= 1e-6, "{place}: {got:?} and not {stated} in tick {tick}");
                }
                Ok(())
            })?;
            ensure!(rig.engine.faults() == 0, "{place}: {} faults", rig.engine.faults());
            (most, named) = (most.max(nodes), named.max(paths));
        }
    }
    Ok(format!("up to {most} nodes, off by at most {worst:.0e}; paths name {named} nodes at most"))
}

#[test]
fn one_to_5000_nodes() {
    let subject = subject(None);
    passes("one_to_5000_nodes", sizes, &subject);
    for kind in ["gain", "mix", "delay"] {
        let louder = broken(&subject, kind, |(): &mut (), tick| {
            tick.outputs.control(0).iter_mut().for_each(|x| *x *= 1.0001);
        });
        breaks("one_to_5000_nodes", sizes, &louder, "and not");
    }
}
