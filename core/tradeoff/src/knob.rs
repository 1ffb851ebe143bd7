//! Knobs: the parts of a graph that a trade-off varies.

use asperity_diagnostics::ron::{Key, Kind, Value};
use asperity_diagnostics::{Diagnostic, Place, nearest, one_of};
use asperity_graph::{EVERY, Endpoint, GraphFile, NodeDecl, Setting};
use asperity_node::{ParamKind, Registry, Role, ShapeSpec};

use crate::setting::LoadedGraph;

/// A knob, and its place in the trade-off file:
///
/// - `tick_hz` and `audio_hz` of the graph;
/// - `guards`: whether outputs of nodes are checked for NaN and infinities;
/// - `NODE.PARAM` or `NODE.every`; `*.PARAM` of every node whose kind has it, `*.every` of nodes without
///   audio;
/// - `NODE`: another node in its place, or none.
#[derive(Clone, Debug)]
pub(crate) struct Knob {
    pub name: String,
    pub place: Place,
}

/// A graph that knobs change.
#[derive(Clone, Debug)]
pub(crate) struct Turned {
    pub graph: GraphFile,
    /// Whether outputs of nodes are checked.
    pub guards: bool,
}

/// Knobs that every graph has.
const GLOBAL: [&str; 3] = ["tick_hz", "audio_hz", "guards"];
/// Value that removes a node: its input is wired to where its output went.
const BYPASSED: &str = "bypassed";
/// Value that leaves a node as it is.
const KEPT: &str = "kept";
/// Origin of the nodes and settings that knobs add, for messages.
const ORIGIN: &str = "the trade-off";

impl Knob {
    /// A knob by its name, which may not have an empty part.
    pub(crate) fn parse(name: &str, place: Place) -> Result<Self, Diagnostic> {
        if name.splitn(2, '.').any(str::is_empty) {
            return Err(Diagnostic::new(format!("`{name}` is not a knob"))
                .at_place(&place)
                .help("NODE.PARAM, *.PARAM, NODE, tick_hz, audio_hz or guards"));
        }
        Ok(Self { name: name.to_owned(), place })
    }

    /// Node and parameter of `NODE.PARAM`.
    fn param(&self) -> Option<(&str, &str)> {
        self.name.split_once('.')
    }

    /// Whether a graph has this knob.
    pub(crate) fn fits(&self, graph: &GraphFile, registry: &Registry) -> bool {
        let Some((id, param)) = self.param() else {
            return GLOBAL.contains(&self.name.as_str()) || graph.node(&self.name).is_some();
        };
        graph.nodes.iter().any(|node| match (id, param) {
            ("*", "every") => has_no_audio(registry, &node.kind),
            (_, "every") => node.id == id,
            _ => (id == "*" || node.id == id) && has(registry, &node.kind, param).is_some(),
        })
    }

    /// Help for a knob that none of these graphs has: the nearest that one has.
    pub(crate) fn nearest(&self, bases: &[LoadedGraph]) -> String {
        let nodes = || bases.iter().flat_map(|b| b.graph.nodes.iter().map(|n| (n, &b.registry)));
        let ids: Vec<&str> = nodes().map(|(n, _)| n.id.as_str()).collect();
        let Some((node, param)) = self.param() else {
            return one_of(&self.name, ids.into_iter().chain(GLOBAL));
        };
        if node != "*" && !ids.contains(&node) {
            let near = nearest(node, ids.iter().copied());
            return near.map_or_else(|| one_of(node, ids), |near| format!("did you mean `{near}.{param}`?"));
        }
        let of = nodes().filter(|(n, _)| node == "*" || n.id == node);
        let params =
            of.filter_map(|(n, registry)| registry.get(&n.kind)).flat_map(|k| &k.descriptor().params);
        let mut names: Vec<String> = params.map(|p| format!("{node}.{}", p.name)).collect();
        names.push(format!("{node}.every"));
        names.sort();
        names.dedup();
        one_of(&self.name, names.iter().map(String::as_str))
    }

    /// The kind of the node in a value, where no such kind is known: its plugin may not be loaded.
    pub(crate) fn unknown_kind<'v>(&self, value: &'v Value, registry: &Registry) -> Option<&'v str> {
        let Kind::Record { fields, .. } = value.kind() else { return None };
        let kind = fields.iter().find(|(key, _)| key.name == "kind")?.1.text().ok()?;
        (self.param().is_none() && registry.get(kind).is_none()).then_some(kind)
    }

    /// Sets it in a graph. Values of parameters are checked when the graph is compiled.
    pub(crate) fn turn(
        &self,
        turned: &mut Turned,
        value: &Value,
        registry: &Registry,
    ) -> Result<(), Diagnostic> {
        let graph = &mut turned.graph;
        let Some((id, param)) = self.param() else {
            match self.name.as_str() {
                "guards" => turned.guards = value.bool()?,
                name @ ("tick_hz" | "audio_hz") => graph
                    .set(&format!("{name}={value}"), ORIGIN)
                    .map_err(|e| value.error(e.message).help(e.help.unwrap_or_default()))?,
                id => replace(graph, id, value, registry)?,
            }
            return Ok(());
        };
        for node in graph.nodes.iter_mut().filter(|n| id == "*" || n.id == id) {
            if param == "every" {
                let every = value.i64_in(EVERY, "ticks")? as u32;
                if id != "*" || has_no_audio(registry, &node.kind) {
                    node.every = every;
                }
            } else if id != "*" || has(registry, &node.kind, param).is_some_and(|kind| takes(kind, value)) {
                set(node, param, value);
            }
        }
        Ok(())
    }
}

