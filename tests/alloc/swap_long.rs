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
    // Id, peak and step of every node so far, and whether it is late.
    let mut nodes: Vec<(String, f32, f32, bool)> = Vec::new();
    for (i, &(kind, which, a, b)) in draws.iter().enumerate() {
        let read = |k: usize| nodes.get(k % i.max(1)).cloned().unwrap_or_default();
        let ((from, peak, step, late), (other, other_peak, other_step, other_late)) = (read(a), read(b));
        let kind = match kind {
            _ if i == 0 => 0,
            // A delay that wakes behind a gate has a step of its own to put out.
            4 if late => 6,
            _ => kind,
        };
        // A delay that grows longer has nothing to put out for a while, which this test is not about.
        let id = if kind == 3 { format!("n{}d{which}", names[i]) } else { format!("n{}", names[i]) };
        let is_late = kind == 3 || (kind > 0 && late) || (kind == 2 && other_late);
        let (mut now, wire) = ((peak, step), format!("; {from}.out -> {id}"));
        let node = match kind {
            0 => {
                let (hz, level) = ([30.0, 55.0, 90.0][which], [1.0, 0.5, -0.7][which]);
                now = (1.0, 1.31e-4 * hz as f32);
                format!("tone(hz: {hz:?}, level: {level:?})")
            }
            1 => format!("scale(by: {:?}){wire}", [1.0, -0.5, 0.3][which]),
            2 => {
                now = (peak + other_peak, step + other_step);
                format!("mix{wire}.in1; {other}.out -> {id}.in2")
            }
            3 => format!("delay(delay_ms: {:?}){wire}", [0.5, 3.0, 20.0][which]),
            4 => {
                let speed =
                    format!("v{i}: level(value: {:?}); u{i}: gain(unit: \"mm/s\")", [10.0, 0.0, 6.0][which]);
                format!("speed_gate{wire}.in; {speed}; v{i} -> u{i} -> {id}.speed")
            }
            5 if forgetful => {
                let kind = ["one_pole", "forgetful", "one_pole"][b % 3];
                format!("{kind}(part: {:?}){wire}", [0.5, 0.01, 0.1][which])
            }
            _ => format!("tracked(version: {which}){wire}"),
        };
        lines += &format!("{id}: {node}\n");
        nodes.push((id, now.0, now.1, is_late));
    }
    let (last, peak, step, _) = nodes.pop().expect("a node");
    lines += "out: file_out(file: \"x.wav\")\n";
    let Some(which) = feedback else {
        return Made { lines: lines + &format!("{last}.out -> out"), peak, step };
    };
    let delay = format!("fd{which}: delay(delay_ms: {:?})", [2.0, 3.0, 4.0][which]);
    lines += &format!("fm: mix; fg: scale(by: 0.4); {delay}; {last}.out -> fm.in1; fd{which} -> fm.in2; ");
    lines += &format!("fm -> fg -> fd{which}; fm -> out");
    Made { lines, peak: peak / 0.6, step: step / 0.6 }
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
