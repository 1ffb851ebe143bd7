//! Which effects of a scene are active, tick by tick: what the picture from above shows.

use asperity_engine::Engine;
use asperity_graph::Schedule;
use asperity_node::Buffer;
use asperity_plot::{Above, Moment, Seen};
use asperity_scene::{Kind, VOICED};

use crate::load::OfScene;

/// What comes of a surface itself, before the kinds that nodes render.
const OF_SURFACES: [&str; 2] = ["stiffness", "damping"];

/// The stroke over a scene, in the making.
pub struct Effects {
    rendered: Vec<(Kind, Vec<String>)>,
    /// Whether surfaces push back, and whether damped.
    walls: Vec<[bool; 2]>,
    surfaces: Vec<Seen>,
    watched: Vec<Watched>,
    contact: Option<Contact>,
    /// The gate that textures go through.
    gate: Option<usize>,
    stroke: f64,
    moments: Vec<Moment>,
}

/// A node whose output is an effect.
struct Watched {
    bit: usize,
    node: usize,
    /// Calls of it so far.
    calls: u64,
    /// Whether it is heard through the gate.
    gated: bool,
}

/// The node that finds what is touched: where its inputs and outputs are.
struct Contact {
    node: usize,
    position: usize,
    stroke: usize,
    surface: usize,
    volume: usize,
}

impl Effects {
    /// Nothing yet, of a scene and the schedule that it came to.
    pub fn new(of: OfScene, schedule: &Schedule) -> Self {
        let mut effects = Self {
            walls: Vec::new(),
            surfaces: Vec::new(),
            rendered: Vec::new(),
            watched: Vec::new(),
            contact: None,
            gate: None,
            stroke: 0.0,
            moments: Vec::new(),
        };
        effects.follow(Some(of), schedule);
        effects.watched.iter_mut().for_each(|watched| watched.calls = 0);
        effects
    }

    /// Goes on with another schedule: of a scene that has changed, whose surfaces count from now on, or of what is no scene any more.
    pub fn follow(&mut self, of: Option<OfScene>, schedule: &Schedule) {
        if let Some(OfScene { scene, rendered }) = of {
            let walls = scene.surfaces.iter().map(|s| {
                let damping = s.effects.damping.as_ref().is_some_and(|d| d.of > 0.0);
                [s.effects.stiffness.is_some(), damping]
            });
            let surfaces = scene.surfaces.iter().map(|s| Seen {
                name: s.name.clone(),
                note: s.material.as_ref().map(|m| m.of.clone()).unwrap_or_default(),
                surface: s.surface.clone(),
                soft: s.effects.stiffness.is_none(),
                // It stays touched where it stands as it did.
                touched: self
                    .surfaces
                    .iter()
                    .any(|b| b.touched && b.name == s.name && b.surface == s.surface),
            });
            (self.walls, self.surfaces) = (walls.collect(), surfaces.collect());
            self.rendered = rendered;
        }
        self.watched.clear();
        for (place, (kind, ids)) in self.rendered.iter().enumerate() {
            let nodes = || ids.iter().filter_map(|id| schedule.index_of(id));
            // What is heard of a voice is behind its level.
            let is_level = |node: &usize| schedule.nodes[*node].kind == "level";
            let leveled = nodes().any(|node| is_level(&node));
            let gated = *kind == Kind::Network || VOICED.contains(kind);
            // How often one was called is known after the next tick, since others may have been counted.
            let watched = nodes().filter(|node| !leveled || is_level(node)).map(|node| Watched {
                bit: OF_SURFACES.len() + place,
                node,
                calls: u64::MAX,
                gated,
            });
            self.watched.extend(watched);
        }
        self.gate = schedule.nodes.iter().position(|node| node.kind == "speed_gate");
        self.contact = schedule.nodes.iter().position(|node| node.kind == "contact").and_then(|node| {
            let of = &schedule.nodes[node];
            let input = |name: &str| of.inputs.iter().position(|i| i.name == name);
            let output = |name: &str| of.outputs.iter().position(|o| o.name == name);
            Some(Contact {
                node,
                position: input("position")?,
                stroke: input("stroke")?,
                surface: output("surface")?,
                volume: output("volume")?,
            })
        });
    }

    /// Takes down the tick that has just run.
    pub fn take(&mut self, engine: &Engine) {
        let mut effects = 0;
        let textures = self.gate.is_none_or(|gate| is_something(engine.output(gate, 0)));
        for watched in &mut self.watched {
            let calls = engine.report(watched.node).map_or(0, |report| report.calls);
            let called = calls > watched.calls;
            watched.calls = calls;
            // Called once more to let go, or to fade in the next tick, it answers nothing.
            if called && (textures || !watched.gated) && is_something(engine.output(watched.node, 0)) {
                effects |= 1 << watched.bit;
            }
        }
        let Some(contact) = &self.contact else { return };
        let value = |buffer: Option<&Buffer>, i: usize| match buffer {
            Some(Buffer::Control { values, .. }) => values.get(i).copied().unwrap_or(f64::NAN),
            _ => f64::NAN,
        };
        let position = engine.input(contact.node, contact.position);
        // A wall and a volume may be touched at once.
        let touched = [contact.surface, contact.volume].map(|output| {
            let number = value(engine.output(contact.node, output), 0);
            // What is no number is not at least 0.
            (number >= 0.0).then_some(number as usize)
        });
        for i in touched.into_iter().flatten() {
            let wall = self.walls.get(i).copied().unwrap_or_default();
            (0..wall.len()).filter(|k| wall[*k]).for_each(|k| effects |= 1 << k);
            if let Some(seen) = self.surfaces.get_mut(i) {
                seen.touched = true;
            }
        }
        let stroke = value(engine.input(contact.node, contact.stroke), 0);
        let jumps = std::mem::replace(&mut self.stroke, stroke) != stroke && !self.moments.is_empty();
        let at_mm = [0, 1].map(|k| value(position, k) as f32);
        self.moments.push(Moment { at_mm, effects, touches: touched != [None, None], jumps });
    }

    /// Ticks in which each effect was active: stiffness, damping, and what nodes render in its order.
    pub fn active(&self) -> Vec<u64> {
        let all = OF_SURFACES.len() + self.rendered.len();
        let count = |bit: usize| self.moments.iter().filter(|m| m.effects >> bit & 1 == 1).count() as u64;
        (0..all).map(count).collect()
    }

    /// The picture.
    pub fn into_above(self, tick_hz: u32) -> Above {
        let rendered = self.rendered.iter().map(|(kind, _)| kind.word());
        let effects = OF_SURFACES.into_iter().chain(rendered).map(str::to_owned).collect();
        Above { surfaces: self.surfaces, effects, moments: self.moments, hz: f64::from(tick_hz) }
    }
}

/// Whether there is a force or a sound.
fn is_something(buffer: Option<&Buffer>) -> bool {
    match buffer {
        Some(Buffer::Control { values, .. }) => values.iter().any(|x| *x != 0.0),
        Some(Buffer::Audio { samples, len, silent, .. }) => {
            !silent && samples.iter().take(*len).any(|x| *x != 0.0)
        }
        _ => false,
    }
}
