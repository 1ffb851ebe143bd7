//! Decides which nodes of a new graph are old ones, and where the two graphs are crossfaded.

use std::collections::BTreeSet;

use asperity_graph::{Schedule, ScheduledInput, ScheduledNode};
use asperity_node::{Latency, ParamKind, ParamValue, Shape};

use super::report::Change;

/// Origin of a node of the new graph.
#[derive(Clone, Debug)]
pub(super) struct Fate {
    /// The old node that it is or replaces.
    pub(super) old: Option<usize>,
    pub(super) change: Change,
}

impl Fate {
    /// The old node that is kept.
    pub(super) fn kept(&self) -> Option<usize> {
        self.old.filter(|_| self.change == Change::Kept)
    }
}

/// A crossfade from the output of an old node to that of a new one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Point {
    /// New node and input before which it is: of a kept node, or of one with latency or tail. None on an
    /// output of a sink that is not kept, for its host.
    pub(super) reader: Option<(usize, usize)>,
    /// Old node and output; `None` fades in from silence.
    pub(super) old: Option<(usize, usize)>,
    /// New node and output.
    pub(super) new: (usize, usize),
}

impl Point {
    /// The new node that hears it.
    pub(super) fn node(&self) -> usize {
        self.reader.unwrap_or(self.new).0
    }
}

/// Keeps as many nodes as possible. Answers the origin of every new node, and the crossfades.
pub(super) fn plan(old: &Schedule, new: &Schedule, changed: &[String]) -> (Vec<Fate>, Vec<Point>) {
    let mut between = BTreeSet::new();
    loop {
        let fates = fates(old, new, changed, &between);
        let points = points(old, new, &fates);
        let more = cascaded(old, new, &fates, &points);
        if more.is_empty() {
            return (fates, points);
        }
        // Each round keeps fewer nodes, so there is a last one.
        between.extend(more);
    }
}

/// Kept nodes after one crossfade and before another. They would combine the old input with the new
/// output, and the reverse. A factor of 100 that moves from one gain to another would then be loud, or
/// missing, during the fade. So an old and a new copy of them run, and the output is a mix of the old
/// graph and the new one only.
fn cascaded(old: &Schedule, new: &Schedule, fates: &[Fate], points: &[Point]) -> Vec<usize> {
    let before = |node: usize, i: usize| {
        // A node that closes a cycle is before its own source.
        let others = || points.iter().filter(|p| p.node() != node);
        let upstream =
            |schedule, of: &mut dyn Iterator<Item = usize>| upstream(schedule, of, |n| !n.closes_cycle);
        upstream(new, &mut others().map(|p| p.new.0))[node]
            || upstream(old, &mut others().filter_map(|p| Some(p.old?.0)))[i]
    };
    let behind: BTreeSet<usize> = points.iter().filter_map(|p| Some(p.reader?.0)).collect();
    behind.into_iter().filter(|&j| fates[j].kept().is_some_and(|i| before(j, i))).collect()
}

/// The given nodes and all nodes that they read from, `through` nodes that are so.
pub(super) fn upstream(
    schedule: &Schedule,
    of: impl Iterator<Item = usize>,
    through: impl Fn(&ScheduledNode) -> bool,
) -> Vec<bool> {
    let (mut heard, mut open) = (vec![false; schedule.nodes.len()], of.collect::<Vec<_>>());
    while let Some(i) = open.pop() {
        let node = &schedule.nodes[i];
        if !std::mem::replace(&mut heard[i], true) && through(node) {
            open.extend(node.inputs.iter().filter_map(|input| Some(input.from?.0)));
        }
    }
    heard
}

/// `between` are nodes that cannot be kept because they are between two changes.
fn fates(old: &Schedule, new: &Schedule, changed: &[String], between: &BTreeSet<usize>) -> Vec<Fate> {
    let fate = |(j, node): (usize, &ScheduledNode)| {
        let found = old.nodes.iter().position(|o| o.id == node.id && o.kind == node.kind);
        let Some(i) = found.or_else(|| same_channel(old, new, j)) else {
            return Fate { old: None, change: Change::New };
        };
        let before = &old.nodes[i];
        let why = if before.id != node.id {
            Some(format!("it drives what `{}` drove", before.id))
        } else if changed.contains(&node.id) {
            Some("its source changed".to_owned())
        } else if old.seed != new.seed {
            Some("the graph has another seed".to_owned())
        } else if between.contains(&j) {
            Some("it is between two changes".to_owned())
        } else {
            difference(before, node)
        };
        let rebuilt = |why| Change::Rebuilt { adopts: same_ports(before, node), why };
        Fate { old: Some(i), change: why.map_or(Change::Kept, rebuilt) }
    };
    let mut fates: Vec<Fate> = new.nodes.iter().enumerate().map(fate).collect();
    // Frames are not crossfaded, so a reader of frames from a rebuilt node is rebuilt too.
    while let Some((j, why)) =
        (0..new.nodes.len()).find_map(|j| Some((j, other_frames(old, new, &fates, j)?)))
    {
        fates[j].change = Change::Rebuilt { adopts: true, why };
    }
    fates
}

