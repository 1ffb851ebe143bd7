//! What can be turned about a graph.

use std::fmt;

use asperity_diagnostics::ron::{Key, Kind, Value};
use asperity_diagnostics::{Diagnostic, Place, one_of};
use asperity_graph::{EVERY, Endpoint, GraphFile, NodeDecl, Setting};
use asperity_node::{NodeKind, ParamKind, Registry, ShapeSpec};

/// What is turned.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Target {
    /// `tick_hz`, `audio_hz`.
    Graph(String),
    /// `NODE.PARAM`, `NODE.every`, or `*.PARAM` for every node whose kind has it; `*.every` for those that
    /// carry no audio.
    Param { node: String, param: String },
    /// `NODE`: the node itself, another in its place, or none.
    Node(String),
    /// `guards`: whether what nodes put out is looked at for NaN and infinities.
    Guards,
}

/// A knob: what is turned, and where a study names it.
#[derive(Clone, Debug)]
pub struct Knob {
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

/// A graph in the turning.
#[derive(Clone, Debug)]
pub struct Turned {
    /// It.
    pub graph: GraphFile,
    /// Whether what nodes put out is looked at.
    pub guards: bool,
}

/// A node that the study leaves out: its input goes where its output went.
const BYPASSED: &str = "bypassed";
/// A node that stays as it is.
const KEPT: &str = "kept";

impl Knob {
    /// Reads `tick_hz`, `audio_hz`, `guards`, `NODE.PARAM`, `NODE.every`, `*.PARAM`, `*.every` or `NODE`.
    ///
    /// # Errors
    /// An empty part.
    pub fn parse(text: &str, place: Place) -> Result<Self, Diagnostic> {
        let target = match text.split_once('.') {
            Some((node, param)) if !node.is_empty() && !param.is_empty() => {
                Target::Param { node: node.to_owned(), param: param.to_owned() }
            }
            None if matches!(text, "tick_hz" | "audio_hz") => Target::Graph(text.to_owned()),
            None if text == "guards" => Target::Guards,
            None if !text.is_empty() => Target::Node(text.to_owned()),
            _ => {
                return Err(Diagnostic::new(format!("`{text}` is no knob"))
                    .at(&place.source, place.span)
                    .help("NODE.PARAM, *.PARAM, NODE, tick_hz, audio_hz or guards"));
            }
        };
        Ok(Self { target, place })
    }

    /// Where a study names it.
    pub fn place(&self) -> &Place {
        &self.place
    }

    /// Whether a graph has what this turns.
    pub fn fits(&self, graph: &GraphFile, registry: &Registry) -> bool {
        match &self.target {
            Target::Graph(_) | Target::Guards => true,
            Target::Node(id) => graph.node(id).is_some(),
            Target::Param { node, param } if node == "*" => {
                if param == "every" {
                    graph.nodes.iter().any(|n| may_rest(registry, &n.kind))
                } else {
                    graph.nodes.iter().any(|n| has(registry, &n.kind, param).is_some())
                }
            }
            Target::Param { node, param } => {
                graph.node(node).is_some_and(|n| param == "every" || has(registry, &n.kind, param).is_some())
            }
        }
    }

    /// Help for a knob that none of these graphs has: the nearest that there is.
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
            let help = asperity_diagnostics::nearest(node, ids.iter().copied());
            return help.map_or_else(|| one_of(node, ids), |near| format!("did you mean `{near}.{param}`?"));
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

