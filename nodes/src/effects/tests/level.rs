//! `level`.

use asperity_node::{Buffer, Shape, Status};

use crate::bench::{Alone, Bench, Run, largest_step, run, spans};

/// A gate at a rate of its own.
fn level(rate_hz: u32, tick_hz: u32) -> Alone {
    let (audio, control) = (Shape::Audio { rate_hz }, Shape::Control { count: 1 });
    Alone::new("level", &[], (tick_hz, 1, 48_000), &[audio, control, control], &[audio]).unwrap()
}

/// Runs one tick. Returns whether the input was wanted, the status, and the output.
fn step(
    it: &mut Alone,
    index: u64,
    x: &[f32],
    (level, slot, valid): (f64, f64, bool),
) -> (bool, Status, Vec<f32>) {
    it.inputs[0] = Buffer::Audio { len: x.len(), samples: x.into(), valid: true, silent: false };
    it.give(1, &[level], valid);
    it.give(2, &[slot], true);
    let (status, wants) = it.tick(index);
    (wants, status, it.audio().to_vec())
}

#[test]
fn levels_go_in_straight_lines_whatever_the_rates() {
    let level_at = |tick: i64| match tick {
        ..3 => 0.0,
        3..10 => 0.1 * (tick - 2) as f64,
        10..20 => 1.0,
        20..25 => 0.4,
        _ => 0.0,
    };
    for (rate, tick_hz) in [(48_000, 500), (44_100, 500), (48_000, 4000), (2500, 4000), (8000, 333)] {
        let mut it = level(rate, tick_hz);
        for (tick, first, len) in spans(40, rate, tick_hz) {
            let x: Vec<f32> = (0..len).map(|n| 1.0 + (first as f32 + n as f32) * 1e-3).collect();
            let (wants, status, out) = step(&mut it, tick, &x, (level_at(tick as i64), 0.0, true));
            let [from, to] = [level_at(tick as i64 - 1), level_at(tick as i64)];
            assert_eq!(wants, from > 0.0 || to > 0.0);
            assert_eq!(status == Status::Quiet, !wants);
            for (n, (y, x)) in out.iter().zip(&x).enumerate() {
                // A sample stands at its end.
                let part = ((first + n as u64 + 1) as f64 / f64::from(rate) * f64::from(tick_hz)
                    - tick as f64)
                    .min(1.0);
                let want = (from + (to - from) * part) * f64::from(*x);
                assert!(
                    (f64::from(*y) - want).abs() < 1e-6 * f64::from(*x),
                    "{rate}/{tick_hz}: {y} for {want}"
                );
                if from == 1.0 && to == 1.0 {
                    assert_eq!(y.to_bits(), x.to_bits());
                }
            }
        }
    }
}

#[test]
fn the_first_level_is_taken_at_once_and_no_slot_is_no_sound() {
    let mut it = level(48_000, 500);
    let x = [0.5_f32; 96];
    for level in [0.5, 0.25] {
        let (wants, _, out) = step(&mut it, 7, &x, (level, 3.0, true));
        assert!(wants && out.iter().all(|y| f64::from(*y) == 0.5 * level));
        it.node().reset();
    }
    step(&mut it, 0, &x, (1.0, 0.0, true));
    let (wants, status, out) = step(&mut it, 1, &x, (1.0, -1.0, true));
    assert!(!wants && status == Status::Quiet && out.iter().all(|y| *y == 0.0));
    // From silence it rises.
    let (wants, _, out) = step(&mut it, 2, &x, (1.0, 1.0, true));
    assert!(wants && out[0] < 0.01 && out[95] == 0.5);
    for (level, reached) in [(7.0, 0.5), (-3.0, 0.0), (f64::INFINITY, 0.5), (f64::NAN, 0.0)] {
        let (_, _, out) = step(&mut it, 3, &x, (level, 0.0, true));
        assert_eq!(out[95], reached, "{level}");
    }
}

#[test]
fn a_level_that_is_not_to_be_trusted_goes_to_0() {
    let mut it = level(48_000, 500);
    let x = [1.0_f32; 96];
    step(&mut it, 0, &x, (1.0, 0.0, true));
    let (wants, _, out) = step(&mut it, 1, &x, (1.0, 0.0, false));
    assert!(wants && out[95] == 0.0 && largest_step(&out) < 0.011);
    let (wants, status, _) = step(&mut it, 2, &x, (1.0, 0.0, false));
    assert!(!wants && status == Status::Quiet);
}

#[test]
fn what_serves_it_alone_sleeps_while_it_is_closed() {
    let play = |tick: u64| {
        let slot = if tick < 50 { 0.0 } else { -1.0 };
        let level = if (10..30).contains(&tick) || tick > 60 { 1.0 } else { 0.0 };
        vec![vec![slot], vec![level]]
    };
    let source = ["(frequency_hz: 120, amplitude_m_s2: 2)"];
    let bench = Bench::new("vibration", "slot level", play).list("sources", &source).behind_level();
    let (Run { audio, .. }, calls) = bench.run("level", 100);
    // Twenty ticks and the one in which the level falls.
    assert_eq!(calls, 21);
    assert!(audio[..960].iter().chain(&audio[31 * 96..]).all(|y| *y == 0.0));
    assert!(audio[15 * 96..30 * 96].iter().any(|y| *y > 1.0));
    // Unconnected, it lets all through.
    let bench = Bench::new("vibration", "slot", |_| vec![vec![0.0]]).list("sources", &source);
    let mut engine = bench.engine("it", true).unwrap();
    let plain = run(&mut engine, "it", 30);
    let through = bench.through_level();
    let mut engine = through.engine("level", true).unwrap();
    assert!(run(&mut engine, "level", 30) == plain);
}
