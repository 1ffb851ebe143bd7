//! `contact`: the surface of a scene that a stylus touches.

use std::collections::HashSet;

use crate::prelude::*;
use crate::since::Since;
use asperity_scene::{ContactSettings, ContactState, Contacts, EffectNames, Motion, Scene};

/// Finds which surface of a scene a stylus touches, and tells the nodes of the effects what to do.
pub struct Contact {
    contacts: Contacts,
    surfaces: usize,
    /// Time since the last valid position.
    since: Since,
}

/// Writes a quantity of the contact to its port.
type Put = fn(&ContactState, &mut [f64]);

/// An output: name, number of values, unit, doc.
struct Port(&'static str, usize, Unit, &'static str, Put);

macro_rules! one {
    ($($field:tt)+) => { |state, to| to[0] = state.$($field)+ };
}
macro_rules! all {
    ($($field:tt)+) => { |state, to| to.copy_from_slice(&state.$($field)+) };
}

const PORTS: &[Port] = &[
    Port("force", 1, N, "normal force by Hooke's law; 0 in the air", one!(force_n)),
    Port("depth", 1, MM, "penetration depth; 0 in the air", one!(depth_mm)),
    Port(
        "plane",
        3,
        MM,
        "a point of the tangent plane, for a device that renders it in its own loop",
        all!(plane_mm),
    ),
    Port("normal", 3, ONE, "outward normal of that plane; 0 without a surface", all!(normal)),
    Port("stiffness", 1, Unit::NEWTON_PER_MILLIMETRE, "stiffness of the surface", one!(stiffness_n_per_mm)),
    Port(
        "damping",
        1,
        Unit::NEWTON_SECOND_PER_METRE,
        "damping of the surface along its normal",
        one!(damping_ns_per_m),
    ),
    Port("push", 3, N, "force of the wall with damping; it never pulls", all!(push_n)),
    Port("tangents", 6, ONE, "two unit vectors along the surface", |state, to| {
        to.copy_from_slice(state.tangents.as_flattened());
    }),
    Port("place", 3, MM, "stylus position along `tangents`, then height over the surface", all!(place_mm)),
    Port("velocity", 2, MM_S, "filtered velocity along `tangents`, for textures", all!(velocity_mm_s)),
    Port("speed", 1, MM_S, "length of `velocity`", one!(speed_mm_s)),
    Port("slide", 2, MM_S, "unfiltered velocity along `tangents`, for friction", all!(slide_mm_s)),
    Port("surface", 1, ONE, "index of the touched wall in the scene, from 0; -1 in the air", one!(surface)),
    Port("volume", 1, ONE, "index of the volume around the stylus; -1 if there is none", one!(volume)),
    Port(
        "approach",
        1,
        MM_S,
        "approach speed in the tick in which contact begins, else 0",
        one!(approach_mm_s),
    ),
    Port("moment", 1, ONE, "time of that contact within its tick, 0 to 1", one!(moment)),
    Port("material", 1, ONE, "index of the network's material", one!(material)),
    Port("material_level", 1, ONE, "level of that material, 0 to 1", one!(network)),
    Port("level_a", 1, ONE, "level of texture voice a, 0 to 1", one!(voices[0].level)),
    Port("place_a", 2, MM, "stylus position on the surface of voice a", all!(voices[0].place_mm)),
    Port("stroke_a", 1, ONE, "changes when voice a changes its surface", one!(voices[0].stroke)),
    Port("level_b", 1, ONE, "level of texture voice b, 0 to 1", one!(voices[1].level)),
    Port("place_b", 2, MM, "stylus position on the surface of voice b", all!(voices[1].place_mm)),
    Port("stroke_b", 1, ONE, "changes when voice b changes its surface", one!(voices[1].stroke)),
];

/// The lists of effects, by where they act.
const LISTS: [(&str, &str); 4] = [
    (
        "touching",
        "Effects that act while a wall is touched. Each NAME adds an output `NAME_slot`. -1 means no slot.",
    ),
    ("inside", "Effects that also act inside volumes. Each NAME adds an output `NAME_slot`."),
    (
        "near",
        "Effects that act from both sides of a surface. Each NAME adds the outputs `NAME_slot`, \
         `NAME_distance` (below 0 inside) and `NAME_normal`.",
    ),
    (
        "textures",
        "Textures other than the network. Each NAME adds the outputs `NAME_slot_a` and `NAME_slot_b`.",
    ),
];

fn names(config: &Config<'_>) -> EffectNames {
    let [touching, inside, near, textures] = LISTS.map(|(list, _)| config.params.texts(list).to_vec());
    EffectNames { touching, inside, near, textures }
}

/// The outputs for the effects, in the order in which `process` writes them.
fn of_effects(names: &EffectNames) -> Vec<Output> {
    let output = |name: String, count, unit: Unit| Output::new(name, ShapeSpec::Control(count), unit);
    let slot = |name: String| output(name, 1, ONE);
    let mut all = Vec::new();
    all.extend(names.touching.iter().chain(&names.inside).map(|name| slot(format!("{name}_slot"))));
    for name in &names.near {
        all.push(slot(format!("{name}_slot")));
        all.push(output(format!("{name}_distance"), 1, MM));
        all.push(output(format!("{name}_normal"), 3, ONE));
    }
    for voice in ["a", "b"] {
        all.extend(names.textures.iter().map(|name| slot(format!("{name}_slot_{voice}"))));
    }
    all
}

