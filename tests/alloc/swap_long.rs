//! Any graph that loads may take the place of any other; and the shipped one of itself, again and again.

use asperity_graph::GraphFile;
use harness::live::largest_step;
use proptest::prelude::*;

use crate::rig::{Rig, STEEPEST, TICK};

/// A graph, and what its output cannot exceed: in level, and from sample to sample.
#[derive(Clone, Debug)]
struct Made {
    lines: String,
    peak: f32,
    step: f32,
}

/// One node: its kind, which of three parameters, and which nodes before it it reads.
type Draw = (usize, usize, usize, usize);

/// `names` deals out ids, so that graphs share some of them, in other places.
fn made(draws: &[Draw], names: &[usize], feedback: Option<usize>, forgetful: bool) -> Made {
    let mut lines = String::new();
    // Peak and step of every node so far.
    let mut levels: Vec<(f32, f32)> = Vec::new();
    let (mut ids, mut lates): (Vec<String>, Vec<bool>) = (Vec::new(), Vec::new());
    let id = |i: usize, kind: usize, which: usize| match kind {
        // A delay that grows longer has nothing to put out for a while, which this test is not about.
        3 => format!("n{}d{which}", names[i]),
        _ => format!("n{}", names[i]),
    };
    for (i, &(kind, which, a, b)) in draws.iter().enumerate() {
        let late = |k: usize| lates.get(k % i.max(1)).copied().unwrap_or(false);
        let kind = match kind {
            _ if i == 0 => 0,
            // A delay that wakes behind a gate has a step of its own to put out.
            4 if late(a) => 6,
            _ => kind,
        };
        let is_late = kind == 3 || (kind > 0 && late(a)) || (kind == 2 && late(b));
        let id = id(i, kind, which);
        let name = |k: usize| format!("{}.out", ids[k % i.max(1)]);
        let level = |k: usize| levels[k % i.max(1)];
        let (text, out) = match kind {
            0 => {
                let (hz, amplitude) = ([30.0, 55.0, 90.0][which], [1.0, 0.5, -0.7][which]);
                let step = 1.31e-4 * hz as f32;
                (format!("{id}: tone(hz: {hz:?}, level: {amplitude:?})\n"), (1.0, step))
            }
            1 => {
                let gain = [1.0, -0.5, 0.3][which];
                (format!("{id}: scale(by: {gain:?})\n{} -> {id}\n", name(a)), level(a))
            }
            2 => {
                let text = format!("{id}: mix\n{} -> {id}.in1\n{} -> {id}.in2\n", name(a), name(b));
                (text, (level(a).0 + level(b).0, level(a).1 + level(b).1))
            }
            3 => {
                let ms = [0.5, 3.0, 20.0][which];
                (format!("{id}: delay(delay_ms: {ms:?})\n{} -> {id}\n", name(a)), level(a))
            }
            4 => {
                let speed = [10.0, 0.0, 6.0][which];
                let text = format!(
                    "v{i}: level(value: {speed:?})\nu{i}: gain(unit: \"mm/s\")\nv{i} -> u{i}\nu{i} -> \
                     {id}.speed\n\
                     {id}: speed_gate\n{} -> {id}.in\n",
                    name(a)
                );
                (text, level(a))
            }
            5 if forgetful => {
                let part = [0.5, 0.01, 0.1][which];
                let kind = ["one_pole", "forgetful", "one_pole"][b % 3];
                (format!("{id}: {kind}(part: {part:?})\n{} -> {id}\n", name(a)), level(a))
            }
            _ => (format!("{id}: tracked(version: {which})\n{} -> {id}\n", name(a)), level(a)),
        };
        lines += &text;
        levels.push(out);
        ids.push(id);
        lates.push(is_late);
    }
    let last = format!("{}.out", ids[draws.len() - 1]);
    let (mut peak, mut step) = levels[draws.len() - 1];
    match feedback {
        None => lines += &format!("out: file_out(file: \"x.wav\")\n{last} -> out\n"),
        Some(which) => {
            let ms = [2.0, 3.0, 4.0][which];
            lines += &format!(
                "fm: mix\nfg: scale(by: 0.4)\nfd{which}: delay(delay_ms: {ms:?})\nout: file_out(file: \
                 \"x.wav\")\n\
                 {last} -> fm.in1\nfd{which} -> fm.in2\nfm -> fg\nfg -> fd{which}\nfm -> out\n"
            );
            (peak, step) = (peak / 0.6, step / 0.6);
        }
    }
    Made { lines, peak, step }
}

fn any_graph(forgetful: bool) -> impl Strategy<Value = Made> {
    let draws = prop::collection::vec((0..7_usize, 0..3_usize, 0..7_usize, 0..7_usize), 1..7);
    let names = Just((0..7).collect::<Vec<usize>>()).prop_shuffle();
    // Mostly in one order, so that much is kept.
    let names = prop_oneof![3 => Just((0..7).collect::<Vec<usize>>()), 1 => names];
    (draws, names, prop::option::of(0..3_usize))
        .prop_map(move |(draws, names, feedback)| made(&draws, &names, feedback, forgetful))
}

/// Ticks until nothing of a graph begins any more.
const SETTLES: usize = 80;

