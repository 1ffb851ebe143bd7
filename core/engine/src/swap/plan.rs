//! Decides which nodes of a new graph are old ones, and where the two graphs are crossfaded.

use std::collections::BTreeSet;

use asperity_graph::{Schedule, ScheduledInput, ScheduledNode};
use asperity_node::{Latency, ParamKind, ParamValue, Shape};

use super::order::{self, Run};
use super::shadow::Shadows;

/// Origin of a node of the new graph.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Fate {
    /// It is this old node and continues unchanged.
    Kept(usize),
    /// It replaces this old node, and takes over its state if it `adopts`.
    Rebuilt { old: usize, adopts: bool, why: String },
    /// There was no such node.
    New,
}

impl Fate {
    /// The old node that is kept.
    pub(super) fn kept(&self) -> Option<usize> {
        if let Fate::Kept(old) = self { Some(*old) } else { None }
    }
}

/// A crossfade from the output of an old node to that of a new one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Point {
    /// The new node that reads it.
    pub(super) node: usize,
    pub(super) place: Place,
    /// Old node and output; `None` fades in from silence.
    pub(super) old: Option<(usize, usize)>,
    /// New node and output.
    pub(super) new: (usize, usize),
}

impl Point {
    pub(super) fn on_input(&self) -> bool {
        matches!(self.place, Place::Input(_))
    }
}

/// Port of a crossfade.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Place {
    /// Before an input: of a kept node, or of one with latency or tail.
    Input(usize),
    /// On an output of a sink that is not kept, for its host.
    Output(usize),
}

/// Plan of a swap, by index in the two schedules.
#[derive(Debug)]
pub(super) struct Plan {
    /// Origin of every new node.
    pub(super) fates: Vec<Fate>,
    pub(super) points: Vec<Point>,
    pub(super) shadows: Shadows,
    /// Steps of a tick during the crossfade.
    pub(super) steps: Vec<Run>,
}

impl Plan {
    /// Keeps as many nodes as possible.
    pub(super) fn new(old: &Schedule, new: &Schedule, changed: &[String]) -> Self {
        let mut between = BTreeSet::new();
        loop {
            let fates = fates(old, new, changed, &between);
            let points = points(old, new, &fates);
            let more = cascaded(old, new, &fates, &points);
            if !more.is_empty() {
                // Each round keeps fewer nodes, so there is a last one.
                between.extend(more);
                continue;
            }
            let shadows = Shadows::find(old, new, &fates, &points);
            let steps = order::order(old, new, &points, &shadows);
            return Self { fates, points, shadows, steps };
        }
    }
}

/// Kept nodes after one crossfade and before another. They would combine the old input with the new
/// output, and the reverse. A factor of 100 that moves from one gain to another would then be loud, or
/// missing, during the fade. So an old and a new copy of them run, and the output is a mix of the old
/// graph and the new one only.
fn cascaded(old: &Schedule, new: &Schedule, fates: &[Fate], points: &[Point]) -> Vec<usize> {
    let before = |node: usize, i: usize| {
        // A node that closes a cycle is before its own source.
        let others = || points.iter().filter(|p| p.node != node);
        upstream(new, others().map(|p| p.new.0))[node]
            || upstream(old, others().filter_map(|p| Some(p.old?.0)))[i]
    };
    let behind: BTreeSet<usize> = points.iter().filter(|p| p.on_input()).map(|p| p.node).collect();
    behind.into_iter().filter(|&j| fates[j].kept().is_some_and(|i| before(j, i))).collect()
}

/// The given nodes and all nodes that they read from in the same tick.
fn upstream(schedule: &Schedule, of: impl Iterator<Item = usize>) -> Vec<bool> {
    let mut heard = vec![false; schedule.nodes.len()];
    of.for_each(|i| heard[i] = true);
    for (i, node) in schedule.nodes.iter().enumerate().rev().filter(|(_, n)| !n.closes_cycle) {
        if heard[i] {
            node.inputs.iter().filter_map(|input| input.from).for_each(|(from, _)| heard[from] = true);
        }
    }
    heard
}

