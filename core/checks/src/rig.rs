//! A graph that runs under a case: the subject's own, or one that the case builds.

use std::sync::Arc;

use asperity_engine::{Engine, Options};
use asperity_graph::{Compiled, GraphFile, Schedule};
use asperity_node::{Buffer, Descriptor, Fact, FactValue, NodeKind, Registry, Role, Shape, ShapeSpec, Unit};

use crate::case::{Stop, not_applicable};
use crate::played::{Motion, Played};
use crate::subject::Subject;

/// The name of a case's own graph in errors.
const ORIGIN: &str = "the case";

/// Whether a graph has to set a parameter of a kind other than these. No case knows a value for it.
pub(crate) fn has_to_be_set(d: &Descriptor, beside: &[&str]) -> bool {
    d.params.iter().any(|p| p.default.is_none() && !p.optional && !beside.contains(&&*p.name))
}

/// A graph that a case builds: of the subject's kinds, and of kinds that play from memory.
#[derive(Clone)]
pub(crate) struct CaseGraph {
    pub graph: GraphFile,
    pub kinds: Vec<Arc<NodeKind>>,
}

impl CaseGraph {
    /// An empty graph with these rates \[Hz\].
    pub(crate) fn new(tick_hz: u32, audio_hz: u32) -> Self {
        let mut graph = GraphFile::empty(ORIGIN);
        (graph.tick_hz, graph.audio_hz) = (tick_hz, audio_hz);
        Self { graph, kinds: Vec::new() }
    }

    /// Adds a node with parameters as RON texts.
    pub(crate) fn node(mut self, id: &str, kind: &str, params: &[(&str, &str)]) -> Result<Self, Stop> {
        self.graph.add_node(id, kind, params, ORIGIN)?;
        Ok(self)
    }

    /// Adds a node of a kind of the case's own.
    pub(crate) fn plays(mut self, id: &str, kind: Arc<NodeKind>) -> Result<Self, Stop> {
        self.graph.add_node(id, &kind.descriptor().kind, &[], ORIGIN)?;
        self.kinds.push(kind);
        Ok(self)
    }

    /// Adds a wire.
    pub(crate) fn wire(mut self, from: &str, to: &str) -> Self {
        self.graph.add_wire(from, to, ORIGIN);
        self
    }

    /// Adds wires from each end to the next.
    pub(crate) fn chain(self, ends: &[&str]) -> Self {
        ends.windows(2).fold(self, |all, pair| all.wire(pair[0], pair[1]))
    }

    /// Compiles it.
    pub(crate) fn rig(&self, subject: &Subject<'_>) -> Result<Rig, Stop> {
        Rig::of(subject, &self.graph, &self.kinds)
    }
}

/// A graph that runs, and its outputs to devices.
pub struct Rig {
    /// Runs the graph.
    pub engine: Engine,
    /// The compiled graph.
    pub schedule: Arc<Schedule>,
    /// Inputs that are played on sound cards: node and input.
    drives: Vec<(usize, usize)>,
    /// The acceleration nearest to the actuator: node and output.
    felt: Option<(usize, usize)>,
    /// Styluses that [`place`](Self::place) moves.
    styluses: Vec<usize>,
}

impl Rig {
    /// The subject's graph with `motion` in place of each node that moves a stylus. `changes` are written as
    /// for `--set`.
    ///
    /// # Errors
    /// No graph; no stylus in it; a change that it refuses.
    pub fn new(subject: &Subject<'_>, motion: Motion, changes: &[&str]) -> Result<Self, Stop> {
        let graph = subject.its_graph()?;
        let (mut graph, kinds) =
            Self::with_stylus(graph, &subject.registry, Some(&motion)).or_else(not_applicable)?;
        for change in changes {
            graph.set(change, ORIGIN)?;
        }
        Self::of(subject, &graph, &kinds)
    }

    /// The subject's graph with the motion of `new`, or as it is where nothing in it moves a stylus.
    pub(crate) fn moved_if_possible(subject: &Subject<'_>, motion: Motion) -> Result<Self, Stop> {
        match Self::new(subject, motion, &[]) {
            Err(Stop::NotApplicable(_)) => Self::of(subject, subject.its_graph()?, &[]),
            rig => rig,
        }
    }

