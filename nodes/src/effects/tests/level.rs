//! `level`.

use asperity_node::{
    Buffer, Config, InputRef, Inputs, Outputs, Params, PortType, Processor, Setup, Shape, Status, Tick, Unit,
    Wiring,
};

use super::bench::{Bench, Run, largest_step, run, spans};

/// A gate at a rate of its own.
fn level(rate_hz: u32, tick_hz: u32) -> Box<dyn Processor> {
    let kind = crate::registry().get("level").unwrap().clone();
    let params = Params::new(None);
    let config = Config { id: "it", params: &params, tick_hz, every: 1, audio_hz: 48_000, seed: 1 };
    let audio = PortType { shape: Shape::Audio { rate_hz }, unit: Unit::NEWTON, limited: false };
    let wired = [Wiring { port: Some(audio), connected: true }];
    let setup = Setup { config, inputs: &wired, outputs: &wired, closes_cycle: false };
    kind.prepare(&setup).unwrap().processor
}

/// Runs one tick. Returns whether the input was wanted, the status, and the output.
fn step(
    it: &mut dyn Processor,
    (index, tick_hz): (u64, u32),
    x: &[f32],
    (level, slot, valid): (f64, f64, bool),
) -> (bool, Status, Vec<f32>) {
    let audio = |samples: Vec<f32>, silent| Buffer::Audio {
        len: samples.len(),
        samples: samples.into(),
        valid: true,
        silent,
    };
    let control = |x, valid| Buffer::Control { values: [x].into(), changed: true, valid };
    let inputs = [audio(x.to_vec(), false), control(level, valid), control(slot, true)];
    let mut outputs = [audio(vec![0.0; x.len()], true)];
    let map = [0, 1, 2].map(|buffer| InputRef { buffer, connected: true });
    let inputs = Inputs::new(&inputs, &[], 3, &map);
    let wants = it.wants(&mut Tick { index, tick_hz, inputs, outputs: Outputs::new(&mut []) });
    let status = it.run(&mut Tick { index, tick_hz, inputs, outputs: Outputs::new(&mut outputs) }).unwrap();
    let Buffer::Audio { samples, .. } = &outputs[0] else { panic!() };
    (wants, status, samples.to_vec())
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
            let (wants, status, out) =
                step(&mut *it, (tick, tick_hz), &x, (level_at(tick as i64), 0.0, true));
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
        let (wants, _, out) = step(&mut *it, (7, 500), &x, (level, 3.0, true));
        assert!(wants && out.iter().all(|y| f64::from(*y) == 0.5 * level));
        it.reset();
    }
    step(&mut *it, (0, 500), &x, (1.0, 0.0, true));
    let (wants, status, out) = step(&mut *it, (1, 500), &x, (1.0, -1.0, true));
    assert!(!wants && status == Status::Quiet && out.iter().all(|y| *y == 0.0));
    // From silence it rises.
    let (wants, _, out) = step(&mut *it, (2, 500), &x, (1.0, 1.0, true));
    assert!(wants && out[0] < 0.01 && out[95] == 0.5);
    for (level, reached) in [(7.0, 0.5), (-3.0, 0.0), (f64::INFINITY, 0.5), (f64::NAN, 0.0)] {
        let (_, _, out) = step(&mut *it, (3, 500), &x, (level, 0.0, true));
        assert_eq!(out[95], reached, "{level}");
    }
}

#[test]
fn a_level_that_is_not_to_be_trusted_goes_to_0() {
    let mut it = level(48_000, 500);
    let x = [1.0_f32; 96];
    step(&mut *it, (0, 500), &x, (1.0, 0.0, true));
    let (wants, _, out) = step(&mut *it, (1, 500), &x, (1.0, 0.0, false));
    assert!(wants && out[95] == 0.0 && largest_step(&out) < 0.011);
    let (wants, status, _) = step(&mut *it, (2, 500), &x, (1.0, 0.0, false));
    assert!(!wants && status == Status::Quiet);
}

#[test]
fn what_serves_it_alone_sleeps_while_it_is_closed() {
    let play = |tick: u64| {
        let slot = if tick < 50 { 0.0 } else { -1.0 };
        let level = if (10..30).contains(&tick) || tick > 60 { 1.0 } else { 0.0 };
        vec![vec![slot], vec![level]]
    };
    let sources = ("sources", "[\"(frequency_hz: 120, amplitude_m_s2: 2)\"]");
    let bench = Bench::new((500, 48_000), "vibration", &[sources], "slot level", play).behind_level();
    let (Run { audio, .. }, calls) = bench.run("level", 100);
    // Twenty ticks and the one in which the level falls.
    assert_eq!(calls, 21);
    assert!(audio[..960].iter().chain(&audio[31 * 96..]).all(|y| *y == 0.0));
    assert!(audio[15 * 96..30 * 96].iter().any(|y| *y > 1.0));
    // Unconnected, it lets all through.
    let bench = Bench::new((500, 48_000), "vibration", &[sources], "slot", |_| vec![vec![0.0]]);
    let mut engine = bench.engine("it", true).unwrap();
    let plain = run(&mut engine, "it", 30);
    let through = bench.through_level();
    let mut engine = through.engine("level", true).unwrap();
    assert!(run(&mut engine, "level", 30) == plain);
}
