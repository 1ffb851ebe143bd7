//! Knobs: the parts of a graph that a trade-off varies.

use std::fmt;

use asperity_diagnostics::ron::{Key, Kind, Value};
use asperity_diagnostics::{Diagnostic, Place, one_of};
use asperity_graph::{EVERY, Endpoint, GraphFile, NodeDecl, Setting};
use asperity_node::{ParamKind, Registry, Role, ShapeSpec};

/// The part of a graph that a knob sets.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Target {
    /// `tick_hz`, `audio_hz`.
    Graph(String),
    /// `NODE.PARAM` or `NODE.every`. `*.PARAM` is for every node whose kind has it, `*.every` for the nodes
    /// without audio ports.
    Param { node: String, param: String },
    /// `NODE`: another node in its place, or none.
    Node(String),
    /// `guards`: whether outputs of nodes are checked for NaN and infinities.
    Guards,
}

/// A knob, and its place in the trade-off file.
#[derive(Clone, Debug)]
pub(crate) struct Knob {
    target: Target,
    place: Place,
}

impl fmt::Display for Knob {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.target {
            Target::Graph(name) => f.write_str(name),
            Target::Param { node, param } => write!(f, "{node}.{param}"),
            Target::Node(id) => f.write_str(id),
            Target::Guards => f.write_str("guards"),
        }
    }
}

/// A graph that knobs change.
#[derive(Clone, Debug)]
pub(crate) struct Turned {
    pub graph: GraphFile,
    /// Whether outputs of nodes are checked.
    pub guards: bool,
}

/// Value that removes a node: its input is wired to where its output went.
const BYPASSED: &str = "bypassed";
/// Value that leaves a node as it is.
const KEPT: &str = "kept";
/// Origin of what knobs add, for messages.
const ORIGIN: &str = "the trade-off";

impl Knob {
    /// Reads `tick_hz`, `audio_hz`, `guards`, `NODE.PARAM`, `NODE.every`, `*.PARAM`, `*.every` or `NODE`.
    ///
    /// # Errors
    /// An empty part.
    pub(crate) fn parse(text: &str, place: Place) -> Result<Self, Diagnostic> {
        let target = match text.split_once('.') {
            Some((node, param)) if !node.is_empty() && !param.is_empty() => {
                Target::Param { node: node.to_owned(), param: param.to_owned() }
            }
            None if matches!(text, "tick_hz" | "audio_hz") => Target::Graph(text.to_owned()),
            None if text == "guards" => Target::Guards,
            None if !text.is_empty() => Target::Node(text.to_owned()),
            _ => {
                return Err(Diagnostic::new(format!("`{text}` is not a knob"))
                    .at(&place.source, place.span)
                    .help("NODE.PARAM, *.PARAM, NODE, tick_hz, audio_hz or guards"));
            }
        };
        Ok(Self { target, place })
    }

    /// Its place in the trade-off file.
    pub(crate) fn place(&self) -> &Place {
        &self.place
    }

    /// Whether a graph has this knob.
    pub(crate) fn fits(&self, graph: &GraphFile, registry: &Registry) -> bool {
        match &self.target {
            Target::Graph(_) | Target::Guards => true,
            Target::Node(id) => graph.node(id).is_some(),
            Target::Param { node, param } if node == "*" => {
                if param == "every" {
                    graph.nodes.iter().any(|n| has_no_audio(registry, &n.kind))
                } else {
                    graph.nodes.iter().any(|n| has(registry, &n.kind, param).is_some())
                }
            }
            Target::Param { node, param } => {
                graph.node(node).is_some_and(|n| param == "every" || has(registry, &n.kind, param).is_some())
            }
        }
    }

