//! Nodes and wires, one after the other.

use crate::{Kind, Part, Scene, Slots};
use asperity_diagnostics::ron::{Kind as Form, Value};
use asperity_diagnostics::{Diagnostic, Place, Span, one_of};
use asperity_graph::{Endpoint, GraphFile, NodeDecl, Setting, WireDecl};
use asperity_node::{Descriptor, Registry};

use crate::{Lowered, Lowering};

/// A graph in the making.
pub(crate) struct Builder<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) registry: &'a Registry,
    pub(crate) prune: bool,
    graph: GraphFile,
    rendered: Vec<(Kind, Vec<String>)>,
    slots: Vec<(Kind, Slots)>,
}

impl<'a> Builder<'a> {
    pub(crate) fn new(
        scene: &'a Scene,
        registry: &'a Registry,
        lowering: Lowering,
        graph: GraphFile,
    ) -> Self {
        let slots = Kind::ALL.iter().map(|kind| (*kind, scene.slots(*kind))).collect();
        let rendered = Kind::ALL.iter().map(|kind| (*kind, Vec::new())).collect();
        Self { scene, registry, prune: lowering.prune, graph, rendered, slots }
    }

    /// The graph, in which something is to be felt.
    pub(crate) fn done(self) -> Result<Lowered, Diagnostic> {
        let sink = |kind: &str| self.registry.get(kind).is_some_and(|kind| kind.descriptor().sink);
        if !self.graph.nodes.iter().any(|node| sink(&node.kind)) {
            let surface = self.scene.surfaces.first();
            let place = surface.map_or_else(|| self.here(), |surface| surface.place.clone());
            let vibrates = |kind: &Kind| kind.vibrates() && self.is_built(*kind);
            let (message, help) = if Kind::ALL.iter().any(vibrates) {
                ("this scene vibrates, and nothing plays it", "output: audio_out")
            } else {
                ("no surface of this scene can be felt", "effects: (stiffness: (stiffness_n_per_mm: 0.5))")
            };
            return Err(Diagnostic::new(message).at(&place.source, place.span).help(help));
        }
        let Self { graph, mut rendered, .. } = self;
        for (_, ids) in &mut rendered {
            ids.retain(|id| graph.node(id).is_some());
        }
        Ok(Lowered { graph, rendered })
    }

    /// Whether an effect is to be built: a surface has it, or everything is.
    pub(crate) fn is_built(&self, kind: Kind) -> bool {
        !self.prune || self.slots(kind).is_some_and(|slots| !slots.first.is_empty())
    }

    pub(crate) fn slots(&self, kind: Kind) -> Option<&Slots> {
        self.slots.iter().find(|(k, _)| *k == kind).map(|(_, slots)| slots)
    }

    /// The beginning of the file, for what nothing in it says.
    pub(crate) fn here(&self) -> Place {
        Place { source: self.scene.source.clone(), span: Span::at(0) }
    }

    /// Where the first surface stands that has an effect.
    pub(crate) fn first_place(&self, kind: Kind) -> Place {
        let first = self.slots(kind).and_then(|slots| slots.first.first());
        let surface = first.and_then(|first| self.scene.surfaces.get(*first));
        let place = surface.and_then(|surface| kind.places(&surface.effects).first().map(|p| (*p).clone()));
        place.unwrap_or_else(|| self.here())
    }

    /// Adds a node.
    pub(crate) fn node(&mut self, id: &str, kind: &str, place: &Place, params: Vec<Setting>) {
        self.graph.nodes.push(NodeDecl {
            id: id.to_owned(),
            place: place.clone(),
            kind: kind.to_owned(),
            kind_place: place.clone(),
            every: 1,
            params,
        });
    }

    /// Says that a node renders a kind of effect.
    pub(crate) fn renders(&mut self, kind: Kind, id: &str) {
        if let Some((_, ids)) = self.rendered.iter_mut().find(|(k, _)| *k == kind) {
            ids.push(id.to_owned());
        }
    }

    /// Adds a wire, `node.port` to `node.port`.
    pub(crate) fn wire(&mut self, from: &str, to: &str) {
        let place = self.here();
        let end = |text: &str| {
            let (node, port) = match text.split_once('.') {
                Some((node, port)) => (node, Some(port.to_owned())),
                None => (text, None),
            };
            Endpoint { node: node.to_owned(), port, place: place.clone() }
        };
        let wire = WireDecl { from: end(from), to: end(to) };
        self.graph.wires.push(wire);
    }

    /// Adds what sums several outputs, and answers its output: a `mix` also of one, so that samples do not depend on how many there are.
    pub(crate) fn sum(&mut self, id: &str, from: &[String]) {
        let place = self.here();
        self.node(id, "mix", &place, vec![setting("inputs", Form::Int(from.len() as i64), &place)]);
        for (i, from) in from.iter().enumerate() {
            self.wire(from, &format!("{id}.in{}", i + 1));
        }
    }

    /// A part as the file has it, of a kind that there is.
    pub(crate) fn part(&mut self, id: &str, part: &Part) -> Result<&'a Descriptor, Diagnostic> {
        let descriptor = self.descriptor(&part.kind, &part.place)?;
        self.node(id, &part.kind, &part.place, handed_on(part));
        Ok(descriptor)
    }

    /// What a kind of node is.
    pub(crate) fn descriptor(&self, kind: &str, place: &Place) -> Result<&'a Descriptor, Diagnostic> {
        match self.registry.get(kind) {
            Some(found) => Ok(found.descriptor()),
            None => Err(Diagnostic::new(format!("there is no node of the kind `{kind}`"))
                .at(&place.source, place.span)
                .help(one_of(kind, self.registry.names()))),
        }
    }

    /// The list of a kind's slots, as its node takes them.
    pub(crate) fn list(&self, name: &str, kind: Kind) -> Setting {
        let place = self.first_place(kind);
        let texts = self.slots(kind).map_or_else(Vec::new, |slots| {
            (0..slots.first.len()).map(|slot| self.scene.slot_text(kind, slots, slot)).collect()
        });
        let items = texts.into_iter().map(|text| Value::made(Form::Text(text), &place)).collect();
        setting(name, Form::List(items), &place)
    }
}

/// A parameter that a program sets.
pub(crate) fn setting(name: &str, value: Form, place: &Place) -> Setting {
    let value = Value::made(value, place);
    Setting { name: name.to_owned(), place: place.clone(), value, typed: None }
}

/// The settings of a part.
pub(crate) fn handed_on(part: &Part) -> Vec<Setting> {
    let place = |key: &asperity_diagnostics::ron::Key, value: &Value| Place {
        source: value.source().clone(),
        span: key.span,
    };
    part.settings
        .iter()
        .map(|(key, value)| Setting {
            name: key.name.clone(),
            place: place(key, value),
            value: value.clone(),
            typed: None,
        })
        .collect()
}

/// A number that the file sets in a part.
pub(crate) fn number(part: &Part, name: &str) -> Option<f64> {
    part.settings.iter().find(|(key, _)| key.name == name).and_then(|(_, value)| value.f64().ok())
}
