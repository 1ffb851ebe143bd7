use crate::bench::{Bench, it};
use asperity_node::Buffer;

/// The tick in which the stylus begins to move, at 60 mm/s.
const MOVES: u64 = 100;
const OPENING: [(&str, f64); 2] = [("cutoff_hz", 20.0), ("cutoff_hz_per_mm_s", 1.0)];

/// The reported speed in ticks from `from` on. `lost` ticks are lost, beginning with the first in which the
/// stylus has moved.
fn told(params: &[(&str, f64)], every: u32, lost: u64, from: u64) -> Vec<f64> {
    // At rest, then on a straight way.
    let moved = |tick: u64| vec![vec![60.0 * tick.saturating_sub(MOVES) as f64 / 500.0, 0.0, 0.0]];
    let bench = Bench::new("velocity", "position", moved).every(every);
    let bench = params.iter().fold(bench, |bench, (name, value)| bench.set(name, &format!("{value:?}")));
    let mut engine = bench.engine("it.velocity", true).unwrap();
    let it = it(&engine);
    let mut all = Vec::new();
    while engine.next_tick() < from + 400 {
        let tick = engine.next_tick();
        if tick == MOVES + 1 {
            engine.skip(lost);
        }
        let tick = engine.next_tick();
        engine.tick();
        if tick >= from {
            match engine.output(it, 1).unwrap() {
                Buffer::Control { values, .. } => all.push(values[0]),
                other => panic!("{other:?}"),
            }
        }
    }
    assert_eq!(engine.faults(), 0);
    all
}

#[test]
fn lost_ticks_leave_no_step_in_speed_at_any_low_pass() {
    for cutoff_hz in [0.0, 0.01, 1.0, 20.0, 80.0] {
        for every in [1, 2] {
            // From just after a gap on: the stylus moved all the while.
            for lost in [1, 9, 49, 51, 499, 501, 3001] {
                let (params, from) = ([("cutoff_hz", cutoff_hz)], MOVES + 1 + lost + lost % u64::from(every));
                let (lossy, whole) = (told(&params, every, lost, from), told(&params, every, 0, from));
                for (a, b) in lossy.iter().zip(&whole) {
                    assert!((a - b).abs() < 1e-5, "{lost} ticks lost at {cutoff_hz} Hz: {a} and {b} mm/s");
                }
            }
        }
    }
}

#[test]
fn opening_low_pass_answers_sooner() {
    let fixed = told(&OPENING[..1], 1, 0, MOVES);
    let opening = told(&OPENING, 1, 0, MOVES);
    let half = |speeds: &[f64]| speeds.iter().position(|v| *v > 30.0).unwrap();
    assert!(half(&opening) < half(&fixed), "{} {}", half(&fixed), half(&opening));
    let most = opening.iter().copied().fold(0.0, f64::max);
    assert!((opening[399] - 60.0).abs() < 1e-6 && most < 63.0, "{} {most}", opening[399]);
}

#[test]
fn opening_low_pass_takes_lost_ticks_without_a_jump() {
    let largest = |speeds: &[f64]| speeds.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f64::max);
    let whole = largest(&told(&OPENING, 1, 0, MOVES));
    for lost in [1, 9, 51, 501, 3001] {
        let lossy = told(&OPENING, 1, lost, MOVES + 1 + lost);
        assert!(lossy.iter().all(|v| (0.0..63.0).contains(v)), "{lost} ticks lost: {:?}", &lossy[..4]);
        let step = largest(&lossy);
        assert!(step <= 1.2 * whole, "{lost} ticks lost: a step of {step} mm/s, and {whole} without");
    }
}
