//! Figures of a running graph for a page, a terminal or a report.
#![allow(missing_docs, reason = "fields without a doc say it all by their name")]

use std::path::PathBuf;

use serde::Serialize;

/// The running graph. Changes only when another graph takes over.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Layout {
    /// Number of the graph: the first is 0, each one that takes over is one more.
    pub number: u64,
    pub file: String,
    pub tick_hz: u32,
    pub audio_hz: u32,
    pub nodes: Vec<NodeLayout>,
    /// Wires: node and output, node and input, by index.
    pub wires: Vec<[usize; 4]>,
    pub scopes: Vec<ScopeLayout>,
    /// Textures that a person may choose, by node.
    pub materials: Vec<Materials>,
    /// How a pointer on a page becomes a stylus, if the graph has one.
    pub pointer: Option<Pointer>,
    /// Largest drive of the first actuator \[A or V\].
    pub peak_drive: Option<f64>,
}

/// A pointer on a page as a stylus: where it is above the surface, and how hard it presses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Pointer {
    /// Height of the surface where the page has no other.
    pub height_mm: f64,
    /// Depth below the surface at full pressure.
    pub depth_mm: f64,
    /// Height above the surface when it is lifted.
    pub lift_mm: f64,
    /// Force at full pressure.
    pub max_force_n: f64,
}

#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct NodeLayout {
    pub id: String,
    pub kind: String,
    /// Its inputs: name, unit.
    pub inputs: Vec<[String; 2]>,
    /// Its outputs: name, unit.
    pub outputs: Vec<[String; 2]>,
    /// Parameters that may change while it runs.
    pub live: Vec<LiveLayout>,
    pub sink: bool,
}

/// A parameter that may change while its node runs.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct LiveLayout {
    pub name: String,
    /// Current value; 0 or 1 for a flag, the index of its word for a choice.
    pub value: f64,
    pub least: f64,
    pub most: f64,
    /// Useful slider range around the value, if the whole range is far wider.
    pub reach: Option<[f64; 2]>,
    pub whole: bool,
    /// Words of a choice, `off` and `on` of a flag; empty for a number.
    pub words: Vec<String>,
    pub unit: String,
    /// Its meaning, in a sentence.
    pub doc: String,
}

/// A signal on a scope.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ScopeLayout {
    /// `speed`, `force`, `acceleration`, `current`, or the name of the port.
    pub name: String,
    pub unit: String,
    pub rate_hz: u32,
}

impl LiveLayout {
    /// Range of a slider: `reach`, or else least to most.
    pub fn slide(&self) -> [f64; 2] {
        self.reach.unwrap_or([self.least, self.most])
    }
}

#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Materials {
    pub node: String,
    pub chosen: String,
    pub names: Vec<String>,
    /// The same materials as a person knows them; a layout does not carry them to a page.
    #[serde(skip)]
    pub gallery: Vec<Material>,
}

/// A material of a library for a person.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Material {
    pub name: String,
    pub family: String,
    pub description: String,
    #[serde(skip)]
    pub picture: Option<PathBuf>,
    /// Width of the picture on the material \[mm\], if the library says it.
    pub picture_mm: Option<f64>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Condition {
    #[default]
    Starting,
    Playing,
    Muted,
    /// The device is lost; the run waits for it.
    Lost,
    /// The output is ramping down for good.
    Stopping,
    /// The engine panicked, and the output is silent.
    Failed,
}

