//! Renders a setting, records its signals, and measures its response lag: how late the output follows a step
//! of speed.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use asperity_accuracy::response::{Steps, lag_ms};
use asperity_actuator::{ActuatorProfile, Drive, Dynamics, Plant};
use asperity_checks::{Rig, Subject, played::Motion};
use asperity_diagnostics::ron::{Kind, Value};
use asperity_diagnostics::{Diagnostic, Place};
use asperity_dsp::Framing;
use asperity_engine::{Engine, Options};
use asperity_graph::{GraphFile, Schedule};
use asperity_node::{Buffer, Latency, Registry, Role, Shape, Unit};
use asperity_texture::Library;

use crate::knob::{has, set};
use crate::patch::{Patch, along};
use crate::setting::LoadedGraph;

/// Path of a stylus: x, y, z in mm over the time in s; z is up.
pub type Path3 = Arc<dyn Fn(f64) -> [f64; 3] + Send + Sync>;

/// A compiled graph with a stylus that follows one of several paths.
pub struct Chain {
    engine: Engine,
    schedule: Arc<Schedule>,
    places: Places,
    /// Index of the path.
    path: Arc<AtomicUsize>,
}

/// Node and output of a signal.
type At = Option<(usize, usize)>;

#[derive(Clone, Debug, Default)]
struct Places {
    /// Magnitudes that a node retrieves phase from, and the first audio signal behind it.
    frames: At,
    signal: At,
    /// Latency between the two.
    between: Latency,
    /// The last acceleration at the audio rate.
    felt: At,
    /// The signal that drives the coil.
    drive: At,
    /// The actuator, at rest.
    plant: Option<Plant>,
}

/// Recorded signals of a render.
#[derive(Clone, Debug, Default)]
pub struct Rendered {
    /// Magnitudes that phase is retrieved from, unscaled as of a DFT; empty where there are none.
    pub frames: Vec<f32>,
    /// Layout of the frames.
    pub framing: Option<Framing>,
    /// The signal retrieved from them, at their rate; sample 0 is the first of frame 0.
    pub signal: Vec<f64>,
    /// The last acceleration before the actuator \[m/s^2\].
    pub felt: Vec<f32>,
    /// The signal that drives the coil \[A or V\].
    pub drive: Vec<f32>,
    /// Acceleration of the simulated handle under this drive \[m/s^2\]; empty without an actuator.
    pub handle: Vec<f64>,
    /// Rate of `felt`, `drive` and `handle` \[Hz\].
    pub rate_hz: u32,
}

impl Rendered {
    /// Acceleration at the hand \[m/s^2\]: of the handle, otherwise `felt`.
    pub fn acceleration(&self) -> Vec<f64> {
        if self.handle.is_empty() {
            self.felt.iter().map(|x| f64::from(*x)).collect()
        } else {
            self.handle.clone()
        }
    }

    /// The last signal of the chain.
    pub(crate) fn last(&self) -> &[f32] {
        if self.drive.is_empty() { &self.felt } else { &self.drive }
    }
}

/// A graph with another material and seed.
pub(crate) fn over(graph: &GraphFile, registry: &Registry, material: Option<&str>, seed: u64) -> GraphFile {
    let mut graph = graph.clone();
    graph.seed = seed;
    let Some(material) = material else { return graph };
    for node in graph.nodes.iter_mut().filter(|n| is_network(registry, &n.kind)) {
        let place = node.place.clone();
        let value = Value::made(Kind::Text(material.to_owned()), &place);
        set(node, "material", &value);
        // A scene's network has a slot for each surface: all get this material.
        let more = node.params.iter().find(|p| p.name == "materials").and_then(|p| p.value.list().ok());
        if let Some(slots) = more.map(<[_]>::len) {
            set(node, "materials", &Value::made(Kind::List(vec![value; slots]), &place));
        }
    }
    graph
}

