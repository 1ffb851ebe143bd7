//! Figures of a render, as text and as JSON, and the parts that `asperity run` reports in the same words.

use std::fmt::Write as _;
use std::path::PathBuf;

use asperity_accuracy::timing::{Recorder as Times, Summary};
use asperity_dsp::Isa;
use asperity_engine::Engine;
use asperity_graph::Schedule;
use asperity_node::{Fact, FactValue, Role};
use serde_json::{Map, Value, json};

use super::recorder::Master;
use super::{Args, samples};
use crate::lag::{self, Lag};

pub struct Run<'a> {
    pub args: &'a Args,
    pub ticks: u64,
    pub asked: u64,
    pub elapsed_s: f64,
    pub swaps: Vec<Swapped>,
    pub engine: &'a Engine,
    pub facts: Vec<Vec<Fact>>,
    pub times: &'a Times,
    pub level: &'a Level,
    pub lag: Lag,
}

#[derive(Clone, Debug)]
pub struct Swapped {
    /// The tick in which it was; `None` for one that was sent too late.
    pub tick: Option<u64>,
    pub what: String,
}

/// Level of the signals into every `audio_out`, which drive the coil.
pub struct Level {
    pub nodes: Vec<usize>,
    unit: String,
    peak: f64,
    sum: f64,
    count: u64,
}

impl Level {
    pub fn new(schedule: &Schedule) -> Self {
        let nodes = Master::channels(schedule);
        let port = nodes.first().and_then(|&i| schedule.nodes[i].inputs.first()?.port.clone());
        let unit = port.map(|p| p.unit.to_string()).unwrap_or_default();
        Self { nodes, unit, peak: 0.0, sum: 0.0, count: 0 }
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

pub fn facts_json<'f>(facts: impl IntoIterator<Item = &'f Fact>) -> Map<String, Value> {
    facts.into_iter().map(|f| (f.name.to_string(), fact_json(f))).collect()
}

fn fact_json(fact: &Fact) -> Value {
    match &fact.value {
        FactValue::Text(t) => json!(t),
        FactValue::Number(x, unit) if unit.is_empty() => json!(x),
        FactValue::Number(x, unit) => json!({ "value": x, "unit": unit }),
        FactValue::Count(n) => json!(n),
    }
}

pub fn dropped_json(schedule: &Schedule) -> Vec<Value> {
    schedule.dropped.iter().map(|d| json!({ "id": d.id, "kind": d.kind, "why": d.why })).collect()
}

/// A network's inputs outside its training range, and outputs that cannot be magnitudes, in words.
pub fn out_of_range(facts: &[Fact]) -> Vec<String> {
    let find = |name: &str| facts.iter().find(|f| f.name == name);
    let count = |name: &str| match find(name).map(|f| &f.value) {
        Some(FactValue::Count(n)) => *n,
        _ => 0,
    };
    let most = |name: &str| find(name).map_or("the known range".to_owned(), |f| f.value.to_string());
    let mut out = Vec::new();
    if let n @ 1.. = count("force_out_of_range") {
        out.push(format!("{n} frames with a force outside 0 to {}, held there", most("trained_force")));
    }
    if let n @ 1.. = count("velocity_out_of_range") {
        out.push(format!("{n} frames with a speed above {}, held there", most("trained_speed")));
    }
    // Phase retrieval counts its inputs under the same name.
    if let (Some(_), n @ 1..) = (find("velocity_out_of_range"), count("bad_magnitudes")) {
        out.push(format!("{n} magnitudes were negative or not finite, and are taken as 0"));
    }
    out
}

/// Why a node of taps never sounded, if it did not.
pub fn no_tap(facts: &[Fact]) -> Option<String> {
    let count = |name: &str| facts.iter().find(|f| f.name == name).map(|f| &f.value);
    match (count("contacts")?, count("taps")?) {
        (FactValue::Count(0), _) => {
            Some("no tap sounded: the stylus never came from the air to a surface that has one".into())
        }
        (FactValue::Count(n), FactValue::Count(0)) => {
            Some(format!("no tap sounded: the approach was below `min_speed_mm_s` in all of {n} contacts"))
        }
        _ => None,
    }
}

/// Samples that were cut at a card's full scale.
pub fn clipped(facts: &[Vec<Fact>]) -> u64 {
    let clipped = facts.iter().flatten().filter(|f| f.name == "clipped_samples");
    clipped.map(|f| if let FactValue::Count(n) = f.value { n } else { 0 }).sum()
}

/// Says how many samples were cut, and the remedy.
pub fn cut_at_full_scale(samples: u64) -> String {
    format!("{samples} samples were cut at the card's full scale: raise its volts or amplify more")
}

pub fn target() -> String {
    format!("{}-{}", std::env::consts::ARCH, std::env::consts::OS)
}

fn us(ns: u64) -> f64 {
    ns as f64 / 1e3
}

fn tick_us(s: &Summary) -> Value {
    json!({ "p50": us(s.p50_ns), "p99": us(s.p99_ns), "p999": us(s.p999_ns), "max": us(s.max_ns) })
}

impl Run<'_> {
    fn realtime_factor(&self) -> f64 {
        self.ticks as f64 / f64::from(self.engine.schedule().tick_hz) / self.elapsed_s.max(1e-9)
    }