    /// A graph with a played stylus in place of each node that moves one, and the kinds that it needs.
    /// Without a motion [`place`](Self::place) moves the stylus from tick to tick. Such a node has an output
    /// `position` of three values and no input that needs a wire.
    ///
    /// # Errors
    /// Nothing in the graph moves a stylus.
    pub fn with_stylus(
        graph: &GraphFile,
        registry: &Registry,
        motion: Option<&Motion>,
    ) -> Result<(GraphFile, Vec<Arc<NodeKind>>), String> {
        let mut graph = graph.clone();
        let mut kinds = Vec::new();
        for node in &mut graph.nodes {
            let Some(kind) = registry.get(&node.kind) else { continue };
            let d = kind.descriptor();
            let moves = d.outputs.iter().any(|o| o.name == "position" && o.shape == ShapeSpec::Control(3))
                && d.inputs.iter().all(|i| i.optional || i.host_fed);
            if !moves {
                continue;
            }
            let name = format!("{} from memory", node.kind);
            kinds.push(match motion {
                Some(motion) => Played::stylus(&name, d, motion.clone()),
                None => Played::fed_stylus(&name, d),
            });
            node.kind = name;
            node.params.clear();
            // The played stylus has none of the inputs of a device.
            let id = node.id.clone();
            graph.wires.retain(|w| w.to.node != id);
        }
        if kinds.is_empty() { Err("nothing in this graph moves a stylus".into()) } else { Ok((graph, kinds)) }
    }

    /// A graph whose stylus [`place`](Self::place) moves from tick to tick.
    pub(crate) fn fed(subject: &Subject<'_>, graph: &GraphFile) -> Result<Self, Stop> {
        let (graph, kinds) = Self::with_stylus(graph, &subject.registry, None).or_else(not_applicable)?;
        Self::of(subject, &graph, &kinds)
    }

    /// Sets the place of each fed stylus from the next tick on \[mm\], and whether it is valid.
    pub(crate) fn place(&mut self, at: [f64; 3], valid: bool) {
        for &stylus in &self.styluses {
            self.engine.feed_control(stylus, 0, &at, valid);
        }
    }

    /// A graph as it is, with kinds of the case's own.
    ///
    /// # Errors
    /// Those of the compiler.
    pub fn of(subject: &Subject<'_>, graph: &GraphFile, kinds: &[Arc<NodeKind>]) -> Result<Self, Stop> {
        let mut rig = Self::from(subject.compiled(graph, kinds)?);
        let fed = |name: &str| {
            let kind = kinds.iter().map(|k| k.descriptor()).find(|d| d.kind == name);
            kind.is_some_and(|d| d.inputs.iter().any(|i| i.host_fed && i.name == Played::PLACE))
        };
        rig.styluses = (0..rig.schedule.nodes.len()).filter(|&i| fed(&rig.schedule.nodes[i].kind)).collect();
        Ok(rig)
    }

    /// Runs so many ticks, and calls `each` after each of them.
    ///
    /// # Errors
    /// Those of `each`.
    pub fn run(
        &mut self,
        ticks: u64,
        mut each: impl FnMut(&mut Self, u64) -> Result<(), Stop>,
    ) -> Result<(), Stop> {
        for _ in 0..ticks {
            let tick = self.engine.next_tick();
            self.engine.tick();
            each(self, tick)?;
        }
        Ok(())
    }

    /// Runs so many ticks. Answers the samples of a node's first output. Fails where a node has failed.
    pub(crate) fn heard(&mut self, ticks: u64, node: &str) -> Result<Vec<f32>, Stop> {
        let mut heard = Vec::new();
        for _ in 0..ticks {
            self.engine.tick();
            heard.extend_from_slice(self.audio(node, 0));
        }
        self.sound()?;
        Ok(heard)
    }

    /// Number of ticks in so many seconds.
    pub fn ticks(&self, seconds: f64) -> u64 {
        (seconds * f64::from(self.schedule.tick_hz)).round() as u64
    }

    /// Checks that no node has failed so far.
    pub(crate) fn sound(&self) -> Result<(), Stop> {
        ensure!(self.engine.faults() == 0, "{} faults", self.engine.faults());
        Ok(())
    }

    /// This tick's samples of each sound card: A or V at the coil.
    pub fn drive(&self) -> impl Iterator<Item = &[f32]> {
        self.drives.iter().map(|&(node, input)| samples(self.engine.input(node, input)))
    }

