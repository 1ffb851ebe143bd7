//! Infers port types over the wires.
//!
//! Every node has variables for the open parts of its descriptor. Wires bind them from output to input
//! until nothing changes. Only then, where an output is still open, they bind back from an input. So
//! the result does not depend on the order of the wires. Then each wire is checked at both ends.

use std::collections::{HashMap, VecDeque};

use asperity_node::{
    Descriptor, Diagnostic, FrameLayout, LayoutSpec, NodeKind, PortType, Ports, RateSpec, Registry, Shape,
    ShapeSpec, Unit, UnitSpec, Var,
};

use super::resolve::{Resolved, Wire};
use crate::GraphFile;

/// Types of every node's ports; `None` where nothing determines one.
pub(super) struct Typed {
    pub(super) inputs: Vec<Vec<Option<PortType>>>,
    pub(super) outputs: Vec<Vec<Option<PortType>>>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Control,
    Audio,
    Magnitude,
    Spectrum,
}

/// The known part of a type.
#[derive(Clone, Debug, Default, PartialEq)]
struct Partial {
    kind: Option<Kind>,
    count: Option<usize>,
    rate_hz: Option<u32>,
    layout: Option<FrameLayout>,
    unit: Option<Unit>,
}

/// Variables of one node.
#[derive(Clone, Debug, Default)]
struct Env {
    shapes: HashMap<Var, Partial>,
    units: HashMap<Var, Unit>,
}

/// Fills an empty slot. Returns whether anything changed.
fn fill<T: Copy>(slot: &mut Option<T>, value: Option<T>) -> bool {
    let fills = slot.is_none() && value.is_some();
    *slot = slot.or(value);
    fills
}

impl Env {
    fn shape(&mut self, var: Var) -> &mut Partial {
        self.shapes.entry(var).or_default()
    }

    fn known_shape(&self, var: Var) -> Partial {
        self.shapes.get(&var).cloned().unwrap_or_default()
    }

    /// Type of a port, as far as known.
    fn port(&self, shape: &ShapeSpec, unit: &UnitSpec, audio_hz: u32) -> Partial {
        let mut p = match shape {
            ShapeSpec::Like(v) => self.known_shape(*v),
            ShapeSpec::Control(n) => {
                Partial { kind: Some(Kind::Control), count: Some(*n), ..Partial::default() }
            }
            ShapeSpec::Audio(rate) => {
                let rate_hz = match rate {
                    RateSpec::Graph => Some(audio_hz),
                    RateSpec::Hz(hz) => Some(*hz),
                    // If frames share the variable, their layout gives the rate.
                    RateSpec::Of(v) => {
                        let shape = self.known_shape(*v);
                        shape.layout.map(|l| l.rate_hz).or(shape.rate_hz)
                    }
                };
                Partial { kind: Some(Kind::Audio), rate_hz, ..Partial::default() }
            }
            ShapeSpec::Magnitude(l) | ShapeSpec::Spectrum(l) => {
                let magnitude = matches!(shape, ShapeSpec::Magnitude(_));
                let layout = match l {
                    LayoutSpec::Is(l) => Some(*l),
                    LayoutSpec::Of(v) => self.known_shape(*v).layout,
                };
                let kind = Some(if magnitude { Kind::Magnitude } else { Kind::Spectrum });
                Partial { kind, rate_hz: layout.map(|l| l.rate_hz), layout, ..Partial::default() }
            }
        };
        p.unit = match unit {
            UnitSpec::Is(u) => Some(u.clone()),
            UnitSpec::Of { var, .. } => self.units.get(var).cloned(),
        };
        p
    }

    /// Binds this port's open variables to `found`. Returns whether anything changed.
    fn bind(&mut self, shape: &ShapeSpec, unit: &UnitSpec, found: &Partial) -> bool {
        let mut changed = match shape {
            ShapeSpec::Like(v) => {
                let p = self.shape(*v);
                // Only for the same kind, because a rate differs in meaning between audio and frames.
                p.kind.is_none_or(|k| found.kind == Some(k))
                    && fill(&mut p.kind, found.kind)
                        | fill(&mut p.count, found.count)
                        | fill(&mut p.rate_hz, found.rate_hz)
                        | fill(&mut p.layout, found.layout)
            }
            ShapeSpec::Audio(RateSpec::Of(v)) if found.kind == Some(Kind::Audio) => {
                fill(&mut self.shape(*v).rate_hz, found.rate_hz)
            }
            ShapeSpec::Magnitude(LayoutSpec::Of(v)) if found.kind == Some(Kind::Magnitude) => {
                fill(&mut self.shape(*v).layout, found.layout)
            }
            ShapeSpec::Spectrum(LayoutSpec::Of(v)) if found.kind == Some(Kind::Spectrum) => {
                fill(&mut self.shape(*v).layout, found.layout)
            }
            _ => false,
        };
        if let UnitSpec::Of { var, among } = unit
            && let Some(u) = &found.unit
            && (among.is_empty() || among.contains(u))
            && !self.units.contains_key(var)
        {
            self.units.insert(*var, u.clone());
            changed = true;
        }
        changed
    }
}

