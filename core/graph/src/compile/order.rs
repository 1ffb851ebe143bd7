//! Decides which nodes are built, their order, and which may sleep.

use std::collections::BTreeSet;

use asperity_node::{Diagnostic, Resume};

use super::Options;
use super::resolve::Resolved;
use super::types::Typed;
use crate::order::{steps, topological_order};
use crate::{Dropped, GateSets, GraphFile, Step, Waiting};

/// Nodes by their index in the file.
pub(super) struct Ordered {
    /// Nodes that are built, in run order.
    pub(super) nodes: Vec<usize>,
    /// Steps of a tick, by index in the file.
    pub(super) steps: Vec<Step>,
    pub(super) dropped: Vec<Dropped>,
    /// Whether a node closes a cycle.
    pub(super) closes_cycle: Vec<bool>,
    /// When each node is wanted.
    pub(super) gate_sets: Vec<GateSets>,
    /// The gated input of each gate.
    pub(super) gates: Vec<Option<usize>>,
}

pub(super) fn order(
    graph: &GraphFile,
    resolved: &Resolved,
    typed: &Typed,
    options: Options,
) -> Result<Ordered, Vec<Diagnostic>> {
    let n = resolved.nodes.len();
    let mut live = reaching_sinks(graph, resolved)?;
    if !options.prune {
        keep_complete(resolved, typed, &mut live);
    }
    check_required(graph, resolved, &live)?;
    let gates = gates(resolved);
    let closes_cycle = cut_cycles(graph, resolved, &live)?;
    let mut gate_sets = gate_sets(resolved, &live, &gates, &closes_cycle);
    let mut reads = vec![Vec::new(); n];
    resolved.wires.iter().for_each(|w| reads[w.to.0].push((w.to.1, w.from.0)));
    let waiting = |gate_sets: &[GateSets]| -> Vec<Waiting> {
        let node = |i: usize| Waiting {
            runs: live[i],
            reads: reads[i].clone(),
            gate: gates[i],
            closes_cycle: closes_cycle[i],
            gate_sets: gate_sets[i].clone(),
        };
        (0..n).map(node).collect()
    };
    let steps = steps(&waiting(&gate_sets)).unwrap_or_else(|| {
        // Gates wait for nodes that they let sleep. No such graph is known; it would run with all nodes
        // awake.
        gate_sets = vec![GateSets::new(); n];
        steps(&waiting(&gate_sets)).unwrap_or_default()
    });
    let process = |step: &Step| if let Step::Process(i) = step { Some(*i) } else { None };
    let nodes = steps.iter().filter_map(process).collect();
    let wired: BTreeSet<usize> = resolved.wires.iter().map(|w| w.from.0).collect();
    let dropped = (0..n).filter(|&i| !live[i]).map(|i| dropped(graph, i, wired.contains(&i))).collect();
    Ok(Ordered { nodes, steps, dropped, closes_cycle, gate_sets, gates })
}

fn dropped(graph: &GraphFile, i: usize, wired: bool) -> Dropped {
    let why = if wired { "no sink is reached from it" } else { "nothing reads its outputs" };
    Dropped { id: graph.nodes[i].id.clone(), kind: graph.nodes[i].kind.clone(), why: why.into() }
}

/// Keeps nodes that reach no sink too, where they could run.
fn keep_complete(resolved: &Resolved, typed: &Typed, live: &mut [bool]) {
    let n = resolved.nodes.len();
    let reached = live.to_vec();
    let complete = |i: usize, live: &[bool]| {
        let node = &resolved.nodes[i];
        let mut inputs = node.ports.inputs.iter().zip(&node.input_wires);
        typed.outputs[i].iter().all(Option::is_some)
            && inputs.all(|(p, wire)| wire.map_or(p.optional, |w| live[resolved.wires[w].from.0]))
    };
    live.fill(true);
    while let Some(i) = (0..n).find(|&i| live[i] && !reached[i] && !complete(i, live)) {
        live[i] = false;
    }
}

fn reaching_sinks(graph: &GraphFile, resolved: &Resolved) -> Result<Vec<bool>, Vec<Diagnostic>> {
    let n = resolved.nodes.len();
    let is_sink = |i: usize| resolved.nodes[i].kind.descriptor().sink;
    if !(0..n).any(is_sink) {
        let source = &graph.source;
        let end = source.text().len().min(1);
        return Err(vec![
            Diagnostic::new("the graph has no sink, so nothing would be built")
                .at(source, asperity_diagnostics::Span { start: 0, end })
                .help("add an `audio_out`, `file_out` or `probe`"),
        ]);
    }
    let mut live: Vec<bool> = (0..n).map(is_sink).collect();
    let mut readers: Vec<Vec<usize>> = vec![Vec::new(); n];
    for w in &resolved.wires {
        readers[w.to.0].push(w.from.0);
    }
    let mut stack: Vec<usize> = (0..n).filter(|&i| live[i]).collect();
    while let Some(i) = stack.pop() {
        for &from in &readers[i] {
            if !live[from] {
                live[from] = true;
                stack.push(from);
            }
        }
    }
    Ok(live)
}