/// `between` are nodes that cannot be kept because they are between two changes.
fn fates(old: &Schedule, new: &Schedule, changed: &[String], between: &BTreeSet<usize>) -> Vec<Fate> {
    let mut fates: Vec<Fate> = new
        .nodes
        .iter()
        .enumerate()
        .map(|(j, node)| {
            let found = old.nodes.iter().position(|o| o.id == node.id && o.kind == node.kind);
            let renamed = || same_channel(old, new, j);
            let Some(i) = found.or_else(renamed) else { return Fate::New };
            let before = &old.nodes[i];
            let why = if before.id != node.id {
                Some(format!("it drives what `{}` drove", before.id))
            } else if changed.contains(&node.id) {
                Some("what it reads changed".to_owned())
            } else if old.seed != new.seed {
                Some("the graph has another seed".to_owned())
            } else if between.contains(&j) {
                Some("it is between two changes".to_owned())
            } else {
                difference(before, node)
            };
            match why {
                Some(why) => Fate::Rebuilt { old: i, adopts: same_ports(before, node), why },
                None => Fate::Kept(i),
            }
        })
        .collect();
    // Frames are not crossfaded, so a reader of frames from a rebuilt node is rebuilt too.
    while let Some((j, why)) =
        (0..new.nodes.len()).find_map(|j| Some((j, other_frames(old, new, &fates, j)?)))
    {
        if let Fate::Kept(old) = fates[j] {
            fates[j] = Fate::Rebuilt { old, adopts: true, why };
        }
    }
    fates
}

/// The removed limiter of the same device channel: coil and mover belong to the channel, independent of
/// the node's name.
fn same_channel(old: &Schedule, new: &Schedule, j: usize) -> Option<usize> {
    let node = &new.nodes[j];
    let channel = limiters(new).iter().position(|(_, limiter)| *limiter == Some(j))?;
    let (sink, before) = (limiters(new)[channel].0, limiters(old));
    let named = before.iter().find(|(was, _)| was.id == sink.id && was.kind == sink.kind);
    let i = named.or(before.get(channel))?.1?;
    let was = &old.nodes[i];
    let gone = !new.nodes.iter().any(|n| n.id == was.id && n.kind == was.kind);
    (gone && was.kind == node.kind).then_some(i)
}

/// Every sink that takes only a limited signal, and the limiter before it.
fn limiters(schedule: &Schedule) -> Vec<(&ScheduledNode, Option<usize>)> {
    let audio = |i: &&ScheduledInput| i.port.as_ref().is_some_and(|p| p.limited && is_audio(p.shape));
    let sinks = schedule.nodes.iter().filter(|n| n.sink);
    sinks.filter_map(|n| Some((n, n.inputs.iter().find(audio)?.from.map(|(node, _)| node)))).collect()
}

