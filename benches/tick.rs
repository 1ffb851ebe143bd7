//! One table: what each node and the whole tick of the shipped graph cost, beside a plain read of the
//! network's weights timed in the same run.
//!
//! Back to back, ticks follow each other at once and caches stay warm. Once every 2 ms the thread sleeps
//! between ticks, as live, and the caches are what the rest of the machine left. The goals are those of the
//! design; they are printed beside what was measured and nothing fails on them: machines differ.

mod shared;

use std::hint::black_box;
use std::time::{Duration, Instant};

use asperity_accuracy::timing::Timing;
use asperity_diagnostics::Source;
use asperity_engine::{Clock as _, Engine, NoClock, Options};
use asperity_graph::{GraphFile, compile};
use asperity_node::{
    Descriptor, Diagnostic, Input, Node, Output, Prepared, Processor, Registry, Role, Setup, ShapeSpec,
    Status, Tick, Unit,
};
use asperity_texture::Library;
use asperity_texture::{Choice, Model, Precision, Runner};
use shared::{Wall, only_starts, shipped};

const MODEL: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../graphs/models/surfaces/texture.onnx");
const LIBRARY: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../graphs/models/surfaces/materials.ron");
const PERIOD: Duration = Duration::from_millis(2);

/// Pace of the ticks.
#[derive(Clone, Copy, PartialEq)]
enum Pace {
    BackToBack,
    Every2Ms,
}

impl Pace {
    fn name(self) -> &'static str {
        match self {
            Pace::BackToBack => "back to back",
            Pace::Every2Ms => "once every 2 ms",
        }
    }

    fn rounds(self) -> usize {
        match self {
            Pace::BackToBack => 20_000,
            Pace::Every2Ms => 1_500,
        }
    }
}

fn engine(synthesis_hz: u32, precision: &str) -> Engine {
    let sets = [format!("texture.synthesis_hz={synthesis_hz}"), format!("texture.precision={precision}")];
    Engine::new(shipped(&sets.each_ref().map(String::as_str)), Options::default())
}

fn weights(precision: Precision) -> Runner {
    let library = Library::read(LIBRARY).unwrap_or_else(|e| panic!("{e}"));
    let vector = library.materials()[0].vector.to_vec();
    let model = Model::load(MODEL).unwrap_or_else(|e| panic!("{e}"));
    model.runner(&[vector], precision, Choice::Auto).unwrap_or_else(|e| panic!("{e}"))
}

struct Row {
    name: String,
    timing: Timing,
    goal: String,
}

fn us(ns: u64) -> String {
    format!("{:.2}", ns as f64 / 1e3)
}

fn table(title: &str, rows: &[Row]) {
    println!("\n{title}");
    println!("  {:<28} {:>10} {:>10}   goal", "", "p50 us", "p99 us");
    for row in rows {
        let s = row.timing.summary();
        println!("  {:<28} {:>10} {:>10}   {}", row.name, us(s.p50_ns), us(s.p99_ns), row.goal);
    }
}

