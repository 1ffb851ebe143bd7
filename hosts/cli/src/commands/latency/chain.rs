//! How late a graph answers a change of speed.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use asperity_engine::Engine;
use asperity_graph::{Compiled, GraphFile, Schedule};
use asperity_measure::response::{Steps, lag_ms};
use asperity_node::{Buffer, Latency, Registry, Shape, Unit};
use asperity_source::Diagnostic;

use crate::args::{GraphArgs, LatencyArgs};
use crate::failure::{Failure, complain};
use crate::kinds::Kinds;
use crate::{load, source};

/// Half a period of the steps, in seconds.
const HALF_S: f64 = 0.4;
/// Steps up: more make a random texture's level surer.
const PERIODS: usize = 150;
/// Steps that are left out, while the chain starts.
const LEFT_OUT: usize = 2;
/// Speeds between which it steps, in mm/s. A period goes 64.618 mm: whatever repeats along the way comes at every phase.
const SPEEDS: [f64; 2] = [40.4, 121.145];
/// How deep the stylus is in a floor at height 0, in mm: 1 N at 0.5 N/mm.
const DEPTH_MM: f64 = 2.0;

/// How late a graph answers.
pub struct Chain {
    /// The graph, as it was named.
    pub graph: String,
    /// Milliseconds after a step of speed until the level has gone 10, 50 and 90 % of its way.
    pub lag_ms: [f64; 3],
    /// What is known to make up the 50 %.
    pub items: Vec<(String, f64)>,
}

/// A graph that can be measured: compiled to play a stroke whose speed steps, and one whose speed does not.
pub struct Ready {
    path: PathBuf,
    stepped: Compiled,
    still: Compiled,
    /// Node and output that are heard.
    at: (usize, usize),
}

/// Makes every graph ready, so that nothing is measured where one of them is wrong. A setting goes to the graphs that have what it
/// sets, and the others are named; where none has, it is an error.
pub fn prepare(args: &LatencyArgs) -> Result<Vec<Ready>, Failure> {
    let dir = tempfile::Builder::new().prefix("asperity-latency-").tempdir();
    let dir = dir.map_err(|e| Failure::Machine(format!("no folder for a stroke: {e}")))?;
    let (steps, still) = (dir.path().join("steps.csv"), dir.path().join("still.csv"));
    for (file, speeds) in [(&steps, SPEEDS), (&still, [SPEEDS[0]; 2])] {
        std::fs::write(file, stroke(speeds)).map_err(|e| Failure::writing(file, e))?;
    }
    let drafts = args.graphs.iter().map(|path| Draft::read(path, &steps, args));
    let drafts: Vec<Draft> = drafts.collect::<Result<_, _>>()?;
    let mut sets = vec![Vec::new(); drafts.len()];
    for assignment in &args.set {
        let has: Vec<bool> = drafts.iter().map(|draft| draft.has(assignment)).collect();
        let nowhere = !has.contains(&true);
        for (sets, _) in sets.iter_mut().zip(&has).filter(|(_, has)| nowhere || **has) {
            sets.push(assignment.as_str());
        }
        let others = drafts.iter().zip(&has).filter(|(_, has)| !**has && !nowhere);
        for (draft, _) in others {
            complain(&format!(
                "note: {} has no such parameter and is measured without --set {assignment}\n",
                draft.args.graph.display()
            ));
        }
    }
    let ready = |(draft, sets): (Draft, Vec<&str>)| -> Result<Ready, Failure> {
        let stepped = draft.compiled(&steps, &sets)?;
        let at = heard(&stepped.schedule, &draft.args.graph)?;
        let still = draft.compiled(&still, &sets)?;
        Ok(Ready { path: draft.args.graph, stepped, still, at })
    };
    drafts.into_iter().zip(sets).map(ready).collect()
}

