//! Medians of one run: packed f32, f16 and int8, f64, tract, and a plain read of the same weights,
//! interleaved so that all see the same machine. `cargo bench -p asperity-texture`; numbers are only as
//! good as the machine is idle.
#![allow(missing_docs, clippy::unwrap_used)]

#[path = "../src/tests/networks.rs"]
mod networks;

use asperity_texture::{Choice, Isa, Model, Precision, onnx};
use networks::{Net, Spelling, bytes, model, motions, textures};
use std::hint::black_box;
use std::time::Instant;

/// Runs per measurement: long against the clock's resolution, short against a scheduler's slice.
const BATCH: u32 = 20;
const ROUNDS: usize = 2000;

fn main() {
    asperity_texture::run_graphs_by(asperity_tract::compile);
    // `cargo test --benches` calls this only to see that it runs.
    let rounds = if std::env::args().any(|a| a == "--bench") { ROUNDS } else { 3 };
    let model =
        Model::from_bytes(&bytes(&model(&Net::random(1), Spelling::default())), "random.onnx").unwrap();
    let mut ways = vec![(Precision::F64, Choice::Auto), (Precision::F32, Choice::Tract)];
    for isa in Isa::available() {
        ways.extend([Precision::F32, Precision::F16, Precision::Int8].map(|p| (p, Choice::Packed(isa))));
    }
    let make = |(precision, choice)| model.runner(&textures(1, 1), precision, choice).unwrap();
    // Each with the times of its runs and of plain reads, in us.
    let mut rows: Vec<_> = ways.into_iter().map(|way| (make(way), [Vec::new(), Vec::new()])).collect();
    let motions = motions(32, 3);
    let mut out = [0.0; 100];
    for round in 0..rounds {
        let (force, speed) = &motions[2 + round % 32];
        for (runner, times) in &mut rows {
            for (read, times) in [false, true].into_iter().zip(times) {
                // Once unmeasured: the rows before it have pushed these weights out of the caches.
                for measured in [false, true] {
                    let start = Instant::now();
                    for _ in 0..BATCH {
                        if read {
                            black_box(runner.read_weights());
                        } else {
                            runner.run(0, black_box(force), black_box(speed), &mut out).unwrap();
                            black_box(&out);
                        }
                    }
                    times.extend(measured.then(|| 1e6 * (start.elapsed() / BATCH).as_secs_f64()));
                }
            }
        }
    }
    println!("{:<24} {:>9} {:>9} {:>9} {:>10}", "", "p50 us", "p99 us", "read us", "weights kB");
    for (runner, mut times) in rows {
        times.iter_mut().for_each(|times| times.sort_by(f64::total_cmp));
        let [run, read] = times;
        let info = runner.describe();
        let (p50, p99, read) = (run[run.len() / 2], run[run.len() * 99 / 100], read[read.len() / 2]);
        let (name, kb) = (info.executor.to_string(), info.weights_bytes as f64 / 1e3);
        println!("{name:<24} {p50:>9.2} {p99:>9.2} {read:>9.2} {kb:>10.0}");
    }
}
