//! Figures of a render: for a person, and as JSON.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use asperity_accuracy::timing::{Recorder as Times, Summary};
use asperity_dsp::Isa;
use asperity_engine::Engine;
use asperity_graph::Schedule;
use asperity_node::{Fact, FactValue};
use serde_json::{Value, json};

use super::samples;
use crate::args::Render;

/// What was run.
pub struct Run<'a> {
    /// The graph file.
    pub graph: &'a Path,
    /// What `--set` changed.
    pub overrides: &'a [String],
    /// What `--input` put in.
    pub input: Option<&'a Path>,
    /// Ticks that ran.
    pub ticks: u64,
    /// Ticks that were asked for.
    pub asked: u64,
    /// How long they took.
    pub elapsed_s: f64,
    /// The command line.
    pub options: &'a Render,
    /// Changes that were taken over while it ran.
    pub swaps: &'a [Swapped],
}

/// A change that was taken over.
#[derive(Clone, Debug)]
pub struct Swapped {
    /// In which tick; none for one that was sent too late.
    pub tick: Option<u64>,
    /// What changed, for a person.
    pub what: String,
}

/// Level of what drives the coil: all that goes into `audio_out`.
pub struct Level {
    nodes: Vec<usize>,
    unit: String,
    peak: f64,
    sum: f64,
    count: u64,
}

impl Level {
    pub fn new(schedule: &Schedule) -> Self {
        let nodes: Vec<usize> =
            (0..schedule.nodes.len()).filter(|&i| schedule.nodes[i].kind == "audio_out").collect();
        let port = nodes.first().and_then(|&i| schedule.nodes[i].inputs.first()?.port.clone());
        let unit = port.map(|p| p.unit.to_string()).unwrap_or_default();
        Self { nodes, unit, peak: 0.0, sum: 0.0, count: 0 }
    }

    /// Goes on with the same nodes where another graph has been taken over.
    pub fn follow(&mut self, moved: impl Fn(usize) -> usize) {
        self.nodes.iter_mut().for_each(|node| *node = moved(*node));
    }

    pub fn take(&mut self, engine: &Engine) {
        for &node in &self.nodes {
            for x in samples(engine.input(node, 0)) {
                let x = f64::from(*x);
                self.peak = self.peak.max(x.abs());
                self.sum += x * x;
                self.count += 1;
            }
        }
    }

    fn rms(&self) -> f64 {
        if self.count == 0 { 0.0 } else { (self.sum / self.count as f64).sqrt() }
    }
}

fn us(ns: u64) -> f64 {
    ns as f64 / 1e3
}

fn tick_us(s: &Summary) -> Value {
    json!({ "p50": us(s.p50_ns), "p99": us(s.p99_ns), "p999": us(s.p999_ns), "max": us(s.max_ns) })
}

/// A fact as JSON: a number with a unit is an object.
pub fn fact_json(fact: &Fact) -> Value {
    match &fact.value {
        FactValue::Text(t) => json!(t),
        FactValue::Number(x, unit) if unit.is_empty() => json!(x),
        FactValue::Number(x, unit) => json!({ "value": x, "unit": unit }),
        FactValue::Count(n) => json!(n),
    }
}

/// What a network was given that it was not made for, and what it answered that no magnitude can be.
pub fn out_of_range(facts: &[Fact]) -> Vec<String> {
    let find = |name: &str| facts.iter().find(|f| f.name == name);
    let count = |name: &str| match find(name).map(|f| &f.value) {
        Some(FactValue::Count(n)) => *n,
        _ => 0,
    };
    let most = |name: &str| find(name).map_or("what is known".to_owned(), |f| f.value.to_string());
    let mut out = Vec::new();
    if let n @ 1.. = count("force_out_of_range") {
        out.push(format!("{n} frames with a force outside 0 to {}, held there", most("trained_force")));
    }
    if let n @ 1.. = count("velocity_out_of_range") {
        out.push(format!("{n} frames with a speed above {}, held there", most("trained_speed")));
    }
    // Phase retrieval counts under the same name what it is given.
    if let (Some(_), n @ 1..) = (find("velocity_out_of_range"), count("bad_magnitudes")) {
        out.push(format!("{n} magnitudes were negative or not finite, and are taken as 0"));
    }
    out
}