impl Partial {
    fn settled(&self, limited: bool) -> Option<PortType> {
        let shape = match self.kind? {
            Kind::Control => Shape::Control { count: self.count? },
            Kind::Audio => Shape::Audio { rate_hz: self.rate_hz? },
            Kind::Magnitude => Shape::Magnitude(self.layout?),
            Kind::Spectrum => Shape::Spectrum(self.layout?),
        };
        Some(PortType { shape, unit: self.unit.clone()?, limited })
    }

    /// Whether a signal of this type may enter a port of type `to`; open parts fit.
    fn fits(&self, to: &Self) -> bool {
        fn same<T: PartialEq>(a: &Option<T>, b: &Option<T>) -> bool {
            a.is_none() || b.is_none() || a == b
        }
        same(&self.kind, &to.kind)
            && same(&self.count, &to.count)
            && same(&self.rate_hz, &to.rate_hz)
            && same(&self.layout, &to.layout)
            && same(&self.unit, &to.unit)
    }

    fn describe(&self) -> String {
        let unit = self.unit.as_ref().map(|u| format!(" [{u}]")).unwrap_or_default();
        let shape = match self.kind {
            None => "any kind".to_owned(),
            Some(Kind::Control) => self.count.map_or("Control".into(), |n| format!("Control x{n}")),
            Some(Kind::Audio) => self.rate_hz.map_or("Audio".into(), |hz| format!("Audio at {hz} Hz")),
            Some(Kind::Magnitude) => self.layout.map_or("Magnitude".into(), |l| format!("Magnitude of {l}")),
            Some(Kind::Spectrum) => self.layout.map_or("Spectrum".into(), |l| format!("Spectrum of {l}")),
        };
        shape + &unit
    }
}

pub(super) fn settle(
    graph: &GraphFile,
    resolved: &Resolved,
    registry: &Registry,
) -> Result<Typed, Vec<Diagnostic>> {
    let hz = graph.audio_hz;
    let envs = bind_all(resolved, hz);
    let errors: Vec<Diagnostic> =
        resolved.wires.iter().filter_map(|w| check_wire(graph, resolved, &envs, *w, registry)).collect();
    if !errors.is_empty() {
        return Err(errors);
    }
    let settled = |i: usize, shape: &ShapeSpec, unit: &UnitSpec, limited: bool| {
        envs[i].port(shape, unit, hz).settled(limited)
    };
    let per_node = |i: usize, ports: &Ports| {
        let ins = ports.inputs.iter().map(|p| settled(i, &p.shape, &p.unit, p.limited)).collect();
        let outs = ports.outputs.iter().map(|p| settled(i, &p.shape, &p.unit, p.limited)).collect();
        (ins, outs)
    };
    let (inputs, outputs) = resolved.nodes.iter().enumerate().map(|(i, n)| per_node(i, &n.ports)).unzip();
    Ok(Typed { inputs, outputs })
}

fn bind_all(resolved: &Resolved, audio_hz: u32) -> Vec<Env> {
    let n = resolved.nodes.len();
    let (mut leaving, mut entering) = (vec![Vec::new(); n], vec![Vec::new(); n]);
    for (w, wire) in resolved.wires.iter().enumerate() {
        leaving[wire.from.0].push(w);
        entering[wire.to.0].push(w);
    }
    let ends = |w: usize| {
        let Wire { from, to } = resolved.wires[w];
        let (source, reader) = (&resolved.nodes[from.0].ports, &resolved.nodes[to.0].ports);
        (&source.outputs[from.1], &reader.inputs[to.1], from.0, to.0)
    };
    let mut envs = vec![Env::default(); n];
    let forward = |envs: &mut Vec<Env>, mut queue: VecDeque<usize>| {
        while let Some(w) = queue.pop_front() {
            let (output, input, from, to) = ends(w);
            let found = envs[from].port(&output.shape, &output.unit, audio_hz);
            if envs[to].bind(&input.shape, &input.unit, &found) {
                queue.extend(&leaving[to]);
            }
        }
    };
    forward(&mut envs, (0..resolved.wires.len()).collect());
    let mut backward: VecDeque<usize> = (0..resolved.wires.len()).rev().collect();
    while let Some(w) = backward.pop_front() {
        let (output, input, from, to) = ends(w);
        let wanted = envs[to].port(&input.shape, &input.unit, audio_hz);
        if envs[from].bind(&output.shape, &output.unit, &wanted) {
            backward.extend(&entering[from]);
            forward(&mut envs, leaving[from].iter().copied().collect());
        }
    }
    envs
}