/// Runs a graph offline over strokes whose speed steps.
pub fn measure(ready: Ready) -> Result<Chain, Failure> {
    let Ready { path, stepped, still, at } = ready;
    let end = at.0;
    let of_scene = stepped.schedule.nodes.iter().any(|node| node.kind == "contact");
    let (schedule, stepped, rate_hz) = run(stepped, at);
    let (_, still, _) = run(still, at);
    let half = (HALF_S * f64::from(rate_hz)) as usize;
    let at: Vec<usize> = (LEFT_OUT..PERIODS).map(|k| (2 * k + 1) * half).collect();
    let steps = Steps { rate_hz, at: &at, before: half / 2, after: half / 2 };
    let lag_ms = lag_ms(&stepped, &still, &steps).ok_or_else(|| {
        Failure::from(
            Diagnostic::new("the level does not rise with speed, so no answer to a step of it can be seen")
                .in_file(&path)
                .help(if of_scene {
                    "the stroke goes 10 m along x at y = 0, 2 mm deep: make the surface that is measured a `plane`, or \
                     as long a rectangle, of a material whose level follows speed"
                } else {
                    "choose a material whose level follows speed: --set texture.material=\"sandpaper P50\""
                }),
        )
    })?;
    let items = items(&schedule, end, lag_ms[1]);
    Ok(Chain { graph: path.display().to_string(), lag_ms, items })
}

/// A stylus pressed to the surface whose speed along x steps up and down again.
fn stroke([slow, fast]: [f64; 2]) -> String {
    let mut csv = String::from("t_s,x_mm,y_mm,z_mm\n");
    let mut x = 0.0;
    for k in 0..(2.0 * HALF_S * PERIODS as f64 * 500.0) as usize {
        let t = k as f64 / 500.0;
        let _ = writeln!(csv, "{t},{x},0,{}", -DEPTH_MM);
        x += if (t / HALF_S) as usize % 2 == 1 { fast } else { slow } / 500.0;
    }
    csv
}

/// A graph as its file has it but for the stroke that it plays, and the kinds that it may use.
struct Draft {
    args: GraphArgs,
    graph: GraphFile,
    registry: Registry,
}

impl Draft {
    fn read(path: &Path, stroke: &Path, args: &LatencyArgs) -> Result<Self, Failure> {
        let args = GraphArgs {
            graph: path.to_owned(),
            set: Vec::new(),
            input: None,
            hand: None,
            no_prune: false,
            strict: false,
            plugins: args.plugins.clone(),
        };
        let mut kinds = Kinds::new(&args.plugins.plugin);
        let mut graph = load::read(&args, &mut kinds)?;
        source::play(&mut graph, stroke)?;
        let registry = kinds.registry(Some(&graph))?;
        Ok(Self { args, graph, registry })
    }

    /// Whether it has what an assignment sets, whatever the value. The graph's own settings (`seed`) are in every graph.
    fn has(&self, assignment: &str) -> bool {
        let target = assignment.split_once('=').map_or(assignment, |(target, _)| target);
        let Some((id, name)) = target.trim().split_once('.') else { return true };
        let kind = self.graph.node(id).and_then(|node| self.registry.get(&node.kind));
        kind.is_some_and(|kind| name == "every" || kind.descriptor().params.iter().any(|p| p.name == name))
    }

    /// Compiles it with another stroke.
    fn compiled(&self, stroke: &Path, sets: &[&str]) -> Result<Compiled, Failure> {
        let mut graph = self.graph.clone();
        source::play(&mut graph, stroke)?;
        for assignment in sets {
            graph.set(assignment, "--set")?;
        }
        // What pushes back needs no device here.
        graph.nodes.retain(|n| !n.kind.ends_with("_force"));
        let ids: Vec<String> = graph.nodes.iter().map(|n| n.id.clone()).collect();
        graph.wires.retain(|w| ids.contains(&w.to.node));
        load::compiled(&graph, &self.args, &self.registry)
    }
}

/// The acceleration nearest to the actuator, else what drives it: node and output.
fn heard(schedule: &Schedule, path: &Path) -> Result<(usize, usize), Failure> {
    let outputs =
        schedule.nodes.iter().enumerate().flat_map(|(i, n)| (0..n.outputs.len()).map(move |o| (i, o)));
    let of = |unit: &Unit| {
        let fits = |&(i, o): &(usize, usize)| {
            let port = &schedule.nodes[i].outputs[o].port;
            port.shape == Shape::Audio { rate_hz: schedule.audio_hz } && port.unit == *unit
        };
        outputs.clone().rfind(fits)
    };
    [Unit::METRE_PER_SECOND_SQUARED, Unit::AMPERE, Unit::VOLT].iter().find_map(of).ok_or_else(|| {
        let message = "nothing in this graph is an acceleration, a current or a voltage at the audio rate";
        Diagnostic::new(message).in_file(path).into()
    })
}

