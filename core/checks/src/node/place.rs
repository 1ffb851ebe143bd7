//! A place for a node: rates and types, settled by the compiler.

use std::fmt;
use std::sync::{Arc, OnceLock};

use asperity_engine::Engine;
use asperity_graph::{BufferEntry, Compiled, compile};
use asperity_node::{
    Config, Descriptor, Diagnostic, FrameClock, FrameLayout, FrameRate, Input, LayoutSpec, NodeKind, Output,
    Params, PortType, Ports, RateSpec, Registry, Setup, Shape, ShapeSpec, Status, Unit, UnitSpec, Wiring,
    random,
};

use crate::case::Stop;
use crate::node::signal::Signal;
use crate::node::stand::Stand;
use crate::played::Played;
use crate::rig::CaseGraph;
use crate::subject::Subject;
use crate::wrap::stateless;

/// Rates and types around a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Conditions {
    pub(crate) tick_hz: u32,
    pub(crate) audio_hz: u32,
    pub(crate) every: u32,
    /// Rate of an audio input that takes any rate.
    pub(crate) source_hz: u32,
    /// Rate, length and bins of a frame input that takes any layout. There are 500 frames a second, or one a
    /// tick.
    pub(crate) frames: (u32, u32, u32),
    /// Shape of an input that takes any shape.
    pub(crate) like: ShapeSpec,
    /// Inputs that stay unconnected, one bit each.
    pub(crate) without: u64,
}

impl Default for Conditions {
    fn default() -> Self {
        Self {
            tick_hz: 500,
            audio_hz: 48_000,
            every: 1,
            source_hz: 8000,
            frames: (2500, 250, 101),
            like: ShapeSpec::Audio(RateSpec::Graph),
            without: 0,
        }
    }
}

impl fmt::Display for Conditions {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (rate, length, bins) = self.frames;
        write!(f, "{} Hz ticks, {} Hz audio", self.tick_hz, self.audio_hz)?;
        if self.every > 1 {
            write!(f, ", every {}", self.every)?;
        }
        let other = Self::default();
        if self.source_hz != other.source_hz {
            write!(f, ", {} Hz in", self.source_hz)?;
        }
        if self.frames != other.frames {
            write!(f, ", {bins} bins of {length} at {rate} Hz")?;
        }
        if let ShapeSpec::Control(n) = self.like {
            write!(f, ", Control x{n} in")?;
        }
        Ok(())
    }
}

impl Conditions {
    fn layout(&self) -> FrameLayout {
        let (rate_hz, length, bins) = self.frames;
        let wanted = FrameRate::new(500, 1).expect("500 is not 0");
        let frame_rate = FrameClock::new(self.tick_hz, self.every, wanted).rate();
        FrameLayout { rate_hz, length, bins, frame_rate }
    }

    /// The shape of a source for an input.
    fn shape(&self, input: &Input, ports: &Ports) -> ShapeSpec {
        let layout = |spec| match spec {
            LayoutSpec::Is(_) => spec,
            LayoutSpec::Of(_) => LayoutSpec::Is(self.layout()),
        };
        let shape = if matches!(input.shape, ShapeSpec::Like(_)) { self.like } else { input.shape };
        match shape {
            ShapeSpec::Audio(RateSpec::Of(var)) => {
                // A rate that frames share is theirs.
                let framed = ports.inputs.iter().any(|i| match i.shape {
                    ShapeSpec::Magnitude(LayoutSpec::Of(v)) | ShapeSpec::Spectrum(LayoutSpec::Of(v)) => {
                        v == var
                    }
                    _ => false,
                });
                ShapeSpec::Audio(RateSpec::Hz(if framed { self.frames.0 } else { self.source_hz }))
            }
            ShapeSpec::Magnitude(l) => ShapeSpec::Magnitude(layout(l)),
            ShapeSpec::Spectrum(l) => ShapeSpec::Spectrum(layout(l)),
            shape => shape,
        }
    }
}

/// The name of the node under test.
const IT: &str = "it";
/// The seed of every graph here.
const SEED: u64 = 5;

