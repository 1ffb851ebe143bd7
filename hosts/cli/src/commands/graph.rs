//! `asperity graph`: the graph as a picture.

use std::process::ExitCode;

use asperity_diagnostics::Diagnostic;
use asperity_graph::{GraphFile, Schedule};
use asperity_node::Shape;
use asperity_plot::{Picture, PictureNode, PictureWire};

use crate::args::Graph;
use crate::failure::{Failure, print};
use crate::kinds::Kinds;
use crate::{load, output};

/// Runs the command.
pub fn run(args: &Graph) -> Result<ExitCode, Failure> {
    let mut kinds = Kinds::new(&args.graph.plugins.plugin).looking();
    let graph = load::read(&args.graph, &mut kinds)?;
    let registry = kinds.registry(Some(&graph))?;
    let schedule = kinds.judge(load::compiled(&graph, &args.graph, &registry))?.schedule;
    let svg = output::resolved(&args.svg);
    let mut read = load::files_read(&args.graph, &schedule);
    read.extend(kinds.files().iter().map(|path| (path.clone(), "the graph, as a plugin,".to_owned())));
    if let Some((_, who)) = read.iter().find(|(path, _)| output::resolved(path) == svg) {
        return Err(Diagnostic::new(format!("{who} reads this file, and it would be overwritten"))
            .in_file(&args.svg)
            .help("name another file")
            .into());
    }
    output::write_text(&args.svg, &picture(&graph, &schedule).to_svg())?;
    print(&format!("wrote {}\n", args.svg.display()))?;
    Ok(ExitCode::SUCCESS)
}

fn picture(graph: &GraphFile, schedule: &Schedule) -> Picture {
    let mut picture = Picture::default();
    for node in &schedule.nodes {
        let note = if node.every > 1 { format!("every {} ticks", node.every) } else { String::new() };
        picture.nodes.push(PictureNode {
            id: node.id.clone(),
            kind: node.kind.clone(),
            note,
            dropped: false,
        });
    }
    for d in &schedule.dropped {
        picture.nodes.push(PictureNode {
            id: d.id.clone(),
            kind: d.kind.clone(),
            note: "not built".into(),
            dropped: true,
        });
    }
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
            picture.wires.push(PictureWire {
                from: (schedule.nodes[from].id.clone(), output.name.clone()),
                to: (node.id.clone(), input.name.clone()),
                label,
                feedback: node.closes_cycle,
            });
        }
    }
    // Wires of nodes that are not built are known by name alone.
    let dropped = |id: &str| schedule.dropped.iter().any(|d| d.id == id);
    for wire in graph.wires.iter().filter(|w| dropped(&w.from.node) || dropped(&w.to.node)) {
        let end = |e: &asperity_graph::Endpoint| (e.node.clone(), e.port.clone().unwrap_or_default());
        picture.wires.push(PictureWire {
            from: end(&wire.from),
            to: end(&wire.to),
            label: String::new(),
            feedback: false,
        });
    }
    picture
}
