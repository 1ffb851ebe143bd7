//! Benches for tests: a node in an engine whose inputs follow a script, and a node by itself.

use std::path::PathBuf;
use std::sync::Arc;

use asperity_engine::{Engine, Options};
use asperity_graph::{GraphFile, compile};
use asperity_node::{
    Buffer, InputRef, NodeKind, Outputs, ParamValue, PortType, Shape, Source, Wiring, time::samples,
};

use crate::prelude::*;

/// Outputs of a script in a tick, a list for each of its outputs.
type Play = Arc<dyn Fn(u64) -> Vec<Vec<f64>> + Send + Sync>;

struct Playing(Play);

impl Processor for Playing {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        for (output, values) in (self.0)(tick.index).iter().enumerate() {
            tick.outputs.control(output).copy_from_slice(values);
        }
        Status::Continue
    }
}

/// A script, the node `it`, and a `level` behind it.
#[derive(Clone)]
pub(crate) struct Bench {
    kind: String,
    names: String,
    play: Play,
    file: String,
    tick_hz: u32,
    audio_hz: u32,
    settings: Vec<String>,
    every: u32,
    /// Inputs of the `level` behind it that follow the script; none where there is no `level`.
    level: Option<&'static [&'static str]>,
}

impl Bench {
    /// A node whose inputs of these names follow a function of the tick. A name that is no input of the node
    /// is one of a `level` behind it. The rates are 500 Hz and 48 kHz.
    pub(crate) fn new(
        kind: &str,
        names: &str,
        play: impl Fn(u64) -> Vec<Vec<f64>> + Send + Sync + 'static,
    ) -> Self {
        let (kind, names, play, file) =
            (kind.to_owned(), names.to_owned(), Arc::new(play), "bench.ron".into());
        let (tick_hz, audio_hz, settings, every, level) = (500, 48_000, Vec::new(), 1, None);
        Self { kind, names, play, file, tick_hz, audio_hz, settings, every, level }
    }

    pub(crate) fn rates(self, (tick_hz, audio_hz): (u32, u32)) -> Self {
        Self { tick_hz, audio_hz, ..self }
    }

    /// Sets a parameter, as a graph writes it.
    pub(crate) fn set(mut self, name: &str, value: &str) -> Self {
        self.settings.push(format!("{name}: {value}"));
        self
    }

    /// Sets a list of texts.
    pub(crate) fn list<T: AsRef<str>>(self, name: &str, texts: &[T]) -> Self {
        let texts: Vec<&str> = texts.iter().map(T::as_ref).collect();
        self.set(name, &format!("{texts:?}"))
    }

    /// The same as if the graph were this file.
    pub(crate) fn file(self, file: &str) -> Self {
        Self { file: file.to_owned(), ..self }
    }

    pub(crate) fn every(self, every: u32) -> Self {
        Self { every, ..self }
    }

    /// Puts a `level` behind it.
    pub(crate) fn through_level(self) -> Self {
        Self { level: Some(&[]), ..self }
    }

    /// Puts a `level` behind it that follows two outputs of the script.
    pub(crate) fn behind_level(self) -> Self {
        Self { level: Some(&["level", "slot"]), ..self }
    }