/// The removed limiter of the same device channel: coil and mover belong to the channel, independent of
/// the node's name.
fn same_channel(old: &Schedule, new: &Schedule, j: usize) -> Option<usize> {
    let (node, after, before) = (&new.nodes[j], limiters(new), limiters(old));
    let channel = after.iter().position(|(_, limiter)| *limiter == Some(j))?;
    let sink = after[channel].0;
    let named = before.iter().find(|(was, _)| was.id == sink.id && was.kind == sink.kind);
    let i = named.or(before.get(channel))?.1?;
    let was = &old.nodes[i];
    let gone = !new.nodes.iter().any(|n| n.id == was.id && n.kind == was.kind);
    (gone && was.kind == node.kind).then_some(i)
}

/// Every sink that takes only a limited signal, and the limiter before it.
fn limiters(schedule: &Schedule) -> Vec<(&ScheduledNode, Option<usize>)> {
    let limited = |i: &&ScheduledInput| is_audio(i) && i.port.as_ref().is_some_and(|p| p.limited);
    let sinks = schedule.nodes.iter().filter(|n| n.sink);
    sinks.filter_map(|n| Some((n, n.inputs.iter().find(limited)?.from.map(|(node, _)| node)))).collect()
}

/// Why a kept node would read other frames than before.
fn other_frames(old: &Schedule, new: &Schedule, fates: &[Fate], j: usize) -> Option<String> {
    let before = &old.nodes[fates[j].kept()?];
    let frames = |input: &ScheduledInput| {
        matches!(input.port.as_ref().map(|p| p.shape), Some(Shape::Magnitude(_) | Shape::Spectrum(_)))
    };
    let ports = new.nodes[j].inputs.iter().zip(&before.inputs).filter(|(input, _)| frames(input));
    let mut others = ports.filter(|(input, was)| !same_source(fates, input.from, was.from));
    let (from, _) = others.find_map(|(input, _)| input.from)?;
    Some(format!("it reads frames of `{}`", new.nodes[from].id))
}

/// Whether a new source is an old one that is kept.
fn same_source(fates: &[Fate], new: Option<(usize, usize)>, old: Option<(usize, usize)>) -> bool {
    match (new, old) {
        (None, None) => true,
        (Some((j, output)), Some((i, was))) => output == was && fates[j].kept() == Some(i),
        _ => false,
    }
}

/// Why a node is not the old one of its id and kind.
fn difference(old: &ScheduledNode, new: &ScheduledNode) -> Option<String> {
    let inputs = || old.inputs.iter().zip(&new.inputs).all(|(a, b)| a.from.is_some() == b.from.is_some());
    let outputs = || old.outputs.iter().zip(&new.outputs).all(|(a, b)| (a.readers > 0) == (b.readers > 0));
    let why = if old.build != new.build {
        "its code was rebuilt"
    } else if let Some(name) = other_param(old, new) {
        return Some(format!("`{name}` changed"));
    } else if old.every != new.every {
        "it runs more or less often"
    } else if !same_ports(old, new) {
        "its ports have other types"
    } else if old.closes_cycle != new.closes_cycle {
        "its place in a cycle changed"
    } else if !inputs() || !outputs() {
        "its connections changed"
    } else {
        return None;
    };
    Some(why.into())
}

/// Whether a state of the one means something to the other: their ports carry the same.
fn same_ports(old: &ScheduledNode, new: &ScheduledNode) -> bool {
    old.inputs.iter().map(|i| &i.port).eq(new.inputs.iter().map(|i| &i.port))
        && old.outputs.iter().map(|o| &o.port).eq(new.outputs.iter().map(|o| &o.port))
}