/// Checks that the libraries of a graph's networks have these materials.
pub(crate) fn check_materials(base: &LoadedGraph, materials: &[&(String, Place)]) -> Result<(), Diagnostic> {
    for node in base.graph.nodes.iter().filter(|n| is_network(&base.registry, &n.kind)) {
        let Some(setting) = node.params.iter().find(|p| p.name == "library") else { continue };
        let library = Library::shared(setting.value.path()?)?;
        for (name, place) in materials {
            library.material(name).map_err(|e| Diagnostic { file: None, ..e }.at_place(place))?;
        }
    }
    Ok(())
}

/// Whether a kind renders a material of a library.
pub(crate) fn is_network(registry: &Registry, kind: &str) -> bool {
    ["library", "material"].iter().all(|param| has(registry, kind, param).is_some())
}

impl Chain {
    /// Compiles a graph. Its stylus is replaced by one that follows the first of these paths.
    ///
    /// # Errors
    /// Those of the compiler; a graph without a stylus.
    pub fn new(
        graph: &GraphFile,
        registry: &Registry,
        paths: Vec<Path3>,
        options: Options,
    ) -> Result<Self, Diagnostic> {
        let (path, tick_hz) = (Arc::new(AtomicUsize::new(0)), f64::from(graph.tick_hz));
        let chosen = path.clone();
        let motion: Motion = Arc::new(move |tick| {
            paths.get(chosen.load(Ordering::Relaxed)).map_or([0.0; 3], |at| at(tick as f64 / tick_hz))
        });
        let (graph, kinds) = Rig::with_stylus(graph, registry, Some(&motion))
            .map_err(|why| Diagnostic::new(why).in_file(graph.source.path()))?;
        let subject = Subject::new(registry.clone());
        let compiled = subject.compiled(&graph, &kinds).map_err(Diagnostic::new)?;
        let schedule = Arc::new(compiled.schedule.clone());
        let places = Places::new(&schedule, registry)?;
        Ok(Self { engine: Engine::new(compiled, options), schedule, places, path })
    }

    pub(crate) fn play(&mut self, path: usize) {
        self.path.store(path, Ordering::Relaxed);
        self.engine.reset();
    }

    /// Faults of nodes, in all renders.
    pub fn faults(&self) -> u64 {
        self.engine.faults()
    }

    /// The schedule.
    pub fn schedule(&self) -> &Schedule {
        &self.schedule
    }

    /// The engine.
    pub(crate) fn engine(&mut self) -> &mut Engine {
        &mut self.engine
    }

    /// Node and output of the last acceleration at the audio rate; otherwise of the coil's drive.
    pub fn output(&self) -> Option<(usize, usize)> {
        self.places.felt.or(self.places.drive)
    }

    /// Declared latency from the frames, or from the inputs, to [`output`](Self::output): the longest path.
    pub(crate) fn latency(&self) -> Latency {
        let Some((end, _)) = self.output() else { return self.schedule.latency() };
        let begin = self.places.frames.map(|(node, _)| node);
        let nodes = &self.schedule.nodes;
        let mut late: Vec<Option<Latency>> = vec![None; nodes.len()];
        for (i, node) in nodes.iter().enumerate() {
            let before = node.inputs.iter().filter_map(|input| late[input.from.filter(|(n, _)| *n < i)?.0]);
            let first = begin.is_none_or(|begin| begin == i).then_some(Latency::ZERO);
            late[i] = before.chain(first).max().map(|l| l + node.latency);
        }
        late.get(end).copied().flatten().unwrap_or_default()
    }

    fn ticks(&self, seconds: f64) -> u64 {
        (seconds * f64::from(self.schedule.tick_hz)).round() as u64
    }

