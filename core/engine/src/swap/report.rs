//! Reports and errors of a swap.

use std::fmt;
use thiserror::Error;

/// Effects of a swap.
#[derive(Clone, Debug, PartialEq)]
pub struct SwapReport {
    /// Number of the swap of this controller, from 1.
    pub number: u64,
    /// Every node of the new graph in run order, then the removed nodes of the old one.
    pub nodes: Vec<NodeChange>,
    /// Live parameters that are set on kept nodes.
    pub parameters: Vec<ParameterChange>,
    /// Number of crossfaded signals.
    pub crossfades: usize,
}

/// Change of a node.
#[derive(Clone, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub struct NodeChange {
    pub id: String,
    pub kind: String,
    pub change: Change,
}

/// Change of a node.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Change {
    /// The node continues unchanged.
    Kept,
    /// Another instance replaces it.
    Rebuilt {
        /// Reason.
        why: String,
        /// Whether it gets the old node's state. [`Finished::anew`] says whether it could use it.
        adopts: bool,
    },
    /// There was no node of this id and kind.
    New,
    /// The node is removed.
    Removed,
}

/// A live parameter that is set.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)]
pub struct ParameterChange {
    pub node: String,
    pub param: String,
    pub value: f64,
}

impl SwapReport {
    /// Whether the new graph is the old one.
    pub fn is_nothing(&self) -> bool {
        self.parameters.is_empty()
            && self.crossfades == 0
            && self.nodes.iter().all(|n| n.change == Change::Kept)
    }
}

impl fmt::Display for SwapReport {
    /// A line: what is rebuilt and why, what is new, removed and set, and how many nodes stay.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut parts = Vec::new();
        for node in &self.nodes {
            match &node.change {
                Change::Kept => {}
                Change::Rebuilt { why, .. } => parts.push(format!("`{}` rebuilt ({why})", node.id)),
                Change::New => parts.push(format!("`{}` new", node.id)),
                Change::Removed => parts.push(format!("`{}` removed", node.id)),
            }
        }
        parts.extend(self.parameters.iter().map(|p| format!("`{}.{}` set to {}", p.node, p.param, p.value)));
        let kept = self.nodes.iter().filter(|n| n.change == Change::Kept).count();
        match kept {
            1 => parts.push("1 node kept".into()),
            n => parts.push(format!("{n} nodes kept")),
        }
        f.write_str(&parts.join(", "))
    }
}

/// A swap that is over: the engine runs the new graph alone.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finished {
    /// Which one: [`SwapReport::number`].
    pub number: u64,
    /// The tick in which the engine took over.
    pub tick: u64,
    /// Nodes that were rebuilt and began anew, since the state of the one before meant nothing to them.
    pub anew: Vec<String>,
}

/// Why a graph was not sent.
#[derive(Clone, Copy, Debug, Eq, Error, PartialEq)]
#[non_exhaustive]
pub enum SwapError {
    /// The tick rate cannot change while the engine runs: start a new engine.
    #[error("runs at {running} ticks a second and cannot go on at {asked}: start anew")]
    TickRate {
        /// Ticks a second now.
        running: u32,
        /// Ticks a second of the new graph.
        asked: u32,
    },
    /// The audio rate cannot change while the engine runs: start a new engine.
    #[error("runs at an audio rate of {running} Hz and cannot go on at {asked} Hz: start anew")]
    AudioRate {
        /// Samples a second now.
        running: u32,
        /// Samples a second of the new graph.
        asked: u32,
    },
    /// Earlier swaps are still under way: let the engine tick, and try again.
    #[error("earlier changes are still under way: try again")]
    Busy,
    /// There is no engine any more.
    #[error("the engine is gone")]
    Stopped,
}

/// Why a parameter was not set.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum ParameterError {
    /// No node has this id.
    #[error("there is no node `{0}`")]
    NoNode(String),
    /// The node has no such parameter that may change while it runs: change the graph instead.
    #[error("`{node}.{param}` cannot change while the node runs{}", others(live))]
    NotLive {
        /// The node.
        node: String,
        /// The parameter.
        param: String,
        /// Those that may change.
        live: Vec<String>,
    },
    /// The parameter does not take this value.
    #[error("`{param}` cannot be {value}: it takes {takes}")]
    OutOfRange {
        /// The parameter.
        param: String,
        /// Requested value.
        value: f64,
        /// Allowed values, in words.
        takes: String,
    },
    /// Too much waits for the next tick: try again.
    #[error("too much waits for the next tick: try again")]
    Busy,
    /// There is no engine any more.
    #[error("the engine is gone")]
    Stopped,
}

/// The parameters that may change, for an error.
fn others(live: &[String]) -> String {
    if live.is_empty() { String::new() } else { format!("; what can: {}", live.join(", ")) }
}
