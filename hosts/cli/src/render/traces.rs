//! What the plot of a render shows: the first signal of each meaning.

use std::path::Path;

use asperity_engine::Engine;
use asperity_graph::Schedule;
use asperity_node::{Buffer, ParamValue, Shape, Unit};
use asperity_plot::{Render, Series};
use asperity_scene::{Kind, VOICED};

use super::effects::Effects;
use super::samples;
use crate::load::OfScene;

/// Longest part of a render that is drawn, in seconds: so much audio is 4 MB a signal.
const MAX_S: u64 = 20;

/// Effects of a scene that are textures.
const TEXTURES: [Kind; 4] = [Kind::Network, VOICED[0], VOICED[1], VOICED[2]];

/// Signals kept for the plot.
pub struct Traces {
    position: Option<Trace>,
    speed: Option<Trace>,
    force: Option<Trace>,
    acceleration: Option<Trace>,
    drive: Option<Trace>,
    active: Option<Trace>,
    gate_mm_s: Option<f64>,
    effects: Option<Effects>,
}

struct Trace {
    node: usize,
    output: usize,
    hz: f64,
    unit: String,
    data: Vec<f32>,
}

impl Traces {
    /// Finds the signals in a graph.
    pub fn new(schedule: &Schedule) -> Self {
        let trace = |(node, output): (usize, usize)| {
            let port = &schedule.nodes[node].outputs[output].port;
            let hz = match port.shape {
                Shape::Audio { rate_hz } => f64::from(rate_hz),
                _ => f64::from(schedule.tick_hz),
            };
            Trace { node, output, hz, unit: port.unit.to_string(), data: Vec::new() }
        };
        // The first wired output of such a shape and unit, or else the first.
        let control = |count: usize, unit: Unit, name: &str| {
            let fits = |n: usize, o: usize| {
                let output = &schedule.nodes[n].outputs[o];
                output.port.shape == Shape::Control { count }
                    && output.port.unit == unit
                    && output.name == name
            };
            let all = (0..schedule.nodes.len())
                .flat_map(|n| (0..schedule.nodes[n].outputs.len()).map(move |o| (n, o)))
                .filter(|&(n, o)| fits(n, o));
            let wired = all.clone().find(|&(n, o)| schedule.nodes[n].outputs[o].readers > 0);
            wired.or_else(|| all.clone().next()).map(trace)
        };
        let into = |kind: &str| {
            let node = schedule.nodes.iter().find(|n| n.kind == kind)?;
            node.inputs.first()?.from.map(trace)
        };
        let last_acceleration = || {
            let fits = |n: usize| {
                schedule.nodes[n].outputs.iter().position(|o| {
                    matches!(o.port.shape, Shape::Audio { .. })
                        && o.port.unit == Unit::METRE_PER_SECOND_SQUARED
                })
            };
            (0..schedule.nodes.len()).rev().find_map(|n| Some((n, fits(n)?))).map(trace)
        };
        let gate_mm_s =
            schedule.nodes.iter().find_map(|n| match (n.kind.as_str(), n.params.get("speed_mm_s")) {
                ("speed_gate", Some(ParamValue::Number(x))) => Some(*x),
                _ => None,
            });
        Self {
            position: control(3, Unit::MILLIMETRE, "position"),
            speed: control(1, Unit::MILLIMETRE_PER_SECOND, "speed"),
            force: control(1, Unit::NEWTON, "force"),
            acceleration: into("actuator_inverse").or_else(last_acceleration),
            drive: into("audio_out"),
            active: control(1, Unit::NONE, "active"),
            gate_mm_s,
            effects: None,
        }
    }

    /// With what is felt of a scene, where the graph is of one.
    pub fn with(self, scene: Option<OfScene>, schedule: &Schedule) -> Self {
        Self { effects: scene.map(|scene| Effects::new(scene, schedule)), ..self }
    }

