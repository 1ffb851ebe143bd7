//! Latency of a graph from the hand to the actuator, as items.
//!
//! It is the time from a position of the hand to the sound of its sample. The response lag of a texture to
//! a change of speed is another figure: its windows reach into the past, and the latencies that nodes
//! declare balance this with samples that they emit early. So only nodes that delay samples count here.

use asperity_graph::Schedule;
use asperity_node::{Latency, Role};

/// Nodes on the path of most delay to an audio output, each with its milliseconds.
pub(crate) fn of_graph(schedule: &Schedule) -> Vec<(String, f64)> {
    let late = |i: usize| schedule.nodes[i].latency.max(Latency::ZERO).ms();
    // Nodes are in the order they run. A wire that closes a cycle carries the value of the tick before, and
    // is left out.
    let mut sums = vec![0.0; schedule.nodes.len()];
    let mut before = vec![None; schedule.nodes.len()];
    for (i, node) in schedule.nodes.iter().enumerate() {
        let sources = node.inputs.iter().filter_map(|input| Some(input.from?.0)).filter(|&from| from < i);
        before[i] = sources.max_by(|&a: &usize, &b: &usize| f64::total_cmp(&sums[a], &sums[b]));
        sums[i] = before[i].map_or(0.0, |from: usize| sums[from]) + late(i);
    }
    let sinks = schedule.with_role(Role::AudioOutput).map(|(i, _)| i);
    let Some(mut at) = sinks.max_by(|&a, &b| f64::total_cmp(&sums[a], &sums[b])) else { return Vec::new() };
    let mut items = Vec::new();
    loop {
        if late(at) > 0.0 {
            let node = &schedule.nodes[at];
            items.push((format!("graph: `{}` ({})", node.id, node.kind), late(at)));
        }
        match before[at] {
            Some(from) => at = from,
            None => break,
        }
    }
    items.reverse();
    items
}
