//! Builds a graph from nodes and wires, one after the other.

use asperity_diagnostics::ron::{Key, Kind as Form, Value};
use asperity_diagnostics::{Diagnostic, Place, Span, one_of};
use asperity_graph::{Endpoint, GraphFile, NodeDecl, Setting, WireDecl};
use asperity_node::{Acts, Descriptor, Effect, Registry};

use crate::effects::effect_of;
use crate::passivity::vibrates;
use crate::read::error;
use crate::slots::effects_in_order;
use crate::{EffectNames, NETWORK, Part, Scene, Slots};
use crate::{Lowered, Lowering, Rendered};

/// A graph under construction.
pub(crate) struct Builder<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) registry: &'a Registry,
    pub(crate) prune: bool,
    graph: GraphFile,
    /// All kinds of effect.
    effects: Vec<Of<'a>>,
}

/// A kind of effect, its slots in the scene, and the nodes that render it.
struct Of<'a> {
    kind: &'a str,
    slots: Slots,
    nodes: Vec<String>,
}

impl<'a> Builder<'a> {
    pub(crate) fn new(
        scene: &'a Scene,
        registry: &'a Registry,
        lowering: Lowering,
        graph: GraphFile,
    ) -> Self {
        let kinds = std::iter::once(NETWORK).chain(effects_in_order(registry));
        let effects = kinds.map(|kind| Of { kind, slots: scene.slots(kind), nodes: Vec::new() }).collect();
        Self { scene, registry, prune: lowering.prune, graph, effects }
    }

    /// Finishes the graph. It must have something to feel.
    pub(crate) fn done(self) -> Result<Lowered, Diagnostic> {
        let sink = |kind: &str| self.registry.get(kind).is_some_and(|kind| kind.descriptor().sink);
        if !self.graph.nodes.iter().any(|node| sink(&node.kind)) {
            let surface = self.scene.surfaces.first();
            let place = surface.map_or_else(|| self.here(), |surface| surface.place.clone());
            let sounds = |of: &Of<'_>| self.is_built(of.kind) && self.vibrates(of.kind);
            let (message, help) = if self.effects.iter().any(sounds) {
                ("this scene has vibration, but no `output`", "output: audio_out")
            } else {
                ("no surface of this scene can be felt", "effects: (stiffness: (stiffness_n_per_mm: 0.5))")
            };
            return Err(error(&place, message).help(help));
        }
        let Self { graph, effects, registry, .. } = self;
        let rendered = effects.into_iter().map(|Of { kind, mut nodes, .. }| {
            nodes.retain(|id| graph.node(id).is_some());
            let texture = effect_of(registry, kind).is_some_and(|effect| effect.acts == Acts::Gliding);
            Rendered { kind: kind.to_owned(), texture, nodes }
        });
        Ok(Lowered { rendered: rendered.collect(), graph })
    }

    /// Whether to build an effect: a surface has it, or all effects are built.
    pub(crate) fn is_built(&self, kind: &str) -> bool {
        self.slots(kind).is_some_and(|slots| !self.prune || !slots.first.is_empty())
    }

    /// Effects to build that act in a given way and have a node of their own, in their order.
    pub(crate) fn acting(&self, acts: Acts) -> Vec<(&'a str, &'a Effect)> {
        let built = self.effects.iter().filter(|of| of.kind != NETWORK && self.is_built(of.kind));
        let effects = built.filter_map(|of| Some((of.kind, effect_of(self.registry, of.kind)?)));
        effects.filter(|(_, effect)| effect.acts == acts).collect()
    }

    /// Names of the effects to build, as the `contact` node takes them.
    pub(crate) fn names(&self) -> EffectNames {
        let of = |acts| self.acting(acts).into_iter().map(|(kind, _)| kind.to_owned()).collect();
        EffectNames {
            touching: of(Acts::Touching),
            inside: of(Acts::Inside),
            near: of(Acts::Near),
            textures: of(Acts::Gliding),
        }
    }

    /// Whether an effect is felt as vibration.
    pub(crate) fn vibrates(&self, kind: &str) -> bool {
        vibrates(self.registry, kind)
    }

    pub(crate) fn slots(&self, kind: &str) -> Option<&Slots> {
        self.effects.iter().find(|built| built.kind == kind).map(|built| &built.slots)
    }

    /// Beginning of the file, as the place of settings that the file does not have.
    pub(crate) fn here(&self) -> Place {
        Place { source: self.scene.source.clone(), span: Span::at(0) }
    }

