//! The plot of a render: signals over time, and for a scene the stroke from above.

use std::path::Path;

use asperity_engine::Engine;
use asperity_graph::Schedule;
use asperity_node::{Buffer, ParamValue, Role, Shape, Unit};
use asperity_offline::render::samples;
use asperity_plot::{Moment, Render, SceneMap, Seen, Series};
use asperity_scene::Rendered;

use crate::load::OfScene;

/// Longest part of a render that is drawn \[s\]: 4 MB of audio a signal.
const MAX_S: u64 = 20;

/// Signals for the plot, the first of each meaning.
pub struct Traces {
    /// Position, speed, force, acceleration, drive, and whether the gate is open.
    all: [Option<Trace>; 6],
    gate_mm_s: Option<f64>,
    effects: Option<Effects>,
}

struct Trace {
    /// Node and output; none has the number of one that ended.
    from: (usize, usize),
    hz: f64,
    unit: String,
    data: Vec<f32>,
}

fn traces(schedule: &Schedule) -> [Option<Trace>; 6] {
    let port = |(node, output): (usize, usize)| &schedule.nodes[node].outputs[output];
    let trace = |from| {
        let port = &port(from).port;
        let hz = match port.shape {
            Shape::Audio { rate_hz } => rate_hz,
            _ => schedule.tick_hz,
        };
        Trace { from, hz: hz.into(), unit: port.unit.to_string(), data: Vec::new() }
    };
    let outputs = || {
        let nodes = schedule.nodes.iter().enumerate();
        nodes.flat_map(|(n, node)| (0..node.outputs.len()).map(move |o| (n, o)))
    };
    // The first wired output of this shape, unit and name; else the first.
    let control = |count: usize, unit: Unit, name: &str| {
        let fits = |of: &(usize, usize)| {
            let it = port(*of);
            it.port.shape == Shape::Control { count } && it.port.unit == unit && it.name == name
        };
        let wired = outputs().find(|of| fits(of) && port(*of).readers > 0);
        wired.or_else(|| outputs().find(fits)).map(trace)
    };
    let into = |role| {
        let (_, node) = schedule.with_role(role).next()?;
        node.inputs.first()?.from.map(trace)
    };
    let sounds = |of: &(usize, usize)| {
        let port = &port(*of).port;
        matches!(port.shape, Shape::Audio { .. }) && port.unit == Unit::METRE_PER_SECOND_SQUARED
    };
    // The first of the last node.
    let last = || outputs().filter(sounds).max_by_key(|(node, output)| (*node, usize::MAX - output));
    [
        control(3, Unit::MILLIMETRE, "position"),
        control(1, Unit::MILLIMETRE_PER_SECOND, "speed"),
        control(1, Unit::NEWTON, "force"),
        into(Role::ActuatorInverse).or_else(|| last().map(trace)),
        into(Role::AudioOutput),
        control(1, Unit::NONE, "active"),
    ]
}

impl Traces {
    /// Starts for a graph, and the scene from which it was lowered.
    pub fn new(schedule: &Schedule, scene: Option<OfScene>) -> Self {
        Self {
            all: traces(schedule),
            gate_mm_s: speed_gate(schedule).map(|(_, mm_s)| mm_s),
            effects: scene.map(|scene| Effects::new(scene, schedule)),
        }
    }

    pub fn take(&mut self, engine: &Engine, tick: u64) {
        if tick >= MAX_S * u64::from(engine.schedule().tick_hz) {
            return;
        }
        if let Some(effects) = &mut self.effects {
            effects.take(engine);
        }
        for trace in self.all.iter_mut().flatten() {
            match engine.output(trace.from.0, trace.from.1) {
                Some(Buffer::Control { values, .. }) => trace.data.extend(values.iter().map(|x| *x as f32)),
                buffer => trace.data.extend_from_slice(samples(buffer)),
            }
        }
    }

    /// Continues with the signals of the same meanings in a new graph. Others end.
    pub fn follow(&mut self, schedule: &Schedule, scene: Option<OfScene>) {
        if let Some(effects) = &mut self.effects {
            effects.follow(scene, schedule);
        }
        for (trace, found) in self.all.iter_mut().zip(traces(schedule)) {
            let Some(trace) = trace else { continue };
            let found = found.filter(|found| found.hz == trace.hz && found.unit == trace.unit);
            trace.from = found.map_or((usize::MAX, 0), |found| found.from);
        }
    }

