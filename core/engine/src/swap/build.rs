//! Allocates everything that the tick thread needs for a swap.

use asperity_graph::{BufferEntry, Compiled, GateSets, Schedule, ScheduledNode, Waiting, gate_sets, steps};
use asperity_node::{Buffer, Latency, PortType, Resume, Shape};

use super::crossfade::Crossfade;
use super::plan::{Fate, Point, live_values, upstream};
use super::report::Change;
use super::takeover::{Absent, Rebuilt, Set, Swap};
use crate::engine::Body;
use crate::slot::Slot;

/// The graph that runs: its schedule, bytes of each node's state, and last values of live parameters.
pub(super) struct Running<'a> {
    pub(super) schedule: &'a Schedule,
    pub(super) sizes: &'a [usize],
    pub(super) live: &'a [Vec<f64>],
}

/// Makes a swap.
pub(super) fn build(
    number: u64,
    running: &Running<'_>,
    compiled: Compiled,
    fates: &[Fate],
    points: &[Point],
) -> Swap {
    let old = running.schedule;
    let mut body = Body::new(compiled);
    let new = body.schedule.clone();
    let sides = Sides::new(old, &new, fates, points);
    let steps = sides.steps();
    let gate_sets = sides.gate_sets_of_new();
    let gate_sets =
        gate_sets.map(|(j, sets)| (j, std::mem::replace(&mut body.slots[j].gate_sets, sets))).collect();
    let mut fed = carried(fates, old, &new);
    fed.extend(sides.add_shadows(&mut body));
    let mut swap = Swap {
        number,
        settled: std::mem::replace(&mut body.steps, steps),
        fades: points.iter().map(|p| sides.crossfade(p, &mut body)).collect(),
        body,
        kept: Vec::new(),
        rebuilt: Vec::new(),
        gone: (0..old.nodes.len()).filter(|i| !fates.iter().any(|f| f.kept() == Some(*i))).collect(),
        sets: Vec::new(),
        gate_sets,
        fed,
        every: every(fates, &new),
        begun: 0,
        shadows: sides.shadows,
    };
    for ((j, fate), node) in fates.iter().enumerate().zip(&new.nodes) {
        let Some(i) = fate.old else { continue };
        if fate.change == Change::Kept {
            swap.kept.push((j, i));
            let values = node.live.iter().zip(live_values(node)).zip(&running.live[i]);
            let changed = values.filter(|((_, x), was)| x != *was && !x.is_nan());
            swap.sets.extend(changed.map(|((l, value), _)| Set { node: j, param: l.index, value }));
        } else {
            // A node without saved state but with a latency or tail starts anew; one without either loses
            // nothing.
            let has_past = node.latency != Latency::ZERO || node.tail != Latency::ZERO;
            let adopts = matches!(fate.change, Change::Rebuilt { adopts: true, .. });
            let goes_on = adopts && (running.sizes[i] > 0 || !has_past);
            let state = goes_on.then(|| vec![0; running.sizes[i]].into());
            swap.rebuilt.push(Rebuilt { new: j, old: i, state, adopted: false });
        }
    }
    swap
}

/// Makes the buffers of a schedule.
pub(crate) fn buffers(schedule: &Schedule) -> Vec<Buffer> {
    schedule.buffers.iter().map(|entry| buffer(entry, schedule.tick_hz)).collect()
}

fn buffer(entry: &BufferEntry, tick_hz: u32) -> Buffer {
    match entry {
        BufferEntry::Constant { count, value } => Buffer::constant(*count, *value),
        BufferEntry::Output(port) => Buffer::new(port, tick_hz),
        BufferEntry::HostFed(port) => {
            // The host has not set anything.
            let mut buffer = Buffer::new(port, tick_hz);
            buffer.set_valid(false);
            buffer
        }
    }
}

/// Audio buffers that the host fills.
pub(crate) fn fed_audio(schedule: &Schedule) -> Vec<usize> {
    let audio =
        |e: &BufferEntry| matches!(e, BufferEntry::HostFed(PortType { shape: Shape::Audio { .. }, .. }));
    (0..schedule.buffers.len()).filter(|&at| audio(&schedule.buffers[at])).collect()
}

/// Buffers fed by the host with which nodes in the same place continue: new and old buffer.
fn carried(fates: &[Fate], old: &Schedule, new: &Schedule) -> Vec<(usize, usize)> {
    let pairs = fates.iter().zip(&new.nodes).filter_map(|(fate, node)| Some((node, &old.nodes[fate.old?])));
    let inputs = pairs.flat_map(|(node, was)| node.inputs.iter().zip(&was.inputs));
    let fed = inputs.filter(|(is, was)| is.host_fed && was.host_fed && is.port == was.port);
    fed.map(|(is, was)| (is.reads.buffer as usize, was.reads.buffer as usize)).collect()
}