fn realtime_factor(run: &Run<'_>, schedule: &Schedule) -> f64 {
    run.ticks as f64 / f64::from(schedule.tick_hz) / run.elapsed_s.max(1e-9)
}

/// Samples that did not fit a card's full scale.
pub fn clipped(engine: &Engine) -> u64 {
    let nodes = 0..engine.schedule().nodes.len();
    let facts = nodes.flat_map(|i| engine.facts(i)).filter(|f| f.name == "clipped_samples");
    facts.map(|f| if let FactValue::Count(n) = f.value { n } else { 0 }).sum()
}

/// Says how many samples were cut, and what to do.
pub fn cut_at_full_scale(samples: u64) -> String {
    format!("{samples} samples were cut at the card's full scale: raise its volts or amplify more")
}

/// The report as JSON.
pub fn json(run: &Run<'_>, engine: &Engine, times: &Times, level: &Level) -> String {
    let schedule = engine.schedule();
    let nodes: Vec<Value> = schedule
        .nodes
        .iter()
        .enumerate()
        .map(|(i, node)| {
            let report = engine.report(i).cloned();
            let time = times.node_summary(i).unwrap_or_default();
            let facts: serde_json::Map<String, Value> =
                engine.facts(i).iter().map(|f| (f.name.to_string(), fact_json(f))).collect();
            json!({
                "id": node.id,
                "kind": node.kind,
                "calls": report.as_ref().map_or(0, |r| r.calls),
                "slept": report.as_ref().map_or(0, |r| r.slept),
                "us_p50": us(time.p50_ns),
                "us_p99": us(time.p99_ns),
                "faults": report.as_ref().map_or(0, |r| r.faults),
                "last_fault": report.as_ref().and_then(|r| r.last_fault).map(|f| f.to_string()),
                "quarantined": report.is_some_and(|r| r.quarantined),
                "allocation_free": node.allocation_free,
                "facts": facts,
            })
        })
        .collect();
    let dropped: Vec<Value> =
        schedule.dropped.iter().map(|d| json!({ "id": d.id, "kind": d.kind, "why": d.why })).collect();
    let report = json!({
        "asperity": env!("CARGO_PKG_VERSION"),
        "target": format!("{}-{}", std::env::consts::ARCH, std::env::consts::OS),
        "instructions": Isa::best().name(),
        "debug_assertions": cfg!(debug_assertions),
        "graph": run.graph.display().to_string(),
        "set": run.overrides,
        "input": run.input.map(|p| p.display().to_string()),
        "seed": schedule.seed,
        "tick_hz": schedule.tick_hz,
        "audio_hz": schedule.audio_hz,
        "ticks": run.ticks,
        "interrupted": run.ticks < run.asked,
        "seconds": run.ticks as f64 / f64::from(schedule.tick_hz),
        "tick_us": tick_us(&times.tick_summary()),
        "realtime_factor": realtime_factor(run, schedule),
        "latency_ms": schedule.latency().ms(),
        "nodes": nodes,
        "faults": engine.faults(),
        "swaps": run.swaps.iter().map(|s| json!({ "tick": s.tick, "what": s.what })).collect::<Vec<_>>(),
        "dropped": dropped,
        "output": { "peak": level.peak, "rms": level.rms(), "unit": level.unit, "clipped": clipped(engine) },
        "options": {
            "seconds": run.options.seconds,
            "probes": run.options.probe,
            "no_sleep": run.options.no_sleep,
            "limit_us": run.options.limit_us,
            "watch": run.options.watch,
            "no_prune": run.options.graph.no_prune,
            "format": format!("{:?}", run.options.format).to_lowercase(),
        },
    });
    format!("{report:#}\n")
}