/// A kind in its place, from which any number of instances can be prepared.
#[derive(Clone)]
pub(crate) struct Place {
    pub(crate) kind: Arc<NodeKind>,
    pub(crate) conditions: Conditions,
    params: Params,
    pub(crate) inputs: Vec<Wiring>,
    pub(crate) outputs: Vec<Wiring>,
    pub(crate) output_names: Vec<String>,
    /// Number of values that each unconnected input reads, and the value.
    pub(crate) constants: Vec<(usize, f64)>,
    pub(crate) gate: Option<usize>,
}

/// A sink for any output. No graph file can name it.
const PROBE: &str = "a probe";

fn text(errors: &[Diagnostic]) -> String {
    errors.first().map(|e| e.message.clone()).unwrap_or_default()
}

/// Compiles a graph of the node, with a signal at every input and a probe at the first `probes` outputs.
fn compiled(
    subject: &Subject<'_>,
    conditions: &Conditions,
    signal: Signal,
    probes: usize,
) -> Result<Compiled, String> {
    subject.alive();
    let plain = |e: Stop| match e {
        Stop::Failed(why) | Stop::NotApplicable(why) => why,
    };
    let kind = subject.its_kind().map_err(plain)?;
    // The ports to which its parameters led.
    let settled = Arc::new(OnceLock::new());
    let (asked, told) = (kind.clone(), settled.clone());
    let watched = NodeKind::clone(kind).with_ports(move |config, _| {
        let ports = asked.ports(config)?;
        Ok(told.get_or_init(|| ports).clone())
    });
    let looks = Input::new("in", ShapeSpec::Like('s'), Unit::NONE).unit_of('u');
    let probe = Descriptor::new(PROBE, "Looks on.").input(looks).sink();
    let mut registry = Registry::new();
    registry.add(stateless(probe, |_| |_| Status::Continue));
    registry.add(Arc::new(watched));
    let settings: Vec<(&str, &str)> =
        subject.settings.iter().map(|(n, v)| (n.as_str(), v.as_str())).collect();
    let CaseGraph { mut graph, .. } = CaseGraph::new(conditions.tick_hz, conditions.audio_hz);
    graph.seed = SEED;
    graph.add_node(IT, &kind.descriptor().kind, &settings, "--set").map_err(|e| e.message)?;
    // The first attempt fails, for nothing is wired, but it settles the ports.
    let first = compile(&graph, &registry, Default::default());
    let Some(ports) = settled.get() else {
        return Err(first.err().map(|e| text(&e)).unwrap_or_default());
    };
    let stays_free = |i: usize| {
        let bit = u32::try_from(i).ok().and_then(|i| conditions.without.checked_shr(i));
        bit.is_some_and(|bit| bit & 1 == 1)
    };
    for (i, input) in ports.inputs.iter().enumerate().filter(|(i, _)| !stays_free(*i)) {
        let (name, seed) = (format!("a source {i}"), SEED + 100 + i as u64);
        let unit = match &input.unit {
            UnitSpec::Is(unit) => unit.clone(),
            UnitSpec::Of { among, .. } => among.first().cloned().unwrap_or(Unit::NEWTON),
        };
        let mut output = Output::new("out", conditions.shape(input, ports), unit);
        output.limited = input.limited;
        registry.add(Played::signal(name.clone(), output, signal, seed));
        graph.add_node(&name, &name, &[], "test").map_err(|e| e.message)?;
        graph.add_wire(&name, &format!("{IT}.{}", input.name), "test");
    }
    for output in ports.outputs.iter().take(probes) {
        let probe = format!("probe {}", output.name);
        graph.add_node(&probe, PROBE, &[], "test").map_err(|e| e.message)?;
        graph.add_wire(&format!("{IT}.{}", output.name), &probe, "test");
    }
    for node in &mut graph.nodes {
        node.every = conditions.every;
    }
    compile(&graph, &registry, Default::default()).map_err(|e| text(&e))
}

/// Compiles with a probe at every output. Some outputs exist with some settings only: where that is refused,
/// a probe at the first output has to do.
fn compiled_somehow(
    subject: &Subject<'_>,
    conditions: &Conditions,
    signal: Signal,
) -> Result<Compiled, String> {
    compiled(subject, conditions, signal, usize::MAX)
        .or_else(|e| compiled(subject, conditions, signal, 1).map_err(|_| e))
}

