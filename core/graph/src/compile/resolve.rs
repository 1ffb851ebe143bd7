//! Resolves kinds, parameters, ports and wires by name.

use std::collections::HashMap;
use std::sync::Arc;

use asperity_diagnostics::one_of;
use asperity_node::random::seed_of;
use asperity_node::{Config, Diagnostic, NodeKind, Params, Ports, Registry};

use super::within_budget;
use crate::{Endpoint, GraphFile, params};

/// A graph with every name resolved.
pub(super) struct Resolved {
    pub(super) nodes: Vec<ResolvedNode>,
    /// In the order of the file.
    pub(super) wires: Vec<Wire>,
}

/// A node with its kind, parameters and ports.
pub(super) struct ResolvedNode {
    pub(super) kind: Arc<NodeKind>,
    pub(super) params: Params,
    pub(super) ports: Ports,
    pub(super) seed: u64,
    /// Wire that ends at each input.
    pub(super) input_wires: Vec<Option<usize>>,
}

/// A wire by indices.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wire {
    pub(super) from: (usize, usize),
    pub(super) to: (usize, usize),
}

impl ResolvedNode {
    pub(super) fn config<'a>(&'a self, graph: &'a GraphFile, index: usize) -> Config<'a> {
        let decl = &graph.nodes[index];
        Config {
            id: &decl.id,
            params: &self.params,
            tick_hz: graph.tick_hz,
            every: decl.every,
            audio_hz: graph.audio_hz,
            seed: self.seed,
        }
    }
}

pub(super) fn resolve(graph: &GraphFile, registry: &Registry) -> Result<Resolved, Vec<Diagnostic>> {
    let mut errors = Vec::new();
    let mut nodes: Vec<Option<ResolvedNode>> = Vec::new();
    for (i, decl) in graph.nodes.iter().enumerate() {
        within_budget(decl, 0)?;
        nodes.push(node(graph, i, registry, &mut errors));
    }
    let mut by_id: HashMap<&str, usize> = HashMap::new();
    for (i, n) in graph.nodes.iter().enumerate() {
        // A file cannot have two nodes of one id; a graph made by a program could.
        if by_id.insert(&n.id, i).is_some() {
            let message = format!("two nodes are called `{}`", n.id);
            errors.push(Diagnostic::new(message).at_place(&n.place));
        }
    }
    let mut wires = Vec::new();
    let mut taken: HashMap<(usize, usize), usize> = HashMap::new();
    for (w, decl) in graph.wires.iter().enumerate() {
        let from = end(graph, &nodes, &by_id, &decl.from, Direction::Output, &mut errors);
        let to = end(graph, &nodes, &by_id, &decl.to, Direction::Input, &mut errors);
        let (Some(from), Some(to)) = (from, to) else { continue };
        if let Some(first) = taken.insert(to, w) {
            let (here, there) = (&decl.to.place, &graph.wires[first].to.place);
            errors.push(
                Diagnostic::new(format!("two wires end at `{}`", name_of(graph, &nodes, to)))
                    .at_place(here)
                    .label("the second")
                    .related(&there.source, there.span, "the first")
                    .help("add signals with a `mix` node"),
            );
            continue;
        }
        wires.push(Wire { from, to });
    }
    if !errors.is_empty() {
        return Err(errors);
    }
    let mut nodes: Vec<ResolvedNode> = nodes.into_iter().flatten().collect();
    for (w, wire) in wires.iter().enumerate() {
        nodes[wire.to.0].input_wires[wire.to.1] = Some(w);
    }
    Ok(Resolved { nodes, wires })
}

