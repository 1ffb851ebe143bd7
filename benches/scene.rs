//! Tick time of scenes with 1 to 10000 surfaces, one of them touched. It must not grow with the number of
//! surfaces.
//!
//! All sizes of a table take turns tick by tick in one loop, so that what the machine does besides is the
//! same for all; figures are medians. `far`: the other surfaces lie in a grid 200 mm and more away.
//! `stacked`: all lie on each other, half a millimetre and less apart, so that any of them could be the one.
//! `crowd`: boxes and balls of 2 mm, turned any way, 7 to 60 mm around the stylus, above, below and through
//! each other. The goals are printed beside what was measured, and nothing fails on them: machines differ.

mod shared;

use std::fmt::Write as _;
use std::path::Path;
use std::time::Instant;

use asperity_accuracy::timing::Timing;
use asperity_engine::{Clock as _, Engine, NoClock, Options};
use asperity_graph::compile;
use asperity_scene::Scene;
use asperity_scene::{Lowering, lower};
use shared::Wall;

const COUNTS: [usize; 5] = [1, 10, 100, 1000, 10_000];
const ROUNDS: usize = 6000;
const MODELS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../graphs/models");

/// Motion of the stylus.
#[derive(Clone, Copy)]
enum Hand {
    /// In circles on the surface.
    Touching,
    /// Over it.
    Air,
}

/// Where the surfaces lie that are not touched.
#[derive(Clone, Copy)]
enum Others {
    Far,
    Stacked,
    Crowd,
}

/// Effects of the surfaces.
#[derive(Clone, Copy)]
struct What {
    name: &'static str,
    effects: &'static str,
    /// Whether there is something to play.
    sounds: bool,
}

const STIFFNESS: What =
    What { name: "stiffness alone", effects: "stiffness: (stiffness_n_per_mm: 0.5)", sounds: false };
const WAVEFORM: What = What {
    name: "waveform",
    effects: "stiffness: (stiffness_n_per_mm: 0.5), texture: waveform(segments: [(0, 0), (0.5, 4), (1, 0)])",
    sounds: true,
};
const NETWORK: What = What {
    name: "network",
    effects: "stiffness: (stiffness_n_per_mm: 0.5), friction: viscous_coulomb(coefficient: 0.3), \
              texture: network",
    sounds: true,
};

fn scene(count: usize, what: What, others: Others, hand: Hand) -> String {
    let mut out = String::from("Scene(\n    version: 1,\n");
    let _ = match hand {
        Hand::Touching => writeln!(
            out,
            "    input: stroke(shape: circle, extent_mm: 10.0, speed_mm_s: 60.0, duration_s: 100000.0, \
             quantum_mm: 0.0),"
        ),
        Hand::Air => writeln!(out, "    input: trajectory(file: \"air.csv\"),"),
    };
    if what.sounds {
        let _ = writeln!(
            out,
            "    network: (model: \"{MODELS}/surfaces/texture.onnx\", \
             library: \"{MODELS}/surfaces/materials.ron\"),\n    \
             actuator: (profile: \"hapcoil_one\", handle_mass_g: 100.0),\n    \
             output: audio_out(volts_at_full_scale: 1.0, amps_per_volt: 1.0),"
        );
    }
    let _ = writeln!(out, "    surfaces: {{");
    for i in 0..count {
        // Parts of the golden ratio and its kin: as even as chance, and the same everywhere.
        let part = |k: f64| (k * i as f64).fract();
        let [x, y, z] = match (i, others) {
            (0, _) => [0.0; 3],
            (_, Others::Stacked) => {
                [0.37 * (i % 7) as f64 - 1.0, 0.29 * (i % 5) as f64, -1e-4 * (i % 5000) as f64]
            }
            (_, Others::Far) => [200.0 + 45.0 * (i % 100) as f64, 45.0 * (i / 100) as f64, 0.0],
            (_, Others::Crowd) => {
                let (angle, away) = (std::f64::consts::TAU * part(0.618_034), 7.0 + 53.0 * part(0.754_878));
                [away * angle.cos(), away * angle.sin(), 60.0 * part(0.569_840) - 30.0]
            }
        };
        let shape = match others {
            Others::Crowd if i % 2 == 1 => "sphere(radius_mm: 1)",
            Others::Crowd if i > 0 => "box(size_mm: (2, 2, 2))",
            _ => "rectangle(size_mm: (40, 40), thickness_mm: 10)",
        };
        let turn = if matches!(others, Others::Crowd) && i > 0 { 360.0 * part(0.438_579) } else { 0.0 };
        let _ = writeln!(
            out,
            "        \"{i}\": (shape: {shape}, place_mm: ({x}, {y}, {z}), turn_deg: ({turn}, {}, 0), \
             material: \"canvas\", effects: ({})),",
            0.5 * turn,
            what.effects
        );
    }
    out + "    },\n)\n"
}

