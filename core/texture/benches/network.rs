//! Medians of one run: packed f32, f16 and int8, f64, tract, and a plain read of the same weights,
//! interleaved so that all see the same machine. `cargo bench -p asperity-texture`; numbers are only as
//! good as the machine is idle.
#![allow(missing_docs, clippy::unwrap_used)]

#[path = "../src/tests/networks.rs"]
mod networks;

use asperity_texture::{Choice, Isa, Model, Precision, Runner, onnx};
use networks::{Net, Spelling, bytes, model, motions, textures};
use std::hint::black_box;
use std::time::{Duration, Instant};

/// Runs per measurement: long against the clock's resolution, short against a scheduler's slice.
const BATCH: u32 = 20;
const ROUNDS: usize = 2000;

struct Row {
    name: String,
    runner: Runner,
    read: bool,
    times: Vec<Duration>,
}

fn main() {
    // `cargo test --benches` calls this only to see that it runs.
    let rounds = if std::env::args().any(|a| a == "--bench") { ROUNDS } else { 3 };
    let model =
        Model::from_bytes(&bytes(&model(&Net::random(1), Spelling::default())), "random.onnx").unwrap();
    let textures = textures(1, 1);
    let make = |precision, choice| model.runner(&textures, precision, choice).unwrap();
    let mut rows = Vec::new();
    for isa in Isa::available() {
        for precision in [Precision::F32, Precision::F16, Precision::Int8] {
            for read in [false, true] {
                let name =
                    format!("{} {} {}", precision.name(), isa.name(), if read { "read" } else { "run" });
                rows.push(Row {
                    name,
                    runner: make(precision, Choice::Packed(isa)),
                    read,
                    times: Vec::new(),
                });
            }
        }
    }
    for (name, runner) in
        [("f64 run", make(Precision::F64, Choice::Auto)), ("tract run", make(Precision::F32, Choice::Tract))]
    {
        rows.push(Row { name: name.into(), runner, read: false, times: Vec::new() });
    }

    let motions = motions(32, 3);
    let mut out = [0.0; 100];
    for round in 0..rounds {
        let (force, speed) = &motions[2 + round % 32];
        for row in &mut rows {
            let batch = |row: &mut Row, out: &mut [f32]| {
                for _ in 0..BATCH {
                    if row.read {
                        black_box(row.runner.read_weights());
                    } else {
                        row.runner.run(0, black_box(force), black_box(speed), out).unwrap();
                        black_box(&out);
                    }
                }
            };
            // Once unmeasured: the rows before it have pushed these weights out of the caches.
            batch(row, &mut out);
            let start = Instant::now();
            batch(row, &mut out);
            row.times.push(start.elapsed() / BATCH);
        }
    }

    println!("{:<20} {:>9} {:>9} {:>10}", "", "p50 us", "p99 us", "weights kB");
    let mut medians: Vec<f64> = Vec::new();
    for row in &mut rows {
        row.times.sort();
        let us = |i: usize| row.times[i].as_secs_f64() * 1e6;
        medians.push(us(row.times.len() / 2));
        let p99 = us(row.times.len() * 99 / 100);
        let bytes = row.runner.describe().weights_bytes as f64 / 1e3;
        println!("{:<20} {:>9.2} {:>9.2} {:>10.0}", row.name, medians[medians.len() - 1], p99, bytes);
    }
    for (pair, names) in medians.chunks_exact(2).zip(rows.chunks_exact(2)) {
        println!("{:<20} is {:.3} times its read", names[0].name, pair[0] / pair[1]);
    }
}