/// Ticks between two ticks in which every new node runs; 1 if such ticks are rarer than once a second.
fn every(fates: &[Fate], new: &Schedule) -> u64 {
    let fresh = fates.iter().zip(&new.nodes).filter(|(fate, _)| fate.change == Change::New);
    let gcd = |mut a: u64, mut b: u64| {
        while b > 0 {
            (a, b) = (b, a % b);
        }
        a
    };
    let all = fresh.map(|(_, n)| u64::from(n.every)).fold(1, |a: u64, b| (a / gcd(a, b)).saturating_mul(b));
    if all <= u64::from(new.tick_hz) { all } else { 1 }
}

/// Both graphs during the crossfade. Slots are those of the new nodes, then those of old nodes beside them.
struct Sides<'a> {
    old: &'a Schedule,
    new: &'a Schedule,
    fates: &'a [Fate],
    points: &'a [Point],
    /// Slot and old index of each old node beside the new ones.
    shadows: Vec<(usize, usize)>,
    /// Slot of each old node that is still there.
    slots: Vec<Option<usize>>,
    /// Old nodes that a crossfade hears, directly or indirectly.
    heard: Vec<bool>,
    /// When each of them is wanted, by slot.
    wanted: Vec<GateSets>,
}

impl<'a> Sides<'a> {
    fn new(old: &'a Schedule, new: &'a Schedule, fates: &'a [Fate], points: &'a [Point]) -> Self {
        let heard = upstream(old, points.iter().filter_map(|p| Some(p.old?.0)), |_| true);
        let mut slots = vec![None; old.nodes.len()];
        for (j, fate) in fates.iter().enumerate() {
            fate.kept().into_iter().for_each(|i| slots[i] = Some(j));
        }
        let beside = (0..old.nodes.len()).filter(|&i| heard[i] && slots[i].is_none());
        let shadows: Vec<(usize, usize)> = (new.nodes.len()..).zip(beside).collect();
        shadows.iter().for_each(|&(slot, i)| slots[i] = Some(slot));
        let mut sides = Self { old, new, fates, points, shadows, slots, heard, wanted: Vec::new() };
        sides.wanted = sides.wanted();
        sides
    }

    /// Computes the field `wanted`: from the sinks up, a wanted node wants its sources.
    fn wanted(&self) -> Vec<GateSets> {
        let nodes = &self.old.nodes;
        let mut readers: Vec<Vec<(usize, usize)>> = vec![Vec::new(); nodes.len()];
        for (r, node) in nodes.iter().enumerate().filter(|(r, _)| self.heard[*r]) {
            for (input, port) in node.inputs.iter().enumerate() {
                port.from.into_iter().for_each(|(from, _)| readers[from].push((r, input)));
            }
        }
        let mut wanted = vec![GateSets::new(); nodes.len()];
        for i in (0..nodes.len()).rev().filter(|&i| self.heard[i]) {
            let node = &nodes[i];
            if node.sink || node.resume == Resume::Never || node.closes_cycle {
                continue;
            }
            let faded = self.points.iter().filter(|p| p.old.is_some_and(|(from, _)| from == i)).map(|p| {
                let reader = &self.new.nodes[p.node()];
                let gates = p.reader.is_some_and(|(_, input)| reader.gate == Some(input));
                (&reader.gate_sets, gates.then_some(p.node()))
            });
            let own = readers[i]
                .iter()
                .map(|&(r, input)| (&wanted[r], self.slots[r].filter(|_| nodes[r].gate == Some(input))));
            wanted[i] = gate_sets(faded.chain(own));
        }
        wanted
    }