impl Place {
    /// Settles the types of a node's ports.
    pub(crate) fn settle(subject: &Subject<'_>, conditions: &Conditions) -> Result<Self, String> {
        let kind = subject.its_kind().map_err(|_| "no kind was given")?.clone();
        let schedule = compiled_somehow(subject, conditions, Signal::Random)?.schedule;
        let at = schedule.index_of(IT).ok_or("the node was dropped from its graph")?;
        let node = &schedule.nodes[at];
        let constant = |buffer: usize| match schedule.buffers.get(buffer) {
            Some(BufferEntry::Constant { count, value }) => (*count, *value),
            // A host has not fed it yet.
            Some(BufferEntry::HostFed(PortType { shape: Shape::Control { count }, .. })) => (*count, 0.0),
            _ => (0, 0.0),
        };
        let inputs = node.inputs.iter();
        let outputs = node.outputs.iter();
        Ok(Self {
            kind,
            conditions: *conditions,
            params: node.params.clone(),
            constants: inputs.clone().map(|i| constant(i.reads.buffer as usize)).collect(),
            inputs: inputs.map(|i| Wiring { port: i.port.clone(), connected: i.from.is_some() }).collect(),
            output_names: outputs.clone().map(|o| o.name.clone()).collect(),
            outputs: outputs
                .map(|o| Wiring { port: Some(o.port.clone()), connected: o.readers > 0 })
                .collect(),
            gate: node.gate,
        })
    }

    /// A new instance with a signal at every input.
    pub(crate) fn stand<'a>(
        &'a self,
        subject: &'a Subject<'a>,
        signal: Signal,
        closes_cycle: bool,
    ) -> Result<Stand<'a>, String> {
        subject.alive();
        let Conditions { tick_hz, audio_hz, every, .. } = self.conditions;
        let seed = random::seed_of(SEED, IT);
        let config = Config { id: IT, params: &self.params, tick_hz, every, audio_hz, seed };
        let setup = Setup { config, inputs: &self.inputs, outputs: &self.outputs, closes_cycle };
        let node = self.kind.prepare(&setup).map_err(|e| e.message)?;
        Ok(Stand::new(self, subject, node, signal, SEED + 100, closes_cycle))
    }

    /// The same graph in the engine, and the node's index in it.
    pub(crate) fn engine(&self, subject: &Subject<'_>, signal: Signal) -> Result<(Engine, usize), String> {
        let engine = Engine::new(compiled_somehow(subject, &self.conditions, signal)?, Default::default());
        let at = engine.schedule().index_of(IT).ok_or("the node was dropped from its graph")?;
        Ok((engine, at))
    }
}

impl<'a> Subject<'a> {
    /// The place in which most cases put the one kind: the first of a few that it takes.
    pub(crate) fn main(&self) -> Result<&Place, String> {
        self.main.get_or_init(|| self.find_main()).as_ref().map_err(Clone::clone)
    }

    fn find_main(&self) -> Result<Place, String> {
        let first = Conditions::default();
        let control = Conditions { like: ShapeSpec::Control(2), ..first };
        let whole = Conditions { frames: (2500, 250, 126), ..first };
        let frames = Conditions { like: ShapeSpec::Magnitude(LayoutSpec::Of('l')), ..first };
        // The error of the first place helps most.
        Place::settle(self, &first)
            .or_else(|e| [control, whole, frames].iter().find_map(|c| Place::settle(self, c).ok()).ok_or(e))
    }

    /// A new instance in the main place. A case does not apply where there is none.
    pub(crate) fn stand(&'a self, signal: Signal) -> Result<Stand<'a>, Stop> {
        Ok(super::main(self)?.stand(self, signal, false)?)
    }

    /// The name of an output of the one kind.
    pub(crate) fn output_name(&self, output: usize) -> String {
        let names = self.main().map(|p| p.output_names.as_slice()).unwrap_or_default();
        names.get(output).cloned().unwrap_or_default()
    }
}
