//! Allocates everything that the tick thread needs for a swap.

use asperity_graph::{BufferEntry, Compiled, Schedule};
use asperity_node::{Buffer, PortType, Shape};

use super::crossfade::Crossfade;
use super::plan::{Fate, Place, Plan, Point, live_value};
use super::shadow::Ways;
use super::takeover::{Absent, Rebuilt, Set, Swap};
use crate::engine::Body;
use crate::slot::{GateSets, Slot};

/// Makes a swap from a plan. `sizes` and `live` belong to the old schedule: bytes of each node's state,
/// and the last values of its live parameters.
pub(super) fn build(
    number: u64,
    plan: &Plan,
    old: &Schedule,
    sizes: &[usize],
    live: &[Vec<f64>],
    compiled: Compiled,
) -> Swap {
    let mut body = Body::new(compiled);
    let settled = std::mem::replace(&mut body.steps, plan.steps.clone());
    let new = body.schedule.clone();
    let gate_sets = gate_sets(plan, old, &new, &mut body.slots);
    let own = add_shadows(plan, old, &mut body);
    let (fades, readers) = plan.points.iter().map(|p| crossfade(plan, &new, *p, &mut body)).unzip();
    let mut swap = Swap {
        number,
        body,
        settled,
        fades,
        readers,
        kept: Vec::new(),
        rebuilt: Vec::new(),
        shadows: plan.shadows.nodes.iter().enumerate().map(|(k, &i)| (new.nodes.len() + k, i)).collect(),
        gone: (0..old.nodes.len()).filter(|i| !plan.fates.iter().any(|f| f.kept() == Some(*i))).collect(),
        sets: Vec::new(),
        gate_sets,
        fed: carried(plan, old, &new),
        every: every(plan, &new),
        begun: 0,
    };
    swap.fed.extend(own);
    for (j, fate) in plan.fates.iter().enumerate() {
        match *fate {
            Fate::Kept(i) => {
                swap.kept.push((j, i));
                swap.sets.extend(sets(&new, j, &live[i]));
            }
            Fate::Rebuilt { old, adopts, .. } => {
                // A node without saved state but with a latency or tail starts anew; one without either
                // loses nothing.
                let (none, node) = (asperity_node::Latency::ZERO, &new.nodes[j]);
                let has_past = node.latency != none || node.tail != none;
                let goes_on = adopts && (sizes[old] > 0 || !has_past);
                let state = goes_on.then(|| vec![0; sizes[old]].into());
                swap.rebuilt.push(Rebuilt { new: j, old, state, adopted: false });
            }
            Fate::New => {}
        }
    }
    swap
}

/// Makes the buffers of a schedule.
pub(crate) fn buffers(schedule: &Schedule) -> Vec<Buffer> {
    let buffer = |entry: &BufferEntry| match entry {
        BufferEntry::Constant { count, value } => Buffer::constant(*count, *value),
        BufferEntry::HostFed(port) => fed(port, schedule.tick_hz),
        BufferEntry::Output(port) => Buffer::new(port, schedule.tick_hz),
    };
    schedule.buffers.iter().map(buffer).collect()
}

/// Audio buffers that the host fills.
pub(crate) fn fed_audio(schedule: &Schedule) -> Vec<usize> {
    let audio =
        |e: &BufferEntry| matches!(e, BufferEntry::HostFed(PortType { shape: Shape::Audio { .. }, .. }));
    (0..schedule.buffers.len()).filter(|&at| audio(&schedule.buffers[at])).collect()
}

/// Buffer of a fed input before the host has set anything.
fn fed(port: &PortType, tick_hz: u32) -> Buffer {
    let mut buffer = Buffer::new(port, tick_hz);
    buffer.set_valid(false);
    buffer
}

/// Values of a node's live parameters.
pub(super) fn live_values(schedule: &Schedule, j: usize) -> Vec<f64> {
    let node = &schedule.nodes[j];
    let value = |l: &asperity_graph::LiveParam| {
        node.params.get(&l.name).and_then(|value| live_value(&l.kind, value)).unwrap_or(f64::NAN)
    };
    node.live.iter().map(value).collect()
}

/// Live parameters of a kept node that the new graph changes.
fn sets(new: &Schedule, j: usize, before: &[f64]) -> Vec<Set> {
    let values = live_values(new, j);
    let changed =
        new.nodes[j].live.iter().zip(values).zip(before).filter(|((_, x), was)| x != *was && !x.is_nan());
    changed.map(|((l, value), _)| Set { node: j, param: l.index, value }).collect()
}

/// Gate sets as a slot has them.
fn boxed(ways: &Ways) -> GateSets {
    ways.iter().map(|way| way.clone().into()).collect()
}

/// Sets the gate sets of new nodes during the fade, and returns those for afterwards.
fn gate_sets(plan: &Plan, old: &Schedule, new: &Schedule, slots: &mut [Slot]) -> Vec<(usize, GateSets)> {
    let ways = plan.shadows.new_ways(old, new).into_iter().enumerate();
    let other = ways.filter(|(j, ways)| *ways != new.nodes[*j].gate_sets);
    other.map(|(j, ways)| (j, std::mem::replace(&mut slots[j].gate_sets, boxed(&ways)))).collect()
}