    /// Help for a knob that none of these graphs has: the nearest that one has.
    pub(crate) fn nearest<'g>(
        &self,
        graphs: impl Iterator<Item = (&'g GraphFile, &'g Registry)> + Clone,
    ) -> String {
        let ids: Vec<&str> =
            graphs.clone().flat_map(|(g, _)| g.nodes.iter().map(|n| n.id.as_str())).collect();
        let (node, param) = match &self.target {
            Target::Graph(_) | Target::Guards => return String::new(),
            Target::Node(id) => return one_of(id, ids.into_iter().chain(["tick_hz", "audio_hz", "guards"])),
            Target::Param { node, param } => (node, param),
        };
        if node != "*" && !ids.contains(&node.as_str()) {
            let near = asperity_diagnostics::nearest(node, ids.iter().copied());
            return near.map_or_else(|| one_of(node, ids), |near| format!("did you mean `{near}.{param}`?"));
        }
        let mut names: Vec<String> = Vec::new();
        for (graph, registry) in graphs {
            let of = graph.nodes.iter().filter(|n| node == "*" || n.id == *node);
            for kind in of.filter_map(|n| registry.get(&n.kind)) {
                names.extend(kind.descriptor().params.iter().map(|p| format!("{node}.{}", p.name)));
            }
        }
        names.push(format!("{node}.every"));
        names.sort();
        names.dedup();
        one_of(&self.to_string(), names.iter().map(String::as_str))
    }

    /// The kind of the node in a value, where no such kind is known: its plugin may not be loaded.
    pub(crate) fn unknown_kind<'v>(&self, value: &'v Value, registry: &Registry) -> Option<&'v str> {
        let Kind::Record { fields, .. } = value.kind() else { return None };
        let kind = fields.iter().find(|(key, _)| key.name == "kind")?.1.text().ok()?;
        (matches!(self.target, Target::Node(_)) && registry.get(kind).is_none()).then_some(kind)
    }

    /// Sets it in a graph.
    ///
    /// # Errors
    /// A value that the knob cannot take. Values of parameters are checked when the graph is compiled.
    pub(crate) fn turn(
        &self,
        turned: &mut Turned,
        value: &Value,
        registry: &Registry,
    ) -> Result<(), Diagnostic> {
        let graph = &mut turned.graph;
        match &self.target {
            Target::Guards => turned.guards = value.bool()?,
            Target::Graph(name) => graph.set(&format!("{name}={}", value), ORIGIN).map_err(|e| {
                let help = e.help.clone().unwrap_or_default();
                value.error(e.message).help(help)
            })?,
            Target::Node(id) => replace(graph, id, value, registry)?,
            Target::Param { node, param } => {
                for n in graph.nodes.iter_mut().filter(|n| node == "*" || n.id == *node) {
                    if param == "every" {
                        let every = value.i64_in(EVERY, "ticks")? as u32;
                        if node != "*" || has_no_audio(registry, &n.kind) {
                            n.every = every;
                        }
                        continue;
                    }
                    let takes = has(registry, &n.kind, param).is_some_and(|kind| takes(kind, value));
                    if node == "*" && !takes {
                        continue;
                    }
                    set(n, param, value);
                }
            }
        }
        Ok(())
    }
}

/// Sets a parameter.
pub(crate) fn set(node: &mut NodeDecl, param: &str, value: &Value) {
    node.params.retain(|s| s.name != param);
    node.params.push(Setting {
        name: param.to_owned(),
        place: value.place(),
        value: value.clone(),
        typed: None,
    });
}

/// The type of a kind's parameter; none where it has no parameter of that name.
pub(crate) fn has<'r>(registry: &'r Registry, kind: &str, param: &str) -> Option<&'r ParamKind> {
    let kind = registry.get(kind)?;
    Some(&kind.descriptor().params.iter().find(|p| p.name == param)?.kind)
}

/// Whether a kind has no audio ports, so that its nodes need not run in every tick.
fn has_no_audio(registry: &Registry, kind: &str) -> bool {
    let audio = |shape: &ShapeSpec| matches!(shape, ShapeSpec::Audio(_) | ShapeSpec::Like(_));
    let Some(kind) = registry.get(kind) else { return false };
    let d = kind.descriptor();
    !d.inputs.iter().any(|p| audio(&p.shape)) && !d.outputs.iter().any(|p| audio(&p.shape))
}

/// Whether a choice has this word. Other parameters are left to the compiler.
fn takes(kind: &ParamKind, value: &Value) -> bool {
    match (kind, value.kind()) {
        (ParamKind::Choice(words), Kind::Text(word) | Kind::Word(word)) => words.iter().any(|w| w == word),
        _ => true,
    }
}

