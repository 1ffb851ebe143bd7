//! Nodes that fail by chance, for a long time: every fault is counted, nothing leaks, what is computed
//! elsewhere is the same to the bit.

mod nodes;

use asperity_checks::{finite, same};
use asperity_engine::Engine;
use harness::counting::{Held, held};

use self::nodes::{INJECTORS, injected, injected_all, registry};

/// Ticks of a run; `ASPERITY_LONG_TICKS` asks for others.
fn ticks() -> u64 {
    std::env::var("ASPERITY_LONG_TICKS").ok().and_then(|t| t.parse().ok()).unwrap_or(30_000)
}

/// Part of the graph that no fault reaches.
const CLEAN: &str = "stylus: stroke(duration_s: 1e6, shape: circle); motion: velocity; speed: probe; \
    tone: sine(frequency_hz: 80, amplitude: 0.1); guard: limiter; clean: audio_out; \
    stylus.position -> motion.position; motion.speed -> speed; tone -> guard -> clean";

fn engine(lines: &str) -> Engine {
    harness::graph::engine(&harness::graph::of_lines(lines), &registry())
}

/// A graph of injectors, each of which fails in one of so many calls: as sources of audio, controls and
/// frames, as gates, in a cycle, asleep now and then; and what is to go on beside them.
fn faulty(one_in: u64) -> Engine {
    let mut lines = CLEAN.to_owned();
    for n in 0..INJECTORS {
        let (kind, of, more) = match n % 4 {
            0 => ("chance", "audio", format!("{n}.control -> forces.in{}", n / 4 + 1)),
            1 => ("chance", "audio", String::new()),
            2 => {
                let tone = format!("tone {n}: chance(number: {n}, one_in: 1000000000)");
                ("chance_gate", "out", format!("{tone}; tone {n}.audio -> {n}.in"))
            }
            _ => ("chance_loop", "out", format!("loop {n}: gain(gain: 0.5); {n} -> loop {n} -> {n}.in")),
        };
        lines += &format!("; {n}: {kind}(number: {n}, one_in: {one_in}); gain {n}: gain(gain: 0.01); {more}");
        lines += &format!("; {n}.{of} -> gain {n} -> mix.in{}", n + 1);
    }
    lines += &format!("; mix: mix(inputs: {INJECTORS}); forces: mix(inputs: {})", INJECTORS / 4);
    lines += "; limiter: limiter; out: audio_out; force: probe; phase: spsi; sum: overlap_add; heard: probe; \
              mix -> limiter -> out; forces -> force; 0.frame -> phase -> sum -> heard";
    engine(&lines)
}

/// An engine as a host sees it: how it ticks, and how many faults it counts.
struct Host<'a> {
    engine: Engine,
    go_on: &'a mut dyn FnMut(&mut Engine),
    counted: fn(&Engine) -> u64,
}

/// A graph of injectors, and how it ticks.
fn host(one_in: u64, go_on: &mut dyn FnMut(&mut Engine)) -> Host<'_> {
    Host { engine: faulty(one_in), go_on, counted: Engine::faults }
}

/// One tick of both, looked at.
fn step(host: &mut Host<'_>, alone: &mut Engine, watched: &[(usize, usize, usize)]) -> Result<(), String> {
    (host.go_on)(&mut host.engine);
    alone.tick();
    let engine = &host.engine;
    for node in 0..engine.schedule().nodes.len() {
        let outputs = engine.schedule().nodes[node].outputs.len();
        if !(0..outputs).all(|o| engine.output(node, o).is_some_and(finite)) {
            let (id, tick) = (&engine.schedule().nodes[node].id, engine.next_tick());
            return Err(format!("`{id}` puts out what is not finite before tick {tick}"));
        }
    }
    for &(here, there, output) in watched {
        let both = engine.output(here, output).zip(alone.output(there, output));
        if !both.is_some_and(|(a, b)| same(a, b)) {
            let (id, tick) = (&engine.schedule().nodes[here].id, engine.next_tick());
            return Err(format!("`{id}` is another before tick {tick}"));
        }
    }
    Ok(())
}

