use std::f64::consts::TAU;

use asperity_checks::{Stop, Subject, node_cases};
use asperity_node::{ParamValue, Shape, Status};

use crate::bench::{Alone, largest_step};

const RATE: u32 = 44_100;
const TICK_HZ: u32 = 500;

/// A source at 44.1 kHz with these parameters, the others at their defaults.
fn source(kind: &str, set: &[(&str, f64)]) -> Alone {
    let set: Vec<_> = set.iter().map(|(name, value)| (*name, ParamValue::Number(*value))).collect();
    Alone::new(kind, &set, (TICK_HZ, 1, RATE), &[], &[Shape::Audio { rate_hz: RATE }]).unwrap()
}

/// The samples of some ticks.
fn play(source: &mut Alone, ticks: std::ops::Range<u64>) -> Vec<f32> {
    let mut out = Vec::new();
    for index in ticks {
        let (status, _) = source.tick(index);
        assert!(status != Status::Quiet || source.audio().iter().all(|x| *x == 0.0));
        out.extend_from_slice(source.audio());
    }
    out
}

#[test]
fn sources_are_as_every_node_must_be() {
    for kind in ["sine", "sweep"] {
        let mut subject = Subject::one(crate::registry().get(kind).unwrap().clone());
        subject.ticks = 500;
        for case in node_cases() {
            let found = case.run(&subject);
            assert!(!matches!(found, Err(Stop::Failed(_))), "{kind} {}: {found:?}", case.name);
        }
    }
}

#[test]
fn a_sine_has_its_phase_after_a_day() {
    let mut sine = source("sine", &[("frequency_hz", 79.7), ("amplitude", 2.0)]);
    let first = 24 * 3600 * u64::from(TICK_HZ);
    for (i, y) in play(&mut sine, first..first + 10).into_iter().enumerate() {
        // In integers: tenths of a hertz times samples, modulo ten times the rate.
        let n = u128::from(24 * 3600 * u64::from(RATE)) + i as u128;
        let phase = (797 * n % (10 * u128::from(RATE))) as f64 / (10.0 * f64::from(RATE));
        assert!((f64::from(y) - 2.0 * (TAU * phase).sin()).abs() < 1e-6, "{i}: {y}");
    }
}

#[test]
fn a_sine_changes_frequency_and_amplitude_without_a_step() {
    let mut sine = source("sine", &[("frequency_hz", 100.0), ("amplitude", 1.0)]);
    let mut out = play(&mut sine, 0..50);
    let mut before = 100.0;
    for (tick, hz) in [(50, 333.3), (53, 40.0), (56, 250.0)] {
        sine.node().set_parameter(0, hz);
        out.extend(play(&mut sine, tick..tick + 3));
        // From the same phase: no step is greater than the steepest of either frequency.
        let steepest = TAU * hz.max(before) / f64::from(RATE);
        assert!(f64::from(largest_step(&out[out.len() - 3 * 88 - 3..])) < 1.001 * steepest, "{hz}");
        before = hz;
    }
    let mut sine = source("sine", &[("frequency_hz", 1.0), ("amplitude", 0.0)]);
    play(&mut sine, 0..125);
    sine.node().set_parameter(1, 1.0);
    // A quarter of a period in, the sine stands at its top and the ramp shows: 1 in 10 ms.
    let up = play(&mut sine, 125..140);
    assert!(largest_step(&up) < 1.1 / 441.0 && (up[440] - 1.0).abs() < 0.01 && up[220] < 0.6, "{}", up[440]);
}