    /// Renders so many seconds, and records all signals.
    pub fn render(&mut self, seconds: f64) -> Rendered {
        let mut out = Rendered { rate_hz: self.schedule.audio_hz, ..Rendered::default() };
        out.framing = self.places.frames.and_then(|at| framing(&self.schedule, at));
        let scale = out.framing.map_or(0.0, |framing| framing.bin_scale() as f32);
        let (mut signal, mut plant) = (Vec::new(), self.places.plant.clone());
        for _ in 0..self.ticks(seconds) {
            self.engine.tick();
            let buffer = self.places.frames.and_then(|(node, output)| self.engine.output(node, output));
            if let (Some(framing), Some(Buffer::Magnitude { bins, frame: Some((number, _)), .. })) =
                (&out.framing, buffer)
            {
                // A missing frame is zero.
                out.frames.resize(*number as usize * framing.bins, 0.0);
                out.frames.extend(bins.iter().map(|x| x * scale));
            }
            signal.extend(self.samples(self.places.signal).iter().map(|x| f64::from(*x)));
            out.felt.extend_from_slice(self.samples(self.places.felt));
            let drive = self.samples(self.places.drive);
            out.drive.extend_from_slice(drive);
            if let Some(plant) = &mut plant {
                out.handle.extend(drive.iter().map(|u| plant.step(f64::from(*u)).acceleration));
            }
        }
        if let Some(framing) = &out.framing {
            out.signal = earlier(signal, self.places.between, framing.rate_hz);
        }
        out
    }

    /// Renders so many seconds of [`output`](Self::output). Returns the samples and their rate \[Hz\].
    pub(crate) fn render_output(&mut self, seconds: f64) -> (Vec<f32>, u32) {
        let mut felt = Vec::new();
        for _ in 0..self.ticks(seconds) {
            self.engine.tick();
            felt.extend_from_slice(self.samples(self.output()));
        }
        (felt, self.schedule.audio_hz)
    }

    fn samples(&self, at: At) -> &[f32] {
        match at.and_then(|(node, output)| self.engine.output(node, output)) {
            Some(Buffer::Audio { samples, len, .. }) => samples.get(..*len).unwrap_or(&[]),
            _ => &[],
        }
    }
}

/// A signal without its latency. A negative latency becomes leading silence.
fn earlier(signal: Vec<f64>, latency: Latency, rate_hz: u32) -> Vec<f64> {
    let (num, den) = latency.as_ratio();
    let late = (i128::from(num) * i128::from(rate_hz)).div_euclid(i128::from(den)) as i64;
    match usize::try_from(late) {
        Ok(late) => signal.into_iter().skip(late).collect(),
        Err(_) => std::iter::repeat_n(0.0, late.unsigned_abs() as usize).chain(signal).collect(),
    }
}

fn framing(schedule: &Schedule, (node, output): (usize, usize)) -> Option<Framing> {
    let Shape::Magnitude(l) = schedule.nodes.get(node)?.outputs.get(output)?.port.shape else { return None };
    Some(Framing {
        rate_hz: l.rate_hz,
        fft_len: l.length as usize,
        bins: l.bins as usize,
        frame_num: l.frame_rate.num(),
        frame_den: l.frame_rate.den(),
    })
}

impl Places {
    fn new(schedule: &Schedule, registry: &Registry) -> Result<Self, Diagnostic> {
        let felt = last(schedule, &[Unit::METRE_PER_SECOND_SQUARED], |_| true);
        let drive = last(schedule, &[Unit::AMPERE, Unit::VOLT], |_| true);
        let mut it = Self { felt, drive, ..Self::default() };
        it.plant = it.drive.map(|at| plant(schedule, at)).transpose()?.flatten();
        for (i, node) in schedule.nodes.iter().enumerate() {
            let kind = registry.get(&node.kind).map(|k| k.descriptor());
            let Some(retrieval) = kind.and_then(|d| d.retrieval()) else { continue };
            let input = node.inputs.iter().find(|input| input.name == retrieval.input);
            it.frames = input.and_then(|input| input.from);
            it.signal = Some((i, 0));
            it.between = node.latency;
            if retrieval.spectrum {
                let mut adders = schedule.with_role(Role::OverlapAdd);
                let next = adders.find(|(_, n)| n.inputs.iter().any(|p| p.from == Some((i, 0))));
                it.signal = next.map(|(n, _)| (n, 0));
                it.between = next.map_or(it.between, |(_, n)| it.between + n.latency);
            }
            break;
        }
        Ok(it)
    }
}