    /// Takes down the tick that has just run.
    pub fn take(&mut self, engine: &Engine, tick: u64) {
        if tick >= MAX_S * u64::from(engine.schedule().tick_hz) {
            return;
        }
        if let Some(effects) = &mut self.effects {
            effects.take(engine);
        }
        let all = [
            &mut self.position,
            &mut self.speed,
            &mut self.force,
            &mut self.acceleration,
            &mut self.drive,
            &mut self.active,
        ];
        for trace in all.into_iter().flatten() {
            match engine.output(trace.node, trace.output) {
                Some(Buffer::Control { values, .. }) => trace.data.extend(values.iter().map(|x| *x as f32)),
                buffer => trace.data.extend_from_slice(samples(buffer)),
            }
        }
    }

    /// Goes on with the same meanings where another graph has been taken over. What it no longer has ends.
    pub fn follow(&mut self, schedule: &Schedule, scene: Option<OfScene>) {
        if let Some(effects) = &mut self.effects {
            effects.follow(scene, schedule);
        }
        let found = Self::new(schedule);
        let pairs = [
            (&mut self.position, found.position),
            (&mut self.speed, found.speed),
            (&mut self.force, found.force),
            (&mut self.acceleration, found.acceleration),
            (&mut self.drive, found.drive),
            (&mut self.active, found.active),
        ];
        for (trace, found) in pairs {
            let Some(trace) = trace else { continue };
            // Past the last node there is none, so nothing more comes.
            (trace.node, trace.output) = match found {
                Some(f) if f.hz == trace.hz && f.unit == trace.unit => (f.node, f.output),
                _ => (usize::MAX, 0),
            };
        }
    }

    /// The picture.
    pub fn svg(self, graph: &Path, schedule: &Schedule) -> String {
        let series = |t: Option<Trace>, name: &str| t.map(|t| Series::sampled(name, &t.unit, t.hz, t.data));
        let text = |key: &str| {
            schedule.nodes.iter().find_map(|n| match n.params.get(key) {
                Some(ParamValue::Text(t)) if !t.is_empty() => Some(t.clone()),
                _ => None,
            })
        };
        // A scene has a material for each surface.
        let material = text("material").filter(|_| self.effects.is_none());
        let material = material.map(|m| format!("{m}: ")).unwrap_or_default();
        let name = graph.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        let drawn =
            self.position.as_ref().map_or(0, |p| p.data.len() as u64 / 3) / u64::from(schedule.tick_hz);
        let cut = if drawn >= MAX_S { format!(", first {MAX_S} s") } else { String::new() };
        let drive =
            if self.drive.as_ref().is_some_and(|t| t.unit == "V") { "coil voltage" } else { "coil current" };
        let above = self.effects.map(|effects| effects.into_above(schedule.tick_hz));
        // The gate of a scene is open over what has no texture too.
        let active = match &above {
            Some(above) => above.times(&TEXTURES.map(Kind::word)),
            None => self.active.map(spans).unwrap_or_default(),
        };
        Render {
            title: format!("{material}{name}"),
            subtitle: format!("{} Hz ticks, {} Hz audio{cut}", schedule.tick_hz, schedule.audio_hz),
            above,
            active,
            position: series(self.position, "position").map(|s| s.with_columns(&["x", "y", "z"])),
            speed: series(self.speed, "speed"),
            gate_mm_s: self.gate_mm_s,
            force: series(self.force, "normal force"),
            acceleration: series(self.acceleration, "acceleration"),
            drive: series(self.drive, drive),
        }
        .to_svg()
    }
}

/// Times from and to at which a signal is above one half.
fn spans(trace: Trace) -> Vec<(f64, f64)> {
    let mut out: Vec<(f64, f64)> = Vec::new();
    let mut before = false;
    for (i, x) in trace.data.iter().enumerate() {
        let (on, t) = (*x > 0.5, i as f64 / trace.hz);
        match (before, on) {
            (false, true) => out.push((t, t)),
            (true, _) => {
                if let Some(last) = out.last_mut() {
                    last.1 = t;
                }
            }
            _ => {}
        }
        before = on;
    }
    out
}