    /// Largest sample and step of each [drive](Self::drive) that its limiter states \[A or V\].
    pub(crate) fn drive_limits(&self) -> Vec<Option<[f64; 2]>> {
        let told = |&(node, input): &(usize, usize)| {
            let (limiter, _) = self.schedule.nodes.get(node)?.inputs.get(input)?.from?;
            let facts = &self.schedule.nodes.get(limiter)?.facts;
            Some([number(facts, "limit")?, number(facts, "limit_step")?])
        };
        self.drives.iter().map(told).collect()
    }

    /// Whether the output to each device is valid in this tick; else it fades.
    pub(crate) fn trusted(&self) -> bool {
        self.drives.iter().all(|&(node, input)| self.engine.input(node, input).is_none_or(Buffer::is_valid))
    }

    /// All outputs: node and output.
    pub(crate) fn outputs(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let nodes = self.schedule.nodes.iter().enumerate();
        nodes.flat_map(|(i, node)| (0..node.outputs.len()).map(move |o| (i, o)))
    }

    /// The first output whose buffer is so, as `node.port`.
    pub(crate) fn first_output(&self, is: impl Fn(&Buffer) -> bool) -> Option<String> {
        let (i, o) = self.outputs().find(|&(i, o)| self.engine.output(i, o).is_some_and(&is))?;
        Some(self.name(i, o))
    }

    /// The name of an output, as `node.port`.
    pub(crate) fn name(&self, node: usize, output: usize) -> String {
        let node = &self.schedule.nodes[node];
        format!("{}.{}", node.id, node.outputs[output].name)
    }

    /// Place of the stylus \[mm\], where an output `position` tells it.
    pub(crate) fn position(&self) -> Option<[f64; 3]> {
        let (node, output) = self.schedule.nodes.iter().enumerate().find_map(|(i, node)| {
            let tells = |o: &asperity_graph::ScheduledOutput| {
                o.name == "position" && o.port.shape == Shape::Control { count: 3 }
            };
            Some((i, node.outputs.iter().position(tells)?))
        })?;
        self.values(node, output).try_into().ok()
    }

    /// Whether anything is played on a sound card.
    pub fn drives(&self) -> bool {
        !self.drives.is_empty()
    }

    /// This tick's acceleration before the actuator's inverse \[m/s^2\]; empty where there is none.
    pub fn felt(&self) -> &[f32] {
        self.felt.map_or(&[], |(node, output)| samples(self.engine.output(node, output)))
    }

    /// This tick's samples of an output.
    pub fn audio(&self, node: &str, output: usize) -> &[f32] {
        self.schedule.index_of(node).map_or(&[], |i| samples(self.engine.output(i, output)))
    }

    /// This tick's values of an output.
    pub(crate) fn values(&self, node: usize, output: usize) -> &[f64] {
        values(self.engine.output(node, output))
    }
}

impl From<Compiled> for Rig {
    fn from(compiled: Compiled) -> Self {
        let schedule = Arc::new(compiled.schedule.clone());
        let drives = schedule.with_role(Role::AudioOutput).map(|(i, _)| (i, 0)).collect();
        let felt = felt(&schedule);
        let engine = Engine::new(compiled, Options::default());
        Self { engine, schedule, drives, felt, styluses: Vec::new() }
    }
}

/// A number that a node states.
pub(crate) fn number(facts: &[Fact], name: &str) -> Option<f64> {
    match facts.iter().find(|f| f.name == name)?.value {
        FactValue::Number(value, _) => Some(value),
        _ => None,
    }
}

/// This tick's values of a buffer of controls.
pub(crate) fn values(buffer: Option<&Buffer>) -> &[f64] {
    match buffer {
        Some(Buffer::Control { values, .. }) => values,
        _ => &[],
    }
}

/// This tick's samples of a buffer of audio.
fn samples(buffer: Option<&Buffer>) -> &[f32] {
    match buffer {
        Some(Buffer::Audio { samples, len, .. }) => samples.get(..*len).unwrap_or(&[]),
        _ => &[],
    }
}

/// The last output of an acceleration at the audio rate.
fn felt(schedule: &Schedule) -> Option<(usize, usize)> {
    let mut outputs =
        schedule.nodes.iter().enumerate().flat_map(|(i, n)| (0..n.outputs.len()).map(move |o| (i, o)));
    outputs.rfind(|&(i, o)| {
        let port = &schedule.nodes[i].outputs[o].port;
        port.shape == Shape::Audio { rate_hz: schedule.audio_hz }
            && port.unit == Unit::METRE_PER_SECOND_SQUARED
    })
}
