//! Runs a graph tick by tick, and reports.

use std::sync::Arc;
use std::time::Instant;

use asperity_accuracy::timing::{Recorder as Times, Summary};
use asperity_dsp::Isa;
use asperity_engine::{Clock, Engine};
use asperity_graph::Schedule;
use asperity_node::{Buffer, Fact, FactValue, Role};
use serde_json::{Map, Value, json};

use crate::lag::{self, Lag};
use crate::load::Request;

/// Nanoseconds since a moment.
pub struct ClockTime(pub Instant);

impl Clock for ClockTime {
    fn now_ns(&self) -> u64 {
        self.0.elapsed().as_nanos() as u64
    }
}

/// Samples of an audio buffer in this tick.
pub fn samples(buffer: Option<&Buffer>) -> &[f32] {
    match buffer {
        Some(Buffer::Audio { samples, len, .. }) => &samples[..*len],
        _ => &[],
    }
}

/// The nodes that are channels of the sound card, in their order.
pub fn channels(schedule: &Schedule) -> Vec<usize> {
    schedule.with_role(Role::AudioOutput).map(|(i, _)| i).collect()
}

/// Samples of these channels in the last tick, interleaved.
pub fn interleaved(engine: &Engine, channels: &[usize]) -> Vec<f32> {
    let all: Vec<&[f32]> = channels.iter().map(|&node| samples(engine.output(node, 0))).collect();
    let len = all.iter().map(|samples| samples.len()).max().unwrap_or(0);
    let row = |i| all.iter().map(move |samples: &&[f32]| samples.get(i).copied().unwrap_or(0.0));
    (0..len).flat_map(row).collect()
}

/// Times of an engine's ticks, and of the calls of its nodes.
pub struct Timed {
    /// Times so far.
    pub times: Times,
    /// Time since it was made.
    pub clock: ClockTime,
    /// The graph of the last tick.
    pub schedule: Arc<Schedule>,
    /// Time of each node in this tick \[ns\].
    spent: Vec<u64>,
    /// Calls of each node before this tick.
    calls: Vec<u64>,
}

impl Timed {
    /// Starts the clock.
    pub fn new(engine: &Engine) -> Self {
        let (schedule, clock) = (engine.schedule().clone(), ClockTime(Instant::now()));
        let nodes = schedule.nodes.len();
        Self { times: Times::new(nodes), clock, schedule, spent: vec![0; nodes], calls: vec![0; nodes] }
    }

    /// Runs a tick and answers its time \[ns\].
    pub fn tick(&mut self, engine: &mut Engine) -> u64 {
        self.spent.fill(0);
        let before = self.clock.now_ns();
        engine.tick_timed(&self.clock, &mut self.spent);
        let took = self.clock.now_ns() - before;
        self.times.tick(took);
        if !Arc::ptr_eq(&self.schedule, engine.schedule()) {
            // The nodes' times of this tick are left out: their numbers are new, and the table is old.
            let next = engine.schedule().clone();
            let from: Vec<_> = next.nodes.iter().map(|n| self.schedule.index_of(&n.id)).collect();
            self.times.renumber(&from);
            (self.spent, self.calls) = (vec![0; from.len()], vec![u64::MAX; from.len()]);
            self.schedule = next;
        }
        for (i, ns) in self.spent.iter().enumerate() {
            let calls = engine.report(i).map_or(0, |r| r.calls);
            if calls > self.calls[i] {
                self.times.node(i, *ns);
            }
            self.calls[i] = calls;
        }
        took
    }
}

/// A render that has ended.
pub struct Run<'a> {
    /// The request.
    pub request: &'a Request,
    /// More of the request, as the report has it.
    pub options: Value,
    /// Ticks that ran.
    pub ticks: u64,
    /// Ticks that were asked for.
    pub asked: u64,
    /// Time that they took \[s\].
    pub elapsed_s: f64,
    /// Changes of the graph.
    pub swaps: Vec<Swapped>,
    /// The engine that ran them.
    pub engine: &'a Engine,
    /// Facts about each node.
    pub facts: Vec<Vec<Fact>>,
    /// Times of the ticks, and of each node.
    pub times: &'a Times,
    /// Level of the output.
    pub level: &'a Level,
    /// How late the graph answers.
    pub lag: Lag,
}

/// A change of the graph while it ran.
#[derive(Clone, Debug)]
pub struct Swapped {
    /// The tick in which it was; `None` for one that was sent too late.
    pub tick: Option<u64>,
    /// The change, in words.
    pub what: String,
}

/// Level of the signals into every `audio_out`, which drive the coil.
pub struct Level {
    /// These nodes.
    pub nodes: Vec<usize>,
    /// Unit of the figures; empty without such a node.
    pub unit: String,
    /// Largest absolute value.
    pub peak: f64,
    sum: f64,
    count: u64,
}

impl Level {
    /// Starts for a graph.
    pub fn new(schedule: &Schedule) -> Self {
        let nodes = channels(schedule);
        let port = nodes.first().and_then(|&i| schedule.nodes[i].inputs.first()?.port.clone());
        let unit = port.map(|p| p.unit.to_string()).unwrap_or_default();
        Self { nodes, unit, peak: 0.0, sum: 0.0, count: 0 }
    }

    /// Adds the samples of the last tick.
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

    /// Root mean square.
    pub fn rms(&self) -> f64 {
        if self.count == 0 { 0.0 } else { (self.sum / self.count as f64).sqrt() }
    }
}

/// Facts by name.
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

/// Nodes that are not built, and why.
pub fn dropped_json(schedule: &Schedule) -> Vec<Value> {
    schedule.dropped.iter().map(|d| json!({ "id": d.id, "kind": d.kind, "why": d.why })).collect()
}

/// Samples that were cut at a card's full scale.
pub fn clipped(facts: &[Vec<Fact>]) -> u64 {
    let clipped = facts.iter().flatten().filter(|f| f.name == "clipped_samples");
    clipped.map(|f| if let FactValue::Count(n) = f.value { n } else { 0 }).sum()
}

/// Processor and system.
pub fn target() -> String {
    format!("{}-{}", std::env::consts::ARCH, std::env::consts::OS)
}

/// Nanoseconds as microseconds.
pub fn us(ns: u64) -> f64 {
    ns as f64 / 1e3
}

fn tick_us(s: &Summary) -> Value {
    json!({ "p50": us(s.p50_ns), "p99": us(s.p99_ns), "p999": us(s.p999_ns), "max": us(s.max_ns) })
}

impl Run<'_> {
    /// Rendered time over the time it took.
    pub fn realtime_factor(&self) -> f64 {
        self.ticks as f64 / f64::from(self.engine.schedule().tick_hz) / self.elapsed_s.max(1e-9)
    }

    /// The report.
    pub fn json(&self) -> Value {
        let Self { request, engine, level, .. } = *self;
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
        json!({
            "asperity": env!("CARGO_PKG_VERSION"),
            "target": target(),
            "instructions": Isa::best().name(),
            "debug_assertions": cfg!(debug_assertions),
            "graph": request.graph.display().to_string(),
            "set": request.set,
            "input": request.input.as_ref().map(|p| p.display().to_string()),
            "loop": request.repeat,
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
            "options": self.options,
        })
    }
}
