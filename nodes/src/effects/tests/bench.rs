//! A node in an engine whose inputs follow a script.

use std::sync::Arc;

use asperity_engine::{Engine, Options};
use asperity_graph::{GraphFile, compile};
use asperity_node::{
    Buffer, Descriptor, NodeKind, Output, Prepared, Processor, Resume, Setup, Source, Status, Tick, UnitSpec,
};

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

/// A script, the node `it`, and the nodes after it.
pub(super) struct Bench {
    script: Arc<NodeKind>,
    graph: GraphFile,
}

impl Bench {
    /// A node whose inputs of these names follow a function of the tick. A name that is no input of the node
    /// is one of a `level` behind it.
    pub(super) fn new(
        rates: (u32, u32),
        kind: &str,
        settings: &[(&str, &str)],
        names: &str,
        play: impl Fn(u64) -> Vec<Vec<f64>> + Send + Sync + 'static,
    ) -> Self {
        Self::beside("bench.ron", rates, kind, settings, names, play)
    }

    /// The same, as if the graph were a file in a folder.
    pub(super) fn beside(
        file: &str,
        (tick_hz, audio_hz): (u32, u32),
        kind: &str,
        settings: &[(&str, &str)],
        names: &str,
        play: impl Fn(u64) -> Vec<Vec<f64>> + Send + Sync + 'static,
    ) -> Self {
        let params: Vec<String> = settings.iter().map(|(name, value)| format!("{name}: {value}")).collect();
        let text = format!(
            "Graph(version: 1, tick_hz: {tick_hz}, audio_hz: {audio_hz}, nodes: {{\"it\": (kind: \"{kind}\", \
             params: ({}))}}, wires: [])",
            params.join(", ")
        );
        let mut graph = GraphFile::parse(&Source::new(file, text)).unwrap();
        graph.add_node("script", "script", &[], "test").unwrap();
        let mut script = Descriptor::new("script", "Controls.").resumes(Resume::Never);
        for name in names.split_whitespace() {
            let input = |kind: &str| {
                let kind = crate::registry().get(kind).unwrap().clone();
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
        let play: Play = Arc::new(play);
        let prepare = move |_: &Setup<'_>| Ok(Prepared::new(Playing(play.clone())));
        Self { script: Arc::new(NodeKind::new(script, prepare)), graph }
    }

    /// Puts a `level` behind it.
    pub(super) fn through_level(mut self) -> Self {
        self.graph.add_node("level", "level", &[], "test").unwrap();
        self.graph.add_wire("it", "level.in", "test");
        self
    }

    /// Puts a `level` behind it that follows two outputs of the script.
    pub(super) fn behind_level(mut self) -> Self {
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
        registry.add(self.script.clone());
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
pub(super) fn refused(kind: &str, settings: &[(&str, &str)]) -> String {
    let inputs = crate::registry().get(kind).unwrap().descriptor().inputs.clone();
    let names: Vec<&str> = inputs.iter().map(|input| input.name.as_ref()).collect();
    Bench::beside("folder/g.ron", (500, 48_000), kind, settings, &names.join(" "), |_| Vec::new())
        .engine("it", true)
        .expect_err("an error")
}