fn check_wire(
    graph: &GraphFile,
    resolved: &Resolved,
    envs: &[Env],
    wire: Wire,
    registry: &Registry,
) -> Option<Diagnostic> {
    let Wire { from, to } = wire;
    let output = &resolved.nodes[from.0].ports.outputs[from.1];
    let input = &resolved.nodes[to.0].ports.inputs[to.1];
    let found = envs[from.0].port(&output.shape, &output.unit, graph.audio_hz);
    let mut wanted = envs[to.0].port(&input.shape, &input.unit, graph.audio_hz);
    let unit_fits = match (&input.unit, &found.unit) {
        (UnitSpec::Of { among, .. }, Some(u)) => among.is_empty() || among.contains(u),
        _ => true,
    };
    let names = (
        format!("{}.{}", graph.nodes[from.0].id, output.name),
        format!("{}.{}", graph.nodes[to.0].id, input.name),
    );
    let index = resolved.nodes[to.0].input_wires[to.1]?;
    let place = &graph.wires.get(index)?.to.place;
    let error = |message: String| Diagnostic::new(message).at_place(place).label("does not fit");
    if !found.fits(&wanted) || !unit_fits {
        let mut takes = wanted.describe();
        if let UnitSpec::Of { among, .. } = &input.unit
            && !among.is_empty()
            && wanted.unit.is_none()
        {
            takes.push_str(&format!(" [{}]", input.unit));
            wanted.unit = among.first().cloned();
        }
        let d = error(format!("`{}` carries {}, but `{}` takes {takes}", names.0, found.describe(), names.1));
        return Some(match bridges(&found, &wanted, graph.audio_hz, registry).as_slice() {
            [] if found.kind == wanted.kind && found.unit != wanted.unit && wanted.unit.is_some() => {
                let unit = wanted.unit.as_ref().map(Unit::symbol).unwrap_or_default();
                let use_for = "if a constant factor converts one into the other";
                d.help(format!("a `gain` with `unit: \"{unit}\"`, {use_for}"))
            }
            [] => d,
            kinds => d.help(format!("nodes that fit between: {}", kinds.join(", "))),
        });
    }
    let message =
        || format!("`{}` takes only the output of a limiter, and `{}` is not one", names.1, names.0);
    let help = "put a `limiter` last before the device; it cannot be left out";
    (input.limited && !output.limited).then(|| error(message()).help(help))
}

/// Checks `every` against the signals: audio must run every tick, and a reader must run whenever a
/// frame comes.
pub(super) fn check_every(
    graph: &GraphFile,
    resolved: &Resolved,
    typed: &Typed,
) -> Result<(), Vec<Diagnostic>> {
    let mut errors = Vec::new();
    for (i, decl) in graph.nodes.iter().enumerate().filter(|(_, n)| n.every > 1) {
        let mut ports = typed.inputs[i].iter().chain(&typed.outputs[i]).flatten();
        if ports.any(|p| matches!(p.shape, Shape::Audio { .. })) {
            errors.push(
                Diagnostic::new(format!("`{}` carries audio and must run every tick", decl.id))
                    .at_place(&decl.place)
                    .help("leave `every` out"),
            );
        }
    }
    for (wire, w) in graph.wires.iter().zip(&resolved.wires) {
        let frames = typed.outputs[w.from.0][w.from.1]
            .as_ref()
            .is_some_and(|p| matches!(p.shape, Shape::Magnitude(_) | Shape::Spectrum(_)));
        let (from, to) = (&graph.nodes[w.from.0], &graph.nodes[w.to.0]);
        if frames && !from.every.is_multiple_of(to.every) {
            let place = &wire.to.place;
            let message = format!(
                "`{}` runs every {} ticks and would miss frames of `{}`, which comes every {}",
                to.id, to.every, from.id, from.every
            );
            let help = format!("`every` of `{}` must divide that of `{}`; or leave it out", to.id, from.id);
            errors.push(Diagnostic::new(message).at_place(place).help(help));
        }
    }
    if errors.is_empty() { Ok(()) } else { Err(errors) }
}

/// Kinds that would connect the wire: one input takes `found`, and one output then fits `wanted`.
fn bridges(found: &Partial, wanted: &Partial, audio_hz: u32, registry: &Registry) -> Vec<String> {
    let fits = |kind: &NodeKind| {
        let d = kind.descriptor();
        d.inputs.iter().any(|input| {
            let mut env = Env::default();
            env.bind(&input.shape, &input.unit, found);
            let takes = env.port(&input.shape, &input.unit, audio_hz);
            let unit_ok = match &input.unit {
                UnitSpec::Is(u) => found.unit.as_ref() == Some(u),
                UnitSpec::Of { among, .. } => {
                    among.is_empty() || found.unit.as_ref().is_some_and(|u| among.contains(u))
                }
            };
            unit_ok
                && found.fits(&takes)
                && takes.kind == found.kind
                && d.outputs.iter().any(|o| {
                    let gives = env.port(&o.shape, &o.unit, audio_hz);
                    gives.kind == wanted.kind && gives.unit == wanted.unit && gives.fits(wanted)
                })
        })
    };
    // A gate's answer has a unit that fits many ports and means nothing here.
    let sensible = |d: &Descriptor| d.gate.is_none() && !d.outputs.is_empty();
    registry
        .iter()
        .filter(|k| sensible(k.descriptor()) && fits(k.as_ref()))
        .map(|k| format!("`{}`", k.descriptor().kind))
        .collect()
}