    pub fn json(&self) -> String {
        let Self { args, engine, level, .. } = *self;
        let schedule = engine.schedule();
        let node = |(i, node): (usize, &asperity_graph::ScheduledNode)| {
            let report = engine.report(i)?;
            let time = self.times.node_summary(i).unwrap_or_default();
            Some(json!({
                "id": node.id,
                "kind": node.kind,
                "calls": report.calls,
                "slept": report.slept,
                "us_p50": us(time.p50_ns),
                "us_p99": us(time.p99_ns),
                "faults": report.faults,
                "last_fault": report.last_fault.as_ref().map(ToString::to_string),
                "quarantined": report.quarantined,
                "allocation_free": node.allocation_free,
                "facts": facts_json(&self.facts[i]),
            }))
        };
        let report = json!({
            "asperity": env!("CARGO_PKG_VERSION"),
            "target": target(),
            "instructions": Isa::best().name(),
            "debug_assertions": cfg!(debug_assertions),
            "graph": args.graph.graph.display().to_string(),
            "set": args.graph.set,
            "input": args.graph.input.as_ref().map(|p| p.display().to_string()),
            "loop": args.graph.repeat,
            "seed": schedule.seed,
            "tick_hz": schedule.tick_hz,
            "audio_hz": schedule.audio_hz,
            "ticks": self.ticks,
            "interrupted": self.ticks < self.asked,
            "seconds": self.ticks as f64 / f64::from(schedule.tick_hz),
            "tick_us": tick_us(&self.times.tick_summary()),
            "realtime_factor": self.realtime_factor(),
            "latency": lag::json(&self.lag),
            "nodes": schedule.nodes.iter().enumerate().filter_map(node).collect::<Vec<_>>(),
            "faults": engine.faults(),
            "swaps": self.swaps.iter().map(|s| json!({ "tick": s.tick, "what": s.what })).collect::<Vec<_>>(),
            "dropped": dropped_json(schedule),
            "output": {
                "peak": level.peak, "rms": level.rms(), "unit": level.unit, "clipped": clipped(&self.facts),
            },
            "options": {
                "seconds": args.seconds,
                "probes": args.probe,
                "no_sleep": args.no_sleep,
                "limit_us": args.limit_us,
                "watch": args.watch,
                "no_prune": args.graph.no_prune,
                "format": format!("{:?}", args.format).to_lowercase(),
            },
        });
        format!("{report:#}\n")
    }

    /// Instructions that were used, and whether other CPUs give the same bits.
    fn computed(&self) -> String {
        let name = Isa::best().name();
        let is_tract = |fact: &Fact| {
            fact.name == "executor" && matches!(&fact.value, FactValue::Text(t) if t == "tract")
        };
        let nodes = &self.engine.schedule().nodes;
        match nodes.iter().zip(&self.facts).find(|(_, facts)| facts.iter().any(is_tract)) {
            Some((node, _)) => {
                format!("by {name}; `{}` runs by tract, which other CPUs round otherwise", node.id)
            }
            None => format!("by {name}; every CPU gives the same bits"),
        }
    }

