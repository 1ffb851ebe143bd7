//! The picture of a graph.

use asperity_graph::{GraphFile, Schedule};
use asperity_node::Shape;
use asperity_plot::{GraphPicture, GraphPictureNode, GraphPictureWire};

/// Draws a graph: nodes in the order in which they run, then those that are not built.
pub fn picture(graph: &GraphFile, schedule: &Schedule) -> GraphPicture {
    let node = |id: &str, kind: &str, note: String, dropped| GraphPictureNode {
        id: id.to_owned(),
        kind: kind.to_owned(),
        note,
        dropped,
    };
    let mut picture = GraphPicture::default();
    for n in &schedule.nodes {
        let note = if n.every > 1 { format!("every {} ticks", n.every) } else { String::new() };
        picture.nodes.push(node(&n.id, &n.kind, note, false));
    }
    picture.nodes.extend(schedule.dropped.iter().map(|d| node(&d.id, &d.kind, "not built".into(), true)));
    for node in &schedule.nodes {
        for input in &node.inputs {
            let Some((from, output)) = input.from else { continue };
            let output = &schedule.nodes[from].outputs[output];
            let label = match output.port.shape {
                Shape::Control { count: 1 } => output.port.unit.to_string(),
                Shape::Control { count } => format!("{} x{count}", output.port.unit),
                Shape::Audio { rate_hz } => {
                    format!("{} @ {} kHz", output.port.unit, f64::from(rate_hz) / 1e3)
                }
                Shape::Magnitude(l) => format!("{} bins", l.bins),
                Shape::Spectrum(l) => format!("{} bins, phase", l.bins),
            };
            picture.wires.push(GraphPictureWire {
                from: (schedule.nodes[from].id.clone(), output.name.clone()),
                to: (node.id.clone(), input.name.clone()),
                label,
                feedback: node.closes_cycle,
            });
        }
    }
    // The schedule has no wires of nodes that are not built.
    let dropped = |id: &str| schedule.dropped.iter().any(|d| d.id == id);
    for wire in graph.wires.iter().filter(|w| dropped(&w.from.node) || dropped(&w.to.node)) {
        let end = |e: &asperity_graph::Endpoint| (e.node.clone(), e.port.clone().unwrap_or_default());
        picture.wires.push(GraphPictureWire {
            from: end(&wire.from),
            to: end(&wire.to),
            label: String::new(),
            feedback: false,
        });
    }
    picture
}