pub(crate) fn set(node: &mut NodeDecl, param: &str, value: &Value) {
    node.params.retain(|s| s.name != param);
    let (place, value) = (value.place(), value.clone());
    node.params.push(Setting { name: param.to_owned(), place, value, typed: None });
}

/// The type of a kind's parameter; none where it has no parameter of that name.
pub(crate) fn has<'r>(registry: &'r Registry, kind: &str, param: &str) -> Option<&'r ParamKind> {
    let kind = registry.get(kind)?;
    Some(&kind.descriptor().params.iter().find(|p| p.name == param)?.kind)
}

/// Whether a kind has no audio ports, so that its nodes need not run in every tick.
fn has_no_audio(registry: &Registry, kind: &str) -> bool {
    registry.get(kind).is_some_and(|kind| {
        let d = kind.descriptor();
        let mut shapes = d.inputs.iter().map(|p| &p.shape).chain(d.outputs.iter().map(|p| &p.shape));
        !shapes.any(|shape| matches!(shape, ShapeSpec::Audio(_) | ShapeSpec::Like(_)))
    })
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
    let Some(new_kind) = registry.get(&new.kind).map(|kind| kind.descriptor()) else {
        let help = one_of(&new.kind, registry.names());
        return Err(value.error(format!("there is no kind `{}`", new.kind)).help(help));
    };
    let Some(old) = graph.nodes.iter_mut().find(|n| n.id == id) else { return Ok(()) };
    let before = registry.get(&old.kind).and_then(|kind| kind.descriptor().retrieval());
    *old = new;
    let (Some(before), Some(now)) = (before, new_kind.retrieval()) else { return Ok(()) };
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
        let adds =
            |to: &str| graph.node(to).is_some_and(|n| registry.role(&n.kind) == Some(Role::OverlapAdd));
        let behind = graph.wires.iter().filter(|w| w.from.node == id && adds(&w.to.node));
        let end = Endpoint { node: id.to_owned(), port: Some(now.output.to_owned()), place };
        for synthesis in behind.map(|w| w.to.node.clone()).collect::<Vec<_>>() {
            graph.wires.retain(|w| w.to.node != synthesis);
            graph.wires.iter_mut().filter(|w| w.from.node == synthesis).for_each(|w| w.from = end.clone());
            graph.nodes.retain(|n| n.id != synthesis);
        }
    } else if now.spectrum && !before.spectrum {
        let numbered = (2..).map(|n| format!("{id} overlap_add {n}"));
        let mut ids = std::iter::once(format!("{id} overlap_add")).chain(numbered);
        let synthesis = ids.find(|id| graph.node(id).is_none()).unwrap_or_default();
        graph.add_node(&synthesis, "overlap_add", &[], ORIGIN)?;
        for wire in graph.wires.iter_mut().filter(|w| w.from.node == id) {
            (wire.from.node, wire.from.port) = (synthesis.clone(), Some("signal".to_owned()));
        }
        graph.add_wire(&format!("{id}.{}", now.output), &format!("{synthesis}.spectrum"), ORIGIN);
    }
    Ok(())
}

/// Removes a node and wires its first input to where its first output went. A sound card behind a removed
/// limiter becomes a probe: nothing may be played without a limiter.
fn bypass(graph: &mut GraphFile, id: &str, value: &Value, registry: &Registry) -> Result<(), Diagnostic> {
    let Some(kind) = graph.node(id).and_then(|n| registry.get(&n.kind)) else { return Ok(()) };
    let d = kind.descriptor();
    let is = |port: &Option<String>, first: Option<&str>| port.as_deref().is_none_or(|p| Some(p) == first);
    let input = d.inputs.first().map(|p| p.name.as_ref());
    let mut into = graph.wires.iter().filter(|w| w.to.node == id && is(&w.to.port, input));
    let Some(from) = into.next().map(|w| w.from.clone()) else {
        return Err(value.error(format!("`{id}` cannot be bypassed: it has no input wire")));
    };
    let output = d.outputs.first().map(|p| p.name.as_ref());
    let mut behind = Vec::new();
    for wire in graph.wires.iter_mut().filter(|w| w.from.node == id && is(&w.from.port, output)) {
        wire.from = from.clone();
        behind.push(wire.to.node.clone());
    }
    graph.wires.retain(|w| w.to.node != id && w.from.node != id);
    graph.nodes.retain(|n| n.id != id);
    let limits = d.outputs.first().is_some_and(|o| o.limited);
    let plays = |n: &NodeDecl| registry.role(&n.kind) == Some(Role::AudioOutput);
    for card in graph.nodes.iter_mut().filter(|n| limits && plays(n) && behind.contains(&n.id)) {
        card.kind = "probe".to_owned();
        card.params.clear();
        graph.wires.iter_mut().filter(|w| w.to.node == card.id).for_each(|w| w.to.port = None);
    }
    Ok(())
}

#[cfg(test)]
#[path = "knob_tests.rs"]
mod tests;
