//! Prepares the nodes, and computes all indices of the schedule.

use std::collections::HashMap;
use std::path::Path;

use asperity_node::{Diagnostic, InputRef, ParamValue, Params, PortType, Setup, Shape, Wiring, time};

use super::order::Ordered;
use super::resolve::Resolved;
use super::types::Typed;
use super::{Compiled, latency, within_budget};
use crate::{
    BufferEntry, GraphFile, LiveParam, Schedule, ScheduledInput, ScheduledNode, ScheduledOutput, Step,
};

pub(super) fn prepare(
    graph: &GraphFile,
    resolved: Resolved,
    typed: &Typed,
    ordered: &Ordered,
) -> Result<Compiled, Vec<Diagnostic>> {
    let mut errors: Vec<Diagnostic> = Vec::new();
    let mut told = HashMap::new();
    let mut place = vec![usize::MAX; resolved.nodes.len()];
    for (at, &i) in ordered.nodes.iter().enumerate() {
        place[i] = at;
    }
    let mut buffers = constants(&resolved, typed, ordered);
    let mut next = buffers.len();
    let mut outputs_at = vec![0; resolved.nodes.len()];
    for &i in &ordered.nodes {
        outputs_at[i] = next;
        next += resolved.nodes[i].ports.outputs.len();
    }
    let mut readers: HashMap<(usize, usize), usize> = HashMap::new();
    for w in resolved.wires.iter().filter(|w| place[w.to.0] != usize::MAX) {
        *readers.entry(w.from).or_default() += 1;
    }
    let mut constant = 0;
    // An engine allocates the buffers later, when a graph can no longer be refused.
    let mut buffer_bytes = 0;
    let (mut nodes, mut all) = (Vec::new(), Vec::new());
    for &i in &ordered.nodes {
        let node = &resolved.nodes[i];
        buffer_bytes += typed.outputs[i].iter().flatten().map(|p| bytes_of(p, graph.tick_hz)).sum::<u64>();
        within_budget(&graph.nodes[i], buffer_bytes)?;
        let mut outputs = Vec::new();
        for (o, output) in node.ports.outputs.iter().enumerate() {
            let readers = readers.get(&(i, o)).copied().unwrap_or(0);
            match &typed.outputs[i][o] {
                Some(port) => {
                    buffers.push(BufferEntry::Output(port.clone()));
                    outputs.push(ScheduledOutput {
                        name: output.name.to_string(),
                        port: port.clone(),
                        readers,
                        secondary: output.secondary,
                    });
                }
                None => {
                    let decl = &graph.nodes[i];
                    let message = format!("the type of `{}.{}` cannot be determined", decl.id, output.name);
                    let help = "connect it to a port of a known type, or remove it";
                    errors.push(Diagnostic::new(message).at_place(&decl.place).help(help));
                }
            }
        }
        let mut inputs = Vec::new();
        for (p, input) in node.ports.inputs.iter().enumerate() {
            let wire = node.input_wires[p].map(|w| resolved.wires[w]);
            let reads = match wire {
                Some(w) => InputRef { buffer: (outputs_at[w.from.0] + w.from.1) as u32, connected: true },
                None => {
                    constant += 1;
                    InputRef { buffer: constant - 1, connected: false }
                }
            };
            inputs.push(ScheduledInput {
                name: input.name.to_string(),
                reads,
                from: wire.map(|w| (place[w.from.0], w.from.1)),
                port: typed.inputs[i][p].clone(),
                wakes: input.wakes,
                host_fed: input.host_fed && wire.is_none(),
            });
        }
        let wirings = |ports: &[Option<PortType>], connected: Vec<bool>| -> Vec<Wiring> {
            ports.iter().cloned().zip(connected).map(|(port, connected)| Wiring { port, connected }).collect()
        };
        let ins = wirings(&typed.inputs[i], node.input_wires.iter().map(Option::is_some).collect());
        let outs = wirings(&typed.outputs[i], outputs.iter().map(|o| o.readers > 0).collect());
        if outs.len() != node.ports.outputs.len() {
            continue;
        }
        let setup = Setup {
            config: node.config(graph, i),
            inputs: &ins,
            outputs: &outs,
            closes_cycle: ordered.closes_cycle[i],
        };
        match node.kind.prepare(&setup) {
            Ok(mut prepared) => {
                let (decl, descriptor) = (&graph.nodes[i], node.kind.descriptor());
                let live = descriptor.params.iter().enumerate().filter(|(_, p)| p.live);
                let live = live.map(|(index, p)| LiveParam {
                    name: p.name.to_string(),
                    index,
                    kind: p.kind.clone(),
                    unit: p.unit.to_string(),
                    doc: p.doc.to_string(),
                });
                let ways = ordered.gate_sets[i].iter();
                nodes.push(ScheduledNode {
                    id: decl.id.clone(),
                    kind: decl.kind.clone(),
                    role: descriptor.role,
                    build: node.kind.build(),
                    every: decl.every,
                    params: node.params.clone(),
                    live: live.collect(),
                    inputs,
                    outputs,
                    buffers: 0..0,
                    gate_sets: ways.map(|way| way.iter().map(|&g| place[g]).collect()).collect(),
                    resume: descriptor.resume,
                    sink: descriptor.sink,
                    gate: ordered.gates[i],
                    closes_cycle: ordered.closes_cycle[i],
                    latency: prepared.latency,
                    tail: prepared.tail,
                    duration: prepared.duration,
                    allocation_free: prepared.allocation_free,
                    facts: prepared.processor.facts(),
                    files: prepared.files.clone(),
                });
                all.push(prepared);
            }
            Err(e) => {
                let e = with_node(e, graph, i, &node.params);
                // Several nodes with the same error at the same position give one error.
                let span = e.place.as_ref().map(|place| (place.span.start, place.span.end));
                let key = (e.message.clone(), e.path().map(Path::to_owned), span);
                let at = *told.entry(key).or_insert(errors.len());
                match errors.get_mut(at) {
                    Some(known) => known.related.extend(e.related),
                    None => errors.push(e),
                }
            }
        }
    }
    if !errors.is_empty() {
        return Err(errors);
    }
    let mut start = buffers.len() - nodes.iter().map(|n| n.outputs.len()).sum::<usize>();
    for node in &mut nodes {
        node.buffers = start..start + node.outputs.len();
        start = node.buffers.end;
    }
    let steps = ordered.steps.iter().map(|s| match s {
        Step::Wants(i) => Step::Wants(place[*i]),
        Step::Process(i) => Step::Process(place[*i]),
        Step::Absorb(i) => Step::Absorb(place[*i]),
    });
    let schedule = Schedule {
        tick_hz: graph.tick_hz,
        audio_hz: graph.audio_hz,
        seed: graph.seed,
        steps: steps.collect(),
        dropped: ordered.dropped.clone(),
        paths: latency::paths(&nodes),
        nodes,
        buffers,
    };
    Ok(Compiled { schedule, nodes: all })
}