/// The last signal of some of the nodes at the audio rate, in one of these units.
fn last(schedule: &Schedule, units: &[Unit], among: impl Fn(usize) -> bool) -> At {
    let nodes = schedule.nodes.iter().enumerate().filter(|(i, _)| among(*i));
    let outputs =
        nodes.flat_map(|(i, node)| node.outputs.iter().enumerate().map(move |(o, it)| ((i, o), &it.port)));
    let audio = Shape::Audio { rate_hz: schedule.audio_hz };
    outputs.filter(|(_, port)| port.shape == audio && units.contains(&port.unit)).map(|(at, _)| at).last()
}

/// The actuator of the last stage before the coil.
fn plant(schedule: &Schedule, (node, output): (usize, usize)) -> Result<Option<Plant>, Diagnostic> {
    let mut stages = schedule.nodes.iter().filter(|n| n.params.get("handle_mass_g").is_some());
    let Some(stage) = stages.rfind(|n| n.params.get("profile").is_some()) else { return Ok(None) };
    let base = stage.params.place("profile").or(stage.params.node_place());
    let base = base.and_then(|p| p.source.path().parent()).unwrap_or(Path::new(""));
    let profile = ActuatorProfile::find(stage.params.text("profile"), base)?;
    let dynamics = Dynamics::new(&profile, stage.params.number("handle_mass_g"))
        .map_err(|e| Diagnostic::new(e.to_string()))?;
    let volts = schedule.nodes[node].outputs[output].port.unit == Unit::VOLT;
    let drive = if volts { Drive::Voltage } else { Drive::Current };
    Ok(Some(Plant::new(&dynamics, drive, f64::from(schedule.audio_hz))))
}

/// Half a period of the steps \[s\].
const HALF_S: f64 = 0.4;
/// First steps, which are left out while the chain starts.
const LEFT_OUT: usize = 2;
/// The two speeds \[mm/s\]. A period covers 64.618 mm, so that anything periodic along the path is met at
/// every phase.
const SPEEDS: [f64; 2] = [40.4, 121.145];
/// Penetration into the floor \[mm\]: 1 N at 0.5 N/mm.
const DEPTH_MM: f64 = 2.0;

/// Position of a stylus whose speed along x steps up and down, or stays at the lower speed.
fn stylus(t: f64, stepped: bool) -> [f64; 3] {
    let [slow, fast] = if stepped { SPEEDS } else { [SPEEDS[0]; 2] };
    let period = (t / (2.0 * HALF_S)).floor();
    let within = t - period * 2.0 * HALF_S;
    let x = period * HALF_S * (slow + fast) + slow * within.min(HALF_S) + fast * (within - HALF_S).max(0.0);
    [x, 0.0, -DEPTH_MM]
}

/// Paths of a stylus with stepped and with constant speed; circles on a patch.
pub(crate) fn stepped_paths(patch: Option<&Patch>) -> [Path3; 2] {
    [true, false].map(|stepped| along(patch, Arc::new(move |t| stylus(t, stepped))))
}

/// Speed of the straight stroke \[mm/s\]; time to settle and time to analyse \[s\].
pub(crate) const STRAIGHT: (f64, [f64; 2]) = (100.0, [0.5, 1.5]);

/// Path along x at constant speed.
pub(crate) fn straight() -> Path3 {
    Arc::new(|t| [STRAIGHT.0 * t, 0.0, -DEPTH_MM])
}

impl Chain {
    /// Mean of the two speeds of [`lag_ms`](Self::lag_ms) \[mm/s\].
    pub const MEAN_MM_S: f64 = (SPEEDS[0] + SPEEDS[1]) / 2.0;

