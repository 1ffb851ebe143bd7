//! From a stimulus to a graph that plays it.

use std::collections::BTreeSet;
use std::path::PathBuf;

use asperity_diagnostics::Place;
use asperity_diagnostics::ron::{Kind, Value};
use asperity_graph::{GraphFile, NodeDecl};
use asperity_hand::device_of;
use asperity_node::{Registry, Role};
use asperity_study::{Experiment, StimulusKind};

use crate::failure::{Failure, wrong};
use crate::kinds::Kinds;
use crate::load::{self, GraphArgs, Loaded};

/// Name that the hand has in every stimulus, so that it goes on when one replaces another.
pub const HAND: &str = "hand of the study";
/// Name of the node that pushes back, in every stimulus: its device goes on, too.
pub const PUSH: &str = "push of the study";
/// Gain before the actuator's own nodes: silence and level matching.
const GAIN: &str = "gain of the study";
/// A floor without stiffness.
const NO_PUSH: &str = "no push of the study";
/// Prefix of the probes that record the hand's outputs.
pub const INPUT: &str = "input of the study: ";
/// Origin of added nodes, in errors.
const ORIGIN: &str = "asperity study";

/// Loads a graph or scene with a stimulus's settings. `vary`: the varied parameter with its level. `args`
/// says which hand or recorded stroke moves the stylus. `push`: the node that pushes back in a study. A gain
/// of 0 is silence, also of forces.
pub fn load(
    (file, set): (&Value, &[(asperity_diagnostics::ron::Key, Value)]),
    vary: Option<(&str, f64)>,
    gain: f64,
    args: &GraphArgs,
    push: Option<&NodeDecl>,
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
    name_hand(&mut graph, &registry, file)?;
    push_back(&mut graph, &registry, gain > 0.0, push)?;
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

/// The node that pushes back with the device which moves the stylus, in the first stimulus that has one.
/// Returns also the names of stimuli that push back with another device: their forces are left out.
pub fn push(
    experiment: &Experiment,
    args: &GraphArgs,
    kinds: &mut Kinds,
) -> Result<(Option<NodeDecl>, BTreeSet<String>), Failure> {
    let (mut found, mut others, mut done) = (None, BTreeSet::new(), BTreeSet::new());
    for (number, part) in experiment.parts.iter().enumerate() {
        for trial in experiment.trials_of(number, 1) {
            for at in trial.places.iter().chain(&part.reference) {
                let kind = experiment.shown(&trial, *at);
                let Some((file, _)) =
                    graph_of(&kind).filter(|(file, _)| done.insert(format!("{:?}", file.kind())))
                else {
                    continue;
                };
                let args = GraphArgs { graph: self::found(file)?, ..args.clone() };
                let (graph, _) = load::read(&args, kinds)?;
                let registry = kinds.registry(Some(&graph))?;
                let forces = |node: &&NodeDecl| registry.role(&node.kind) == Some(Role::Force);
                match graph.nodes.iter().find(|node| forces(node) && moves(&graph, node)) {
                    Some(node) => {
                        found = found.or_else(|| Some(NodeDecl { id: PUSH.into(), ..node.clone() }))
                    }
                    None if graph.nodes.iter().any(|node| forces(&node)) => {
                        others.insert(experiment.stimuli[*at].name.clone());
                    }
                    None => (),
                }
            }
        }
    }
    Ok((found, others))
}

/// Whether the device of a force node also moves the stylus.
fn moves(graph: &GraphFile, force: &NodeDecl) -> bool {
    device_of(&force.kind).is_some_and(|device| graph.nodes.iter().any(|node| node.kind == device.input()))
}

/// Gives the node that pushes back its common name. Without one, or in silence, `push` pushes with nothing,
/// so that the device goes on.
fn push_back(
    graph: &mut GraphFile,
    registry: &Registry,
    sounds: bool,
    push: Option<&NodeDecl>,
) -> Result<(), Failure> {
    let forces = |node: &NodeDecl| registry.role(&node.kind) == Some(Role::Force);
    let own = graph.nodes.iter().position(|node| sounds && forces(node) && moves(graph, node));
    if let Some(at) = own {
        rename(graph, at, PUSH);
    }
    graph.nodes.retain(|node| node.id == PUSH || !forces(node));
    let ids: BTreeSet<String> = graph.nodes.iter().map(|node| node.id.clone()).collect();
    graph.wires.retain(|wire| ids.contains(&wire.to.node));
    if let (None, Some(push)) = (own, push) {
        graph.nodes.push(push.clone());
        graph.add_node(NO_PUSH, "virtual_floor", &[("stiffness_n_per_mm", "0.0")], ORIGIN)?;
        graph.add_wire(&format!("{HAND}.position"), NO_PUSH, ORIGIN);
        for port in ["plane", "normal", "stiffness"] {
            graph.add_wire(&format!("{NO_PUSH}.{port}"), &format!("{PUSH}.{port}"), ORIGIN);
        }
    }
    Ok(())
}

/// Gives a node another name, also in its wires.
fn rename(graph: &mut GraphFile, at: usize, name: &str) {
    let id = std::mem::replace(&mut graph.nodes[at].id, name.to_owned());
    for wire in &mut graph.wires {
        for end in [&mut wire.from, &mut wire.to] {
            if end.node == id {
                name.clone_into(&mut end.node);
            }
        }
    }
}

/// Gives the node that moves the stylus its common name, and records its outputs.
fn name_hand(graph: &mut GraphFile, registry: &Registry, file: &Value) -> Result<(), Failure> {
    let moves = |kind: &str| matches!(registry.role(kind), Some(Role::Stroke | Role::Hand));
    let found: Vec<usize> = (0..graph.nodes.len()).filter(|i| moves(&graph.nodes[*i].kind)).collect();
    let &[at] = found.as_slice() else {
        let what = format!("one node moves the stylus of a stimulus; here are {}", found.len());
        return Err(file.error(what).into());
    };
    rename(graph, at, HAND);
    let kind = &graph.nodes[at].kind;
    // Further outputs of a recorded stroke need columns that its file may lack.
    let most = if registry.role(kind) == Some(Role::Hand) { usize::MAX } else { 1 };
    let outputs: Vec<String> = registry.get(kind).map_or(Vec::new(), |kind| {
        kind.descriptor().outputs.iter().take(most).map(|output| output.name.to_string()).collect()
    });
    for output in outputs {
        let probe = format!("{INPUT}{output}");
        // The host reads it; no file of this name is written.
        graph.add_node(&probe, "probe", &[("file", "\"log.npy\"")], ORIGIN)?;
        graph.add_wire(&format!("{HAND}.{output}"), &probe, ORIGIN);
    }
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
