//! `asperity check`: the schedule that a graph compiles to.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use asperity_graph::{BufferEntry, Schedule, ScheduledInput, ScheduledOutput, SlowestPath, Step};
use asperity_node::{Fact, FactValue};
use serde_json::{Value, json};

use crate::commands::nodes::param_json;
use crate::commands::render::report::{dropped_json, facts_json};
use crate::failure::{Failure, plural, print_report, warn};
use crate::kinds::Kinds;
use crate::lag::{self, Lag};
use crate::load::{self, GraphArgs, Loaded};

/// Check a graph, and print its order, buffers, rates, response lag and dropped nodes
#[derive(Debug, clap::Args)]
#[command(after_help = crate::commands::examples(&["asperity check graphs/texture.ron"]))]
pub struct Args {
    #[command(flatten)]
    pub graph: GraphArgs,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

pub fn run(args: &Args) -> Result<(), Failure> {
    let mut kinds = Kinds::new(&args.graph.plugins.plugin).looking();
    let Loaded { graph, registry, compiled, .. } = load::load(&args.graph, &mut kinds)?;
    let schedule = compiled.schedule;
    let lag = Lag::of(&graph, &registry, &schedule);
    print_report(args.json, || as_json(&schedule, &lag), || text_of(&schedule, &lag))?;
    load::warnings(&schedule).iter().for_each(|warning| warn(warning));
    Ok(())
}

fn text_of(schedule: &Schedule, lag: &Lag) -> String {
    let mut out = String::new();
    let Schedule { tick_hz, audio_hz, seed, .. } = schedule;
    let _ = writeln!(out, "{tick_hz} ticks/s, audio at {audio_hz} Hz, seed {seed}");
    let _ = writeln!(out, "\norder");
    let id_width = schedule.nodes.iter().map(|n| n.id.chars().count()).max().unwrap_or(0);
    let kind_width = schedule.nodes.iter().map(|n| n.kind.chars().count()).max().unwrap_or(0);
    for (i, node) in schedule.nodes.iter().enumerate() {
        let (n, id, kind, remarks) = (i + 1, &node.id, &node.kind, remarks(schedule, i));
        let _ = writeln!(out, "{n:>4}  {id:id_width$}  {kind:kind_width$}  {remarks}");
        for output in node.outputs.iter() {
            let readers = match output.readers {
                0 => "unread".to_owned(),
                n => plural(n, "reader"),
            };
            let _ = writeln!(out, "      {:id_width$}    .{}: {} ({readers})", "", output.name, output.port);
        }
        // Counts of a run are still 0.
        for fact in node.facts.iter().filter(|f| !is_zero(f)) {
            let _ = writeln!(out, "      {:id_width$}    {}: {}", "", fact.name, fact.value);
        }
    }
    let (constants, outputs) = buffer_counts(schedule);
    let counts = outputs.map(|(kind, n)| format!("{n} {kind}"));
    let _ = writeln!(out, "\nbuffers   {}; {constants} constant inputs", counts.join(", "));
    let _ = writeln!(out, "\nlatency   {lag}");
    for (to, path) in slowest_paths(schedule) {
        let through: Vec<&str> = path.through.iter().map(|&i| schedule.nodes[i].id.as_str()).collect();
        let _ = writeln!(out, "      {}: {:.4} ms declared", schedule.nodes[to].id, path.latency.ms());
        let _ = writeln!(out, "        {}", through.join(" -> "));
    }
    let _ = writeln!(out, "\ndropped");
    if schedule.dropped.is_empty() {
        let _ = writeln!(out, "      nothing");
    }
    for d in &schedule.dropped {
        let _ = writeln!(out, "      {} ({}): {}", d.id, d.kind, d.why);
    }
    let _ = match schedule.allocating().as_slice() {
        [] => writeln!(out, "\nno node allocates while it runs"),
        ids => writeln!(out, "\nallocates while it runs, so not fit for real time: {}", ids.join(", ")),
    };
    out
}

/// Every sink, and the slowest path to it.
fn slowest_paths(schedule: &Schedule) -> impl Iterator<Item = (usize, SlowestPath)> {
    let sinks = (0..schedule.nodes.len()).filter(|&i| schedule.nodes[i].sink);
    sinks.map(|to| (to, schedule.slowest_path(to)))
}

fn is_zero(fact: &Fact) -> bool {
    matches!(fact.value, FactValue::Count(0)) || matches!(fact.value, FactValue::Number(x, _) if x == 0.0)
}

fn remarks(schedule: &Schedule, i: usize) -> String {
    let node = &schedule.nodes[i];
    let mut out = Vec::new();
    if node.every > 1 {
        out.push(format!("every {} ticks", node.every));
    }
    if let Some(gated) = node.gate {
        out.push(format!("gates `{}`", node.inputs[gated].name));
    }
    if !node.gate_sets.is_empty() {
        let way = |way: &Vec<usize>| -> String {
            way.iter().map(|&g| schedule.nodes[g].id.as_str()).collect::<Vec<_>>().join(" and ")
        };
        let ways: Vec<String> = node.gate_sets.iter().map(way).collect();
        out.push(format!("runs while {} is open, wakes by {}", ways.join(", or "), node.resume.word()));
    }
    if node.closes_cycle {
        out.push("closes a cycle".into());
    }
    if node.latency.as_ratio().0 != 0 {
        out.push(format!("latency {:.4} ms", node.latency.ms()));
    }
    if node.tail.as_ratio().0 != 0 {
        out.push(format!("tail {:.1} ms", node.tail.ms()));
    }
    if node.sink {
        out.push("sink".into());
    }
    out.join("; ")
}

/// Constants, and buffers of each kind.
fn buffer_counts(schedule: &Schedule) -> (usize, [(&'static str, usize); 4]) {
    let constants = schedule.buffers.iter().filter(|b| matches!(b, BufferEntry::Constant { .. })).count();
    let kind = |buffer: &BufferEntry| match buffer {
        BufferEntry::Output(port) => Some(port.shape.kind()),
        _ => None,
    };
    let count = |of| (of, schedule.buffers.iter().filter(|buffer| kind(buffer) == Some(of)).count());
    (constants, ["Control", "Audio", "Magnitude", "Spectrum"].map(count))
}

fn as_json(schedule: &Schedule, lag: &Lag) -> Value {
    let id = |i: usize| schedule.nodes[i].id.as_str();
    let ids = |all: &[usize]| all.iter().map(|&i| id(i)).collect::<Vec<_>>();
    let input = |input: &ScheduledInput| {
        let from = input.from.map(|(n, o)| format!("{}.{}", id(n), schedule.nodes[n].outputs[o].name));
        let port = input.port.as_ref().map(ToString::to_string);
        json!({ "name": input.name, "from": from, "buffer": input.reads.buffer, "type": port })
    };
    let output = |(o, buffer): (&ScheduledOutput, _)| {
        let port = o.port.to_string();
        json!({ "name": o.name, "buffer": buffer, "type": port, "readers": o.readers })
    };
    let nodes = schedule.nodes.iter().map(|node| {
        json!({
            "id": node.id,
            "kind": node.kind,
            "every": node.every,
            "params": node.params.iter().map(|(name, v)| (name, param_json(v))).collect::<BTreeMap<_, _>>(),
            "inputs": node.inputs.iter().map(input).collect::<Vec<_>>(),
            "outputs": node.outputs.iter().zip(node.buffers.clone()).map(output).collect::<Vec<_>>(),
            "guards": node.gate_sets.iter().map(|way| ids(way)).collect::<Vec<_>>(),
            "resume": node.resume.word(),
            "sink": node.sink,
            "closes_cycle": node.closes_cycle,
            "latency_ms": node.latency.ms(),
            "tail_ms": node.tail.ms(),
            "allocation_free": node.allocation_free,
            "facts": facts_json(&node.facts),
        })
    });
    let steps = schedule.steps.iter().map(|step| match *step {
        Step::Wants(i) => ("wants", id(i)),
        Step::Process(i) => ("process", id(i)),
        Step::Absorb(i) => ("absorb", id(i)),
    });
    let (constants, counts) = buffer_counts(schedule);
    let paths = slowest_paths(schedule).map(
        |(to, path)| json!({ "to": id(to), "declared_ms": path.latency.ms(), "through": ids(&path.through) }),
    );
    json!({
        "tick_hz": schedule.tick_hz,
        "audio_hz": schedule.audio_hz,
        "seed": schedule.seed,
        "nodes": nodes.collect::<Vec<_>>(),
        "steps": steps.collect::<Vec<_>>(),
        "buffers": { "constants": constants, "outputs": counts.into_iter().collect::<BTreeMap<_, _>>() },
        "latency": lag::json(lag),
        "paths": paths.collect::<Vec<_>>(),
        "dropped": dropped_json(schedule),
        "allocation_free": schedule.allocating().is_empty(),
    })
}