    pub fn summary(&self, written: &[PathBuf]) -> String {
        let Self { ticks, engine, level, .. } = *self;
        let schedule = engine.schedule();
        let tick_hz = f64::from(schedule.tick_hz);
        let mut out = String::new();
        let mut line = |name: &str, text: String| {
            let _ = writeln!(out, "{name:<10}{text}");
        };
        let cut = if ticks < self.asked { ", interrupted" } else { "" };
        let (seconds, factor) = (ticks as f64 / tick_hz, self.realtime_factor());
        line(
            "rendered",
            format!("{seconds:.2} s ({ticks} ticks at {tick_hz} Hz){cut}, {factor:.0} x real time"),
        );
        let t = self.times.tick_summary();
        let part = |ns: u64| format!("{:.1} us ({:.1} %)", us(ns), 100.0 * us(ns) / (1e6 / tick_hz));
        line("tick", format!("p50 {}  p99 {}", part(t.p50_ns), part(t.p99_ns)));
        line("", format!("p99.9 {}  max {}", part(t.p999_ns), part(t.max_ns)));
        line("computed", self.computed());
        line("latency", self.lag.to_string());
        if !level.unit.is_empty() {
            line("output", format!("peak {:.4} {u}, rms {:.4} {u}", level.peak, level.rms(), u = level.unit));
            if level.peak == 0.0 {
                line("", "silent: no gate opened, or nothing moved".into());
            }
            if let samples @ 1.. = clipped(&self.facts) {
                line("", cut_at_full_scale(samples));
            }
        }
        for (node, facts) in schedule.nodes.iter().zip(&self.facts) {
            for fact in facts.iter().filter(|f| f.name == "executor") {
                line("network", format!("`{}`: {}", node.id, fact.value));
            }
            for text in out_of_range(facts).into_iter().chain(no_tap(facts)) {
                line("", format!("`{}`: {text}", node.id));
            }
            if node.role == Some(Role::Limiter) {
                line("limiter", format!("`{}` {}", node.id, limited(facts)));
            }
        }
        match engine.faults() {
            0 => line("faults", "none".into()),
            n => line("faults", n.to_string()),
        }
        for (i, node) in schedule.nodes.iter().enumerate() {
            if let Some(r) = engine.report(i).filter(|r| r.faults > 0) {
                let last = r.last_fault.map(|f| f.to_string()).unwrap_or_default();
                line("", faulty((&node.id, &node.kind), r.faults, &last, r.quarantined));
            }
        }
        for Swapped { tick, what } in &self.swaps {
            let at = tick.map_or("too late".into(), |t| format!("{:.2} s", t as f64 / tick_hz));
            line("changed", format!("at {at}: {what}"));
        }
        for d in &schedule.dropped {
            line("dropped", format!("`{}` ({}): {}", d.id, d.kind, d.why));
        }
        for path in written {
            line("wrote", path.display().to_string());
        }
        if written.is_empty() {
            line("wrote", "nothing: name a file with --out, --plot, --report or --probe".into());
        }
        out
    }
}

/// A node that failed, in words.
pub fn faulty((id, kind): (&str, &str), times: u64, last: &str, quarantined: bool) -> String {
    let end = if quarantined { "; it was taken out of the graph" } else { "" };
    format!("`{id}` ({kind}) {times} times, last: {last}{end}")
}

/// Samples that a limiter changed, by reason.
fn limited(facts: &[Fact]) -> String {
    let by = |f: &Fact| match f.value {
        FactValue::Count(n) if n > 0 => Some(format!("{} {n}", f.name.strip_prefix("limited_")?)),
        _ => None,
    };
    let acted: Vec<String> = facts.iter().filter_map(by).collect();
    if acted.is_empty() { "removed DC only".into() } else { format!("samples: {}", acted.join(", ")) }
}
