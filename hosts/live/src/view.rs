//! What a person sees of a running graph: figures for a page, a terminal or a report.

use serde::Serialize;

/// The graph as it is being run. Changes only when another graph is taken over.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Layout {
    /// Counts the graphs that were taken over, from 0.
    pub number: u64,
    /// The graph file.
    pub file: String,
    /// Ticks a second.
    pub tick_hz: u32,
    /// Audio rate in Hz.
    pub audio_hz: u32,
    /// Nodes in the order they run.
    pub nodes: Vec<NodeLayout>,
    /// Wires: node and output, node and input, by index.
    pub wires: Vec<[usize; 4]>,
    /// What the scopes show.
    pub scopes: Vec<ScopeLayout>,
    /// Textures that may be chosen: node id, the one it has, and all there are.
    pub materials: Vec<Materials>,
}

/// One node of a [`Layout`].
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct NodeLayout {
    /// Its name in the graph.
    pub id: String,
    /// Its kind.
    pub kind: String,
    /// Its inputs: name, unit.
    pub inputs: Vec<[String; 2]>,
    /// Its outputs: name, unit.
    pub outputs: Vec<[String; 2]>,
    /// Parameters that may change while it runs.
    pub live: Vec<LiveLayout>,
    /// Whether it wants to be heard for its own sake.
    pub sink: bool,
}

/// A parameter that may change while its node runs.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct LiveLayout {
    /// Its name.
    pub name: String,
    /// What it was last set to; a flag is 0 or 1, a choice the place of its word.
    pub value: f64,
    /// Least value.
    pub least: f64,
    /// Greatest value.
    pub most: f64,
    /// The part of the range around its value that is worth a slider, where the whole is far wider.
    pub reach: Option<[f64; 2]>,
    /// Only whole numbers.
    pub whole: bool,
    /// Words of a choice, `off` and `on` of a flag; empty for a number.
    pub words: Vec<String>,
    /// Unit, for a person.
    pub unit: String,
}

/// A signal on a scope.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ScopeLayout {
    /// `speed`, `force`, `acceleration`, `current`, or the name of the port.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Samples a second.
    pub rate_hz: u32,
}

impl LiveLayout {
    /// Least and greatest value of a slider: those that it may have, or the part of them that is worth one.
    pub fn slide(&self) -> [f64; 2] {
        self.reach.unwrap_or([self.least, self.most])
    }
}

/// The textures of a node.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Materials {
    /// The node.
    pub node: String,
    /// The one it has.
    pub chosen: String,
    /// All there are.
    pub names: Vec<String>,
}

/// How the run stands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Condition {
    /// The output is ramping up.
    #[default]
    Starting,
    /// It plays.
    Playing,
    /// The output was muted by hand.
    Muted,
    /// The device is lost, and the run waits for it.
    Lost,
    /// The output is ramping down for good.
    Stopping,
    /// The engine panicked, and the output is silent.
    Failed,
}

