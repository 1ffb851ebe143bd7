//! What the compiler answers: plain data that can be printed, compared and run.

use std::collections::BTreeSet;
use std::ops::Range;
use std::path::PathBuf;

use asperity_node::{Fact, InputRef, Latency, ParamKind, Params, PortType, Resume};

/// A compiled graph.
#[derive(Clone, Debug, PartialEq)]
pub struct Schedule {
    /// Ticks a second.
    pub tick_hz: u32,
    /// Audio rate in Hz.
    pub audio_hz: u32,
    /// Seed of the graph.
    pub seed: u64,
    /// Nodes in the order they run.
    pub nodes: Vec<ScheduledNode>,
    /// Buffers: constants and what the host gives first, then every node's outputs in the order of `nodes`.
    pub buffers: Vec<BufferEntry>,
    /// What one tick does, in order.
    pub steps: Vec<Step>,
    /// Nodes that were declared and are not built.
    pub dropped: Vec<Dropped>,
    /// Latency from every source to every sink it reaches.
    pub paths: Vec<PathLatency>,
}

/// One step of a tick. The number is an index into [`Schedule::nodes`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Ask a gate whether it wants its gated input.
    Wants(usize),
    /// Run a node.
    Process(usize),
    /// Give a node that closes a cycle the inputs it ran without.
    Absorb(usize),
}

/// A node in its place.
#[derive(Clone, Debug, PartialEq)]
pub struct ScheduledNode {
    /// Its name in the graph.
    pub id: String,
    /// Its kind.
    pub kind: String,
    /// Which build of its kind's code it is; see [`NodeKind::build`](asperity_node::NodeKind::build).
    pub build: u64,
    /// It runs every so many ticks.
    pub every: u32,
    /// Its parameters with all defaults filled in.
    pub params: Params,
    /// Which of them may change while it runs.
    pub live: Vec<LiveParam>,
    /// Its inputs in the descriptor's order.
    pub inputs: Vec<ScheduledInput>,
    /// Its outputs in the descriptor's order.
    pub outputs: Vec<ScheduledOutput>,
    /// Its output buffers.
    pub buffers: Range<usize>,
    /// The gates that let it sleep, as ways in which it is wanted: it runs while all gates of one of these
    /// sets are open. Empty for a node that always runs.
    pub guards: Vec<Vec<usize>>,
    /// How it wakes.
    pub resume: Resume,
    /// Whether it is wanted for its own sake.
    pub sink: bool,
    /// The input it gates, if it is a gate.
    pub gate: Option<usize>,
    /// Whether it runs before its inputs are there.
    pub closes_cycle: bool,
    /// Latency from inputs to outputs.
    pub latency: Latency,
    /// How long its outputs go on after its inputs.
    pub tail: Latency,
    /// How long a source has something to play.
    pub duration: Option<Latency>,
    /// Whether it keeps the rule against allocation.
    pub allocation_free: bool,
    /// What it said of itself when it was prepared.
    pub facts: Vec<Fact>,
    /// Files that it read beside those that its parameters of kind `File` name.
    pub files: Vec<PathBuf>,
}

/// A parameter that may change while its node runs.
#[derive(Clone, Debug, PartialEq)]
pub struct LiveParam {
    /// Its name.
    pub name: String,
    /// Its place in the descriptor.
    pub index: usize,
    /// What it may be.
    pub kind: ParamKind,
    /// Its unit, for a person; may be empty.
    pub unit: String,
}

/// An input in its place.
#[derive(Clone, Debug, PartialEq)]
pub struct ScheduledInput {
    /// Its name.
    pub name: String,
    /// What it reads.
    pub reads: InputRef,
    /// Node and output it reads from.
    pub from: Option<(usize, usize)>,
    /// Its type, where anything settles it.
    pub port: Option<PortType>,
    /// Whether it wakes a node that said it sleeps.
    pub wakes: bool,
    /// Whether the host gives its values: no wire ends at it, and its buffer is its own.
    pub fed: bool,
}

