//! Shapes whose answer is known, of any size.

use std::sync::Arc;

use asperity_node::Unit;

use crate::case::{Found, Not, holds};
use crate::played::Played;
use crate::rig::Rig;
use crate::small::Small;
use crate::subject::Subject;

/// Ticks of each run.
const TICKS: u64 = 24;
/// What is played: a control of 1.
const ONE: &str = "one from memory";
/// Inputs of a `mix`, at most.
const MIX: usize = 64;
/// How many sources and sinks the widest shape has.
const MANY: usize = 100;

/// A shape of so many nodes or a few more, and what its sinks are to read in a tick, the first of them at least.
struct Shape {
    name: &'static str,
    make: fn(usize) -> Result<Small, Not>,
    stated: fn(usize, u64) -> f64,
}

const SHAPES: [Shape; 5] = [
    Shape { name: "chain", make: chain, stated: |_, _| 1.0 },
    Shape { name: "fan", make: fan, stated: |_, _| 1.0 },
    Shape { name: "diamonds", make: diamonds, stated: |_, _| 1.0 },
    Shape { name: "loops", make: loops, stated: settling },
    Shape { name: "many to many", make: many_to_many, stated: |_, _| 1.0 },
];

fn begun() -> Result<Small, Not> {
    let one = Played::control(ONE, 1, Unit::NEWTON, Arc::new(|_, out| out.fill(1.0)));
    Small::new(500, 48_000).plays("one", one)
}

/// Gains of 2 and 1/2 in a row.
fn chain(nodes: usize) -> Result<Small, Not> {
    let (mut graph, last) = run_of(begun()?, "one".into(), nodes.saturating_sub(2))?;
    graph = graph.node("out", "probe", &[])?;
    Ok(graph.wire(&last, "out"))
}

/// So many gains behind `from`, whose product is 1; the last of them.
fn run_of(mut graph: Small, from: String, nodes: usize) -> Result<(Small, String), Not> {
    let mut last = from;
    for i in 0..nodes {
        let gain = if nodes % 2 == 1 && i + 1 == nodes { "1.0" } else { ["2.0", "0.5"][i % 2] };
        let id = format!("g{i}");
        graph = graph.node(&id, "gain", &[("gain", gain)])?.wire(&last, &id);
        last = id;
    }
    Ok((graph, last))
}

/// The mean of many, by mixes of mixes.
fn mean(mut graph: Small, mut ends: Vec<String>) -> Result<(Small, String), Not> {
    let mut level = 0;
    while ends.len() > 1 {
        let (all, mut next) = (ends.len() as f64, Vec::new());
        for (k, some) in ends.chunks(MIX).enumerate() {
            let id = format!("m{level} {k}");
            // As many as a mix has, in the last as many as are left: weighed so that in the end all count alike, which they do as all are alike.
            let weight =
                format!("[{}]", vec![format!("{:?}", 1.0 / some.len() as f64); some.len()].join(", "));
            graph = graph.node(&id, "mix", &[("inputs", &some.len().to_string()), ("gains", &weight)])?;
            for (i, end) in some.iter().enumerate() {
                graph = graph.wire(end, &format!("{id}.in{}", i + 1));
            }
            next.push(id);
        }
        holds((next.len() as f64) < all, || "the case builds no tree".into())?;
        (ends, level) = (next, level + 1);
    }
    Ok((graph, ends.pop().unwrap_or_default()))
}

/// One into many, and all into one.
fn fan(nodes: usize) -> Result<Small, Not> {
    let wide = nodes.saturating_sub(2).max(1) * (MIX - 1) / MIX + 1;
    let mut graph = begun()?;
    let mut ends = Vec::new();
    for i in 0..wide {
        let id = format!("g{i}");
        graph = graph.node(&id, "gain", &[])?.wire("one", &id);
        ends.push(id);
    }
    let (graph, last) = mean(graph, ends)?;
    Ok(graph.node("out", "probe", &[])?.wire(&last, "out"))
}

/// Twice two ways from here to there, and again: 2^n paths.
fn diamonds(nodes: usize) -> Result<Small, Not> {
    let (mut graph, mut last) = (begun()?, "one".to_owned());
    for i in 0..(nodes / 3).max(1) {
        let [a, b, sum] = ["a", "b", "s"].map(|side| format!("{side}{i}"));
        graph = graph
            .node(&a, "gain", &[("gain", "0.25")])?
            .node(&b, "gain", &[("gain", "0.75")])?
            .node(&sum, "mix", &[])?
            .wire(&last, &a)
            .wire(&last, &b)
            .wire(&a, &format!("{sum}.in1"))
            .wire(&b, &format!("{sum}.in2"));
        last = sum;
    }
    Ok(graph.node("out", "probe", &[])?.wire(&last, "out"))
}