    /// Place of the first surface that has an effect.
    pub(crate) fn first_place(&self, kind: &str) -> Place {
        let first = self.slots(kind).and_then(|slots| slots.first.first());
        let surface = first.and_then(|first| self.scene.surfaces.get(*first));
        surface.and_then(|surface| surface.effects.place(kind)).unwrap_or_else(|| self.here())
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
            seeded_as: None,
        });
    }

    /// Notes that a node renders a kind of effect.
    pub(crate) fn renders(&mut self, kind: &str, id: &str) {
        if let Some(built) = self.effects.iter_mut().find(|built| built.kind == kind) {
            built.nodes.push(id.to_owned());
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
        self.graph.wires.push(WireDecl { from: end(from), to: end(to) });
    }

    /// Adds a `mix` that sums several outputs. A single output gets a `mix` too, so that samples do not
    /// depend on the number of outputs.
    pub(crate) fn sum(&mut self, id: &str, from: &[String]) {
        let place = self.here();
        self.node(id, "mix", &place, vec![setting("inputs", Form::Int(from.len() as i64), &place)]);
        for (i, from) in from.iter().enumerate() {
            self.wire(from, &format!("{id}.in{}", i + 1));
        }
    }

    /// Adds a part as the file has it. Its kind must exist.
    pub(crate) fn part(&mut self, id: &str, part: &Part) -> Result<&'a Descriptor, Diagnostic> {
        let descriptor = self.descriptor(&part.kind, &part.place)?;
        self.node(id, &part.kind, &part.place, handed_on(part));
        Ok(descriptor)
    }

    /// Looks up a kind of node.
    pub(crate) fn descriptor(&self, kind: &str, place: &Place) -> Result<&'a Descriptor, Diagnostic> {
        match self.registry.get(kind) {
            Some(found) => Ok(found.descriptor()),
            None => Err(error(place, format!("there is no node of the kind `{kind}`"))
                .help(one_of(kind, self.registry.names()))),
        }
    }

    /// Adds the node of an effect. If `voice` is not empty, the node is that voice of a texture. Its
    /// inputs come from the contact or the motion.
    pub(crate) fn effect(&mut self, kind: &str, effect: &Effect, voice: &str) -> String {
        let place = self.first_place(kind);
        let id = if voice.is_empty() { kind.to_owned() } else { format!("{kind} {voice}") };
        let slots = self.slots(kind).map_or_else(Vec::new, |slots| self.scene.slot_texts(kind, slots));
        let texts = slots.into_iter().map(|(text, place)| Value::made(Form::Text(text), &place));
        let mut params = vec![setting(&effect.list, Form::List(texts.collect()), &place)];
        let device = &self.scene.device;
        let smooths = |descriptor: &Descriptor| descriptor.params.iter().any(|p| p.name == "smooth_hz");
        if device.position_step_mm > 0.0 && self.registry.get(kind).is_some_and(|k| smooths(k.descriptor())) {
            // Without smoothing, places that come in steps can be heard.
            let cutoff_hz = number(&self.scene.motion, "cutoff_hz").unwrap_or(20.0);
            params.push(setting("smooth_hz", Form::Float(cutoff_hz), &device.place));
        }
        self.node(&id, kind, &place, params);
        self.renders(kind, &id);
        self.wire(&format!("contact.{}", slot_port(kind, voice)), &format!("{id}.slot"));
        for (input, quantity) in &effect.needs {
            let from = self.quantity(kind, effect.acts, voice, quantity);
            self.wire(&from, &format!("{id}.{input}"));
        }
        id
    }

    /// Output that gives a quantity of the contact.
    fn quantity(&self, kind: &str, acts: Acts, voice: &str, quantity: &str) -> String {
        let of_contact = |name: &str| {
            let contact = self.registry.get("contact").map(|kind| kind.descriptor());
            contact.is_some_and(|contact| contact.outputs.iter().any(|output| output.name == name))
        };
        let of_voice = format!("{quantity}_{voice}");
        match acts {
            Acts::Near if matches!(quantity, "distance" | "normal") => format!("contact.{kind}_{quantity}"),
            Acts::Gliding if of_contact(&of_voice) => format!("contact.{of_voice}"),
            _ if of_contact(quantity) => format!("contact.{quantity}"),
            _ => format!("motion.{quantity}"),
        }
    }
}

/// Output of `contact` with the slot of an effect; for a texture, the slot in voice `voice`.
pub(crate) fn slot_port(kind: &str, voice: &str) -> String {
    if voice.is_empty() { format!("{kind}_slot") } else { format!("{kind}_slot_{voice}") }
}

/// Makes a parameter that does not stand in the file.
pub(crate) fn setting(name: &str, value: Form, place: &Place) -> Setting {
    let value = Value::made(value, place);
    Setting { name: name.to_owned(), place: place.clone(), value, typed: None }
}

/// Settings of a part, passed on to its node.
pub(crate) fn handed_on(part: &Part) -> Vec<Setting> {
    let setting = |(key, value): &(Key, Value)| {
        let place = Place { source: value.source().clone(), span: key.span };
        Setting { name: key.name.clone(), place, value: value.clone(), typed: None }
    };
    part.settings.iter().map(setting).collect()
}

/// Number that the file sets in a part.
pub(crate) fn number(part: &Part, name: &str) -> Option<f64> {
    part.settings.iter().find(|(key, _)| key.name == name).and_then(|(_, value)| value.f64().ok())
}
