//! From a stimulus to a graph that plays it.

use std::path::PathBuf;

use asperity_diagnostics::Place;
use asperity_diagnostics::ron::{Kind, Value};
use asperity_graph::GraphFile;
use asperity_node::{Registry, Role};
use asperity_study::StimulusKind;

use crate::failure::{Failure, wrong};
use crate::kinds::Kinds;
use crate::load::{self, GraphArgs, Loaded};

/// Name that the hand has in every stimulus, so that it goes on when one replaces another.
pub const HAND: &str = "hand of the study";
/// Gain before the actuator's own nodes: silence and level matching.
const GAIN: &str = "gain of the study";
/// The probe that records the position of the stylus.
pub const POSITION: &str = "position of the study";
/// Origin of added nodes, in errors.
const ORIGIN: &str = "asperity study";

/// Loads a graph or scene with a stimulus's settings. `vary`: the varied parameter with its level. `args`
/// says which hand or recorded stroke moves the stylus. A gain of 0 is silence, also of forces.
pub fn load(
    (file, set): (&Value, &[(asperity_diagnostics::ron::Key, Value)]),
    vary: Option<(&str, f64)>,
    gain: f64,
    args: &GraphArgs,
    kinds: &mut Kinds,
) -> Result<Loaded, Failure> {
    let args = GraphArgs { graph: found(file)?, ..args.clone() };
    let (mut graph, scene) = load::read(&args, kinds)?;
    for (key, value) in set {
        let place = Place { source: value.source().clone(), span: key.span };
        graph.set_value(&key.name, value.clone(), place, None)?;
    }
    if let Some((target, level)) = vary {
        let place = file.place();
        graph.set_value(target, Value::made(Kind::Float(level), &place), place, None)?;
    }
    let registry = kinds.registry(Some(&graph))?;
    if gain == 0.0 {
        graph = load::without_force(&graph, &registry);
    }
    name_hand(&mut graph, &registry, file)?;
    scale(&mut graph, &registry, gain)?;
    load::compile(&args, kinds, graph, scene)
}

/// Path of a stimulus's file: beside the experiment, or a shipped one.
pub fn found(file: &Value) -> Result<PathBuf, Failure> {
    let named = std::path::Path::new(file.text()?);
    match crate::shipped::file(named).filter(|_| !named.exists()) {
        Some(shipped) => Ok(shipped),
        None => Ok(file.path()?),
    }
}

/// Graph and settings of a stimulus; `None` where nothing plays.
pub fn graph_of(kind: &StimulusKind) -> Option<(&Value, &[(asperity_diagnostics::ron::Key, Value)])> {
    match kind {
        StimulusKind::Graph { file, set } => Some((file, set)),
        _ => None,
    }
}

/// Gives the node that moves the stylus its common name, and records its position.
fn name_hand(graph: &mut GraphFile, registry: &Registry, file: &Value) -> Result<(), Failure> {
    let moves = |kind: &str| matches!(registry.role(kind), Some(Role::Stroke | Role::Hand));
    let found: Vec<usize> = (0..graph.nodes.len()).filter(|i| moves(&graph.nodes[*i].kind)).collect();
    let &[at] = found.as_slice() else {
        let what = format!("one node moves the stylus of a stimulus; here are {}", found.len());
        return Err(file.error(what).into());
    };
    let id = std::mem::replace(&mut graph.nodes[at].id, HAND.to_owned());
    for wire in &mut graph.wires {
        for end in [&mut wire.from, &mut wire.to] {
            if end.node == id {
                HAND.clone_into(&mut end.node);
            }
        }
    }
    // The host reads it; no file of this name is written.
    graph.add_node(POSITION, "probe", &[("file", "\"log.npy\"")], ORIGIN)?;
    graph.add_wire(&format!("{HAND}.position"), POSITION, ORIGIN);
    Ok(())
}

/// Inserts a gain before the inverse and limiter of each output.
fn scale(graph: &mut GraphFile, registry: &Registry, gain: f64) -> Result<(), Failure> {
    let role = |graph: &GraphFile, id: &str| graph.node(id).and_then(|node| registry.role(&node.kind));
    let outs = graph.nodes.iter().filter(|node| registry.role(&node.kind) == Some(Role::AudioOutput));
    let outs: Vec<String> = outs.map(|node| node.id.clone()).collect();
    for (number, out) in outs.iter().enumerate() {
        let mut first = out.clone();
        let wire = loop {
            let Some(at) = graph.wires.iter().position(|wire| wire.to.node == first) else {
                return Err(wrong(graph.source.path(), format!("`{first}` has no input"), "wire it"));
            };
            let from = &graph.wires[at].from.node;
            match role(graph, from) {
                Some(Role::ActuatorInverse | Role::Limiter) => first = from.clone(),
                _ => break at,
            }
        };
        let id = if number == 0 { GAIN.to_owned() } else { format!("{GAIN} {number}") };
        graph.add_node(&id, "gain", &[("gain", &format!("{gain:?}"))], ORIGIN)?;
        let port = graph.wires[wire].to.port.clone();
        graph.wires[wire].to.node.clone_from(&id);
        graph.wires[wire].to.port = None;
        let to = port.map_or(first.clone(), |port| format!("{first}.{port}"));
        graph.add_wire(&id, &to, ORIGIN);
    }
    Ok(())
}
