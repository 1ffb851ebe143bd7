//! A node in an engine whose inputs follow a script.

use std::sync::Arc;

use asperity_engine::{Engine, Options};
use asperity_graph::{GraphFile, compile};
use asperity_node::{
    Buffer, Descriptor, Node, NodeKind, Output, Prepared, Processor, Resume, Setup, ShapeSpec, Source,
    Status, Tick, Unit,
};

/// Outputs of a script in a tick, a list for each of its outputs.
type Play = Arc<dyn Fn(u64) -> Vec<Vec<f64>> + Send + Sync>;

/// Controls that are functions of the tick.
pub(super) struct Script {
    descriptor: Descriptor,
    play: Play,
}

impl Script {
    /// Outputs by name, number of values and unit.
    pub(super) fn new(
        outputs: &[(&'static str, usize, Unit)],
        play: impl Fn(u64) -> Vec<Vec<f64>> + Send + Sync + 'static,
    ) -> Self {
        let descriptor = Descriptor::new("script", "Controls.").resumes(Resume::Never);
        let descriptor = outputs.iter().fold(descriptor, |d, (name, count, unit)| {
            d.output(Output::new(*name, ShapeSpec::Control(*count), unit.clone()).doc("values"))
        });
        Self { descriptor, play: Arc::new(play) }
    }

    fn kind(&self) -> Arc<NodeKind> {
        let play = self.play.clone();
        let prepare = move |_: &Setup<'_>| Ok(Prepared::new(Playing(play.clone())));
        Arc::new(NodeKind::new(self.descriptor.clone(), prepare))
    }
}

struct Playing(Play);

impl Processor for Playing {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        for (output, values) in (self.0)(tick.index).iter().enumerate() {
            tick.outputs.control(output).copy_from_slice(values);
        }
        Status::Continue
    }
    fn reset(&mut self) {}
}

/// A script, the node `it` with an input of each of the script's names, and the nodes after it.
pub(super) struct Bench {
    script: Arc<Script>,
    graph: GraphFile,
}

impl Bench {
    pub(super) fn new(
        tick_hz: u32,
        audio_hz: u32,
        kind: &str,
        settings: &[(&str, &str)],
        script: Script,
    ) -> Self {
        Self::beside("bench.ron", tick_hz, audio_hz, kind, settings, script)
    }

    /// The same, as if the graph were a file in a folder.
    pub(super) fn beside(
        file: &str,
        tick_hz: u32,
        audio_hz: u32,
        kind: &str,
        settings: &[(&str, &str)],
        script: Script,
    ) -> Self {
        let params: Vec<String> = settings.iter().map(|(name, value)| format!("{name}: {value}")).collect();
        let text = format!(
            "Graph(version: 1, tick_hz: {tick_hz}, audio_hz: {audio_hz}, nodes: {{\"it\": (kind: \"{kind}\", \
             params: ({}))}}, wires: [])",
            params.join(", ")
        );
        let mut graph = GraphFile::parse(&Source::new(file, text)).unwrap();
        graph.add_node("script", "script", &[], "test").unwrap();
        for output in &script.descriptor.outputs {
            graph.add_wire(&format!("script.{}", output.name), &format!("it.{}", output.name), "test");
        }
        Self { script: Arc::new(script), graph }
    }

    /// Leaves out wires to an input that the node does not have.
    pub(super) fn drop_wires(&mut self, to: &str) {
        self.graph.wires.retain(|w| w.to.port.as_deref() != Some(to));
    }

    /// Puts a `level` behind it.
    pub(super) fn through_level(mut self) -> Self {
        self.graph.add_node("level", "level", &[], "test").unwrap();
        self.graph.add_wire("it", "level.in", "test");
        self
    }

    /// Puts a `level` behind it that follows two outputs of the script.
    pub(super) fn behind_level(mut self) -> Self {
        self.drop_wires("level");
        self = self.through_level();
        self.graph.add_wire("script.level", "level.level", "test");
        self.graph.add_wire("script.slot", "level.slot", "test");
        self
    }

    pub(super) fn every(mut self, every: u32) -> Self {
        self.graph.nodes.iter_mut().for_each(|n| n.every = every);
        self
    }

    /// The graph with a probe behind `end`.
    ///
    /// # Errors
    /// The compiler's messages about the graph.
    pub(super) fn engine(&self, end: &str, sleep: bool) -> Result<Engine, String> {
        let mut graph = self.graph.clone();
        graph.add_node("probe", "probe", &[], "test").unwrap();
        graph.add_wire(end, "probe", "test");
        let mut registry = crate::registry();
        registry.add(self.script.kind());
        let compiled = compile(&graph, &registry, asperity_graph::Options::default())
            .map_err(|e| e.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))?;
        Ok(Engine::new(compiled, Options { sleep, ..Options::default() }))
    }

    /// Output of `end` over some ticks, which must be the same to the bit awake and asleep. Second, how often
    /// `it` was called when it might sleep.
    pub(super) fn run(&self, end: &str, ticks: u64) -> (Run, u64) {
        let [asleep, awake] = [true, false].map(|sleep| {
            let mut engine = self.engine(end, sleep).unwrap_or_else(|e| panic!("{e}"));
            let run = run(&mut engine, end, ticks);
            let it = engine.schedule().index_of("it").unwrap();
            let report = engine.report(it).unwrap();
            assert_eq!(report.faults, 0, "{:?}", report.last_fault);
            (run, report.calls)
        });
        let bits = |run: &Run| {
            let audio: Vec<u32> = run.audio.iter().map(|x| x.to_bits()).collect();
            (audio, run.control.iter().flatten().map(|x| x.to_bits()).collect::<Vec<_>>())
        };
        assert!(bits(&asleep.0) == bits(&awake.0), "asleep it is not the same");
        (asleep.0, asleep.1)
    }
}

/// Recorded output: samples, or the values of every tick.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Run {
    pub(super) audio: Vec<f32>,
    pub(super) control: Vec<Vec<f64>>,
}

/// Runs some ticks of a graph.
pub(super) fn run(engine: &mut Engine, end: &str, ticks: u64) -> Run {
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

/// The first samples of ticks, and how many each has.
pub(super) fn spans(ticks: u64, rate_hz: u32, tick_hz: u32) -> impl Iterator<Item = (u64, u64, usize)> {
    (0..ticks).map(move |tick| {
        let at = |tick: u64| tick * u64::from(rate_hz) / u64::from(tick_hz);
        (tick, at(tick), (at(tick + 1) - at(tick)) as usize)
    })
}

pub(super) fn largest_step(x: &[f32]) -> f32 {
    x.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max)
}

/// Error message of a graph of one node.
pub(super) fn refused<N: Node>(settings: &[(&str, &str)]) -> String {
    let kind = N::descriptor().kind;
    let inputs: Vec<_> = N::descriptor().inputs;
    let outputs: Vec<(&'static str, usize, Unit)> = inputs
        .iter()
        .map(|i| {
            let ShapeSpec::Control(count) = i.shape else { panic!("{}", i.name) };
            let asperity_node::UnitSpec::Is(unit) = &i.unit else { panic!("{}", i.name) };
            (&*Box::leak(i.name.to_string().into_boxed_str()), count, unit.clone())
        })
        .collect();
    let script = Script::new(&outputs, |_| Vec::new());
    Bench::beside("folder/g.ron", 500, 48_000, &kind, settings, script)
        .engine("it", true)
        .expect_err("an error")
}