/// An output in its place.
#[derive(Clone, Debug, PartialEq)]
pub struct ScheduledOutput {
    /// Its name.
    pub name: String,
    /// Its type.
    pub port: PortType,
    /// How many inputs read it.
    pub readers: usize,
    /// Whether it comes beside what the node is for.
    pub aside: bool,
}

/// A buffer.
#[derive(Clone, Debug, PartialEq)]
pub enum BufferEntry {
    /// What an unconnected input reads: `count` times `value`.
    Constant {
        /// Number of values.
        count: usize,
        /// The value.
        value: f64,
    },
    /// What the host gives to an input.
    Fed(PortType),
    /// A node's output.
    Output(PortType),
}

/// A node that was declared and is not built.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Dropped {
    /// Its name in the graph.
    pub id: String,
    /// Its kind.
    pub kind: String,
    /// Why it is not built.
    pub why: String,
}

/// Latency from a source to a sink.
#[derive(Clone, Debug, PartialEq)]
pub struct PathLatency {
    /// Index of the source.
    pub from: usize,
    /// Index of the sink.
    pub to: usize,
    /// Least latency of any path.
    pub least: Latency,
    /// Greatest latency of any path.
    pub most: Latency,
    /// The nodes of the path with the greatest latency, its ends included; in a graph of very many and long
    /// paths, its ends alone.
    pub through: Vec<usize>,
}

impl Schedule {
    /// Index of a node by its name in the graph.
    pub fn index_of(&self, id: &str) -> Option<usize> {
        self.nodes.iter().position(|n| n.id == id)
    }

    /// Greatest latency of any path from a source to a sink.
    pub fn latency(&self) -> Latency {
        self.paths.iter().map(|p| p.most).max().unwrap_or(Latency::ZERO)
    }

    /// How long the longest source plays, in ticks, rounded up; `None` where no source says.
    pub fn duration_ticks(&self) -> Option<u64> {
        let longest = self.nodes.iter().filter_map(|n| n.duration).max()?;
        let (num, den) = longest.as_ratio();
        let ticks = (i128::from(num) * i128::from(self.tick_hz) + i128::from(den) - 1) / i128::from(den);
        Some(u64::try_from(ticks).unwrap_or(0))
    }

    /// Every input that the host is to give values to: node and input.
    pub fn fed(&self) -> impl Iterator<Item = (usize, usize)> {
        let of = |(i, n): (usize, &ScheduledNode)| {
            let fed = n.inputs.iter().enumerate().filter(|(_, p)| p.fed);
            fed.map(|(p, _)| (i, p)).collect::<Vec<_>>()
        };
        self.nodes.iter().enumerate().flat_map(of)
    }

    /// Ids of nodes that allocate while they run.
    pub fn allocating(&self) -> Vec<&str> {
        self.nodes.iter().filter(|n| !n.allocation_free).map(|n| n.id.as_str()).collect()
    }
}

/// Orders the wanted vertices so that each comes after those `before` it. Of several that may come next, the
/// lowest number comes first. Vertices on a cycle, and all after them, are left out.
pub fn topological_order(before: &[BTreeSet<usize>], wanted: impl Fn(usize) -> bool) -> Vec<usize> {
    let mut missing: Vec<usize> = before.iter().map(|b| b.iter().filter(|&&v| wanted(v)).count()).collect();
    let mut after: Vec<Vec<usize>> = vec![Vec::new(); before.len()];
    for (v, b) in before.iter().enumerate().filter(|(v, _)| wanted(*v)) {
        for &u in b.iter().filter(|&&u| wanted(u)) {
            after[u].push(v);
        }
    }
    let mut ready: BTreeSet<usize> = (0..before.len()).filter(|&v| wanted(v) && missing[v] == 0).collect();
    let mut out = Vec::new();
    while let Some(v) = ready.pop_first() {
        out.push(v);
        for &w in &after[v] {
            missing[w] -= 1;
            if missing[w] == 0 {
                ready.insert(w);
            }
        }
    }
    out
}