    pub fn svg(self, graph: &Path, schedule: &Schedule) -> String {
        let series = |t: Option<Trace>, name: &str| t.map(|t| Series::sampled(name, &t.unit, t.hz, t.data));
        let material = schedule.nodes.iter().find_map(|n| match n.params.get("material") {
            // A scene has a material for each surface.
            Some(ParamValue::Text(t)) if !t.is_empty() && self.effects.is_none() => Some(format!("{t}: ")),
            _ => None,
        });
        let material = material.unwrap_or_default();
        let name = graph.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        let [position, speed, force, acceleration, drive, active] = self.all;
        let drawn = position.as_ref().map_or(0, |p| p.data.len() as u64 / 3) / u64::from(schedule.tick_hz);
        let cut = if drawn >= MAX_S { format!(", first {MAX_S} s") } else { String::new() };
        let volts = drive.as_ref().is_some_and(|t| t.unit == "V");
        let textures = self.effects.as_ref().map(Effects::textures).unwrap_or_default();
        let above = self.effects.map(|effects| effects.into_scene_map(schedule.tick_hz));
        // The gate of a scene is open over what has no texture too.
        let active = match &above {
            Some(above) => above.times(&textures.iter().map(String::as_str).collect::<Vec<_>>()),
            None => active.map(spans).unwrap_or_default(),
        };
        Render {
            title: format!("{material}{name}"),
            subtitle: format!("{} Hz ticks, {} Hz audio{cut}", schedule.tick_hz, schedule.audio_hz),
            above,
            active,
            position: series(position, "position").map(|s| s.with_columns(&["x", "y", "z"])),
            speed: series(speed, "speed"),
            gate_mm_s: self.gate_mm_s,
            force: series(force, "normal force"),
            acceleration: series(acceleration, "acceleration"),
            drive: series(drive, if volts { "coil voltage" } else { "coil current" }),
        }
        .to_svg()
    }
}

/// Intervals of time in which a signal is above one half.
fn spans(trace: Trace) -> Vec<(f64, f64)> {
    let on = trace.data.iter().map(|x| *x > 0.5).enumerate().collect::<Vec<_>>();
    let runs = on.chunk_by(|a, b| a.1 == b.1).filter(|run| run[0].1);
    // The end is the first sample that is off.
    let end = |run: &[(usize, bool)]| (run[0].0 + run.len()).min(trace.data.len() - 1);
    runs.map(|run| (run[0].0 as f64 / trace.hz, end(run) as f64 / trace.hz)).collect()
}

/// Effects that a surface itself gives. They come before the kinds that nodes render.
const OF_SURFACES: [&str; 2] = ["stiffness", "damping"];

/// The stroke over a scene, with the effects that were active in each tick.
#[derive(Default)]
pub struct Effects {
    rendered: Vec<Rendered>,
    /// Of each surface: whether it is stiff, whether it is damped.
    walls: Vec<[bool; 2]>,
    surfaces: Vec<Seen>,
    pub touched: Vec<u64>,
    watched: Vec<Watched>,
    contact: Option<Contact>,
    /// The gate that textures go through.
    gate: Option<usize>,
    stroke: f64,
    moments: Vec<Moment>,
}

struct Watched {
    bit: usize,
    node: usize,
    calls: u64,
    /// Whether its output goes through the gate.
    gated: bool,
}

/// The `contact` node, and indices of its inputs position and stroke and outputs surface and volume.
#[derive(Clone, Copy)]
struct Contact {
    node: usize,
    inputs: [usize; 2],
    outputs: [usize; 2],
}

impl Effects {
    pub fn new(of: OfScene, schedule: &Schedule) -> Self {
        let mut effects = Self::default();
        effects.follow(Some(of), schedule);
        effects.watched.iter_mut().for_each(|watched| watched.calls = 0);
        effects
    }

    /// Continues with a new schedule, of a changed scene or of no scene.
    pub fn follow(&mut self, of: Option<OfScene>, schedule: &Schedule) {
        if let Some(OfScene { scene, rendered, .. }) = of {
            let walls = scene.surfaces.iter().map(|s| {
                let damping = s.effects.damping.as_ref().is_some_and(|d| d.of > 0.0);
                [s.effects.stiffness.is_some(), damping]
            });
            let before = &self.surfaces;
            let surfaces = scene.surfaces.iter().map(|s| Seen {
                name: s.name.clone(),
                note: s.material.as_ref().map(|m| m.of.clone()).unwrap_or_default(),
                surface: s.surface.clone(),
                soft: s.effects.stiffness.is_none(),
                // A surface that did not change stays touched.
                touched: before.iter().any(|b| b.touched && b.name == s.name && b.surface == s.surface),
            });
            (self.walls, self.surfaces) = (walls.collect(), surfaces.collect());
            self.touched = vec![0; self.surfaces.len()];
            self.rendered = rendered;
        }
        self.watched.clear();
        for (place, Rendered { texture: gated, nodes: ids, .. }) in self.rendered.iter().enumerate() {
            let nodes = || ids.iter().filter_map(|id| schedule.index_of(id));
            // A voice is heard behind its level.
            let is_level = |node: &usize| schedule.nodes[*node].gate.is_some();
            let leveled = nodes().any(|node| is_level(&node));
            // The next tick sets the count of calls: the node may have been called before.
            let watched = nodes().filter(|node| !leveled || is_level(node)).map(|node| Watched {
                bit: OF_SURFACES.len() + place,
                node,
                calls: u64::MAX,
                gated: *gated,
            });
            self.watched.extend(watched);
        }
        self.gate = speed_gate(schedule).map(|(gate, _)| gate);
        self.contact = schedule.with_role(Role::Contact).next().and_then(|(node, of)| {
            let input = |name: &str| of.inputs.iter().position(|i| i.name == name);
            let output = |name: &str| of.outputs.iter().position(|o| o.name == name);
            let inputs = [input("position")?, input("stroke")?];
            Some(Contact { node, inputs, outputs: [output("surface")?, output("volume")?] })
        });
    }