/// Why a kept node would read other frames than before.
fn other_frames(old: &Schedule, new: &Schedule, fates: &[Fate], j: usize) -> Option<String> {
    let before = &old.nodes[fates[j].kept()?];
    let ports = new.nodes[j].inputs.iter().zip(&before.inputs);
    let frames = |shape: Shape| matches!(shape, Shape::Magnitude(_) | Shape::Spectrum(_));
    let mut others = ports
        .filter(|(input, _)| input.port.as_ref().is_some_and(|p| frames(p.shape)))
        .filter(|(input, was)| !same_source(fates, input.from, was.from))
        .filter_map(|(input, _)| input.from);
    others.next().map(|(from, _)| format!("it reads frames of `{}`", new.nodes[from].id))
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
    if old.build != new.build {
        return Some("its code was built anew".into());
    }
    if let Some(name) = other_param(old, new) {
        return Some(format!("`{name}` changed"));
    }
    if old.every != new.every {
        return Some("it runs more or less often".into());
    }
    if !same_ports(old, new) {
        return Some("its ports have other types".into());
    }
    if old.closes_cycle != new.closes_cycle {
        return Some("it stands otherwise in a cycle".into());
    }
    let inputs = old.inputs.iter().zip(&new.inputs).all(|(a, b)| a.from.is_some() == b.from.is_some());
    let outputs = old.outputs.iter().zip(&new.outputs).all(|(a, b)| (a.readers > 0) == (b.readers > 0));
    (!inputs || !outputs).then(|| "other ports of it are connected".into())
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

/// Value of a live parameter as [`Node::set_parameter`](asperity_node::Node::set_parameter) takes it.
pub(super) fn live_value(kind: &ParamKind, value: &ParamValue) -> Option<f64> {
    match (kind, value) {
        (ParamKind::Number(_), ParamValue::Number(x)) => Some(*x),
        (ParamKind::Integer(_), ParamValue::Integer(i)) => Some(*i as f64),
        (ParamKind::Flag, ParamValue::Flag(b)) => Some(f64::from(u8::from(*b))),
        (ParamKind::Choice(words), ParamValue::Text(word)) => {
            words.iter().position(|w| w == word).map(|i| i as f64)
        }
        _ => None,
    }
}

/// Crossfades before every audio and control input of a kept node whose source changed, on the audio of
/// sinks that are not kept, and before nodes with latency or tail that are not kept.
fn points(old: &Schedule, new: &Schedule, fates: &[Fate]) -> Vec<Point> {
    let mut points = on_sinks(old, new, fates);
    for (j, (fate, node)) in fates.iter().zip(&new.nodes).enumerate() {
        match *fate {
            Fate::Kept(i) => {
                for (input, (port, was)) in node.inputs.iter().zip(&old.nodes[i].inputs).enumerate() {
                    let (Some(to), Some(from)) = (port.from, was.from) else { continue };
                    let on_sink = Point { node: to.0, place: Place::Output(to.1), old: Some(from), new: to };
                    if !same_source(fates, Some(to), Some(from)) && !points.contains(&on_sink) {
                        let place = Place::Input(input);
                        points.push(Point { node: j, place, old: Some(from), new: to });
                    }
                }
            }
            _ if node.latency > Latency::ZERO || node.tail > Latency::ZERO => {
                points.extend(before_memory(old, new, fates, j));
            }
            Fate::Rebuilt { .. } | Fate::New => {}
        }
    }
    points
}

/// Crossfades before a node with latency or tail that is not kept: a step at its input would be heard
/// after the fade. A node that adopts a state continues from the old node's input; another one starts
/// in silence.
fn before_memory(old: &Schedule, new: &Schedule, fates: &[Fate], j: usize) -> Vec<Point> {
    let before = if let Fate::Rebuilt { old: i, .. } = &fates[j] { &old.nodes[*i].inputs[..] } else { &[] };
    let audio = new.nodes[j]
        .inputs
        .iter()
        .enumerate()
        .filter(|(_, i)| i.port.as_ref().is_some_and(|p| is_audio(p.shape)));
    let point = |(input, port): (usize, &ScheduledInput)| {
        let was = before.get(input).filter(|was| was.port == port.port);
        let other = was.filter(|was| !same_source(fates, port.from, was.from));
        Some(Point {
            node: j,
            place: Place::Input(input),
            old: other.and_then(|was| was.from),
            new: port.from?,
        })
    };
    audio.filter_map(point).collect()
}

/// Crossfades on the audio of sinks that are not kept.
fn on_sinks(old: &Schedule, new: &Schedule, fates: &[Fate]) -> Vec<Point> {
    let mut points = Vec::new();
    let mut removed: BTreeSet<usize> = (0..old.nodes.len()).collect();
    for fate in fates {
        if let Fate::Kept(i) | Fate::Rebuilt { old: i, .. } = fate {
            removed.remove(i);
        }
    }
    for (j, (fate, node)) in fates.iter().zip(&new.nodes).enumerate().filter(|(_, (_, n))| n.sink) {
        let before = match fate {
            Fate::Kept(_) => continue,
            Fate::Rebuilt { old, .. } => Some(*old),
            // A device under another name goes on playing.
            Fate::New => removed.iter().copied().find(|&i| drives_same(&old.nodes[i], node)),
        };
        if let Some(i) = before {
            removed.remove(&i);
        }
        for (output, port) in node.outputs.iter().enumerate().filter(|(_, o)| is_audio(o.port.shape)) {
            let was =
                before.filter(|&i| old.nodes[i].outputs.get(output).is_some_and(|o| o.port == port.port));
            let old = was.map(|i| (i, output));
            points.push(Point { node: j, place: Place::Output(output), old, new: (j, output) });
        }
    }
    points
}

fn is_audio(shape: Shape) -> bool {
    matches!(shape, Shape::Audio { .. })
}

/// Whether two sinks drive the same kind of device.
fn drives_same(old: &ScheduledNode, new: &ScheduledNode) -> bool {
    let device =
        |n: &ScheduledNode| n.sink && n.inputs.iter().any(|i| i.port.as_ref().is_some_and(|p| p.limited));
    old.kind == new.kind && device(old) && device(new)
}