/// With which instructions it was computed, and whether other CPUs give the same bits.
fn computed(engine: &Engine) -> String {
    let name = Isa::best().name();
    let by_tract =
        |fact: &Fact| fact.name == "executor" && matches!(&fact.value, FactValue::Text(t) if t == "tract");
    let nodes = &engine.schedule().nodes;
    match (0..nodes.len()).find(|&i| engine.facts(i).iter().any(by_tract)) {
        Some(i) => {
            format!("by {name}; `{}` runs by tract, which other CPUs round otherwise", nodes[i].id)
        }
        None => format!("by {name}; every CPU gives the same bits"),
    }
}

/// The summary a person reads.
pub fn summary(run: &Run<'_>, engine: &Engine, times: &Times, level: &Level, written: &[PathBuf]) -> String {
    let schedule = engine.schedule();
    let mut out = String::new();
    let mut line = |name: &str, text: String| {
        let _ = writeln!(out, "{name:<10}{text}");
    };
    let seconds = run.ticks as f64 / f64::from(schedule.tick_hz);
    let cut = if run.ticks < run.asked { ", interrupted" } else { "" };
    let factor = realtime_factor(run, schedule);
    line(
        "rendered",
        format!(
            "{seconds:.2} s ({} ticks at {} Hz){cut}, {factor:.0} x real time",
            run.ticks, schedule.tick_hz
        ),
    );
    let t = times.tick_summary();
    let tick_us = 1e6 / f64::from(schedule.tick_hz);
    let part = |ns: u64| format!("{:.1} us ({:.1} %)", us(ns), 100.0 * us(ns) / tick_us);
    line("tick", format!("p50 {}  p99 {}", part(t.p50_ns), part(t.p99_ns)));
    line("", format!("p99.9 {}  max {}", part(t.p999_ns), part(t.max_ns)));
    line("computed", computed(engine));
    line("latency", format!("{:.2} ms, source to sink", schedule.latency().ms()));
    if !level.unit.is_empty() {
        line("output", format!("peak {:.4} {u}, rms {:.4} {u}", level.peak, level.rms(), u = level.unit));
        if level.peak == 0.0 {
            line("", "silent: no gate opened, or nothing moved".into());
        }
        let clipped = clipped(engine);
        if clipped > 0 {
            line("", cut_at_full_scale(clipped));
        }
    }
    for (i, node) in schedule.nodes.iter().enumerate() {
        let facts = engine.facts(i);
        for fact in facts.iter().filter(|f| f.name == "executor") {
            line("network", format!("`{}`: {}", node.id, fact.value));
        }
        for text in out_of_range(&facts) {
            line("", format!("`{}`: {text}", node.id));
        }
        if node.kind == "limiter" {
            let acted: Vec<String> = engine
                .facts(i)
                .iter()
                .filter_map(|f| match f.value {
                    FactValue::Count(n) if n > 0 && f.name.starts_with("limited_") => {
                        Some(format!("{} {n}", f.name.trim_start_matches("limited_")))
                    }
                    _ => None,
                })
                .collect();
            let text = if acted.is_empty() {
                "removed DC only".into()
            } else {
                format!("samples: {}", acted.join(", "))
            };
            line("limiter", format!("`{}` {text}", node.id));
        }
    }
    match engine.faults() {
        0 => line("faults", "none".into()),
        n => {
            line("faults", n.to_string());
            for (i, node) in schedule.nodes.iter().enumerate() {
                if let Some(r) = engine.report(i).filter(|r| r.faults > 0) {
                    let last = r.last_fault.map(|f| f.to_string()).unwrap_or_default();
                    let end = if r.quarantined { "; it was taken out of the graph" } else { "" };
                    line("", format!("`{}` ({}) {} times, last: {last}{end}", node.id, node.kind, r.faults));
                }
            }
        }
    }
    for swap in run.swaps {
        let at = swap
            .tick
            .map_or("too late".into(), |t| format!("{:.2} s", t as f64 / f64::from(schedule.tick_hz)));
        line("changed", format!("at {at}: {}", swap.what));
    }
    for d in &schedule.dropped {
        line("dropped", format!("`{}` ({}): {}", d.id, d.kind, d.why));
    }
    for path in written {
        line("wrote", path.display().to_string());
    }
    out
}
