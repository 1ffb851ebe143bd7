//! Reports and errors of a swap.

use std::fmt;
use thiserror::Error;

/// Effects of a swap.
#[derive(Clone, Debug, PartialEq)]
pub struct SwapReport {
    /// Number of the swap of this controller, from 1.
    pub number: u64,
    /// Ids of the new graph in run order, then those of removed nodes.
    pub nodes: Vec<(String, Change)>,
    /// Live parameters that are set on kept nodes, as `node.param`.
    pub parameters: Vec<(String, f64)>,
    /// Number of crossfaded signals.
    pub crossfades: usize,
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

impl SwapReport {
    /// Whether the new graph is the old one.
    pub fn is_nothing(&self) -> bool {
        self.parameters.is_empty() && self.crossfades == 0 && self.nodes.iter().all(|n| n.1 == Change::Kept)
    }
}

impl fmt::Display for SwapReport {
    /// A line: nodes that are rebuilt, with the reason, nodes that are new, removed or set, and the number
    /// of nodes that stay.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (id, change) in &self.nodes {
            match change {
                Change::Kept => {}
                Change::Rebuilt { why, .. } => write!(f, "`{id}` rebuilt ({why}), ")?,
                Change::New => write!(f, "`{id}` new, ")?,
                Change::Removed => write!(f, "`{id}` removed, ")?,
            }
        }
        self.parameters.iter().try_for_each(|(param, value)| write!(f, "`{param}` set to {value}, "))?;
        match self.nodes.iter().filter(|n| n.1 == Change::Kept).count() {
            1 => f.write_str("1 node kept"),
            n => write!(f, "{n} nodes kept"),
        }
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
#[allow(missing_docs)]
pub enum SwapError {
    /// The tick rate \[Hz\] cannot change while the engine runs: start a new engine.
    #[error("runs at {running} ticks a second and cannot go on at {asked}: start anew")]
    TickRate { running: u32, asked: u32 },
    /// The audio rate \[Hz\] cannot change while the engine runs: start a new engine.
    #[error("runs at an audio rate of {running} Hz and cannot go on at {asked} Hz: start anew")]
    AudioRate { running: u32, asked: u32 },
    /// Earlier swaps are still under way: let the engine tick, and try again.
    #[error("earlier changes are still under way: try again")]
    Busy,
    /// There is no engine any more.
    #[error("the engine is gone")]
    Stopped,
}
