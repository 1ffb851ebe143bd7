//! A subject's graph under a stylus that moves as a case wants it to.

use std::sync::Arc;

use asperity_engine::{Engine, Options};
use asperity_graph::{Compiled, GraphFile, Schedule};
use asperity_node::{Buffer, Descriptor, FactValue, NodeKind, Registry, Shape, ShapeSpec, Unit};

use crate::case::{Not, not_applicable};
use crate::played::{Motion, Played};
use crate::subject::Subject;

/// What a limiter says that it holds a drive to.
#[derive(Clone, Copy, Debug)]
pub struct DriveLimits {
    /// Largest sample \[A or V\].
    pub peak: f64,
    /// Largest step from sample to sample \[A or V\].
    pub step: f64,
}

/// A graph that runs, with what goes to its devices.
pub struct Rig {
    /// Runs it.
    pub engine: Engine,
    /// What is run.
    pub schedule: Arc<Schedule>,
    /// What is played on sound cards: node and input.
    drives: Vec<(usize, usize)>,
    /// The acceleration nearest to the actuator: node and output.
    felt: Option<(usize, usize)>,
    /// What moves the stylus, where the case gives its place.
    styluses: Vec<usize>,
}

impl Rig {
    /// The subject's graph with `motion` in the place of whatever moves its stylus, and `changes` as `--set` has them.
    ///
    /// # Errors
    /// No graph, nothing in it that moves a stylus, a change that it does not take.
    pub fn new(subject: &Subject<'_>, motion: Motion, changes: &[&str]) -> Result<Self, Not> {
        let (mut graph, kinds) =
            Self::with_stylus(subject.its_graph()?, subject.registry(), &motion).or_else(not_applicable)?;
        for change in changes {
            graph.set(change, "the case")?;
        }
        Self::of(subject, &graph, &kinds)
    }

    /// A graph with a played stylus in the place of every node that moves one, which has an output `position` of three values and no input that
    /// needs a wire; and the kinds that it needs beside the registry's.
    ///
    /// # Errors
    /// Nothing in the graph moves a stylus.
    pub fn with_stylus(
        graph: &GraphFile,
        registry: &Registry,
        motion: &Motion,
    ) -> Result<(GraphFile, Vec<Arc<dyn NodeKind>>), String> {
        Self::with_stylus_of(graph, registry, |name, like| Played::stylus(name, like, motion.clone()))
    }

    /// The subject's graph with a stylus whose place the case gives from tick to tick by [`place`](Self::place).
    ///
    /// # Errors
    /// No graph, nothing in it that moves a stylus.
    pub fn fed(subject: &Subject<'_>) -> Result<Self, Not> {
        let (graph, kinds) =
            Self::with_stylus_of(subject.its_graph()?, subject.registry(), Played::fed_stylus)
                .or_else(not_applicable)?;
        let mut rig = Self::of(subject, &graph, &kinds)?;
        let is = |name: &str| kinds.iter().any(|kind| kind.descriptor().kind == name);
        rig.styluses = (0..rig.schedule.nodes.len()).filter(|&i| is(&rig.schedule.nodes[i].kind)).collect();
        Ok(rig)
    }

    /// Gives a fed stylus its place for the next tick and those after it \[mm\], and whether that is to be trusted.
    pub fn place(&mut self, at: [f64; 3], valid: bool) {
        for &stylus in &self.styluses {
            self.engine.feed_control(stylus, 0, &at, valid);
        }
    }

    fn with_stylus_of(
        graph: &GraphFile,
        registry: &Registry,
        make: impl Fn(&str, &Descriptor) -> Arc<dyn NodeKind>,
    ) -> Result<(GraphFile, Vec<Arc<dyn NodeKind>>), String> {
        let mut graph = graph.clone();
        let mut kinds = Vec::new();
        for node in &mut graph.nodes {
            let Some(kind) = registry.get(&node.kind) else { continue };
            let d = kind.descriptor();
            let moves = d.outputs.iter().any(|o| o.name == "position" && o.shape == ShapeSpec::Control(3))
                && d.inputs.iter().all(|i| i.optional || i.fed);
            if !moves {
                continue;
            }
            let name = format!("{} from memory", node.kind);
            kinds.push(make(&name, d));
            node.kind = name;
            node.params.clear();
            // What was wired into the place of a device plays no more.
            let id = node.id.clone();
            graph.wires.retain(|w| w.to.node != id);
        }
        if kinds.is_empty() { Err("nothing in this graph moves a stylus".into()) } else { Ok((graph, kinds)) }
    }