/// The first parameter that differs and cannot be set while the node runs. A node may ask whether a
/// graph sets a value, and in which file, so these count too.
fn other_param(old: &ScheduledNode, new: &ScheduledNode) -> Option<String> {
    let path = |node: &ScheduledNode, name: &str| node.params.place(name).map(|p| p.source.path().to_owned());
    let same = |name: &str| {
        let (was, is) = (old.params.get(name), new.params.get(name));
        if new.live.iter().any(|l| l.name == name) && old.live.iter().any(|l| l.name == name) {
            return was.is_some() == is.is_some();
        }
        was == is
            && old.params.is_set(name) == new.params.is_set(name)
            && (!matches!(is, Some(ParamValue::Text(_) | ParamValue::Texts(_)))
                || path(old, name) == path(new, name))
    };
    let mut names = old.params.iter().chain(new.params.iter()).map(|(name, _)| name);
    names.find(|name| !same(name)).map(str::to_owned)
}

/// Values of a node's live parameters, as [`Node::set_parameter`](asperity_node::Node::set_parameter) takes
/// them; NaN for one without.
pub(super) fn live_values(node: &ScheduledNode) -> Vec<f64> {
    let value = |kind: &ParamKind, value: &ParamValue| match (kind, value) {
        (ParamKind::Number(_), ParamValue::Number(x)) => Some(*x),
        (ParamKind::Integer(_), ParamValue::Integer(i)) => Some(*i as f64),
        (ParamKind::Flag, ParamValue::Flag(b)) => Some(f64::from(u8::from(*b))),
        (ParamKind::Choice(words), ParamValue::Text(word)) => {
            words.iter().position(|w| w == word).map(|i| i as f64)
        }
        _ => None,
    };
    let live = node.live.iter().map(|l| node.params.get(&l.name).and_then(|v| value(&l.kind, v)));
    live.map(|value| value.unwrap_or(f64::NAN)).collect()
}

/// Crossfades before every audio and control input of a kept node whose source changed. There are also
/// crossfades on the audio of sinks that are not kept, and before nodes with latency or tail that are not
/// kept.
fn points(old: &Schedule, new: &Schedule, fates: &[Fate]) -> Vec<Point> {
    let mut points = on_sinks(old, new, fates);
    for (j, (fate, node)) in fates.iter().zip(&new.nodes).enumerate() {
        let before = fate.old.map_or(&[][..], |i| &old.nodes[i].inputs);
        let kept = fate.change == Change::Kept;
        // A step at the input of a node with a memory would be heard after the fade. A node that adopts a
        // state continues from the old node's input; another one starts in silence.
        let remembers = node.latency > Latency::ZERO || node.tail > Latency::ZERO;
        for (input, port) in node.inputs.iter().enumerate().filter(|_| kept || remembers) {
            let Some(to) = port.from else { continue };
            let was = before.get(input).filter(|was| kept || was.port == port.port);
            let from = was.filter(|was| !same_source(fates, Some(to), was.from)).and_then(|was| was.from);
            let on_sink = Point { reader: None, old: from, new: to };
            if if kept { from.is_some() && !points.contains(&on_sink) } else { is_audio(port) } {
                points.push(Point { reader: Some((j, input)), old: from, new: to });
            }
        }
    }
    points
}

/// Crossfades on the audio of sinks that are not kept.
fn on_sinks(old: &Schedule, new: &Schedule, fates: &[Fate]) -> Vec<Point> {
    let mut points = Vec::new();
    let mut removed: BTreeSet<usize> = (0..old.nodes.len()).collect();
    removed.retain(|i| !fates.iter().any(|fate| fate.old == Some(*i)));
    for (j, (fate, node)) in fates.iter().zip(&new.nodes).enumerate() {
        if !node.sink || fate.change == Change::Kept {
            continue;
        }
        // A device under another name goes on playing.
        let device = || removed.iter().copied().find(|&i| drives_same(&old.nodes[i], node));
        let before = fate.old.or_else(device);
        before.iter().for_each(|i| _ = removed.remove(i));
        let audio = |port| matches!(port, Shape::Audio { .. });
        for (output, port) in node.outputs.iter().enumerate().filter(|(_, o)| audio(o.port.shape)) {
            let same = |i: &usize| old.nodes[*i].outputs.get(output).is_some_and(|o| o.port == port.port);
            let old = before.filter(same).map(|i| (i, output));
            points.push(Point { reader: None, old, new: (j, output) });
        }
    }
    points
}

fn is_audio(input: &ScheduledInput) -> bool {
    input.port.as_ref().is_some_and(|p| matches!(p.shape, Shape::Audio { .. }))
}

/// Whether two sinks drive the same kind of device.
fn drives_same(old: &ScheduledNode, new: &ScheduledNode) -> bool {
    let device =
        |n: &ScheduledNode| n.sink && n.inputs.iter().any(|i| i.port.as_ref().is_some_and(|p| p.limited));
    old.kind == new.kind && device(old) && device(new)
}