/// Timings of one setting at one pace. Everything in a table takes turns in one loop.
fn measure(synthesis_hz: u32, precision: &str, pace: Pace) {
    let mut plain = engine(synthesis_hz, precision);
    let mut timed = engine(synthesis_hz, precision);
    let runner = weights(if precision == "f16" { Precision::F16 } else { Precision::F32 });
    let schedule = timed.schedule().clone();
    let wall = Wall(Instant::now());
    let mut spent = vec![0; schedule.nodes.len()];
    // Past the approach, so that the gate is open.
    for _ in 0..1000 {
        plain.tick();
        timed.tick_timed(&wall, &mut spent);
    }
    let new = || Timing::new(3);
    let (mut read, mut whole, mut nodes) = (new(), new(), vec![new(); schedule.nodes.len()]);
    let mut pair = new();
    let place = |kind: &str| schedule.nodes.iter().position(|n| n.kind == kind).expect("the node");
    let (spsi, ola) = (place("spsi"), place("overlap_add"));
    let mut next = Instant::now();
    for _ in 0..pace.rounds() {
        let mut wait = || {
            if pace == Pace::Every2Ms {
                next += PERIOD;
                std::thread::sleep(next.saturating_duration_since(Instant::now()));
            }
        };
        wait();
        let t = wall.now_ns();
        black_box(runner.read_weights());
        read.record(wall.now_ns() - t);
        wait();
        let t = wall.now_ns();
        plain.tick_timed(&NoClock, &mut []);
        whole.record(wall.now_ns() - t);
        wait();
        spent.fill(0);
        timed.tick_timed(&wall, &mut spent);
        for (timing, ns) in nodes.iter_mut().zip(&spent) {
            timing.record(*ns);
        }
        pair.record(spent[spsi] + spent[ola]);
    }
    let at = if synthesis_hz == 0 {
        "48 kHz, N = 4800".to_owned()
    } else {
        format!("{synthesis_hz} Hz, N = {}", synthesis_hz / 10)
    };
    let warm = pace == Pace::BackToBack && precision == "f32";
    let goal = |text: &str| if warm { text.to_owned() } else { String::new() };
    let read_p50 = read.summary().p50_ns;
    let mut rows = vec![Row { name: "plain read of the weights".into(), timing: read, goal: String::new() }];
    for (node, timing) in schedule.nodes.iter().zip(nodes) {
        let ratio = timing.summary().p50_ns as f64 / read_p50 as f64;
        let goal = if node.role == Some(Role::TextureNetwork) {
            format!("{} ({ratio:.2} x the read)", goal("<= 1.2 x the read"))
        } else {
            String::new()
        };
        rows.push(Row { name: format!("{} ({})", node.id, node.kind), timing, goal });
    }
    let (pair_goal, tick_goal) = match synthesis_hz {
        2500 => ("<= 4", "<= 25"),
        0 => ("", "<= 45"),
        _ => ("", ""),
    };
    rows.push(Row { name: "spsi + overlap_add".into(), timing: pair, goal: goal(pair_goal) });
    rows.push(Row { name: "whole tick, not timed inside".into(), timing: whole, goal: goal(tick_goal) });
    table(&format!("synthesis at {at}, {precision} weights, {}", pace.name()), &rows);
}

/// A node that does next to nothing: what is left is the engine.
struct Nothing;

impl Node for Nothing {
    fn descriptor() -> Descriptor {
        Descriptor::new("nothing", "Passes a number on.")
            .input(Input::new("in", ShapeSpec::Control(1), Unit::NONE).or(1.0))
            .output(Output::new("out", ShapeSpec::Control(1), Unit::NONE))
    }

    fn prepare(_: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        Ok(Prepared::new(Self))
    }
}

impl Processor for Nothing {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let x = tick.inputs.value(0);
        tick.outputs.set(0, x);
        Status::Continue
    }

    fn reset(&mut self) {}
}

fn engine_overhead() {
    const NODES: u64 = 200;
    let nodes: Vec<String> = (0..NODES).map(|i| format!("\"n{i}\": (kind: \"nothing\")")).collect();
    let wires: Vec<String> = (1..NODES).map(|i| format!("(\"n{}\", \"n{i}\")", i - 1)).collect();
    let text = format!(
        "Graph(version: 1, nodes: {{{}, \"p\": (kind: \"probe\")}}, wires: [{}, (\"n{}\", \"p\")])",
        nodes.join(", "),
        wires.join(", "),
        NODES - 1
    );
    let registry: Registry = asperity_nodes::registry().with::<Nothing>();
    let graph = GraphFile::parse(&Source::new("overhead", text)).unwrap_or_else(|e| panic!("{e}"));
    let compiled =
        compile(&graph, &registry, asperity_graph::Options::default()).unwrap_or_else(|e| panic!("{}", e[0]));
    let mut engine = Engine::new(compiled, Options::default());
    let mut timing = Timing::new(3);
    for _ in 0..20_000 {
        let t = Instant::now();
        engine.tick();
        timing.record(t.elapsed().as_nanos() as u64);
    }
    let s = timing.summary();
    let per = |ns: u64| ns as f64 / (NODES + 1) as f64 / 1e3;
    println!("\nthe engine, per call of a node that does nothing");
    println!("  {:<28} {:>10.4} {:>10.4}   <= 0.05", "one call", per(s.p50_ns), per(s.p99_ns));
}

fn cpu() -> String {
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model =
        info.lines().find_map(|l| l.strip_prefix("model name")?.split_once(": ").map(|(_, m)| m.to_owned()));
    let cores = std::thread::available_parallelism().map_or(0, usize::from);
    format!("{}, {cores} cores, {}", model.unwrap_or_else(|| "unknown CPU".into()), std::env::consts::ARCH)
}

fn main() {
    if only_starts() {
        return;
    }
    println!("{}", cpu());
    println!("network: {}", weights(Precision::F32).describe().report);
    for pace in [Pace::BackToBack, Pace::Every2Ms] {
        measure(2500, "f32", pace);
        measure(0, "f32", pace);
    }
    measure(500, "f32", Pace::BackToBack);
    measure(2500, "f16", Pace::BackToBack);
    engine_overhead();
}
