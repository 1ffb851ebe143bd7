//! Response lag of a graph after a step of speed.

use std::path::PathBuf;

use asperity_diagnostics::Diagnostic;
use asperity_dsp::low_pass::opened_hz;
use asperity_graph::{Schedule, ScheduledNode};
use asperity_node::{Latency, Role};
use asperity_tradeoff::Chain as Response;

use serde::Serialize;

use super::{Args, Item};
use crate::failure::{Failure, complain, wrong};
use crate::lag::{self, Lag};
use crate::load;

#[derive(Serialize)]
pub struct Chain {
    pub graph: String,
    #[serde(rename = "latency", serialize_with = "lag::with_line")]
    pub lag: Lag,
    /// Known parts of the response lag.
    pub items: Vec<Item>,
}

pub struct Ready {
    path: PathBuf,
    response: Response,
    /// Node whose output is measured.
    end: usize,
}

/// Prepares every graph. A setting changes the graphs that have it; one that none has is an error.
pub fn prepare(args: &Args) -> Result<Vec<Ready>, Failure> {
    let mut drafts = Vec::new();
    for path in &args.graphs {
        drafts.push((path, load::offline(path, &args.plugins)?));
    }
    for assignment in &args.set {
        let has: Vec<bool> = drafts.iter().map(|(_, draft)| has(draft, assignment)).collect();
        let nowhere = !has.contains(&true);
        for ((path, draft), has) in drafts.iter_mut().zip(has) {
            if has || nowhere {
                draft.graph.set(assignment, "--set")?;
            } else {
                let path = path.display();
                complain(&format!(
                    "note: {path} has no such parameter and is measured without --set {assignment}\n"
                ));
            }
        }
    }
    let ready = |(path, draft): (&PathBuf, load::Offline)| {
        let response = Response::stepped(&draft.graph, &draft.registry)?;
        let nothing = "nothing in this graph is an acceleration, a current or a voltage at the audio rate";
        let (end, _) = response.output().ok_or_else(|| Diagnostic::new(nothing).in_file(path))?;
        Ok(Ready { path: path.clone(), response, end })
    };
    drafts.into_iter().map(ready).collect()
}

/// Whether a graph has the parameter of an assignment. All have the graph's own settings, such as `seed`.
fn has(draft: &load::Offline, assignment: &str) -> bool {
    let target = assignment.split_once('=').map_or(assignment, |(target, _)| target);
    let Some((id, name)) = target.trim().split_once('.') else { return true };
    let kind = draft.graph.node(id).and_then(|node| draft.registry.get(&node.kind));
    kind.is_some_and(|kind| name == "every" || kind.descriptor().params.iter().any(|p| p.name == name))
}

/// Runs a graph offline over strokes whose speed steps.
pub fn measure(ready: Ready) -> Result<Chain, Failure> {
    let Ready { path, mut response, end } = ready;
    let measured = lag::measure(&mut response);
    let schedule = response.schedule();
    let help = match schedule.with_role(Role::Contact).next() {
        Some(_) => {
            "the stroke is 10 m along x at y = 0, 2 mm deep: use a `plane` or a rectangle of that \
             length, with a material whose level follows speed"
        }
        None => "choose a material whose level follows speed: --set texture.material=\"sandpaper P50\"",
    };
    let [_, half, _] = *measured.as_ref().map_err(|what| wrong(&path, what, help))?;
    let items = items(schedule, end, half);
    Ok(Chain { graph: path.display().to_string(), lag: Lag::new(measured, schedule), items })
}

/// Known parts of the lag up to a node, and the rest. Of parallel paths the slowest counts.
fn items(schedule: &Schedule, end: usize, lag_ms: f64) -> Vec<Item> {
    let mut items = Vec::new();
    let item = |what: String, ms: f64| Item { what, ms };
    let (leads, slowest) = (leading_to(schedule, end), schedule.slowest_path(end).through);
    for (i, node) in schedule.nodes.iter().enumerate() {
        if leads[i]
            && node.role == Some(Role::Velocity)
            && let Some(hz) = node.params.get_number("cutoff_hz").filter(|hz| *hz > 0.0)
        {
            let (at, rate_hz) = (Response::MEAN_MM_S, f64::from(schedule.tick_hz) / f64::from(node.every));
            let hz = opened_hz(hz, node.params.number("cutoff_hz_per_mm_s"), at, rate_hz);
            // The group delay of a second-order Butterworth low-pass at 0: sqrt(2) / w_c.
            let ms = std::f64::consts::SQRT_2 / (std::f64::consts::TAU * hz) * 1e3;
            items.push(item(format!("`{}`: its low-pass, of {hz:.0} Hz at {at:.0} mm/s", node.id), ms));
        }
        if slowest.contains(&i) && node.latency > Latency::ZERO {
            items.push(item(format!("`{}` ({}): declared", node.id, node.kind), node.latency.ms()));
        }
    }
    let known: f64 = items.iter().map(|item| item.ms).sum();
    items.push(item("windows, history and the model's own rise: the rest".into(), lag_ms - known));
    items
}

/// Whether each node leads to one, and not past a low-pass. Nodes are in the order in which they run.
fn leading_to(schedule: &Schedule, end: usize) -> Vec<bool> {
    let mut leads: Vec<Vec<bool>> = schedule.nodes.iter().map(|n| vec![false; n.outputs.len()]).collect();
    if let Some(end) = leads.get_mut(end) {
        end.fill(true);
    }
    for i in (0..schedule.nodes.len()).rev() {
        let node = &schedule.nodes[i];
        let wanted: Vec<&str> =
            node.outputs.iter().zip(&leads[i]).filter(|(_, on)| **on).map(|(o, _)| o.name.as_str()).collect();
        for (index, input) in node.inputs.iter().enumerate() {
            // The other inputs of a gate open it, and delay nothing.
            let passed = node.gate.is_none_or(|gated| gated == index);
            let leads_on = passed && wanted.iter().any(|output| passes(node, &input.name, output));
            if let Some((from, output)) = input.from.filter(|(from, _)| leads_on && *from < i) {
                leads[from][output] = true;
            }
        }
    }
    // A path past the low-pass is not delayed by it.
    let leads = schedule.nodes.iter().zip(&leads).map(|(node, outputs)| {
        let held = |o: usize| node.role != Some(Role::Velocity) || node.outputs[o].name != "unfiltered";
        outputs.iter().enumerate().any(|(o, on)| *on && held(o))
    });
    leads.collect()
}

/// Whether an output depends on an input in time: the point of contact does not depend on the speed.
fn passes(node: &ScheduledNode, input: &str, output: &str) -> bool {
    match (node.role, input) {
        (Some(Role::Contact), "velocity") => matches!(output, "velocity" | "speed"),
        (Some(Role::Contact), "unfiltered") => matches!(output, "slide" | "push"),
        _ => true,
    }
}