impl Node for Contact {
    fn descriptor() -> Descriptor {
        let velocity = |name: &'static str, doc: &'static str| {
            Input::new(name, ShapeSpec::Control(3), MM_S).or(0.0).doc(doc)
        };
        let it = Descriptor::new(
            "contact",
            "Finds the surface of a scene that the stylus touches, and tells each effect what to render.",
        )
        .role(Role::Contact)
        .input(control("position", 3, MM).doc("stylus position x, y, z; z points up"))
        .input(velocity("velocity", "filtered velocity, from `velocity.spatial`"))
        .input(velocity("unfiltered", "unfiltered velocity, from `velocity.unfiltered`"))
        .input(control("stroke", 1, ONE).or(0.0))
        .doc("counts strokes; when it changes, the jump to the new position is no motion");
        PORTS
            .iter()
            .fold(it, |it, Port(name, count, unit, doc, _)| {
                it.output(Output::new(*name, ShapeSpec::Control(*count), unit.clone()).doc(*doc))
            })
            .param(file("scene").doc("Scene file. Only its surfaces and their slots are used."))
            .param(texts(LISTS[0].0).doc(LISTS[0].1))
            .param(texts(LISTS[1].0).doc(LISTS[1].1))
            .param(texts(LISTS[2].0).doc(LISTS[2].1))
            .param(texts(LISTS[3].0).doc(LISTS[3].1))
            .param(text("slots", "").doc(
                "Checksum of the slots in the effects' lists. A scene with other slots is refused. Empty: \
                 no check.",
            ))
            .param(number("max_force_n", 3.3, 0.0..=100.0, "N").doc("Largest force of a surface."))
            .param(number("crossfade_ms", 20.0, 0.1..=1000.0, "ms"))
            .doc("Duration of the crossfade from one surface's textures to the next.")
            .param(number("hold_ms", 20.0, 0.0..=10_000.0, "ms"))
            .doc("Time for which textures continue after contact ends, so that a gate can fade them.")
            .param(number("anticipate_mm", 0.0, 0.0..=100.0, "mm").doc(
                "Distance from which `plane` describes a surface before contact. Use it for a device with \
                 its own loop.",
            ))
            .param(
                number("put_down_mm_s", 100.0, 0.0..=10_000.0, "mm/s")
                    .doc("Approach speed of a stylus that is put down on a wall. 0: no tap."),
            )
            .timing("no latency")
            .resumes(Resume::Never)
    }

    fn ports(config: &Config<'_>, mut ports: Ports) -> Result<Ports, Diagnostic> {
        ports.outputs.extend(of_effects(&names(config)));
        let mut known = HashSet::new();
        match ports.outputs.iter().find(|output| !known.insert(output.name.clone())) {
            Some(Output { name, .. }) => {
                Err(config.params.node_error(format!("two outputs are called `{name}`")))
            }
            None => Ok(ports),
        }
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let p = setup.params;
        let scene = Scene::read(p.file("scene"))?;
        let names = names(setup);
        let (slots, now) = (p.text("slots"), scene.slots_key(names.iter()));
        if !slots.is_empty() && slots != now {
            return Err(p
                .error("scene", "the effects of this scene have changed since the graph was made of it")
                .help(format!(
                    "expand it again; or, where the lists in the graph are as they should be, slots: \
                     \"{now}\""
                )));
        }
        let settings = ContactSettings {
            max_force_n: p.number("max_force_n"),
            crossfade_s: 1e-3 * p.number("crossfade_ms"),
            hold_s: 1e-3 * p.number("hold_ms"),
            anticipate_mm: p.number("anticipate_mm"),
            put_down_mm_s: p.number("put_down_mm_s"),
        };
        let runs_hz = f64::from(setup.tick_hz) / f64::from(setup.every);
        let it = Self {
            contacts: Contacts::new(&scene, &names, settings, runs_hz)?,
            surfaces: scene.surfaces.len(),
            since: Since::new(setup.every),
        };
        Ok(Prepared::new(it).files(scene.pictures))
    }
}

impl Processor for Contact {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let three = |input: usize| -> [f64; 3] { tick.inputs.control(input).try_into().unwrap_or([0.0; 3]) };
        let motion = Motion {
            position_mm: three(0),
            velocity_mm_s: three(1),
            unfiltered_mm_s: three(2),
            stroke: tick.inputs.value(3),
        };
        if tick.inputs.valid(0) {
            let runs = self.since.runs(tick.index);
            if runs > 1 {
                self.contacts.missed(runs - 1);
            }
        }
        let state = self.contacts.step(&motion);
        for (output, Port(.., put)) in PORTS.iter().enumerate() {
            put(state, tick.outputs.control(output));
        }
        let mut output = PORTS.len();
        let mut next = |values: &[f64]| {
            tick.outputs.control(output).copy_from_slice(values);
            output += 1;
        };
        state.touching.iter().chain(&state.inside).for_each(|slot| next(&[*slot]));
        for pull in &state.near {
            next(&[pull.slot]);
            next(&[pull.distance_mm]);
            next(&pull.normal);
        }
        state.textures.iter().flatten().for_each(|slot| next(&[*slot]));
        Status::Continue
    }

    fn reset(&mut self) {
        self.since.reset();
        self.contacts.reset();
    }

    /// Contacts that are held. Another scene has other surfaces: it starts anew.
    fn state(&mut self, state: &mut State<'_>) {
        let mut surfaces = self.surfaces;
        state.keep(&mut surfaces);
        state.require(surfaces == self.surfaces);
        self.since.state(state);
        self.contacts.state(state);
    }

    fn facts(&mut self) -> Vec<Fact> {
        let [walls, volumes, near] = self.contacts.counts();
        vec![
            Fact::count("surfaces", self.surfaces as u64),
            Fact::count("walls", walls as u64),
            Fact::count("volumes", volumes as u64),
            Fact::count("near", near as u64),
            Fact::number("index", self.contacts.bytes() as f64 / 1024.0, "KiB"),
        ]
    }
}
