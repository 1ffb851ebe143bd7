//! Cost of a hot swap of the shipped graph, in one run: plain ticks, the tick of the takeover, ticks while
//! it fades; and what it costs the control thread.

mod shared;

use std::time::Instant;

use asperity_accuracy::timing::Timing;
use asperity_engine::{Engine, Options};
use shared::{only_starts, shipped};

fn row(name: &str, timing: &Timing) {
    let s = timing.summary();
    let us = |ns: u64| ns as f64 / 1e3;
    println!("  {name:<28} {:>10.2} {:>10.2}", us(s.p50_ns), us(s.p99_ns));
}

/// Goes back and forth between two graphs.
fn measure(title: &str, sets: [&str; 2], swaps: usize) {
    let compiled = |k: usize| shipped(&[sets[k % 2]]);
    let (mut controller, mut engine) = Engine::controlled(compiled(0), Options::default());
    (0..1000).for_each(|_| engine.tick());
    let new = || Timing::new(3);
    let (mut plain, mut takeover, mut fading, mut after, mut plan) = (new(), new(), new(), new(), new());
    let timed = |engine: &mut Engine, timing: &mut Timing| {
        let t = Instant::now();
        engine.tick();
        timing.record(t.elapsed().as_nanos() as u64);
    };
    for k in 1..=swaps {
        let next = compiled(k);
        (0..20).for_each(|_| engine.tick());
        (0..20).for_each(|_| timed(&mut engine, &mut plain));
        let t = Instant::now();
        controller.swap(next, &[]).unwrap_or_else(|e| panic!("{e}"));
        plan.record(t.elapsed().as_nanos() as u64);
        // What planning left in the caches is not what a tick finds there.
        timed(&mut engine, &mut takeover);
        (1..5).for_each(|_| timed(&mut engine, &mut fading));
        timed(&mut engine, &mut after);
        controller.collect();
    }
    println!("\n{title}");
    println!("  {:<28} {:>10} {:>10}", "", "p50 us", "p99 us");
    row("plain tick", &plain);
    row("takeover, the first faded", &takeover);
    row("the other ticks of the fade", &fading);
    row("the tick that ends it", &after);
    row("plan and parts (control)", &plan);
}

fn main() {
    if only_starts() {
        return;
    }
    measure("phase retrieval and synthesis are rebuilt", ["phase.seed=1", "phase.seed=2"], 300);
    measure("every node behind the stylus is rebuilt", ["seed=1", "seed=2"], 300);
}