    fn textures(&self) -> Vec<String> {
        self.rendered.iter().filter(|of| of.texture).map(|of| of.kind.clone()).collect()
    }

    pub fn take(&mut self, engine: &Engine) {
        let mut effects = 0;
        let textures = self.gate.is_none_or(|gate| is_something(engine.output(gate, 0)));
        for watched in &mut self.watched {
            let calls = engine.report(watched.node).map_or(0, |report| report.calls);
            let called = calls > watched.calls;
            watched.calls = calls;
            // A node that is called once more to fade out puts out nothing.
            if called && (textures || !watched.gated) && is_something(engine.output(watched.node, 0)) {
                effects |= 1 << watched.bit;
            }
        }
        let Some(Contact { node, inputs, outputs }) = self.contact else { return };
        let value = |buffer: Option<&Buffer>, i: usize| match buffer {
            Some(Buffer::Control { values, .. }) => values.get(i).copied().unwrap_or(f64::NAN),
            _ => f64::NAN,
        };
        let [position, stroke] = inputs.map(|input| engine.input(node, input));
        // A wall and a volume may be touched at once.
        let touched = outputs.map(|output| {
            let number = value(engine.output(node, output), 0);
            // NaN is not at least 0.
            (number >= 0.0).then_some(number as usize)
        });
        for i in touched.into_iter().flatten().filter(|i| *i < self.walls.len()) {
            let [stiff, damped] = self.walls[i];
            effects |= u16::from(stiff) | u16::from(damped) << 1;
            self.surfaces[i].touched = true;
            self.touched[i] += 1;
        }
        let stroke = value(stroke, 0);
        let jumps = std::mem::replace(&mut self.stroke, stroke) != stroke && !self.moments.is_empty();
        let at_mm = [0, 1].map(|k| value(position, k) as f32);
        self.moments.push(Moment { at_mm, effects, touches: touched != [None, None], jumps });
    }

    /// Whether a surface was touched in the last tick.
    pub fn touches(&self) -> bool {
        self.moments.last().is_some_and(|moment| moment.touches)
    }

    /// Ticks in which each effect was active: stiffness, damping, then the kinds that nodes render.
    pub fn active(&self) -> Vec<u64> {
        let all = OF_SURFACES.len() + self.rendered.len();
        let count = |bit: usize| self.moments.iter().filter(|m| m.effects >> bit & 1 == 1).count() as u64;
        (0..all).map(count).collect()
    }

    pub fn into_scene_map(self, tick_hz: u32) -> SceneMap {
        let rendered = self.rendered.iter().map(|of| of.kind.clone());
        let effects = OF_SURFACES.into_iter().map(str::to_owned).chain(rendered).collect();
        SceneMap { surfaces: self.surfaces, effects, moments: self.moments, hz: f64::from(tick_hz) }
    }
}

/// The gate over a speed, with the speed that opens it \[mm/s\].
fn speed_gate(schedule: &Schedule) -> Option<(usize, f64)> {
    let gates = schedule.nodes.iter().enumerate().filter(|(_, node)| node.gate.is_some());
    gates.filter_map(|(i, gate)| Some((i, gate.params.get_number("speed_mm_s")?))).next()
}

/// Whether a buffer holds a force or a sound.
fn is_something(buffer: Option<&Buffer>) -> bool {
    match buffer {
        Some(Buffer::Control { values, .. }) => values.iter().any(|x| *x != 0.0),
        Some(Buffer::Audio { samples, len, silent, .. }) => {
            !silent && samples.iter().take(*len).any(|x| *x != 0.0)
        }
        _ => false,
    }
}
