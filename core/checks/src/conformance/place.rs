//! A place for a node: rates and types, settled by the real compiler.

use std::fmt;
use std::sync::Arc;

use asperity_engine::Engine;
use asperity_graph::{BufferEntry, Compiled, GraphFile, compile};
use asperity_node::{
    Config, Diagnostic, FrameClock, FrameLayout, FrameRate, Input, LayoutSpec, NodeKind, Params, PortType,
    Ports, RateSpec, Registry, Setup, Shape, ShapeSpec, Wiring, random,
};

use crate::conformance::fixtures::{Probe, Source, Watched, unit};
use crate::conformance::signal::Signal;
use crate::conformance::stand::Stand;
use crate::conformance::subject::Subject;

/// Rates and types that a node is put among.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Conditions {
    pub(crate) tick_hz: u32,
    pub(crate) audio_hz: u32,
    pub(crate) every: u32,
    /// Rate of an audio input that takes any.
    pub(crate) source_hz: u32,
    /// Rate, length and bins of a frame input that takes any; 500 frames a second, or as many as there are ticks.
    pub(crate) frames: (u32, u32, u32),
    /// What an input of any kind gets.
    pub(crate) like: ShapeSpec,
    /// Inputs that stay unconnected, a bit each.
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

/// A kind in its place: all that is needed to prepare any number of instances.
pub(crate) struct Place {
    kind: Arc<dyn NodeKind>,
    pub(crate) conditions: Conditions,
    params: Params,
    pub(crate) inputs: Vec<Wiring>,
    pub(crate) outputs: Vec<Wiring>,
    pub(crate) output_names: Vec<String>,
    /// What each unconnected input reads: how many values, and which.
    pub(crate) constants: Vec<(usize, f64)>,
    pub(crate) gate: Option<usize>,
}

fn text(errors: &[Diagnostic]) -> String {
    errors.first().map(|e| e.message.clone()).unwrap_or_default()
}

/// A node with a signal at every input and a probe at every output (or the first `probes`), compiled.
fn compiled(
    subject: &Subject<'_>,
    conditions: &Conditions,
    signal: Signal,
    probes: usize,
) -> Result<Compiled, String> {
    subject.alive();
    let watched = Arc::new(Watched::new(subject.kind.clone()));
    let mut registry = Registry::new();
    registry.add(watched.clone());
    registry.add(Arc::new(Probe::new()));
    let mut graph = GraphFile::empty("conformance");
    (graph.tick_hz, graph.audio_hz, graph.seed) = (conditions.tick_hz, conditions.audio_hz, SEED);
    let settings: Vec<(&str, &str)> =
        subject.settings.iter().map(|(n, v)| (n.as_str(), v.as_str())).collect();
    let kind = subject.kind.descriptor().kind.to_string();
    graph.add_node(IT, &kind, &settings, "--set").map_err(|e| e.message)?;
    // The first look fails, for nothing is wired, but tells the ports.
    let first = compile(&graph, &registry, Default::default());
    let Some(ports) = watched.seen() else {
        return Err(first.err().map(|e| text(&e)).unwrap_or_default());
    };
    for (i, input) in ports.inputs.iter().enumerate().filter(|(i, _)| {
        !u32::try_from(*i).is_ok_and(|i| conditions.without.checked_shr(i).is_some_and(|w| w & 1 == 1))
    }) {
        let (name, seed) = (format!("conformance source {i}"), SEED + 100 + i as u64);
        let shape = conditions.shape(input, ports);
        registry.add(Arc::new(Source::new(&name, shape, unit(&input.unit), input.limited, signal, seed)));
        graph.add_node(&name, &name, &[], "test").map_err(|e| e.message)?;
        graph.add_wire(&name, &format!("{IT}.{}", input.name), "test");
    }
    for output in ports.outputs.iter().take(probes) {
        let probe = format!("probe {}", output.name);
        graph.add_node(&probe, Probe::KIND, &[], "test").map_err(|e| e.message)?;
        graph.add_wire(&format!("{IT}.{}", output.name), &probe, "test");
    }
    for node in &mut graph.nodes {
        node.every = conditions.every;
    }
    compile(&graph, &registry, Default::default()).map_err(|e| text(&e))
}

/// With a probe at every output; where that is refused, at the first: some outputs are there with some settings only.
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
    ///
    /// # Errors
    /// Why the kind cannot be there.
    pub(crate) fn settle(subject: &Subject<'_>, conditions: &Conditions) -> Result<Self, String> {
        let schedule = compiled_somehow(subject, conditions, Signal::Random)?.schedule;
        let at = schedule.index_of(IT).ok_or("the node was dropped from its graph")?;
        let node = &schedule.nodes[at];
        let constant = |buffer: usize| match schedule.buffers.get(buffer) {
            Some(BufferEntry::Constant { count, value }) => (*count, *value),
            // What a host has not given yet.
            Some(BufferEntry::Fed(PortType { shape: Shape::Control { count }, .. })) => (*count, 0.0),
            _ => (0, 0.0),
        };
        let inputs = node.inputs.iter();
        let outputs = node.outputs.iter();
        Ok(Self {
            kind: subject.kind.clone(),
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
    ///
    /// # Errors
    /// What `prepare` says.
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
        let processor = self.kind.prepare(&setup).map_err(|e| e.message)?;
        Ok(Stand::new(self, subject, processor, signal, SEED + 100, closes_cycle))
    }

    /// The same graph in the engine, and the node's index in it.
    ///
    /// # Errors
    /// Why it does not compile.
    pub(crate) fn engine(&self, subject: &Subject<'_>, signal: Signal) -> Result<(Engine, usize), String> {
        let engine = Engine::new(compiled_somehow(subject, &self.conditions, signal)?, Default::default());
        let at = engine.schedule().index_of(IT).ok_or("the node was dropped from its graph")?;
        Ok((engine, at))
    }
}
