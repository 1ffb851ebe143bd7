//! One node of any kind, prepared by the compiler as its descriptor says.

use std::sync::Arc;

use asperity_graph::GraphFile;
use asperity_node::{
    Descriptor, FrameLayout, FrameRate, Input, LayoutSpec, NodeKind, Output, Prepared, Processor, RateSpec,
    Registry, Role, ShapeSpec, Status, Tick, Unit, UnitSpec,
};

/// A source that puts out nothing.
struct Still;

impl Processor for Still {
    fn process(&mut self, _: &mut Tick<'_>) -> Status {
        Status::Continue
    }

    fn reset(&mut self) {}
}

/// Parameters that a kind must be given.
fn required(kind: &str) -> Vec<(&'static str, String)> {
    let file = |p: &str| crate::graphs(p).display().to_string();
    match kind {
        "texture_network" => vec![
            ("model", file("models/surfaces/texture.onnx")),
            ("library", file("models/surfaces/materials.ron")),
            ("material", "canvas".to_owned()),
        ],
        "contact" => vec![("scene", file("../tests/data/near.ron"))],
        "file_out" => vec![("file", "unused.wav".to_owned())],
        "osc_input" => vec![("arguments", "x_mm, y_mm, z_mm, force_n".to_owned())],
        kind => crate::effects(kind),
    }
}

/// A node at 500 Hz and 48 kHz with a wire at each input and output, and with settings such as `gain=2`.
pub fn prepared(kind: &NodeKind, settings: &[&str]) -> Box<dyn Processor> {
    let (mut graph, mut registry) = (GraphFile::empty("any node"), crate::registry());
    let d = kind.descriptor();
    let params = required(&d.kind);
    let params: Vec<(&str, &str)> = params.iter().map(|(n, v)| (*n, v.as_str())).collect();
    graph.add_node("it", &d.kind, &params, "test").unwrap();
    let layout = || {
        let frame_rate = FrameRate::new(500, 1).expect("a rate");
        LayoutSpec::Is(FrameLayout { rate_hz: 2500, length: 250, bins: 101, frame_rate })
    };
    // A stroke that begins anew in every tick leaves nothing to remember.
    for Input { name, shape, unit, limited, .. } in d.inputs.iter().filter(|input| input.name != "stroke") {
        let unit = match unit {
            UnitSpec::Is(u) => u.clone(),
            UnitSpec::Of { among, .. } => among.first().cloned().unwrap_or(Unit::NEWTON),
        };
        // A rate of its own where the node takes any, so that it is not always the graph's.
        let shape = match shape {
            ShapeSpec::Like(_) | ShapeSpec::Audio(RateSpec::Graph) => ShapeSpec::Audio(RateSpec::Graph),
            ShapeSpec::Audio(_) => ShapeSpec::Audio(RateSpec::Hz(8000)),
            ShapeSpec::Control(n) => ShapeSpec::Control(*n),
            ShapeSpec::Magnitude(_) => ShapeSpec::Magnitude(layout()),
            ShapeSpec::Spectrum(_) => ShapeSpec::Spectrum(layout()),
        };
        let source = format!("source_{name}");
        let descriptor = Descriptor::new(source.clone(), "Is still.").output(Output::new("out", shape, unit));
        registry.add(Arc::new(NodeKind::new(descriptor, |_| Ok(Prepared::new(Still)))));
        graph.add_node(&source, &source, &[], "test").unwrap();
        if *limited {
            graph.add_node("guard", "limiter", &[], "test").unwrap();
            graph.add_wire(&source, "guard", "test");
        }
        graph.add_wire(if *limited { "guard" } else { &source }, &format!("it.{name}"), "test");
    }
    // A recorded force or speed is there only where the file has it.
    let there = |o: &&Output| d.role != Some(Role::Stroke) || o.name == "position";
    for output in d.outputs.iter().filter(there) {
        let probe = format!("probe {}", output.name);
        graph.add_node(&probe, "probe", &[], "test").unwrap();
        graph.add_wire(&format!("it.{}", output.name), &probe, "test");
    }
    of(graph, &registry, settings)
}

/// The node `it` of a graph, with settings.
pub fn of(mut graph: GraphFile, registry: &Registry, settings: &[&str]) -> Box<dyn Processor> {
    for setting in settings {
        graph.set(&format!("it.{setting}"), "test").expect("a setting");
    }
    let mut compiled = crate::graph::compiled(&graph, registry);
    let it = compiled.schedule.index_of("it").expect("the node");
    compiled.nodes.swap_remove(it).processor
}