/// Replaces a node by another, or removes it.
fn replace(graph: &mut GraphFile, id: &str, value: &Value, registry: &Registry) -> Result<(), Diagnostic> {
    if let Kind::Word(word) | Kind::Text(word) = value.kind() {
        return match word.as_str() {
            KEPT => Ok(()),
            BYPASSED => bypass(graph, id, value, registry),
            other => Err(value
                .error(format!("a node cannot be set to `{other}`"))
                .help(format!("{}, or a node: (kind: \"spsi\")", one_of(other, [KEPT, BYPASSED])))),
        };
    }
    let place = value.place();
    let new = NodeDecl::read(&Key { name: id.to_owned(), span: place.span }, value)?;
    let descriptor = |kind: &str| registry.get(kind).map(|k| k.descriptor().clone());
    let Some(new_kind) = descriptor(&new.kind) else {
        let help = one_of(&new.kind, registry.names());
        return Err(value.error(format!("there is no kind `{}`", new.kind)).help(help));
    };
    let Some(old) = graph.nodes.iter_mut().find(|n| n.id == id) else { return Ok(()) };
    let old_kind = descriptor(&old.kind);
    *old = new;
    let (Some(before), Some(now)) = (old_kind.as_ref().and_then(|d| d.retrieval()), new_kind.retrieval())
    else {
        return Ok(());
    };
    // Both retrieve phase. Ports have other names, and an `overlap_add` follows those that return spectra.
    // Wires into ports that the new node does not have are removed.
    let main = |port: &Option<String>| port.as_deref().is_none_or(|port| port == before.input);
    let has = |port: &Option<String>| new_kind.inputs.iter().any(|i| Some(&*i.name) == port.as_deref());
    graph.wires.retain(|wire| wire.to.node != id || main(&wire.to.port) || has(&wire.to.port));
    for wire in &mut graph.wires {
        if wire.to.node == id && main(&wire.to.port) {
            wire.to.port = Some(now.input.to_owned());
        }
        if wire.from.node == id {
            wire.from.port = Some(now.output.to_owned());
        }
    }
    if before.spectrum && !now.spectrum {
        let behind: Vec<String> = graph
            .wires
            .iter()
            .filter(|w| w.from.node == id)
            .map(|w| w.to.node.clone())
            .filter(|to| graph.node(to).is_some_and(|n| registry.role(&n.kind) == Some(Role::OverlapAdd)))
            .collect();
        for synthesis in behind {
            graph.wires.retain(|w| w.to.node != synthesis);
            let end =
                Endpoint { node: id.to_owned(), port: Some(now.output.to_owned()), place: place.clone() };
            for wire in graph.wires.iter_mut().filter(|w| w.from.node == synthesis) {
                wire.from = end.clone();
            }
            graph.nodes.retain(|n| n.id != synthesis);
        }
    } else if now.spectrum && !before.spectrum {
        let synthesis = free(graph, &format!("{id} overlap_add"));
        graph.add_node(&synthesis, "overlap_add", &[], ORIGIN)?;
        for wire in graph.wires.iter_mut().filter(|w| w.from.node == id) {
            wire.from.node = synthesis.clone();
            wire.from.port = Some("signal".to_owned());
        }
        graph.add_wire(&format!("{id}.{}", now.output), &format!("{synthesis}.spectrum"), ORIGIN);
    }
    Ok(())
}

/// An unused id.
fn free(graph: &GraphFile, wanted: &str) -> String {
    let more = (2..).map(|n| format!("{wanted} {n}"));
    std::iter::once(wanted.to_owned()).chain(more).find(|id| graph.node(id).is_none()).unwrap_or_default()
}

/// Removes a node and wires its first input to where its first output went. A sound card behind a removed
/// limiter becomes a probe: nothing may be played without a limiter.
fn bypass(graph: &mut GraphFile, id: &str, value: &Value, registry: &Registry) -> Result<(), Diagnostic> {
    let Some(kind) = graph.node(id).and_then(|n| registry.get(&n.kind)) else { return Ok(()) };
    let d = kind.descriptor();
    let (input, output) =
        (d.inputs.first().map(|p| p.name.clone()), d.outputs.first().map(|p| p.name.clone()));
    let limits = d.outputs.first().is_some_and(|o| o.limited);
    let is = |port: &Option<String>, first: &Option<std::borrow::Cow<'static, str>>| {
        port.as_deref().is_none_or(|p| Some(p) == first.as_deref())
    };
    let Some(from) =
        graph.wires.iter().find(|w| w.to.node == id && is(&w.to.port, &input)).map(|w| w.from.clone())
    else {
        return Err(value.error(format!("`{id}` cannot be bypassed: it has no input wire")));
    };
    let mut behind = Vec::new();
    for wire in graph.wires.iter_mut().filter(|w| w.from.node == id && is(&w.from.port, &output)) {
        wire.from = from.clone();
        behind.push(wire.to.node.clone());
    }
    graph.wires.retain(|w| w.to.node != id && w.from.node != id);
    graph.nodes.retain(|n| n.id != id);
    let plays = |n: &NodeDecl| registry.role(&n.kind) == Some(Role::AudioOutput);
    let cards = |n: &&mut NodeDecl| limits && plays(n) && behind.contains(&n.id);
    for card in graph.nodes.iter_mut().filter(cards) {
        card.kind = "probe".to_owned();
        card.params.clear();
        for wire in graph.wires.iter_mut().filter(|w| w.to.node == card.id) {
            wire.to.port = None;
        }
    }
    Ok(())
}

#[cfg(test)]
#[path = "knob_tests.rs"]
mod tests;