#[test]
fn a_sine_fades_in_and_out_and_is_over() {
    let mut sine = source("sine", &[("frequency_hz", 500.0), ("seconds", 0.5)]);
    let out = play(&mut sine, 0..500);
    let (fade, end) = (882, 22_050);
    for (n, y) in out.iter().enumerate() {
        let edge = (n.min(end - 1 - n.min(end - 1)) as f64 / fade as f64).min(1.0);
        let most = 0.1 * (0.5 - 0.5 * (TAU / 2.0 * edge).cos());
        assert!(f64::from(y.abs()) <= if n < end { most + 1e-7 } else { 0.0 }, "{n}: {y}");
    }
    assert!(out[2000..20_000].iter().any(|y| *y > 0.0999));
    assert_eq!(sine.prepared.duration.unwrap().ms(), 500.0);
    assert!(source("sine", &[]).prepared.duration.is_none());
}

#[test]
fn a_sine_that_does_not_fit_the_rate_is_refused() {
    let set = [("frequency_hz", ParamValue::Number(19_900.0))];
    let error =
        Alone::new("sine", &set, (TICK_HZ, 1, RATE), &[], &[Shape::Audio { rate_hz: RATE }]).err().unwrap();
    assert!(error.message.contains("does not fit an audio rate of 44100 Hz"), "{}", error.message);
}

#[test]
fn sweep_is_exponential_between_silences() {
    let set = [("from_hz", 20.0), ("to_hz", 1280.0), ("seconds", 3.0), ("amplitude", 0.5)];
    let mut sweep = source("sweep", &set);
    let ms = sweep.prepared.duration.unwrap().ms();
    // f0 L = 20 x 3 / ln 64 = 14.4, of which 14 remain.
    assert!((ms - 1500.0 - 14.0 / 20.0 * 64f64.ln() * 1e3).abs() < 0.1, "{ms}");
    let out = play(&mut sweep, 0..(ms / 2.0) as u64 + 100);
    let rate = f64::from(RATE);
    let (before, active) = ((0.5 * rate) as usize, ((ms * 1e-3 - 1.5) * rate).round() as usize);
    assert!(out[..before].iter().chain(&out[before + active..]).all(|y| *y == 0.0));
    // A quarter, a half and three quarters in: an octave and a half further each.
    for part in [0.25, 0.5, 0.75] {
        let at = before + (part * active as f64) as usize;
        let near = &out[at - 2205..at + 2205];
        let ups: Vec<f64> = near
            .windows(2)
            .enumerate()
            .filter(|(_, w)| w[0] < 0.0 && w[1] >= 0.0)
            .map(|(i, w)| i as f64 + f64::from(w[0] / (w[0] - w[1])))
            .collect();
        let hz = (ups.len() - 1) as f64 / (ups[ups.len() - 1] - ups[0]) * rate;
        let want = 20.0 * 64f64.powf(part);
        assert!((hz / want - 1.0).abs() < 0.02, "{part}: {hz} {want}");
    }
    assert!(out.iter().all(|y| y.abs() <= 0.5) && out.iter().any(|y| *y > 0.499));
}

#[test]
fn a_sweep_of_shape_displacement_is_small_where_it_is_slow() {
    let number = ParamValue::Number;
    let set = [
        ("from_hz", number(10.0)),
        ("to_hz", number(1000.0)),
        ("seconds", number(4.0)),
        ("before_s", number(0.0)),
        ("shape", ParamValue::Text("displacement".into())),
    ];
    let rates = (TICK_HZ, 1, RATE);
    let mut sweep = Alone::new("sweep", &set, rates, &[], &[Shape::Audio { rate_hz: RATE }]).unwrap();
    let out = play(&mut sweep, 0..2000);
    let peak = |from: f64, to: f64| {
        let range = (from * f64::from(RATE)) as usize..(to * f64::from(RATE)) as usize;
        out[range].iter().fold(0.0f32, |m, y| m.max(y.abs()))
    };
    // 100 Hz are reached after half the time: from there on flat, 31.6 Hz a quarter in.
    assert!((peak(2.1, 3.9) - 0.1).abs() < 1e-4);
    assert!((peak(0.9, 1.01) - 0.0316).abs() < 0.002, "{}", peak(0.9, 1.01));
}