fn check_required(graph: &GraphFile, resolved: &Resolved, live: &[bool]) -> Result<(), Vec<Diagnostic>> {
    let mut errors = Vec::new();
    for (i, node) in resolved.nodes.iter().enumerate().filter(|(i, _)| live[*i]) {
        let inputs = node.ports.inputs.iter().zip(&node.input_wires);
        for (input, _) in inputs.filter(|(input, wire)| wire.is_none() && !input.optional) {
            let decl = &graph.nodes[i];
            let message = format!("`{}.{}` is required, and nothing is wired to it", decl.id, input.name);
            errors.push(
                Diagnostic::new(message)
                    .at_place(&decl.place)
                    .label(format!("`{}` is unconnected", input.name))
                    .help(format!("it takes {} [{}]: {}", input.shape, input.unit, input.doc)),
            );
        }
    }
    if errors.is_empty() { Ok(()) } else { Err(errors) }
}

fn gates(resolved: &Resolved) -> Vec<Option<usize>> {
    let gated = |node: &super::resolve::ResolvedNode| {
        let name = node.kind.descriptor().gate.clone()?;
        node.ports.inputs.iter().position(|p| p.name == name)
    };
    resolved.nodes.iter().map(gated).collect()
}

/// Lets nodes that can close a cycle do so; a remaining cycle is an error.
fn cut_cycles(graph: &GraphFile, resolved: &Resolved, live: &[bool]) -> Result<Vec<bool>, Vec<Diagnostic>> {
    let n = resolved.nodes.len();
    let mut closes = vec![false; n];
    let mut after: Vec<Vec<usize>> = vec![Vec::new(); n];
    for w in &resolved.wires {
        after[w.from.0].push(w.to.0);
    }
    // The longest delay of a cycle closes it, so that the others may be arbitrarily short.
    let length = |i: usize| {
        let name = resolved.nodes[i].kind.descriptor().feedback.as_ref()?;
        resolved.nodes[i].params.get_number(name)
    };
    let mut delays: Vec<(f64, usize)> =
        (0..n).filter(|&i| live[i]).filter_map(|i| Some((length(i)?, i))).collect();
    delays.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    for (_, i) in delays {
        // A node is on a cycle if its own outputs reach it. Cycles that are already cut do not count.
        let mut seen = vec![false; n];
        let mut stack = after[i].clone();
        while let Some(v) = stack.pop() {
            if v == i {
                closes[i] = true;
                break;
            }
            if !seen[v] && !closes[v] {
                seen[v] = true;
                stack.extend(&after[v]);
            }
        }
    }
    let mut before = vec![BTreeSet::new(); n];
    for w in resolved.wires.iter().filter(|w| !closes[w.to.0]) {
        before[w.to.0].insert(w.from.0);
    }
    let Some(cycle) = find_cycle(&before, |v| live[v] && !closes[v]) else { return Ok(closes) };
    let mut names: Vec<&str> = cycle.iter().map(|&i| graph.nodes[i].id.as_str()).collect();
    names.push(names[0]);
    let (last, first) = (cycle[cycle.len() - 1], cycle[0]);
    let wire = resolved.wires.iter().position(|w| w.from.0 == last && w.to.0 == first);
    let place = wire.and_then(|w| graph.wires.get(w)).map_or(&graph.nodes[first].place, |w| &w.from.place);
    Err(vec![
        Diagnostic::new(format!("these nodes wait for each other: {}", names.join(" -> ")))
            .at_place(place)
            .label("this wire closes the cycle")
            .help("put a `delay` into the cycle"),
    ])
}

/// Finds a cycle among the `open` vertices, if there is one, beginning with its lowest number.
fn find_cycle(before: &[BTreeSet<usize>], open: impl Fn(usize) -> bool) -> Option<Vec<usize>> {
    let ordered: BTreeSet<usize> = topological_order(before, &open).into_iter().collect();
    let left: BTreeSet<usize> = (0..before.len()).filter(|&v| open(v) && !ordered.contains(&v)).collect();
    // Each of these waits for another of them.
    let (mut path, mut at) = (Vec::new(), *left.first()?);
    while !path.contains(&at) {
        path.push(at);
        at = *before[at].intersection(&left).next()?;
    }
    let mut cycle = path.split_off(path.iter().position(|v| *v == at)?);
    cycle.reverse();
    let lowest = (0..cycle.len()).min_by_key(|i| cycle[*i])?;
    cycle.rotate_left(lowest);
    Some(cycle)
}

/// Gate sets of every node.
fn gate_sets(
    resolved: &Resolved,
    live: &[bool],
    gates: &[Option<usize>],
    closes_cycle: &[bool],
) -> Vec<GateSets> {
    let n = resolved.nodes.len();
    let mut before: Vec<BTreeSet<usize>> = vec![BTreeSet::new(); n];
    let mut readers: Vec<Vec<(usize, usize)>> = vec![Vec::new(); n];
    for w in resolved.wires.iter().filter(|w| live[w.to.0]) {
        if !resolved.nodes[w.to.0].kind.descriptor().passive {
            readers[w.from.0].push(w.to);
        }
        if !closes_cycle[w.to.0] {
            before[w.to.0].insert(w.from.0);
        }
    }
    let mut all = vec![GateSets::new(); n];
    for i in topological_order(&before, |i| live[i]).into_iter().rev() {
        let d = resolved.nodes[i].kind.descriptor();
        if !d.sink && d.resume != Resume::Never && !closes_cycle[i] && !readers[i].is_empty() {
            let gate = |&(r, input): &(usize, usize)| (&all[r], (gates[r] == Some(input)).then_some(r));
            all[i] = crate::gate_sets(readers[i].iter().map(gate));
        }
    }
    all
}
