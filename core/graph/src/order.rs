//! The order of a tick, and when nodes may sleep: for the compiler, and for an engine between two graphs.

use std::collections::BTreeSet;

use crate::Step;

/// Sets of gates: a node is wanted while all gates of one set are open. No set for a node that always runs.
pub type GateSets = Vec<Vec<usize>>;

/// A node with more sets of gates than this always runs.
const MAX_SETS: usize = 64;
/// Most gates in a set; others are ignored, so that a node may run although nobody reads it.
const MAX_GATES: usize = 64;

/// Gate sets of a node whose readers have these, each with the gate that the reader is for it, if any.
///
/// A node is wanted when a reader is wanted. Through a gated input the gate must be open too. A superset of
/// another set adds nothing. So a gate is never in a set of a node on which its own question depends: such a
/// node is wanted whenever the gate is, which includes the set with the gate.
pub fn gate_sets<'a>(readers: impl IntoIterator<Item = (&'a GateSets, Option<usize>)>) -> GateSets {
    let always = vec![Vec::new()];
    let within = |a: &[usize], b: &[usize]| a.iter().all(|gate| b.contains(gate));
    let mut all = GateSets::new();
    for (sets, gate) in readers {
        for set in if sets.is_empty() { &always } else { sets } {
            let mut set = set.clone();
            set.extend(gate.filter(|gate| !set.contains(gate) && set.len() < MAX_GATES));
            set.sort_unstable();
            if !all.iter().any(|known| within(known, &set)) {
                all.retain(|known| !within(&set, known));
                all.push(set);
            }
        }
    }
    if all.len() > MAX_SETS || all.iter().any(Vec::is_empty) { GateSets::new() } else { all }
}

/// A node as the order of a tick sees it.
#[derive(Clone, Debug, Default)]
#[allow(missing_docs)]
pub struct Waiting {
    /// Whether it takes part in the tick.
    pub runs: bool,
    /// For each wire its own input and the node that it comes from.
    pub reads: Vec<(usize, usize)>,
    /// The gated input, if it is a gate.
    pub gate: Option<usize>,
    pub closes_cycle: bool,
    pub gate_sets: GateSets,
}

/// Steps of a tick, each after those that it waits for. None where they wait for each other.
pub fn steps(nodes: &[Waiting]) -> Option<Vec<Step>> {
    // Vertices 0..n are nodes, n..2n the questions to gates.
    let n = nodes.len();
    let mut before = vec![BTreeSet::new(); 2 * n];
    for (i, node) in nodes.iter().enumerate() {
        for &(input, from) in &node.reads {
            if !node.closes_cycle {
                before[i].insert(from);
            }
            if node.gate != Some(input) {
                before[n + i].insert(from);
            }
        }
        for gate in node.gate_sets.iter().flatten().filter(|gate| **gate != i) {
            before[i].insert(n + gate);
            before[n + i].insert(n + gate);
        }
        before[i].insert(n + i);
    }
    let wanted = |v: usize| nodes[v % n].runs && (v < n || nodes[v - n].gate.is_some());
    let order = topological_order(&before, wanted);
    let complete = order.len() == (0..2 * n).filter(|v| wanted(*v)).count();
    let absorb = (0..n).filter(|i| nodes[*i].runs && nodes[*i].closes_cycle).map(Step::Absorb);
    let order = order.into_iter().map(|v| if v < n { Step::Process(v) } else { Step::Wants(v - n) });
    complete.then(|| order.chain(absorb).collect())
}

/// Orders the wanted vertices so that each comes after those `before` it. Of several that may come next, the
/// lowest number comes first. Vertices on a cycle, and all after them, are left out.
pub(crate) fn topological_order(before: &[BTreeSet<usize>], wanted: impl Fn(usize) -> bool) -> Vec<usize> {
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