    /// The engine of the graph with a probe behind `end`.
    ///
    /// # Errors
    /// The compiler's messages about the graph.
    pub(crate) fn engine(&self, end: &str, sleep: bool) -> Result<Engine, String> {
        let Self { kind, file, tick_hz, audio_hz, every, .. } = self;
        let text = format!(
            "Graph(version: 1, tick_hz: {tick_hz}, audio_hz: {audio_hz}, nodes: {{\"it\": (kind: \"{kind}\", \
             params: ({}))}}, wires: [])",
            self.settings.join(", ")
        );
        let mut graph = GraphFile::parse(&Source::new(file, text)).unwrap();
        let mut registry = crate::registry();
        graph.add_node("script", "script", &[], "test").unwrap();
        let mut script = Descriptor::new("script", "Controls.").resumes(Resume::Never);
        for name in self.names.split_whitespace() {
            let input = |kind: &str| {
                let kind = registry.get(kind).unwrap();
                kind.descriptor().inputs.iter().find(|input| input.name == name).cloned()
            };
            let own = input(kind);
            if own.is_some() {
                graph.add_wire(&format!("script.{name}"), &format!("it.{name}"), "test");
            }
            let input = own.or_else(|| input("level")).unwrap();
            let UnitSpec::Is(unit) = input.unit else { panic!("{name}") };
            script = script.output(Output::new(name.to_owned(), input.shape, unit).doc("values"));
        }
        graph.nodes.iter_mut().for_each(|n| n.every = *every);
        if let Some(inputs) = self.level {
            graph.add_node("level", "level", &[], "test").unwrap();
            graph.add_wire("it", "level.in", "test");
            inputs.iter().for_each(|i| graph.add_wire(&format!("script.{i}"), &format!("level.{i}"), "test"));
        }
        graph.add_node("probe", "probe", &[], "test").unwrap();
        graph.add_wire(end, "probe", "test");
        let play = self.play.clone();
        let prepare = move |_: &Setup<'_>| Ok(Prepared::new(Playing(play.clone())));
        registry.add(Arc::new(NodeKind::new(script, prepare)));
        let compiled = compile(&graph, &registry, asperity_graph::Options::default())
            .map_err(|e| e.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))?;
        Ok(Engine::new(compiled, Options { sleep, ..Options::default() }))
    }

    /// Output of `end` over some ticks, which must be the same to the bit awake and asleep. Second, how often
    /// `it` was called when it might sleep.
    pub(crate) fn run(&self, end: &str, ticks: u64) -> (Run, u64) {
        let [asleep, awake] = [true, false].map(|sleep| {
            let mut engine = self.engine(end, sleep).unwrap_or_else(|e| panic!("{e}"));
            let run = run(&mut engine, end, ticks);
            let report = engine.report(it(&engine)).unwrap();
            assert_eq!(report.faults, 0, "{:?}", report.last_fault);
            (run, report.calls)
        });
        let bits = |run: &Run| {
            let audio: Vec<u32> = run.audio.iter().map(|x| x.to_bits()).collect();
            (audio, run.control.iter().flatten().map(|x| x.to_bits()).collect::<Vec<_>>())
        };
        assert!(bits(&asleep.0) == bits(&awake.0), "asleep it is not the same");
        asleep
    }
}

/// The node `it` of an engine.
pub(crate) fn it(engine: &Engine) -> usize {
    engine.schedule().index_of("it").unwrap()
}

/// Facts of the node `it`.
pub(crate) fn facts(engine: &mut Engine) -> Vec<String> {
    let it = it(engine);
    engine.facts(it).iter().map(|f| format!("{} {}", f.name, f.value)).collect()
}

/// Files of the node `it`.
pub(crate) fn files(bench: &Bench) -> Vec<PathBuf> {
    let engine = bench.engine("it", true).unwrap();
    engine.schedule().nodes[it(&engine)].files.clone()
}

/// Recorded output: samples, or the values of every tick.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Run {
    pub(crate) audio: Vec<f32>,
    pub(crate) control: Vec<Vec<f64>>,
}

/// Runs some ticks of a graph.
pub(crate) fn run(engine: &mut Engine, end: &str, ticks: u64) -> Run {
    let node = engine.schedule().index_of(end).unwrap();
    let mut run = Run::default();
    for _ in 0..ticks {
        engine.tick();
        match engine.output(node, 0).unwrap() {
            Buffer::Audio { samples, len, .. } => run.audio.extend_from_slice(&samples[..*len]),
            Buffer::Control { values, .. } => run.control.push(values.to_vec()),
            _ => panic!("frames"),
        }
    }
    run
}

/// Ticks with their first samples, and how many each has.
pub(crate) fn spans(ticks: u64, rate_hz: u32, tick_hz: u32) -> impl Iterator<Item = (u64, u64, usize)> {
    (0..ticks).map(move |tick| {
        let span = samples(tick, rate_hz, tick_hz);
        (tick, span.start, (span.end - span.start) as usize)
    })
}

pub(crate) fn largest_step(x: &[f32]) -> f32 {
    x.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max)
}

