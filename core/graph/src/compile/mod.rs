//! From a declared graph to a schedule, in this order:
//!
//! 1. Look up kinds and parameters (`resolve`).
//! 2. Infer port types over the wires (`types`).
//! 3. Drop nodes that reach no sink, and order the others (`order`).
//! 4. Prepare the nodes (`prepare`) and add up latencies (`latency`).
//!
//! Each stage collects all its errors before the next starts.

mod latency;
mod order;
mod prepare;
mod resolve;
mod types;

use asperity_diagnostics::budget;
use asperity_node::{Diagnostic, Prepared, Registry};

use crate::{GraphFile, NodeDecl, Schedule};

/// Options of the compiler.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Drops nodes that reach no sink.
    pub prune: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self { prune: true }
    }
}

/// A schedule with its nodes, in the order of [`Schedule::nodes`].
pub struct Compiled {
    /// The schedule.
    pub schedule: Schedule,
    /// The prepared nodes.
    pub nodes: Vec<Prepared>,
}

impl std::fmt::Debug for Compiled {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Compiled").field("schedule", &self.schedule).finish_non_exhaustive()
    }
}

/// Checks a graph and prepares its nodes.
///
/// # Errors
/// Everything wrong with the graph, as far as it could be checked; never empty.
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