    /// The kind of a node that a value asks for and that nobody has, such as one of a plugin that is not
    /// loaded.
    pub fn lacks<'v>(&self, value: &'v Value, registry: &Registry) -> Option<&'v str> {
        let Kind::Record { fields, .. } = value.kind() else { return None };
        let kind = fields.iter().find(|(key, _)| key.name == "kind")?.1.text().ok()?;
        (matches!(self.target, Target::Node(_)) && registry.get(kind).is_none()).then_some(kind)
    }

    /// Turns it.
    ///
    /// # Errors
    /// A value that means nothing there; whether a parameter takes it shows when the graph is compiled.
    pub fn turn(&self, turned: &mut Turned, value: &Value, registry: &Registry) -> Result<(), Diagnostic> {
        let graph = &mut turned.graph;
        match &self.target {
            Target::Guards => turned.guards = value.bool()?,
            Target::Graph(name) => graph.set(&format!("{name}={}", value), "the study").map_err(|e| {
                let help = e.help.clone().unwrap_or_default();
                value.error(e.message).help(help)
            })?,
            Target::Node(id) => replace(graph, id, value, registry)?,
            Target::Param { node, param } => {
                for n in graph.nodes.iter_mut().filter(|n| node == "*" || n.id == *node) {
                    if param == "every" {
                        let every = value.i64_in(EVERY, "ticks")? as u32;
                        if node != "*" || may_rest(registry, &n.kind) {
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

/// What a kind's parameter may be, if it has one of that name.
pub(crate) fn has<'r>(registry: &'r Registry, kind: &str, param: &str) -> Option<&'r ParamKind> {
    let kind = registry.get(kind)?;
    Some(&kind.descriptor().params.iter().find(|p| p.name == param)?.kind)
}

/// Whether nodes of a kind need not run in every tick, whatever they are wired to: they carry no audio.
fn may_rest(registry: &Registry, kind: &str) -> bool {
    let audio = |shape: &ShapeSpec| matches!(shape, ShapeSpec::Audio(_) | ShapeSpec::Like(_));
    let Some(kind) = registry.get(kind) else { return false };
    let d = kind.descriptor();
    !d.inputs.iter().any(|p| audio(&p.shape)) && !d.outputs.iter().any(|p| audio(&p.shape))
}

/// Whether a choice has that word; whatever is no choice is left to the compiler.
fn takes(kind: &ParamKind, value: &Value) -> bool {
    match (kind, value.kind()) {
        (ParamKind::Choice(words), Kind::Text(word) | Kind::Word(word)) => words.iter().any(|w| w == word),
        _ => true,
    }
}

/// Puts another node in the place of one, or none at all.
fn replace(graph: &mut GraphFile, id: &str, value: &Value, registry: &Registry) -> Result<(), Diagnostic> {
    if let Kind::Word(word) | Kind::Text(word) = value.kind() {
        return match word.as_str() {
            KEPT => Ok(()),
            BYPASSED => bypass(graph, id, value, registry),
            other => Err(value
                .error(format!("`{other}` is nothing to turn a node to"))
                .help(format!("{}, or a node: (kind: \"spsi\")", one_of(other, [KEPT, BYPASSED])))),
        };
    }
    let place = value.place();
    let new = NodeDecl::read(&Key { name: id.to_owned(), span: place.span }, value)?;
    let descriptor = |kind: &str| registry.get(kind).map(|k| NodeKind::descriptor(&**k).clone());
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
    // Both retrieve phase: ports go by other names, and an `overlap_add` stands behind those that answer
    // spectra. What the other has no port for, it is not told.
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
            .filter(|to| graph.node(to).is_some_and(|n| n.kind == "overlap_add"))
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
        graph.add_node(&synthesis, "overlap_add", &[], "the study")?;
        for wire in graph.wires.iter_mut().filter(|w| w.from.node == id) {
            wire.from.node = synthesis.clone();
            wire.from.port = Some("signal".to_owned());
        }
        graph.add_wire(&format!("{id}.{}", now.output), &format!("{synthesis}.spectrum"), "the study");
    }
    Ok(())
}

/// An id that no node has yet.
fn free(graph: &GraphFile, wanted: &str) -> String {
    let more = (2..).map(|n| format!("{wanted} {n}"));
    std::iter::once(wanted.to_owned()).chain(more).find(|id| graph.node(id).is_none()).unwrap_or_default()
}

/// Takes a node out; what came to its first input goes to where its first output went. A sound card behind
/// a limiter that is gone only looks on: nothing is to be played without one.
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
        return Err(value.error(format!("`{id}` cannot be bypassed: nothing goes into it")));
    };
    let mut behind = Vec::new();
    for wire in graph.wires.iter_mut().filter(|w| w.from.node == id && is(&w.from.port, &output)) {
        wire.from = from.clone();
        behind.push(wire.to.node.clone());
    }
    graph.wires.retain(|w| w.to.node != id && w.from.node != id);
    graph.nodes.retain(|n| n.id != id);
    let cards = |n: &&mut NodeDecl| limits && n.kind == "audio_out" && behind.contains(&n.id);
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