/// Error message of a graph of one node.
pub(crate) fn refused(kind: &str, settings: &[(&str, &str)]) -> String {
    let inputs = crate::registry().get(kind).unwrap().descriptor().inputs.clone();
    let names: Vec<&str> = inputs.iter().map(|input| input.name.as_ref()).collect();
    let bench = Bench::new(kind, &names.join(" "), |_| Vec::new()).file("folder/g.ron");
    let bench = settings.iter().fold(bench, |bench, (name, value)| bench.set(name, value));
    bench.engine("it", true).expect_err("an error")
}

/// A node by itself. A test fills its inputs and reads its outputs.
pub(crate) struct Alone {
    pub(crate) prepared: Prepared,
    pub(crate) inputs: Vec<Buffer>,
    pub(crate) outputs: Vec<Buffer>,
    ports: Vec<PortType>,
    tick_hz: u32,
}

/// A port's type without a unit.
pub(crate) fn port(shape: Shape) -> PortType {
    PortType { shape, unit: Unit::AMPERE, limited: false }
}

impl Alone {
    /// A node with these parameters, the others at their defaults. It runs every `every`-th tick.
    pub(crate) fn new(
        kind: &str,
        set: &[(&str, ParamValue)],
        (tick_hz, every, audio_hz): (u32, u32, u32),
        inputs: &[Shape],
        outputs: &[Shape],
    ) -> Result<Self, Diagnostic> {
        let kind = crate::registry().get(kind).unwrap().clone();
        let mut params = Params::new(None);
        for p in &kind.descriptor().params {
            let value = set.iter().find(|(name, _)| *name == p.name).map(|(_, value)| value.clone());
            params.insert(p.name.to_string(), value.or_else(|| p.default.clone()), None);
        }
        // As in a graph of seed 1.
        let seed = random::seed_of(1, "it");
        let config = Config { id: "it", params: &params, tick_hz, every, audio_hz, seed };
        let [inputs, outputs] = [inputs, outputs].map(|all| all.iter().map(|s| port(*s)).collect::<Vec<_>>());
        let wired = |ports: &[PortType]| -> Vec<Wiring> {
            ports.iter().map(|port| Wiring { port: Some(port.clone()), connected: true }).collect()
        };
        let (ins, outs) = (wired(&inputs), wired(&outputs));
        let prepared = kind.prepare(&Setup { config, inputs: &ins, outputs: &outs, closes_cycle: false })?;
        let inputs = inputs.iter().map(|port| Buffer::new(port, tick_hz)).collect();
        Ok(Self { prepared, inputs, outputs: Vec::new(), ports: outputs, tick_hz })
    }

    pub(crate) fn node(&mut self) -> &mut dyn Processor {
        &mut *self.prepared.processor
    }

    /// Fills a control.
    pub(crate) fn give(&mut self, input: usize, values: &[f64], valid: bool) {
        self.inputs[input] = Buffer::Control { values: values.into(), changed: true, valid };
    }

    /// Runs a tick. Second, whether its gate wanted the input.
    pub(crate) fn tick(&mut self, index: u64) -> (Status, bool) {
        self.outputs = self.ports.iter().map(|port| Buffer::new(port, self.tick_hz)).collect();
        for (buffer, port) in self.outputs.iter_mut().zip(&self.ports) {
            if let (Buffer::Audio { len, .. }, Shape::Audio { rate_hz }) = (buffer, port.shape) {
                let span = samples(index, rate_hz, self.tick_hz);
                *len = (span.end - span.start) as usize;
            }
        }
        let count = self.inputs.len();
        let map: Vec<InputRef> =
            (0..count as u32).map(|buffer| InputRef { buffer, connected: true }).collect();
        let inputs = Inputs::new(&self.inputs, &[], count, &map);
        let node = &mut self.prepared.processor;
        let tick_hz = self.tick_hz;
        let wants = node.wants(&mut Tick { index, tick_hz, inputs, outputs: Outputs::new(&mut []) });
        let outputs = Outputs::new(&mut self.outputs);
        (node.run(&mut Tick { index, tick_hz, inputs, outputs }).unwrap(), wants)
    }

    /// Samples of the last tick.
    pub(crate) fn audio(&self) -> &[f32] {
        let Buffer::Audio { samples, len, .. } = &self.outputs[0] else { panic!("audio") };
        &samples[..*len]
    }
}
