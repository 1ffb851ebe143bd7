//! The compiler's result: plain data that can be printed, compared and run.

use std::ops::Range;
use std::path::PathBuf;

use asperity_node::{Fact, InputRef, Latency, ParamKind, Params, PortType, Resume, Role};

use crate::GateSets;

/// A compiled graph.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)]
pub struct Schedule {
    pub tick_hz: u32,
    pub audio_hz: u32,
    pub seed: u64,
    /// Nodes in the order they run.
    pub nodes: Vec<ScheduledNode>,
    /// Buffers: first constants and fed inputs, then every node's outputs in the order of `nodes`.
    pub buffers: Vec<BufferEntry>,
    pub steps: Vec<Step>,
    /// Declared nodes that are not built.
    pub dropped: Vec<Dropped>,
    /// Latency from every source to every sink it reaches.
    pub paths: Vec<PathLatency>,
}

/// One step of a tick. The number is an index into [`Schedule::nodes`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Asks a gate whether it wants its gated input.
    Wants(usize),
    /// Runs a node.
    Process(usize),
    /// Gives a node that closes a cycle the inputs of this tick.
    Absorb(usize),
}

/// A node of the schedule.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)]
pub struct ScheduledNode {
    pub id: String,
    pub kind: String,
    /// Purpose for the host.
    pub role: Option<Role>,
    /// Build of its kind's code; see [`NodeKind::build`](asperity_node::NodeKind::build).
    pub build: u64,
    /// The node runs every `every`-th tick.
    pub every: u32,
    /// Parameters with all defaults filled in.
    pub params: Params,
    /// Parameters that may change while it runs.
    pub live: Vec<LiveParam>,
    /// Inputs in the descriptor's order.
    pub inputs: Vec<ScheduledInput>,
    /// Outputs in the descriptor's order.
    pub outputs: Vec<ScheduledOutput>,
    pub buffers: Range<usize>,
    /// Gates that let it sleep.
    pub gate_sets: GateSets,
    /// Behaviour on waking.
    pub resume: Resume,
    pub sink: bool,
    /// The gated input, if it is a gate.
    pub gate: Option<usize>,
    /// Whether it runs before its inputs are ready.
    pub closes_cycle: bool,
    /// Latency from inputs to outputs.
    pub latency: Latency,
    /// Duration of its outputs after its inputs end.
    pub tail: Latency,
    /// Duration of a source.
    pub duration: Option<Latency>,
    /// Whether `process` does not allocate.
    pub allocation_free: bool,
    /// Facts from its preparation.
    pub facts: Vec<Fact>,
    /// Files that it read in addition to parameters of kind `File`.
    pub files: Vec<PathBuf>,
}

/// A parameter that may change while its node runs.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)]
pub struct LiveParam {
    pub name: String,
    pub index: usize,
    pub kind: ParamKind,
    /// Its unit, for a person; may be empty.
    pub unit: String,
    /// Its meaning, in a sentence.
    pub doc: String,
}

/// An input of the schedule.
#[derive(Clone, Debug, PartialEq)]
pub struct ScheduledInput {
    /// Name.
    pub name: String,
    /// Buffer that it reads.
    pub reads: InputRef,
    /// Node and output it reads from.
    pub from: Option<(usize, usize)>,
    /// Type, if anything determines it.
    pub port: Option<PortType>,
    /// Whether it wakes a sleeping node.
    pub wakes: bool,
    /// Whether the host sets its values: no wire ends at it, and its buffer is its own.
    pub host_fed: bool,
}

/// An output of the schedule.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)]
pub struct ScheduledOutput {
    pub name: String,
    pub port: PortType,
    pub readers: usize,
    /// Whether it is `secondary`; see [`asperity_node::Output`].
    pub secondary: bool,
}

/// A buffer.
#[derive(Clone, Debug, PartialEq)]
pub enum BufferEntry {
    /// Value of an unconnected input: `count` times `value`.
    Constant {
        /// Number of values.
        count: usize,
        /// The value.
        value: f64,
    },
    /// Input set by the host.
    HostFed(PortType),
    /// A node's output.
    Output(PortType),
}

/// A declared node that is not built.
#[derive(Clone, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub struct Dropped {
    pub id: String,
    pub kind: String,
    pub why: String,
}