/// Figures now. Times are in microseconds unless the name says otherwise.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct View {
    pub number: u64,
    /// Number of the [`Layout`] that the node indices refer to.
    pub layout: u64,
    pub condition: Condition,
    pub muted: bool,
    /// Strength of the output, 0 to 1.
    pub strength: f32,
    /// Clock of the ticks: `callback`, `paced`, `timer`.
    pub clock: String,
    /// Name of the device; empty for none.
    pub device: String,
    /// Frames a callback, as measured; 0 for none.
    pub period_frames: u32,
    pub ticks: u64,
    pub seconds: f64,
    pub timing: TimingView,
    /// Callbacks that found too few samples.
    pub underruns: u64,
    /// Samples of each channel that were never played.
    pub lost_samples: u64,
    /// Samples that a channel's guard limited, behind the graph's own limiters.
    pub guarded: u64,
    /// Xruns: gaps between callbacks, or xruns that the host reported. One that both saw counts once.
    pub xruns: u64,
    pub losses: u64,
    /// Ticks skipped because they were too late.
    pub skipped_ticks: u64,
    /// Recorded samples of each channel that were lost, or missing when a tick needed them.
    pub recording_gaps: u64,
    pub faults: u64,
    /// Each node, in the layout's order.
    pub nodes: Vec<NodeView>,
    pub sources: Vec<SourceView>,
    /// Place of the stylus; `None` where the graph has none.
    pub stylus_mm: Option<[f32; 3]>,
    /// New samples of each scope, oldest first.
    pub scopes: Vec<Vec<f32>>,
    /// Latency from the hand to the actuator, as items with milliseconds.
    pub latency_ms: Vec<(String, f64)>,
    /// Peak of the output since the view before, behind all ramps, of full scale; 0 without a device.
    pub peak: f32,
}

/// Wake-up lateness and computing time of ticks since the start.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TimingView {
    /// One tick in microseconds: the deadline.
    pub deadline_us: f64,
    /// Deadline misses: ticks that ended more than a tick after they were due.
    pub misses: u64,
    /// Deadline misses by late waking: the computing itself took less than a tick.
    pub woke_late: u64,
    /// Wake-up lateness: p50, p99, p99.9, max.
    pub late_us: [f64; 4],
    pub compute_us: [f64; 4],
    /// Time from the due time of a deadline miss to the end of the next tick in time: p50, p99, p99.9, max;
    /// 0 for none.
    pub recovery_us: [f64; 4],
    /// Upper edges of the histogram's bins; the last bin is open.
    pub edges_us: Vec<f64>,
    pub late_counts: Vec<u64>,
    pub compute_counts: Vec<u64>,
}

#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct NodeView {
    /// Mean time of a call since the view before.
    pub us: f64,
    /// Longest call so far.
    pub max_us: f64,
    pub calls: u64,
    pub slept: u64,
    pub faults: u64,
    /// How it failed last, for a person; empty for never.
    pub last_fault: String,
    /// Whether it is no longer called.
    pub quarantined: bool,
    /// One figure an output: the first value of a control, the rms of audio, the largest bin of a frame.
    pub values: Vec<f32>,
}

/// A source of a hand's motion.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SourceView {
    pub id: String,
    /// Samples a second, as they arrive.
    pub rate_hz: f64,
    pub age_ms: f64,
    pub delay_ms: f64,
    pub stalls: u64,
    pub stalled: bool,
    pub samples: u64,
}

/// A change of a run, or a note about it. The first two wait for the control thread; the others act at once.
#[derive(Clone, Debug, PartialEq)]
pub enum Request {
    Set {
        node: String,
        param: String,
        value: f64,
    },
    Material {
        node: String,
        name: String,
    },
    /// Silences the output, or ends the silence.
    Mute(bool),
    /// Strength of the output, 0 to 1.
    Strength(f32),
    /// A note for the report.
    Marker(String),
    /// Ends the run.
    Stop,
}

impl Request {
    /// Whether both change the same parameter, or the texture of the same node: then the newer one counts.
    pub fn is_of_the_same(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Set { node, param, .. }, Self::Set { node: n, param: p, .. }) => node == n && param == p,
            (Self::Material { node, .. }, Self::Material { node: n, .. }) => node == n,
            _ => false,
        }
    }
}

/// Who requests a change.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct By {
    /// Name for reports.
    pub name: String,
    /// Number of the client that hears the answer; 0 for none.
    pub client: u64,
}

impl By {
    /// Somebody who sees the run, and needs no answer.
    pub fn name(name: &str) -> Self {
        Self { name: name.into(), client: 0 }
    }
}

/// A change that was carried out, or a marker.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Change {
    /// The first tick that it counts for.
    pub tick: u64,
    /// Start of that tick.
    pub at_s: f64,
    /// The command with its arguments, such as `set gain.gain 0.5`.
    pub what: String,
    /// Name of who asked for it.
    pub by: String,
}
