//! From a declared graph to a schedule.
//!
//! In order: kinds and parameters are looked up (`resolve`), types settle over the wires (`types`), what
//! leads nowhere is dropped and the rest is put in order (`order`), nodes are prepared, latencies add up
//! (`latency`). Each stage gathers all errors it can before the next begins.

mod latency;
mod order;
mod prepare;
mod resolve;
mod types;

use asperity_diagnostics::budget;
use asperity_node::{Diagnostic, Processor, Registry};

use crate::{GraphFile, NodeDecl, Schedule};

/// How to compile.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Drop nodes from which no sink is reached.
    pub prune: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self { prune: true }
    }
}

/// A schedule and its nodes, in the order of [`Schedule::nodes`].
pub struct Compiled {
    /// What runs when.
    pub schedule: Schedule,
    /// The prepared nodes.
    pub processors: Vec<Box<dyn Processor>>,
}

impl std::fmt::Debug for Compiled {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Compiled").field("schedule", &self.schedule).finish_non_exhaustive()
    }
}

/// Checks a graph and prepares its nodes.
///
/// # Errors
/// Everything that is wrong with the graph, as far as it could be looked at; never empty.
pub fn compile(
    graph: &GraphFile,
    registry: &Registry,
    options: Options,
) -> Result<Compiled, Vec<Diagnostic>> {
    let resolved = resolve::resolve(graph, registry)?;
    let typed = types::settle(graph, &resolved, registry)?;
    types::check_every(graph, &resolved, &typed)?;
    let ordered = order::order(graph, &resolved, &typed, options)?;
    prepare::prepare(graph, resolved, &typed, &ordered)
}

/// Refuses a graph at the first node for which memory does not suffice; `bytes` more are needed.
fn within_budget(node: &NodeDecl, bytes: u64) -> Result<(), Vec<Diagnostic>> {
    budget::needs(bytes).map_err(|e| vec![e.at_place(&node.place)])
}