fn run(compiled: Compiled, (node, output): (usize, usize)) -> (Schedule, Vec<f32>, u32) {
    let schedule = compiled.schedule.clone();
    let mut engine = Engine::new(compiled, Default::default());
    let ticks = 2.0 * HALF_S * PERIODS as f64 * f64::from(schedule.tick_hz);
    let mut out = Vec::new();
    for _ in 0..ticks as u64 {
        engine.tick();
        if let Some(Buffer::Audio { samples, len, .. }) = engine.output(node, output) {
            out.extend_from_slice(&samples[..*len]);
        }
    }
    let rate_hz = schedule.audio_hz;
    (schedule, out, rate_hz)
}

/// What is known to make a graph late up to one of its nodes, and what is left for its windows. Of ways side by side the slowest counts.
fn items(schedule: &Schedule, end: usize, lag_ms: f64) -> Vec<(String, f64)> {
    let mut items = Vec::new();
    let (leads, slowest) = leading_to(schedule, end);
    for (i, node) in schedule.nodes.iter().enumerate() {
        if leads[i]
            && node.kind == "velocity"
            && let Some(hz) = node.params.get_number("cutoff_hz").filter(|hz| *hz > 0.0)
        {
            // The group delay of a second-order Butterworth low-pass at 0: sqrt(2) / w_c.
            let ms = std::f64::consts::SQRT_2 / (std::f64::consts::TAU * hz) * 1e3;
            items.push((format!("`{}`: its low-pass of {hz} Hz", node.id), ms));
        }
        if slowest[i] && node.latency != Latency::ZERO {
            items.push((format!("`{}` ({}): declared", node.id, node.kind), node.latency.ms()));
        }
    }
    let known: f64 = items.iter().map(|(_, ms)| ms).sum();
    items.push(("windows, history and the model's own rise: the rest".into(), lag_ms - known));
    items
}

/// Which nodes lead to one, and which are on the slowest way there. Nodes stand in the order in which they run.
fn leading_to(schedule: &Schedule, end: usize) -> (Vec<bool>, Vec<bool>) {
    let count = schedule.nodes.len();
    let mut leads: Vec<Vec<bool>> = schedule.nodes.iter().map(|n| vec![false; n.outputs.len()]).collect();
    if let Some(end) = leads.get_mut(end) {
        end.fill(true);
    }
    // Wires into a node that lead on, of those that come from nodes that ran before it.
    let mut before: Vec<Vec<usize>> = vec![Vec::new(); count];
    for i in (0..count).rev() {
        let node = &schedule.nodes[i];
        let wanted: Vec<&str> =
            node.outputs.iter().zip(&leads[i]).filter(|(_, on)| **on).map(|(o, _)| o.name.as_str()).collect();
        for input in &node.inputs {
            let leads_on = wanted.iter().any(|output| passes(&node.kind, &input.name, output));
            if let Some((from, output)) = input.from.filter(|(from, _)| leads_on && *from < i) {
                leads[from][output] = true;
                before[i].push(from);
            }
        }
    }
    let mut late_ms = vec![0.0; count];
    for i in 0..count {
        let most = before[i].iter().map(|n| late_ms[*n]).fold(f64::NEG_INFINITY, f64::max);
        late_ms[i] = if most.is_finite() { most } else { 0.0 } + schedule.nodes[i].latency.ms();
    }
    let mut slowest = vec![false; count];
    let mut at = (end < count).then_some(end);
    while let Some(i) = at {
        slowest[i] = true;
        at = before[i].iter().copied().max_by(|a, b| late_ms[*a].total_cmp(&late_ms[*b]));
    }
    // What goes round a low-pass is not held up by it.
    let leads = schedule.nodes.iter().zip(&leads).map(|(node, outputs)| {
        let held = |o: usize| node.kind != "velocity" || node.outputs[o].name != "unfiltered";
        outputs.iter().enumerate().any(|(o, on)| *on && held(o))
    });
    (leads.collect(), slowest)
}

/// Whether an output follows an input: where a stylus touches does not follow from how fast it is.
fn passes(kind: &str, input: &str, output: &str) -> bool {
    match (kind, input) {
        ("contact", "velocity") => matches!(output, "velocity" | "speed"),
        ("contact", "unfiltered") => matches!(output, "slide" | "push"),
        // These open it, and hold nothing up.
        ("speed_gate", "speed" | "force") => false,
        _ => true,
    }
}