/// Bytes that an engine allocates for an output: its buffer, and a copy for after a fault.
fn bytes_of(port: &PortType, tick_hz: u32) -> u64 {
    2 * match port.shape {
        Shape::Control { count } => 8 * count as u64,
        Shape::Audio { rate_hz } => 4 * time::max_samples(rate_hz, tick_hz) as u64,
        Shape::Magnitude(layout) => 4 * u64::from(layout.bins),
        Shape::Spectrum(layout) => 8 * u64::from(layout.bins),
    }
}

/// Buffers of unconnected inputs, in run order: constants, and inputs fed by the host.
fn constants(resolved: &Resolved, typed: &Typed, ordered: &Ordered) -> Vec<BufferEntry> {
    let mut out = Vec::new();
    for &i in &ordered.nodes {
        let node = &resolved.nodes[i];
        let ports = node.ports.inputs.iter().zip(&typed.inputs[i]).zip(&node.input_wires);
        for ((input, port), _) in ports.filter(|(_, wire)| wire.is_none()) {
            out.push(match port {
                Some(port) if input.host_fed => BufferEntry::HostFed(port.clone()),
                Some(PortType { shape: Shape::Control { count }, .. }) => {
                    BufferEntry::Constant { count: *count, value: input.default }
                }
                _ => BufferEntry::Constant { count: 0, value: input.default },
            });
        }
    }
    out
}

/// Adds to an error in another file which part of the graph reads that file.
fn with_node(error: Diagnostic, graph: &GraphFile, i: usize, params: &Params) -> Diagnostic {
    let decl = &graph.nodes[i];
    let Some(path) = error.path() else {
        return error.at_place(&decl.place);
    };
    if path == decl.place.source.path() {
        return error;
    }
    let names = |value: &ParamValue| matches!(value, ParamValue::File(file) if file == path);
    let param = params.iter().find(|(_, value)| names(value)).and_then(|(name, _)| params.place(name));
    let place = param.unwrap_or(&decl.place).clone();
    error.related(&place.source, place.span, format!("read by `{}`", decl.id))
}