    /// Compiles a graph to measure its response lag. In a scene the stylus follows a circle; a scene without
    /// room gets a straight line.
    ///
    /// # Errors
    /// Those of the compiler; a graph without a stylus.
    pub fn stepped(graph: &GraphFile, registry: &Registry) -> Result<Self, Diagnostic> {
        let paths = stepped_paths(Patch::of(graph, registry).unwrap_or(None).as_ref());
        let mut it = Self::new(graph, registry, paths.into(), Options::default())?;
        // Of several actuators the slowest is measured.
        let path = it.schedule.slowest().through;
        let on_path = last(&it.schedule, &[Unit::METRE_PER_SECOND_SQUARED], |node| path.contains(&node));
        it.places.felt = on_path.or(it.places.felt);
        Ok(it)
    }

    /// Response lag \[ms\]: from a step from 40 to 121 mm/s until 10, 50 and 90 % of the change of level,
    /// over so many steps. None where the level does not rise with speed. The chain's stepped path has this
    /// index, and the steady one is behind it.
    pub fn lag_ms(&mut self, path: usize, steps: usize) -> Option<[f64; 3]> {
        let periods = steps + LEFT_OUT;
        let seconds = 2.0 * HALF_S * periods as f64;
        self.play(path);
        let (stepped, rate_hz) = self.render_output(seconds);
        self.play(path + 1);
        let (still, _) = self.render_output(seconds);
        let half = (HALF_S * f64::from(rate_hz)) as usize;
        let at: Vec<usize> = (LEFT_OUT..periods).map(|k| (2 * k + 1) * half).collect();
        lag_ms(&stepped, &still, &Steps { rate_hz, at: &at, before: half / 2, after: half / 2 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use asperity_diagnostics::{Source, Span};

    fn graph(nodes: &str) -> GraphFile {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../graphs/g.ron");
        crate::testing::graph_of(path, nodes, "")
    }

    #[test]
    fn all_slots_of_a_scene_get_the_material() {
        let graph = graph(
            r#""t": (kind: "texture_network", params: (material: "oak", materials: ["cut pile", "canvas"])),
            "u": (kind: "texture_network", params: (material: "oak"))"#,
        );
        let over = over(&graph, &asperity_nodes::registry(), Some("leather"), 7);
        let text = |node: &str| over.node(node).unwrap().to_string();
        for (node, want) in [
            ("t", r#"material: "leather""#),
            ("t", r#"materials: ["leather", "leather"]"#),
            ("u", r#"material: "leather""#),
        ] {
            assert!(text(node).contains(want), "{want}: {}", text(node));
        }
        assert!(!text("u").contains("materials"), "{}", text("u"));
    }

    #[test]
    fn unknown_material_is_reported_at_its_place() {
        let base = crate::testing::loaded(
            "g",
            graph(
                r#""t": (kind: "texture_network",
                    params: (library: "models/surfaces/materials.ron", material: "oak"))"#,
            ),
        );
        let source = Source::new("s.ron", r#"["canvas", "canvsa"]"#);
        let at = |name: &str, start: usize| {
            (name.to_owned(), Place { span: Span { start, end: start + 8 }, source: source.clone() })
        };
        let [known, unknown] = [at("canvas", 1), at("canvsa", 11)];
        check_materials(&base, &[&known]).unwrap();
        let e = check_materials(&base, &[&known, &unknown]).unwrap_err().to_string();
        assert!(e.starts_with("s.ron:1:12:") && e.contains("did you mean `canvas`?"), "{e}");
    }

    #[test]
    fn stylus_moves_at_the_two_speeds() {
        for (t, want) in [(0.1, 40.4), (0.5, 121.145), (0.9, 40.4), (8.3, 40.4), (8.7, 121.145)] {
            let speed = (stylus(t + 1e-3, true)[0] - stylus(t, true)[0]) / 1e-3;
            assert!((speed - want).abs() < 1e-6, "{t}: {speed}");
            let still = (stylus(t + 1e-3, false)[0] - stylus(t, false)[0]) / 1e-3;
            assert!((still - 40.4).abs() < 1e-6, "{t}: {still}");
        }
        // The path is continuous between periods.
        assert!((stylus(0.8 - 1e-9, true)[0] - stylus(0.8, true)[0]).abs() < 1e-6);
    }
}