/// A scene that runs, and how it was loaded.
struct Loaded {
    engine: Engine,
    /// Nodes of the network's chain.
    of_network: Vec<usize>,
    load_ms: f64,
    grown_kib: Option<i64>,
}

/// Memory of this process in KiB, where the system tells.
fn resident_kib() -> Option<i64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmRSS:"))?;
    line.split_whitespace().nth(1)?.parse().ok()
}

fn load(dir: &Path, text: &str) -> Loaded {
    let file = dir.join("scene.ron");
    std::fs::write(&file, text).expect("a scene file");
    let registry = asperity_nodes::registry();
    let before = resident_kib();
    let began = Instant::now();
    let scene = Scene::read(&file).unwrap_or_else(|e| panic!("{e}"));
    let lowered = lower(&scene, &registry, Lowering::default()).unwrap_or_else(|e| panic!("{e}"));
    drop(scene);
    let compiled = compile(&lowered.graph, &registry, asperity_graph::Options::default())
        .unwrap_or_else(|e| panic!("{}", e[0]));
    drop(lowered.graph);
    let load_ms = began.elapsed().as_secs_f64() * 1e3;
    let grown_kib = before.zip(resident_kib()).map(|(before, after)| after - before);
    let ids =
        lowered.rendered.iter().find(|of| of.kind == asperity_scene::NETWORK).map(|of| of.nodes.clone());
    let of_network = ids.unwrap_or_default().iter().filter_map(|id| compiled.schedule.index_of(id)).collect();
    Loaded { engine: Engine::new(compiled, Options::default()), of_network, load_ms, grown_kib }
}

/// One table: every size takes its turn in every round.
fn table(dir: &Path, what: What, others: Others, hand: Hand, goal: &str) {
    let mut all: Vec<Loaded> = COUNTS.iter().map(|n| load(dir, &scene(*n, what, others, hand))).collect();
    let wall = Wall(Instant::now());
    let mut whole = vec![Timing::new(3); all.len()];
    let mut without = vec![Timing::new(3); all.len()];
    for loaded in &mut all {
        for _ in 0..1000 {
            loaded.engine.tick_timed(&NoClock, &mut []);
        }
    }
    let mut spent = vec![0; 64];
    for round in 0..ROUNDS {
        for i in 0..all.len() {
            // Not always in the same order: who comes after whom finds other caches.
            let i = (i + round) % all.len();
            let Loaded { engine, of_network, .. } = &mut all[i];
            // A clock around every node costs as much as some of them.
            if of_network.is_empty() || matches!(hand, Hand::Air) {
                let began = wall.now_ns();
                engine.tick_timed(&NoClock, &mut []);
                let took = wall.now_ns() - began;
                whole[i].record(took);
                without[i].record(took);
            } else {
                spent.fill(0);
                let began = wall.now_ns();
                engine.tick_timed(&wall, &mut spent);
                let took = wall.now_ns() - began;
                whole[i].record(took);
                let network: u64 = of_network.iter().map(|n| spent[*n]).sum();
                without[i].record(took.saturating_sub(network));
            }
        }
    }
    let place = match others {
        Others::Far => "all but one far",
        Others::Stacked => "all stacked",
        Others::Crowd => "one in a crowd",
    };
    let hand = if matches!(hand, Hand::Air) { "in the air" } else { "one touched" };
    println!("\n{}, {place}, {hand}   (goal: {goal})", what.name);
    println!(
        "  {:>8} {:>12} {:>20} {:>8} {:>10} {:>12}",
        "surfaces", "tick us", "without network us", "ratio", "load ms", "memory KiB"
    );
    let us = |timing: &Timing| timing.summary().p50_ns as f64 / 1e3;
    for (i, count) in COUNTS.iter().enumerate() {
        let memory = all[i].grown_kib.map_or("?".into(), |kib| kib.to_string());
        println!(
            "  {count:>8} {:>12.2} {:>20.2} {:>8.2} {:>10.1} {memory:>12}",
            us(&whole[i]),
            us(&without[i]),
            us(&without[i]) / us(&without[0]),
            all[i].load_ms,
        );
    }
}

fn main() {
    let dir = tempfile::tempdir().expect("a folder");
    std::fs::write(dir.path().join("air.csv"), "t_s,x_mm,y_mm,z_mm\n0,0,0,3\n100000,10,0,3\n")
        .expect("a stroke");
    let growth = "at most 1.10 times one surface";
    for others in [Others::Far, Others::Stacked, Others::Crowd] {
        table(dir.path(), STIFFNESS, others, Hand::Touching, &format!("3 us; {growth}"));
        table(dir.path(), WAVEFORM, others, Hand::Touching, growth);
        table(dir.path(), NETWORK, others, Hand::Touching, growth);
    }
    table(dir.path(), NETWORK, Others::Far, Hand::Air, "2 us idle");
    table(dir.path(), STIFFNESS, Others::Far, Hand::Air, "2 us idle");
}