/// How many loops there are in so many nodes.
fn loops_in(nodes: usize) -> usize {
    (nodes / 2).max(1)
}

/// y = x / 2 + y a tick before / 2, in a row.
fn loops(nodes: usize) -> Result<Small, Not> {
    let (mut graph, mut last) = (begun()?, "one".to_owned());
    for i in 0..loops_in(nodes) {
        let [sum, later] = ["s", "d"].map(|part| format!("{part}{i}"));
        graph = graph
            .node(&sum, "mix", &[("gains", "[0.5, 0.5]")])?
            .node(&later, "delay", &[("delay_ms", "2.0")])?
            .wire(&last, &format!("{sum}.in1"))
            .wire(&later, &format!("{sum}.in2"))
            .wire(&sum, &later);
        last = sum;
    }
    Ok(graph.node("out", "probe", &[])?.wire(&last, "out"))
}

/// What the last of the loops answers in a tick: how likely it is that so many heads have been thrown by then, one tick or more for each.
fn settling(nodes: usize, tick: u64) -> f64 {
    // A throw more each time: of n + tick throws, at least n heads; by the chance of each number of tails before the n-th head.
    let n = loops_in(nodes) as f64;
    let mut chance = 0.5_f64.powf(n);
    let mut sum = chance;
    for tails in 1..=tick {
        chance *= (n + tails as f64 - 1.0) / tails as f64 / 2.0;
        sum += chance;
    }
    sum
}

/// A hundred sources, added up, in a chain, and a hundred sinks behind it.
fn many_to_many(nodes: usize) -> Result<Small, Not> {
    let many = MANY.min(nodes / 4).max(1);
    let (mut graph, mut ends) = (begun()?, vec!["one".to_owned()]);
    for i in 1..many {
        let id = format!("source {i}");
        graph = graph.node(&id, ONE, &[])?;
        ends.push(id);
    }
    let (graph, first) = mean(graph, ends)?;
    let (mut graph, last) = run_of(graph, first, nodes.saturating_sub(2 * many + many / MIX + 1).max(1))?;
    for i in 0..many {
        let id = if i == 0 { "out".to_owned() } else { format!("out {i}") };
        graph = graph.node(&id, "probe", &[])?.wire(&last, &id);
    }
    Ok(graph)
}

pub(super) fn run(subject: &Subject<'_>) -> Found {
    let sizes = subject.by_effort(
        &[1, 10, 300][..],
        &[1, 2, 3, 10, 100, 1000, 5000],
        &[1, 2, 3, 5, 10, 30, 100, 300, 1000, 3000, 5000],
    );
    let alone = begun()?;
    let refused = subject.compiled(&alone.graph, &alone.kinds).err();
    holds(refused.as_ref().is_some_and(|why| why.contains("sink")), || {
        format!("a node that nobody hears is not refused: {}", refused.unwrap_or_default())
    })?;
    let (mut most, mut worst, mut named) = (0, 0.0_f64, 0);
    for shape in &SHAPES {
        for size in sizes {
            let place = format!("{} of {size}", shape.name);
            let mut rig: Rig = (shape.make)(*size)?.rig(subject).map_err(|e| e.after(&place))?;
            let nodes = rig.schedule.nodes.len();
            let steps = rig.schedule.steps.len();
            holds(steps <= 3 * nodes, || format!("{place}: {steps} steps for {nodes} nodes"))?;
            let paths: usize = rig.schedule.paths.iter().map(|p| p.through.len()).sum();
            holds(paths <= 20 * nodes + 200_000, || format!("{place}: paths of {paths} nodes for {nodes}"))?;
            let sinks: Vec<usize> = (0..nodes).filter(|i| rig.schedule.nodes[*i].kind == "probe").collect();
            rig.run(TICKS, |rig, tick| {
                for &sink in &sinks {
                    let got = match rig.engine.input(sink, 0) {
                        Some(asperity_node::Buffer::Control { values, .. }) => values.first().copied(),
                        _ => None,
                    };
                    let stated = (shape.stated)(*size, tick);
                    let off = got.map_or(f64::INFINITY, |got| (got - stated).abs());
                    worst = worst.max(off);
                    holds(off <= 1e-6, || format!("{place}: {got:?} and not {stated} in tick {tick}"))?;
                }
                Ok(())
            })?;
            holds(rig.engine.faults() == 0, || format!("{place}: {} faults", rig.engine.faults()))?;
            (most, named) = (most.max(nodes), named.max(paths));
        }
    }
    Ok(format!("up to {most} nodes, off by at most {worst:.0e}; paths name {named} nodes at most"))
}
