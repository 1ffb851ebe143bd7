//! Graphs of 1 to 5000 nodes in shapes with a known output.

use std::sync::Arc;

use asperity_checks::played::Played;
use asperity_checks::{Found, Rig, Subject, ensure};
use asperity_node::{Role, Unit};
use harness::graph::of_lines;

use crate::{breaks, passes, pushing, subject};

/// Ticks of each run.
const TICKS: u64 = 24;
/// The kind that plays a control of 1.
const ONE: &str = "one from memory";
/// Inputs of a `mix`, at most.
const MIX: usize = 64;
/// How many sources and sinks the widest shape has.
const MANY: usize = 100;

/// Shapes: the name, a graph of a number of nodes or a few more, and the value at its sinks in a tick.
type Shape = (&'static str, fn(usize) -> String, fn(usize, u64) -> f64);

const SHAPES: [Shape; 5] = [
    ("chain", chain, |_, _| 1.0),
    ("fan", fan, |_, _| 1.0),
    ("diamonds", diamonds, |_, _| 1.0),
    ("loops", loops, settling),
    ("many to many", many_to_many, |_, _| 1.0),
];

/// A graph with a source of 1, in lines of nodes and wires.
fn begun() -> String {
    format!("one: {ONE}\n")
}

/// The graph with a probe at its end.
fn heard(mut graph: String, end: &str) -> String {
    graph += &format!("out: probe\n{end} -> out\n");
    graph
}

/// Gains of 2 and 1/2 in a row.
fn chain(nodes: usize) -> String {
    let mut graph = begun();
    let last = run_of(&mut graph, "one".into(), nodes.saturating_sub(2));
    heard(graph, &last)
}

/// Adds a number of gains behind `from` with a product of 1. Answers the last of them.
fn run_of(graph: &mut String, from: String, nodes: usize) -> String {
    (0..nodes).fold(from, |last, i| {
        let gain = if nodes % 2 == 1 && i + 1 == nodes { "1.0" } else { ["2.0", "0.5"][i % 2] };
        *graph += &format!("g{i}: gain(gain: {gain})\n{last} -> g{i}\n");
        format!("g{i}")
    })
}

/// Adds the mean of many, by mixes of mixes. Answers its node.
fn mean(graph: &mut String, mut ends: Vec<String>) -> String {
    let mut level = 0;
    while ends.len() > 1 {
        let mut next = Vec::new();
        for (k, some) in ends.chunks(MIX).enumerate() {
            let (id, count) = (format!("m{level} {k}"), some.len());
            // The ends are equal, so the mean of means is their mean.
            let gains = vec![1.0 / count as f64; count];
            *graph += &format!("{id}: mix(inputs: {count}, gains: {gains:?})\n");
            for (end, i) in some.iter().zip(1..) {
                *graph += &format!("{end} -> {id}.in{i}\n");
            }
            next.push(id);
        }
        assert!(next.len() < ends.len(), "the mixes make no tree");
        (ends, level) = (next, level + 1);
    }
    ends.pop().unwrap_or_default()
}

/// One into many, and all into one.
fn fan(nodes: usize) -> String {
    let wide = nodes.saturating_sub(2).max(1) * (MIX - 1) / MIX + 1;
    let mut graph = begun();
    for i in 0..wide {
        graph += &format!("g{i}: gain\none -> g{i}\n");
    }
    let last = mean(&mut graph, (0..wide).map(|i| format!("g{i}")).collect());
    heard(graph, &last)
}

/// Two ways from node to node, again and again: 2^n paths.
fn diamonds(nodes: usize) -> String {
    let (mut graph, mut last) = (begun(), "one".to_owned());
    for i in 0..(nodes / 3).max(1) {
        graph += &format!("a{i}: gain(gain: 0.25)\nb{i}: gain(gain: 0.75)\ns{i}: mix\n");
        graph += &format!("{last} -> a{i}\n{last} -> b{i}\na{i} -> s{i}.in1\nb{i} -> s{i}.in2\n");
        last = format!("s{i}");
    }
    heard(graph, &last)
}

/// Number of loops in so many nodes.
fn loops_in(nodes: usize) -> usize {
    (nodes / 2).max(1)
}

/// Loops in a row: y is half of x and half of y a tick before.
fn loops(nodes: usize) -> String {
    let (mut graph, mut last) = (begun(), "one".to_owned());
    for i in 0..loops_in(nodes) {
        graph += &format!("s{i}: mix(gains: [0.5, 0.5])\nd{i}: delay(delay_ms: 2.0)\n");
        graph += &format!("{last} -> s{i}.in1\nd{i} -> s{i}.in2\ns{i} -> d{i}\n");
        last = format!("s{i}");
    }
    heard(graph, &last)
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
fn many_to_many(nodes: usize) -> String {
    let many = MANY.min(nodes / 4).max(1);
    let (mut graph, mut ends) = (begun(), vec!["one".to_owned()]);
    for i in 1..many {
        graph += &format!("source {i}: {ONE}\n");
        ends.push(format!("source {i}"));
    }
    let first = mean(&mut graph, ends);
    let last = run_of(&mut graph, first, nodes.saturating_sub(2 * many + many / MIX + 1).max(1));
    for i in 1..many {
        graph += &format!("out {i}: probe\n{last} -> out {i}\n");
    }
    heard(graph, &last)
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
    let refused = subject.compiled(&of_lines(&begun()), &one).err();
    ensure!(
        refused.as_ref().is_some_and(|why| why.contains("sink")),
        "a node that nobody hears is not refused: {}",
        refused.unwrap_or_default()
    );
    let (mut most, mut worst, mut named) = (0, 0.0_f64, 0);
    for (name, make, stated) in SHAPES {
        for size in sizes {
            let place = format!("{name} of {size}");
            let mut rig = Rig::of(subject, &of_lines(&make(*size)), &one).map_err(|e| e.after(&place))?;
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
                    let stated = stated(*size, tick);
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
        breaks("one_to_5000_nodes", sizes, &pushing(&subject, kind, |x| 1.0001 * x), "and not");
    }
}