/// Latency from a source to a sink.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)]
pub struct PathLatency {
    pub from: usize,
    pub to: usize,
    /// Greatest latency of any path.
    pub most: Latency,
    /// Nodes of the path with the greatest latency, including its ends. In a graph with very many long
    /// paths, only the ends.
    pub through: Vec<usize>,
}

/// The path to a node on which samples come latest, and how late its nodes declare them to be.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SlowestPath {
    /// Sum of the declared latencies.
    pub latency: Latency,
    /// Its nodes, from a source on.
    pub through: Vec<usize>,
}

impl Schedule {
    /// The slowest path to a node.
    ///
    /// A latency below 0 counts as 0: it balances windows that reach into the past, and brings no sample to
    /// the actuator before the hand has moved. The other inputs of a gate open it, and delay nothing.
    pub fn slowest_path(&self, to: usize) -> SlowestPath {
        // Nodes are in the order they run. A wire that closes a cycle carries the value of the tick before,
        // and is left out.
        let mut late = vec![Latency::ZERO; self.nodes.len()];
        let mut before = vec![None; self.nodes.len()];
        for (i, node) in self.nodes.iter().enumerate() {
            let passed = |(index, _): &(usize, _)| node.gate.is_none_or(|gated| gated == *index);
            let inputs = node.inputs.iter().enumerate().filter(passed);
            let sources = inputs.filter_map(|(_, input)| Some(input.from?.0)).filter(|&from| from < i);
            before[i] = sources.rev().max_by_key(|&from| late[from]);
            late[i] =
                before[i].map_or(Latency::ZERO, |from: usize| late[from]) + node.latency.max(Latency::ZERO);
        }
        let Some(&latency) = late.get(to) else { return SlowestPath::default() };
        let mut through: Vec<usize> = std::iter::successors(Some(to), |&at| before[at]).collect();
        through.reverse();
        SlowestPath { latency, through }
    }

    /// The slowest path to an audio output; without one, to any sink. Empty where there is none.
    pub fn slowest(&self) -> SlowestPath {
        let audio = self.with_role(Role::AudioOutput).map(|(i, _)| i);
        let sinks = (0..self.nodes.len()).filter(|&i| self.nodes[i].sink && audio.clone().next().is_none());
        let paths = audio.clone().chain(sinks).map(|to| self.slowest_path(to));
        paths.reduce(|a, b| if b.latency > a.latency { b } else { a }).unwrap_or_default()
    }

    /// Index of a node by its name in the graph.
    pub fn index_of(&self, id: &str) -> Option<usize> {
        self.nodes.iter().position(|n| n.id == id)
    }

    /// Greatest latency of any path from a source to a sink.
    pub fn latency(&self) -> Latency {
        self.paths.iter().map(|p| p.most).max().unwrap_or(Latency::ZERO)
    }

    /// Nodes with a role, each with its index.
    pub fn with_role(&self, role: Role) -> impl Iterator<Item = (usize, &ScheduledNode)> + Clone {
        self.nodes.iter().enumerate().filter(move |(_, node)| node.role == Some(role))
    }

    /// Duration of the longest source in ticks, rounded up; `None` if no source has one.
    pub fn duration_ticks(&self) -> Option<u64> {
        let longest = self.nodes.iter().filter_map(|n| n.duration).max()?;
        let (num, den) = longest.as_ratio();
        let ticks = (i128::from(num) * i128::from(self.tick_hz) + i128::from(den) - 1) / i128::from(den);
        Some(u64::try_from(ticks).unwrap_or(0))
    }

    /// Every input that the host sets: node and input.
    pub fn host_fed(&self) -> impl Iterator<Item = (usize, usize)> {
        let of = |(i, n): (usize, &ScheduledNode)| {
            let fed = n.inputs.iter().enumerate().filter(|(_, p)| p.host_fed);
            fed.map(|(p, _)| (i, p)).collect::<Vec<_>>()
        };
        self.nodes.iter().enumerate().flat_map(of)
    }

    /// Ids of nodes that allocate while they run.
    pub fn allocating(&self) -> Vec<&str> {
        self.nodes.iter().filter(|n| !n.allocation_free).map(|n| n.id.as_str()).collect()
    }
}
