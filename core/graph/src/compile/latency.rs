//! Latencies add up along paths.

use asperity_node::Latency;

use crate::{PathLatency, ScheduledNode};

/// For every sink and every source that reaches it, the least and greatest latency of any path. Wires into a
/// node that closes a cycle do not count: they are of another time.
pub(super) fn paths(nodes: &[ScheduledNode]) -> Vec<PathLatency> {
    let is_source = |n: &ScheduledNode| n.inputs.iter().all(|i| i.from.is_none());
    let mut out = Vec::new();
    for (from, _) in nodes.iter().enumerate().filter(|(_, n)| is_source(n)) {
        // Nodes are in order, so one pass over them settles every path from here.
        let mut best: Vec<Option<(Latency, Latency, usize)>> = vec![None; nodes.len()];
        best[from] = Some((nodes[from].latency, nodes[from].latency, from));
        for (i, node) in nodes.iter().enumerate().skip(from + 1).filter(|(_, n)| !n.closes_cycle) {
            for (before, _) in node.inputs.iter().filter_map(|p| p.from) {
                let Some((least, most, _)) = best[before] else { continue };
                let (least, most) = (least + node.latency, most + node.latency);
                best[i] = Some(match best[i] {
                    None => (least, most, before),
                    Some((l, m, via)) => (l.min(least), m.max(most), if most > m { before } else { via }),
                });
            }
        }
        for (to, _) in nodes.iter().enumerate().filter(|(i, n)| n.sink && *i != from && best[*i].is_some()) {
            let Some((least, most, _)) = best[to] else { continue };
            let mut through = vec![to];
            let mut at = to;
            while let Some((_, _, via)) = best[at].filter(|(_, _, via)| *via != at) {
                through.push(via);
                at = via;
            }
            through.reverse();
            out.push(PathLatency { from, to, least, most, through });
        }
    }
    out
}