/// Figures of the moment. Times are in microseconds unless the name says otherwise.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct View {
    /// Counts views.
    pub number: u64,
    /// The [`Layout`] that the numbers of nodes are of.
    pub layout: u64,
    /// How the run stands.
    pub condition: Condition,
    /// Whether a person muted it, whatever else is the matter.
    pub muted: bool,
    /// What drives the ticks: `callback`, `paced`, `timer`.
    pub clock: String,
    /// The device, as a person knows it; empty for none.
    pub device: String,
    /// Frames of a callback, as last seen; 0 for none.
    pub period_frames: u32,
    /// Ticks so far.
    pub ticks: u64,
    /// Time of the graph in seconds.
    pub seconds: f64,
    /// Times of ticks.
    pub timing: TimingView,
    /// Callbacks that found too few samples.
    pub underruns: u64,
    /// Samples of each channel that were never played.
    pub lost_samples: u64,
    /// Samples that a channel's guard had to hold to the limits, behind the graph's own limiters.
    pub guarded: u64,
    /// Gaps of callbacks that the loop over their times saw, or xruns the host reported; what both saw
    /// counts once.
    pub xruns: u64,
    /// How often the device was lost.
    pub losses: u64,
    /// Ticks that were left out, because they were too far behind.
    pub skipped_ticks: u64,
    /// Recorded samples of each channel that were lost, or were not there when a tick wanted them.
    pub recording_gaps: u64,
    /// Faults of all nodes.
    pub faults: u64,
    /// Each node, in the layout's order.
    pub nodes: Vec<NodeView>,
    /// Each input source.
    pub sources: Vec<SourceView>,
    /// New samples of each scope, oldest first.
    pub scopes: Vec<Vec<f32>>,
    /// Latency from a hand to the actuator, itemised: what, milliseconds.
    pub latency_ms: Vec<(String, f64)>,
    /// Peak of what the device was given since the view before, behind the ramp of start, mute and stop, of
    /// full scale; 0 without a device.
    pub peak: f32,
}

/// Times of ticks since the start: how late they woke, and how long they took.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TimingView {
    /// One tick in microseconds: the deadline.
    pub deadline_us: f64,
    /// Ticks that were done later than a tick after they were due.
    pub misses: u64,
    /// Of these, ticks that woke too late: the machine's doing.
    pub woke_late: u64,
    /// Wake-up lateness: p50, p99, p99.9, max.
    pub late_us: [f64; 4],
    /// Computing: p50, p99, p99.9, max.
    pub compute_us: [f64; 4],
    /// Recovery, from when a tick that was missed was due to when the next one was there in time: p50, p99,
    /// p99.9, max; 0 for none.
    pub recovery_us: [f64; 4],
    /// Upper edges of the histogram's bins; the last bin is open.
    pub edges_us: Vec<f64>,
    /// Ticks by lateness.
    pub late_counts: Vec<u64>,
    /// Ticks by computing.
    pub compute_counts: Vec<u64>,
}

/// One node of a [`View`].
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct NodeView {
    /// Mean time of a call since the view before.
    pub us: f64,
    /// Longest call so far.
    pub max_us: f64,
    /// Calls so far.
    pub calls: u64,
    /// Ticks slept through so far.
    pub slept: u64,
    /// Faults so far.
    pub faults: u64,
    /// How it failed last, for a person; empty for never.
    pub last_fault: String,
    /// Whether it is no longer called.
    pub quarantined: bool,
    /// For every output: the first value of a control, the rms of audio since the view before, the largest
    /// bin of a frame.
    pub values: Vec<f32>,
}

/// A source of a hand's motion.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SourceView {
    /// The node.
    pub id: String,
    /// Samples a second, as they arrive.
    pub rate_hz: f64,
    /// Age of the newest sample in milliseconds.
    pub age_ms: f64,
    /// How far behind the hand it is read, in milliseconds, so that samples need not be made up.
    pub delay_ms: f64,
    /// How often it stalled.
    pub stalls: u64,
    /// Whether it stalls now.
    pub stalled: bool,
    /// Samples so far.
    pub samples: u64,
}

/// What a person asks of a running graph, beside muting and stopping it: see [`Reins`](crate::Reins).
#[derive(Clone, Debug, PartialEq)]
pub enum Request {
    /// Set a live parameter: node, parameter, value.
    Set {
        /// The node.
        node: String,
        /// The parameter.
        param: String,
        /// Its value.
        value: f64,
    },
    /// Give a texture node another material.
    Material {
        /// The node.
        node: String,
        /// The material.
        name: String,
    },
}

impl Request {
    /// Whether both are of one parameter, or of one node's texture: then only the newer of them counts.
    pub fn is_of_the_same(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Set { node, param, .. }, Self::Set { node: n, param: p, .. }) => node == n && param == p,
            (Self::Material { node, .. }, Self::Material { node: n, .. }) => node == n,
            _ => false,
        }
    }
}