/// Buffers fed by the host with which nodes in the same place continue: new and old buffer.
fn carried(plan: &Plan, old: &Schedule, new: &Schedule) -> Vec<(usize, usize)> {
    let mut pairs = Vec::new();
    for (fate, node) in plan.fates.iter().zip(&new.nodes) {
        let (Fate::Kept(i) | Fate::Rebuilt { old: i, .. }) = fate else { continue };
        let inputs = node.inputs.iter().zip(&old.nodes[*i].inputs);
        let fed = inputs.filter(|(new, old)| new.host_fed && old.host_fed && new.port == old.port);
        pairs.extend(fed.map(|(new, old)| (new.reads.buffer as usize, old.reads.buffer as usize)));
    }
    pairs
}

/// Buffer from which an old node still running reads the host's values: that of the node that replaces
/// it.
fn fed_anew(plan: &Plan, old: &Schedule, new: &Schedule, i: usize, input: usize) -> Option<usize> {
    let j = plan.fates.iter().position(|f| matches!(f, Fate::Rebuilt { old, .. } if *old == i))?;
    let (was, is) = (&old.nodes[i].inputs[input], new.nodes[j].inputs.get(input)?);
    (was.host_fed && is.host_fed && is.port == was.port).then_some(is.reads.buffer as usize)
}

/// Adds slots for old nodes after the new ones. Returns the buffers fed by the host to nodes that
/// nothing replaces: new and old buffer.
fn add_shadows(plan: &Plan, old: &Schedule, body: &mut Body) -> Vec<(usize, usize)> {
    let new = body.schedule.clone();
    let mut own = Vec::new();
    let first = body.slots.len();
    for &i in &plan.shadows.nodes {
        let node = &old.nodes[i];
        let mut slot = Slot::new(node, Box::new(Absent));
        slot.gate_sets = boxed(&plan.shadows.old_ways(old, i));
        let start = body.buffers.len();
        slot.outputs = start..start + node.outputs.len();
        body.buffers.extend(node.outputs.iter().map(|o| Buffer::new(&o.port, old.tick_hz)));
        body.slots.push(slot);
    }
    for (k, &i) in plan.shadows.nodes.iter().enumerate() {
        for (input, port) in old.nodes[i].inputs.iter().enumerate() {
            let at = match port.from {
                Some(from) => source(plan, body, from),
                None => Some(fed_anew(plan, old, &new, i, input).unwrap_or_else(|| {
                    let (was, is) = (port.reads.buffer as usize, body.buffers.len());
                    body.buffers.push(match old.buffers.get(was) {
                        Some(BufferEntry::Constant { count, value }) => Buffer::constant(*count, *value),
                        Some(BufferEntry::HostFed(port)) => {
                            // It holds its last values.
                            own.push((is, was));
                            fed(port, old.tick_hz)
                        }
                        _ => Buffer::constant(0, 0.0),
                    });
                    is
                })),
            };
            // A gate that only keeps its last answer reads nothing.
            body.slots[first + k].inputs[input].buffer = at.unwrap_or(0) as u32;
        }
    }
    own
}

/// The buffer of an old node's output in the new body.
fn source(plan: &Plan, body: &Body, (node, output): (usize, usize)) -> Option<usize> {
    Some(body.slots[plan.shadows.slot(node)?].outputs.start + output)
}

/// Makes a crossfade, and returns its reader too.
fn crossfade(
    plan: &Plan,
    new: &Schedule,
    point: Point,
    body: &mut Body,
) -> (Crossfade, Option<(usize, usize)>) {
    let (node, output) = point.new;
    let port = &new.nodes[node].outputs[output].port;
    let rate_hz = if let Shape::Audio { rate_hz } = port.shape { rate_hz } else { 0 };
    let old = point.old.and_then(|from| source(plan, body, from));
    let new = new.nodes[node].buffers.start + output;
    match point.place {
        Place::Output(_) => (Crossfade { old, new, mix: None, rate_hz, through: false }, None),
        Place::Input(input) => {
            let mix = body.buffers.len();
            body.buffers.push(Buffer::new(port, body.schedule.tick_hz));
            body.slots[point.node].inputs[input].buffer = mix as u32;
            (Crossfade { old, new, mix: Some(mix), rate_hz, through: false }, Some((point.node, input)))
        }
    }
}

/// Ticks between two ticks in which every new node runs; 1 if such ticks are rarer than once a second.
fn every(plan: &Plan, new: &Schedule) -> u64 {
    let fresh = plan.fates.iter().zip(&new.nodes).filter(|(fate, _)| **fate == Fate::New);
    let gcd = |mut a: u64, mut b: u64| {
        while b > 0 {
            (a, b) = (b, a % b);
        }
        a
    };
    let all = fresh.map(|(_, n)| u64::from(n.every)).fold(1, |a: u64, b| (a / gcd(a, b)).saturating_mul(b));
    if all <= u64::from(new.tick_hz) { all } else { 1 }
}