    /// A graph as it is, with kinds of the case's own.
    ///
    /// # Errors
    /// What the compiler says.
    pub fn of(subject: &Subject<'_>, graph: &GraphFile, kinds: &[Arc<dyn NodeKind>]) -> Result<Self, Not> {
        Ok(Self::from(subject.compiled(graph, kinds)?))
    }

    /// Runs so many ticks; `each` is shown the rig after each of them.
    ///
    /// # Errors
    /// What `each` says.
    pub fn run(
        &mut self,
        ticks: u64,
        mut each: impl FnMut(&mut Self, u64) -> Result<(), Not>,
    ) -> Result<(), Not> {
        for _ in 0..ticks {
            let tick = self.engine.next_tick();
            self.engine.tick();
            each(self, tick)?;
        }
        Ok(())
    }

    /// Ticks of so many seconds.
    pub fn ticks(&self, seconds: f64) -> u64 {
        (seconds * f64::from(self.schedule.tick_hz)).round() as u64
    }

    /// What this tick plays on the sound card, of every `audio_out`: A or V at the coil.
    pub fn drive(&self) -> impl Iterator<Item = &[f32]> {
        self.drives.iter().map(|&(node, input)| samples(self.engine.input(node, input)))
    }

    /// What holds each [drive](Self::drive), where the node before it tells.
    pub fn drive_limits(&self) -> Vec<Option<DriveLimits>> {
        let told = |&(node, input): &(usize, usize)| {
            let (limiter, _) = self.schedule.nodes.get(node)?.inputs.get(input)?.from?;
            let facts = &self.schedule.nodes.get(limiter)?.facts;
            let number = |name| match facts.iter().find(|f| f.name == name)?.value {
                FactValue::Number(value, _) => Some(value),
                _ => None,
            };
            Some(DriveLimits { peak: number("limit")?, step: number("limit_step")? })
        };
        self.drives.iter().map(told).collect()
    }

    /// Whether what goes to every device is to be trusted in this tick: else it fades.
    pub fn trusted(&self) -> bool {
        self.drives.iter().all(|&(node, input)| self.engine.input(node, input).is_none_or(Buffer::is_valid))
    }

    /// Where the stylus is \[mm\]; none where nothing tells.
    pub fn position(&self) -> Option<[f64; 3]> {
        let place = |(i, n): (usize, &asperity_graph::ScheduledNode)| {
            let tells = |o: &asperity_graph::ScheduledOutput| {
                o.name == "position" && o.port.shape == Shape::Control { count: 3 }
            };
            Some((i, n.outputs.iter().position(tells)?))
        };
        let (node, output) = self.schedule.nodes.iter().enumerate().find_map(place)?;
        match self.engine.output(node, output)? {
            Buffer::Control { values, .. } => <[f64; 3]>::try_from(&values[..]).ok(),
            _ => None,
        }
    }

    /// Whether anything is played on a sound card.
    pub fn drives(&self) -> bool {
        !self.drives.is_empty()
    }

    /// This tick's acceleration \[m/s^2\] before the inverse of the actuator; empty where there is none.
    pub fn felt(&self) -> &[f32] {
        self.felt.map_or(&[], |(node, output)| samples(self.engine.output(node, output)))
    }

    /// This tick's samples of an output.
    pub fn audio(&self, node: &str, output: usize) -> &[f32] {
        self.schedule.index_of(node).map_or(&[], |i| samples(self.engine.output(i, output)))
    }

    /// This tick's values of an output.
    pub fn control(&self, node: &str, output: usize) -> &[f64] {
        match self.schedule.index_of(node).and_then(|i| self.engine.output(i, output)) {
            Some(Buffer::Control { values, .. }) => values,
            _ => &[],
        }
    }
}

impl From<Compiled> for Rig {
    fn from(compiled: Compiled) -> Self {
        let schedule = Arc::new(compiled.schedule.clone());
        let drives = schedule.nodes.iter().enumerate().filter(|(_, n)| n.kind == "audio_out");
        let drives = drives.map(|(i, _)| (i, 0)).collect();
        let felt = felt(&schedule);
        let engine = Engine::new(compiled, Options::default());
        Self { engine, schedule, drives, felt, styluses: Vec::new() }
    }
}

/// This tick's samples of a buffer.
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