/// Whether an engine whose nodes fail goes on as it should for so many ticks, put back to the start every so
/// often. Answers how many faults there were.
fn endures(mut host: Host<'_>, ticks: u64, reset_every: u64) -> Result<u64, String> {
    let mut alone = engine(CLEAN);
    let mut watched = Vec::new();
    for (there, node) in alone.schedule().nodes.iter().enumerate() {
        let here = host.engine.schedule().index_of(&node.id).expect("it is in both");
        watched.extend((0..node.outputs.len()).map(|output| (here, there, output)));
    }
    let faults_before = (host.counted)(&host.engine) as i64 - injected_all() as i64;
    let mut run = |from: u64, to: u64| {
        (from..to).try_for_each(|tick| {
            if tick.is_multiple_of(reset_every) {
                host.engine.reset();
                alone.reset();
            }
            step(&mut host, &mut alone, &watched)
        })
    };
    // What a first panic sets up stays.
    run(0, ticks / 10)?;
    let (done, Held { left, .. }) = held(|| run(ticks / 10, ticks));
    done?;
    if left != 0 {
        return Err(format!("{left} bytes are left behind"));
    }
    let (counted, thrown) = ((host.counted)(&host.engine), injected_all());
    if counted as i64 - thrown as i64 != faults_before {
        return Err(format!("{counted} faults were counted, and there were {thrown}"));
    }
    for n in 0..INJECTORS {
        let engine = &host.engine;
        let at = engine.schedule().index_of(&n.to_string()).expect("an injector");
        let (counted, thrown) = (engine.report(at).expect("a report").faults, injected(n));
        if counted != thrown {
            return Err(format!("`{n}` failed {thrown} times, and {counted} were counted"));
        }
    }
    Ok(thrown)
}

/// Faults as rare as they must be for a node to stay in the graph.
#[test]
fn rare_faults_are_contained_and_counted_without_a_leak() {
    let ticks = ticks();
    let faults = endures(host(20_000, &mut Engine::tick), ticks, u64::MAX).unwrap();
    println!("{faults} faults in {ticks} ticks");
    assert!(faults > ticks * INJECTORS as u64 / 100_000, "{faults} faults are few");
}

/// One call of 50 fails, and every node is soon taken out of the graph; then all is put back to the start.
#[test]
fn frequent_faults_are_contained_and_counted_without_leak() {
    let ticks = ticks();
    let faults = endures(host(50, &mut Engine::tick), ticks, 1000).unwrap();
    println!("{faults} faults in {ticks} ticks");
    assert!(faults > ticks / 1000 * INJECTORS as u64, "{faults} faults are few");
}

/// As it was: the node was taken out of the graph, and the second fault was in no count.
#[test]
fn a_panic_in_the_reset_that_follows_a_panic_is_counted_too() {
    let mut engine = engine("it: breaks_twice; p: probe; it -> p");
    (0..3).for_each(|_| engine.tick());
    let it = engine.schedule().index_of("it").expect("the node");
    let report = engine.report(it).expect("a report").clone();
    assert_eq!((report.calls, report.faults, report.quarantined), (1, 2, true));
    // And once more where all is put back to the start.
    engine.reset();
    assert_eq!(engine.report(it).expect("a report").faults, 3);
}

/// As it was: what a panic carried was never freed, and a node that panics less than once in ten seconds
/// does so for good.
#[test]
fn what_a_panic_carries_is_freed() {
    let mut engine = faulty(50);
    let mut run = || (0..2000).for_each(|_| engine.tick());
    run();
    let (_, Held { left, .. }) = held(run);
    assert_eq!(left, 0);
}

/// Mutants: an engine that loses one count of a hundred, one that leaves what a panic carried where it is,
/// one whose other branches miss a tick when a node fails.
#[test]
fn an_engine_that_loses_count_leaks_or_stumbles_is_found_out() {
    let mut tick = Engine::tick;
    let loses = Host { counted: |engine| engine.faults() - engine.faults() / 100, ..host(50, &mut tick) };
    let found = endures(loses, 20_000, 1000).unwrap_err();
    assert!(found.contains("were counted"), "{found}");
    let leak: fn(&mut Engine) = |_| std::mem::forget(std::hint::black_box(Box::new([0_u8; 16])));
    for (spoil, why) in [(leak, "left behind"), (|engine| engine.skip(1), "is another")] {
        nodes::forget();
        let mut seen = 0;
        let mut go_on = |engine: &mut Engine| {
            engine.tick();
            if engine.faults() > seen + 100 {
                seen = engine.faults();
                spoil(engine);
            }
        };
        let found = endures(host(50, &mut go_on), 20_000, 1000).unwrap_err();
        assert!(found.contains(why), "{found}");
    }
}