fn swap_through(graphs: &[Made], waits: &[usize]) -> Rig {
    let mut rig = Rig::new(&graphs[0].lines);
    // Six delays of 20 ms, and a loop behind them: what begins has begun.
    rig.run(SETTLES + 10);
    let mut bound = 0.0_f32;
    for (pair, wait) in graphs.windows(2).zip(waits) {
        rig.swap(&pair[1].lines);
        rig.run(*wait);
        let fades = 3.0 * STEEPEST * (pair[0].peak + pair[1].peak);
        bound = bound.max(pair[0].step.max(pair[1].step) + fades);
    }
    rig.run(80);
    let step = largest_step(&rig.heard[SETTLES * TICK..]);
    let lines = || graphs.iter().map(|g| g.lines.as_str()).collect::<Vec<_>>().join("\nto\n");
    assert!(rig.heard.iter().all(|x| x.is_finite()));
    assert!(step < bound, "a step of {step}, {bound} at most:\n{}", lines());
    assert_eq!(rig.controller.collect().len(), waits.len());
    rig
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 128, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_graph_takes_the_place_of_any_other_without_a_click(
        graphs in prop::collection::vec(any_graph(true), 2..5),
        waits in prop::collection::vec(0..9_usize, 3),
    ) {
        swap_through(&graphs, &waits[..graphs.len() - 1]);
    }

    /// Compares the output after the fade with an engine that only ever ran the new graph.
    #[test]
    fn swapped_engine_equals_a_fresh_one_after_the_fade(
        graphs in prop::collection::vec(any_graph(false), 2..5),
        waits in prop::collection::vec(0..9_usize, 3),
    ) {
        let rig = swap_through(&graphs, &waits[..graphs.len() - 1]);
        let (last, tracked) = (&graphs[graphs.len() - 1].lines, crate::tones::tracked());
        let mut fresh = Rig::new(last);
        fresh.run(rig.engine.next_tick() as usize);
        let worst = rig.last().iter().zip(fresh.last()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        prop_assert!(worst < 1e-5, "{worst} from a fresh one:\n{last}");
        prop_assert_eq!(crate::tones::tracked(), 2 * tracked, "as many in the one as in the other");
    }
}

/// Number of swaps of the shipped graph; `ASPERITY_LONG_SWAPS` asks for more. Most of the time goes to
/// loading the network.
fn swaps() -> usize {
    std::env::var("ASPERITY_LONG_SWAPS").ok().and_then(|t| t.parse().ok()).unwrap_or(70)
}

/// The shipped graph under a stroke that never stops, with a part of it changed.
fn shipped(k: usize) -> GraphFile {
    let mut graph = GraphFile::read(harness::graphs("heravi2024.ron")).unwrap_or_else(|e| panic!("{e}"));
    let stylus = graph.nodes.iter_mut().find(|n| n.id == "stylus").expect("the stylus");
    stylus.kind = "stroke".into();
    stylus.params.clear();
    let mut set = |what: &str| graph.set(what, "test").unwrap_or_else(|e| panic!("{e}"));
    set("stylus.shape=circle");
    set("stylus.duration_s=1000");
    let round = k / 7;
    match k % 7 {
        1 => set(&format!("phase.seed={round}")),
        2 => set("gate.fade_ms=12.0"),
        3 => set("limiter.slew_hz=3000"),
        4 => set("floor.stiffness_n_per_mm=0.6"),
        5 => set("out.volts_at_full_scale=1.25"),
        6 => set("motion.cutoff_hz=25.0"),
        _ => {}
    }
    graph
}

#[test]
fn shipped_graph_swapped_often_neither_clicks_nor_allocates() {
    let registry = harness::registry();
    let compiled = |k| harness::graph::compiled(&shipped(k), &registry);
    // Some of the seven are louder than others.
    let still: Vec<Rig> = (0..7)
        .map(|k| {
            let mut rig = Rig::of(compiled(k));
            rig.run(1000 + 7 * swaps());
            rig
        })
        .collect();
    let own = still.iter().map(|rig| largest_step(&rig.heard)).fold(0.0, f32::max);
    let mut rig = Rig::of(compiled(0));
    rig.run(500);
    let mut over = 0;
    for k in 1..=swaps() {
        rig.controller.swap(compiled(k), &[]).expect("it is sent");
        rig.run(6 + k % 3);
        over += rig.controller.collect().len();
    }
    rig.run(10);
    over += rig.controller.collect().len();
    assert_eq!((over, rig.engine.swaps(), rig.engine.faults()), (swaps(), swaps() as u64, 0));
    let step = largest_step(&rig.heard);
    assert!(own > 1e-3 && step <= own, "a step of {step}, where the graphs alone have {own}");
    let rms = |x: &[f32]| (x.iter().map(|x| x * x).sum::<f32>() / x.len() as f32).sqrt();
    let (with, without) = (rms(&rig.heard[400 * TICK..]), rms(&still[0].heard[400 * TICK..]));
    assert!((0.5..2.0).contains(&(with / without)), "it goes on: {with} to {without}");
}

#[test]
fn a_controller_and_its_engine_live_on_two_threads() {
    let with =
        |k: usize| format!("t: tone\ns: scale(by: {})\nout: probe\nt -> s\ns -> out", [1.0, 0.5][k % 2]);
    let Rig { mut controller, engine, .. } = Rig::new(&with(0));
    let ticking = std::thread::spawn(move || {
        let mut rig = Rig { controller: Rig::new(&with(0)).controller, engine, heard: Vec::new() };
        while rig.engine.swaps() < 100 || rig.engine.is_fading() {
            rig.tick();
            std::thread::yield_now();
        }
        rig.run(2);
        rig.heard
    });
    let mut over = 0;
    let mut next = crate::rig::compiled(&with(1));
    for k in 1..=100 {
        while !controller.ready() {
            std::thread::yield_now();
        }
        controller.swap(next, &[]).expect("there is room");
        next = crate::rig::compiled(&with(k + 1));
        over += controller.collect().len();
    }
    let heard = ticking.join().expect("the engine ticks on");
    over += controller.collect().len();
    assert_eq!(over, 100);
    assert!(largest_step(&heard) < 0.0131 + STEEPEST, "{}", largest_step(&heard));
}
