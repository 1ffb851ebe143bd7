//! How late a graph answers a change of speed.

use std::fmt::Write as _;
use std::path::Path;

use asperity_engine::Engine;
use asperity_graph::{Compiled, GraphFile, Schedule};
use asperity_measure::response::{Steps, lag_ms};
use asperity_node::{Buffer, Latency, Shape, Unit};
use asperity_source::Diagnostic;

use crate::args::{GraphArgs, LatencyArgs};
use crate::failure::Failure;
use crate::kinds::Kinds;
use crate::{load, source};

/// Half a period of the steps, in seconds.
const HALF_S: f64 = 0.4;
/// Steps up: more make a random texture's level surer.
const PERIODS: usize = 150;
/// Steps that are left out, while the chain starts.
const LEFT_OUT: usize = 2;
/// Speeds between which it steps, in mm/s.
const SPEEDS: [f64; 2] = [40.0, 120.0];
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

/// Runs a graph offline over strokes whose speed steps.
pub fn measure(path: &Path, args: &LatencyArgs) -> Result<Chain, Failure> {
    let dir = tempfile::tempdir().map_err(|e| Failure::Machine(format!("no folder for a stroke: {e}")))?;
    let play = |name: &str, speeds: [f64; 2]| -> Result<(Schedule, Vec<f32>, u32), Failure> {
        let file = dir.path().join(name);
        std::fs::write(&file, stroke(speeds)).map_err(|e| Failure::writing(&file, e))?;
        let compiled = compiled(path, &file, args)?;
        let at = heard(&compiled.schedule, path)?;
        Ok(run(compiled, at))
    };
    let (schedule, stepped, rate_hz) = play("steps.csv", SPEEDS)?;
    let (_, still, _) = play("still.csv", [SPEEDS[0]; 2])?;
    let half = (HALF_S * f64::from(rate_hz)) as usize;
    let at: Vec<usize> = (LEFT_OUT..PERIODS).map(|k| (2 * k + 1) * half).collect();
    let steps = Steps { rate_hz, at: &at, before: half / 2, after: half / 2 };
    let lag_ms = lag_ms(&stepped, &still, &steps).ok_or_else(|| {
        Failure::from(
            Diagnostic::new("the level does not rise with speed, so no answer to a step of it can be seen")
                .in_file(path)
                .help(
                    "choose a material whose level follows speed: --set texture.material=\"rough sandpaper\"",
                ),
        )
    })?;
    let items = items(&schedule, lag_ms[1]);
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

fn compiled(path: &Path, stroke: &Path, args: &LatencyArgs) -> Result<Compiled, Failure> {
    let graph_args = GraphArgs {
        graph: path.to_owned(),
        set: Vec::new(),
        input: None,
        hand: None,
        no_prune: false,
        plugins: args.plugins.clone(),
    };
    let mut graph: GraphFile = load::read(&graph_args)?;
    source::play(&mut graph, stroke)?;
    for assignment in &args.set {
        graph.set(assignment, "--set")?;
    }
    // What pushes back needs no device here.
    graph.nodes.retain(|n| !n.kind.ends_with("_force"));
    let ids: Vec<String> = graph.nodes.iter().map(|n| n.id.clone()).collect();
    graph.wires.retain(|w| ids.contains(&w.to.node));
    let registry = Kinds::new(&args.plugins.plugin).registry(Some(&graph))?;
    load::compiled(&graph, &graph_args, &registry)
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

/// What is known to make a graph late, and what is left for its windows.
fn items(schedule: &Schedule, lag_ms: f64) -> Vec<(String, f64)> {
    let mut items = Vec::new();
    for node in &schedule.nodes {
        if node.kind == "velocity"
            && let Some(hz) = node.params.get_number("cutoff_hz").filter(|hz| *hz > 0.0)
        {
            // The group delay of a second-order Butterworth low-pass at 0: sqrt(2) / w_c.
            let ms = std::f64::consts::SQRT_2 / (std::f64::consts::TAU * hz) * 1e3;
            items.push((format!("`{}`: its low-pass of {hz} Hz", node.id), ms));
        }
        if node.latency != Latency::ZERO {
            items.push((format!("`{}` ({}): declared", node.id, node.kind), node.latency.ms()));
        }
    }
    let known: f64 = items.iter().map(|(_, ms)| ms).sum();
    items.push(("windows, history and the model's own rise: the rest".into(), lag_ms - known));
    items
}