fn node(
    graph: &GraphFile,
    index: usize,
    registry: &Registry,
    errors: &mut Vec<Diagnostic>,
) -> Option<ResolvedNode> {
    let decl = &graph.nodes[index];
    let Some(kind) = registry.get(&decl.kind) else {
        let error = Diagnostic::new(format!("there is no node kind `{}`", decl.kind))
            .at_place(&decl.kind_place)
            .label("unknown kind");
        tell(errors, error, || one_of(&decl.kind, registry.names()));
        return None;
    };
    let before = errors.len();
    let params = params::check(decl, kind.descriptor(), registry, errors);
    if errors.len() > before {
        return None;
    }
    let seed = seed_of(graph.seed, decl.seeded_as.as_ref().unwrap_or(&decl.id));
    let ports = Ports { inputs: Vec::new(), outputs: Vec::new() };
    let mut node = ResolvedNode { kind: kind.clone(), params, ports, seed, input_wires: Vec::new() };
    match kind.ports(&node.config(graph, index)) {
        Ok(ports) => node.ports = ports,
        Err(e) => {
            errors.push(e);
            return None;
        }
    }
    node.input_wires = vec![None; node.ports.inputs.len()];
    Some(node)
}

/// Most errors with a suggested name: each wrong name is compared with each right one.
const MAX_GUESSES: usize = 100;

/// Adds an error, with a suggestion as its help.
fn tell(errors: &mut Vec<Diagnostic>, error: Diagnostic, guess: impl FnOnce() -> String) {
    errors.push(if errors.len() < MAX_GUESSES { error.help(guess()) } else { error });
}

#[derive(Clone, Copy, PartialEq)]
enum Direction {
    Input,
    Output,
}

fn end(
    graph: &GraphFile,
    nodes: &[Option<ResolvedNode>],
    by_id: &HashMap<&str, usize>,
    end: &Endpoint,
    direction: Direction,
    errors: &mut Vec<Diagnostic>,
) -> Option<(usize, usize)> {
    let place = &end.place;
    let Some(&index) = by_id.get(end.node.as_str()) else {
        let message = format!("there is no node `{}`", end.node);
        let error = Diagnostic::new(message).at_place(place);
        tell(errors, error, || one_of(&end.node, graph.nodes.iter().map(|n| n.id.as_str())));
        return None;
    };
    let mut fail = |message: String, help: &dyn Fn() -> String| {
        tell(errors, Diagnostic::new(message).at_place(place), help);
    };
    // A node that could not be resolved has its own error already.
    let ports = &nodes[index].as_ref()?.ports;
    // A wire without a port name means the only required input, or the only output that is not secondary.
    let ins: Vec<(&str, bool)> = ports.inputs.iter().map(|p| (p.name.as_ref(), !p.optional)).collect();
    let outs: Vec<(&str, bool)> = ports.outputs.iter().map(|p| (p.name.as_ref(), !p.secondary)).collect();
    let (these, others, word, other) = match direction {
        Direction::Input => (ins, outs, "input", "output"),
        Direction::Output => (outs, ins, "output", "input"),
    };
    let Some(port) = &end.port else {
        let mut main = (0..these.len()).filter(|&i| these[i].1 || these.len() == 1);
        if let (Some(only), None) = (main.next(), main.next()) {
            return Some((index, only));
        }
        let all: Vec<String> = these.iter().map(|(n, _)| format!("`{}.{n}`", end.node)).collect();
        let help =
            || if all.is_empty() { "it has none".into() } else { format!("one of {}", all.join(", ")) };
        fail(format!("`{}` has {} {word}s; name one", end.node, these.len()), &help);
        return None;
    };
    let at = these.iter().position(|(n, _)| n == port);
    if at.is_none() && others.iter().any(|(n, _)| n == port) {
        let help = || "a wire goes from an output to an input".to_owned();
        fail(format!("`{}.{port}` is an {other}, not an {word}", end.node), &help);
    } else if at.is_none() {
        let kind = &graph.nodes[index].kind;
        let help = || one_of(port, these.iter().map(|(n, _)| *n));
        fail(format!("`{kind}` has no {word} `{port}`"), &help);
    }
    Some((index, at?))
}

fn name_of(graph: &GraphFile, nodes: &[Option<ResolvedNode>], (node, input): (usize, usize)) -> String {
    let port = nodes[node].as_ref().and_then(|n| n.ports.inputs.get(input)).map_or("", |p| p.name.as_ref());
    format!("{}.{port}", graph.nodes[node].id)
}
