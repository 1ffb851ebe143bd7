//! Adds up latencies along paths.

use asperity_node::Latency;

use crate::{PathLatency, ScheduledNode};

/// Most pairs of source and sink that are listed.
const MAX_PATHS: usize = 10_000;
/// Most nodes named by all paths together, without their ends.
const MAX_NAMED: usize = 100_000;

/// Greatest latency of all paths from every source to every sink it reaches. A node that
/// closes a cycle counts as a source, since its input belongs to another time. Beyond [`MAX_PATHS`]
/// pairs only the latest of each sink is listed. After [`MAX_NAMED`] named nodes, paths name only their
/// ends.
pub(super) fn paths(nodes: &[ScheduledNode]) -> Vec<PathLatency> {
    let is_source = |n: &ScheduledNode| n.closes_cycle || n.inputs.iter().all(|i| i.from.is_none());
    let sources = nodes.iter().filter(|n| is_source(n)).count();
    let all = sources * nodes.iter().filter(|n| n.sink).count() <= MAX_PATHS;
    let mut out: Vec<PathLatency> = Vec::new();
    // Index of the latest path of each sink.
    let mut listed: Vec<Option<usize>> = vec![None; nodes.len()];
    let mut named = 0;
    for (from, _) in nodes.iter().enumerate().filter(|(_, n)| is_source(n)) {
        // Nodes are in order, so one pass computes every path from here.
        let mut best: Vec<Option<(Latency, usize)>> = vec![None; nodes.len()];
        best[from] = Some((nodes[from].latency, from));
        for (i, node) in nodes.iter().enumerate().skip(from + 1).filter(|(_, n)| !n.closes_cycle) {
            for (before, _) in node.inputs.iter().filter_map(|p| p.from) {
                let Some((most, _)) = best[before] else { continue };
                let most = most + node.latency;
                if best[i].is_none_or(|(known, _)| most > known) {
                    best[i] = Some((most, before));
                }
            }
        }
        for (to, _) in nodes.iter().enumerate().filter(|(i, n)| n.sink && *i != from) {
            let Some((most, _)) = best[to] else { continue };
            let known = listed[to].filter(|_| !all);
            if known.is_some_and(|at| out[at].most >= most) {
                continue;
            }
            let through = if named < MAX_NAMED { through(&best, to) } else { vec![from, to] };
            named += through.len() - 2;
            let path = PathLatency { from, to, most, through };
            match known {
                Some(at) => {
                    named -= out[at].through.len() - 2;
                    out[at] = path;
                }
                None => {
                    listed[to] = Some(out.len());
                    out.push(path);
                }
            }
        }
    }
    out
}

/// Nodes of the latest path to a node, its source first; at least two, as no node is its own sink.
fn through(best: &[Option<(Latency, usize)>], to: usize) -> Vec<usize> {
    let (mut out, mut at) = (vec![to], to);
    while let Some((_, via)) = best[at].filter(|(_, via)| *via != at) {
        out.push(via);
        at = via;
    }
    out.reverse();
    out
}