    /// New nodes with other gate sets during the fade, since old ones read them.
    fn gate_sets_of_new(&self) -> impl Iterator<Item = (usize, GateSets)> + use<'_> {
        let kept = self.fates.iter().enumerate().filter_map(|(j, fate)| Some((j, fate.kept()?)));
        kept.filter(|(_, i)| self.heard[*i])
            .map(|(j, i)| (j, gate_sets([(&self.new.nodes[j].gate_sets, None), (&self.wanted[i], None)])))
    }

    /// Steps of a tick during the crossfade, each after its sources. Slots after the last one stand for the
    /// crossfades.
    ///
    /// Such an order exists: old and new nodes meet only in kept ones, and no kept node is both after a
    /// crossfade and before one.
    fn steps(&self) -> Vec<asperity_graph::Step> {
        let count = self.new.nodes.len() + self.shadows.len();
        let point = |is: &dyn Fn(&Point) -> bool| self.points.iter().position(is).map(|p| count + p);
        // Where an output of a new node is ready.
        let ready = |new: (usize, usize)| point(&|p| p.reader.is_none() && p.new == new).unwrap_or(new.0);
        let slot = |old: (usize, usize)| self.slots[old.0];
        let waiting = |node: &ScheduledNode, gate_sets: &GateSets, reads| Waiting {
            runs: true,
            reads,
            gate: node.gate,
            closes_cycle: node.closes_cycle,
            gate_sets: gate_sets.clone(),
        };
        let mut all: Vec<Waiting> = Vec::new();
        for (j, node) in self.new.nodes.iter().enumerate() {
            let wires = node.inputs.iter().enumerate().filter_map(|(input, port)| Some((input, port.from?)));
            let source = |(input, from)| {
                (input, point(&|p| p.reader == Some((j, input))).unwrap_or_else(|| ready(from)))
            };
            all.push(waiting(node, &node.gate_sets, wires.map(source).collect()));
        }
        self.gate_sets_of_new().for_each(|(j, sets)| all[j].gate_sets = sets);
        for &(_, i) in &self.shadows {
            let node = &self.old.nodes[i];
            let wires = node.inputs.iter().enumerate();
            let reads = wires.filter_map(|(input, port)| Some((input, slot(port.from?)?))).collect();
            all.push(waiting(node, &self.wanted[i], reads));
        }
        all.extend(self.points.iter().map(|p| {
            let new = if p.reader.is_some() { ready(p.new) } else { p.new.0 };
            let reads = [Some(new), p.old.and_then(slot)].into_iter().flatten().enumerate().collect();
            Waiting { runs: true, reads, ..Waiting::default() }
        }));
        steps(&all).unwrap_or_else(|| {
            // Gates wait for each other: their answers are those of the tick before.
            all.iter_mut().for_each(|node| node.gate_sets.clear());
            let found = steps(&all);
            debug_assert!(found.is_some(), "steps wait for each other");
            found.unwrap_or_default()
        })
    }

    /// Adds slots for old nodes after the new ones. Returns the buffers fed by the host to nodes that
    /// nothing replaces: new and old buffer.
    fn add_shadows(&self, body: &mut Body) -> Vec<(usize, usize)> {
        let Self { old, .. } = *self;
        let mut own = Vec::new();
        for &(_, i) in &self.shadows {
            let node = &old.nodes[i];
            let mut slot = Slot::new(node, Box::new(Absent));
            slot.gate_sets = self.wanted[i].clone();
            let start = body.buffers.len();
            slot.outputs = start..start + node.outputs.len();
            body.buffers.extend(node.outputs.iter().map(|o| Buffer::new(&o.port, old.tick_hz)));
            body.slots.push(slot);
        }
        for &(slot, i) in &self.shadows {
            for (input, port) in old.nodes[i].inputs.iter().enumerate() {
                let anew = || self.fed_anew(i, input);
                let at = self.source(body, port.from).or_else(anew).unwrap_or_else(|| {
                    let (was, is) = (port.reads.buffer as usize, body.buffers.len());
                    body.buffers.push(buffer(&old.buffers[was], old.tick_hz));
                    if port.host_fed {
                        // It holds its last values.
                        own.push((is, was));
                    }
                    is
                });
                body.slots[slot].inputs[input].buffer = at as u32;
            }
        }
        own
    }

    /// Buffer from which an old node still running reads the host's values: that of the node that replaces
    /// it.
    fn fed_anew(&self, i: usize, input: usize) -> Option<usize> {
        let j = self.fates.iter().position(|f| f.old == Some(i))?;
        let (was, is) = (&self.old.nodes[i].inputs[input], self.new.nodes[j].inputs.get(input)?);
        (was.host_fed && is.host_fed && is.port == was.port).then_some(is.reads.buffer as usize)
    }

    /// The buffer of an old node's output in the new body.
    fn source(&self, body: &Body, from: Option<(usize, usize)>) -> Option<usize> {
        let (node, output) = from?;
        Some(body.slots[self.slots[node]?].outputs.start + output)
    }

    fn crossfade(&self, point: &Point, body: &mut Body) -> Crossfade {
        let (node, output) = point.new;
        let node = &self.new.nodes[node];
        let port = &node.outputs[output].port;
        let rate_hz = if let Shape::Audio { rate_hz } = port.shape { rate_hz } else { 0 };
        let (old, new) = (self.source(body, point.old), node.buffers.start + output);
        let mix = point.reader.map(|(node, input)| {
            let mix = body.buffers.len();
            body.buffers.push(Buffer::new(port, self.new.tick_hz));
            body.slots[node].inputs[input].buffer = mix as u32;
            mix
        });
        Crossfade { old, new, mix, reader: point.reader, rate_hz, through: false }
    }
}
