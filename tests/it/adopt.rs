//! Use that a node makes of the state of one with other parameters, and of a parameter that changes: what is
//! heard and felt.

use asperity_node::{Buffer, Processor};
use harness::{any_node, registry};

use crate::drive::{audio, control, samples, tick, values};

/// Samples of a tick.
const PER_TICK: usize = 96;

/// A node of a kind, with settings such as `gain=2`.
fn one(kind: &str, settings: &[&str]) -> Box<dyn Processor> {
    any_node::prepared(registry().get(kind).expect("a kind"), settings)
}

fn adopt(old: &mut dyn Processor, new: &mut dyn Processor) {
    let mut bytes = vec![0; old.state_size()];
    let len = old.save(&mut bytes).expect("a state");
    assert!(new.restore(&bytes[..len]));
}

fn silence() -> [Buffer; 1] {
    [audio(&[0.0; PER_TICK], true)]
}

#[test]
fn a_delay_of_another_length_takes_over_what_it_keeps() {
    // Sample n is n + 1, so that silence is told from what came first.
    let x = |n: i64| if n < 0 { 0.0 } else { n as f32 + 1.0 };
    let input = |k: u64| -> Vec<f32> { (0..PER_TICK as i64).map(|i| x(k as i64 * 96 + i)).collect() };
    let mut old = one("delay", &["delay_ms=10"]);
    let mut out = silence();
    for k in 0..50 {
        tick(old.as_mut(), k, &[audio(&input(k), true)], &mut out);
    }
    for (ms, delay) in [("10", 480), ("4", 192), ("0", 0), ("20", 960)] {
        let mut new = one("delay", &[&format!("delay_ms={ms}")]);
        adopt(old.as_mut(), new.as_mut());
        for k in 50..65 {
            tick(new.as_mut(), k, &[audio(&input(k), true)], &mut out);
            for (i, y) in samples(&out[0]).iter().enumerate() {
                let from = k as i64 * 96 + i as i64 - delay;
                // The old one kept its delay and a tick.
                let since = from - (50 * 96 - 480 - 96);
                // A longer one has silence before that, out of which what was kept rises in 10 ms.
                let gain = match (since, delay) {
                    (..0, _) => 0.0,
                    (0..480, 960) => since as f32 / 480.0,
                    _ => 1.0,
                };
                assert_eq!(*y, x(from) * gain, "{ms} ms, tick {k}, sample {i}");
            }
        }
    }
}

#[test]
fn control_in_a_delay_arrives_after_its_length_changes() {
    let prepared = |setting: &str| {
        let lines = "s: stroke; v: velocity; it: delay; p: probe; s -> v; v.velocity -> it -> p";
        any_node::of(harness::graph::of_lines(lines), &registry(), &[setting])
    };
    let mut old = prepared("delay_ms=20");
    let mut out = [control(&[0.0; 2])];
    for k in 0..40 {
        tick(old.as_mut(), k, &[control(&[k as f64, -(k as f64)])], &mut out);
    }
    for (ms, delay) in [("20", 10), ("6", 3), ("30", 15)] {
        let mut new = prepared(&format!("delay_ms={ms}"));
        adopt(old.as_mut(), new.as_mut());
        for k in 40..60_u64 {
            tick(new.as_mut(), k, &[control(&[k as f64, -(k as f64)])], &mut out);
            let from = k - delay;
            let expected = if from >= 29 { from as f64 } else { 0.0 };
            assert_eq!(values(&out[0]), [expected, -expected], "{ms} ms, tick {k}");
        }
    }
    // Another number of values is another signal.
    let mut bytes = vec![0; old.state_size()];
    old.save(&mut bytes).expect("a state");
    assert!(!one("delay", &["delay_ms=20"]).restore(&bytes));
}

#[test]
fn a_velocity_with_another_cutoff_does_not_start_from_rest() {
    let mut out = [control(&[0.0; 2]), control(&[0.0]), control(&[0.0; 3]), control(&[0.0; 3])];
    // 60 mm/s along x, 80 mm/s along y.
    let position = |k: u64| [control(&[0.12 * k as f64, 0.16 * k as f64, 0.0])];
    let mut old = one("velocity", &[]);
    for k in 0..400 {
        tick(old.as_mut(), k, &position(k), &mut out);
    }
    for cutoff in ["cutoff_hz=20", "cutoff_hz=2", "cutoff_hz=200", "cutoff_hz=0"] {
        let mut new = one("velocity", &[cutoff]);
        adopt(old.as_mut(), new.as_mut());
        for k in 400..500 {
            tick(new.as_mut(), k, &position(k), &mut out);
            let (v, speed) = (values(&out[0]), values(&out[1])[0]);
            assert!((v[0] - 60.0).abs() < 1e-6 && (v[1] - 80.0).abs() < 1e-6, "{cutoff}: {v:?}");
            assert!((speed - 100.0).abs() < 1e-6, "{cutoff}: {speed}");
        }
    }
}

#[test]
fn action_history_goes_on_at_another_rate() {
    let mut out = [control(&[0.0; 10]), control(&[0.0; 20])];
    let mut old = one("action_history", &[]);
    let inputs = [control(&[2.0]), control(&[30.0, 40.0])];
    for k in 0..100 {
        tick(old.as_mut(), k, &inputs, &mut out);
    }
    for rate in ["rate_hz=500", "rate_hz=100", "rate_hz=2000"] {
        let mut new = one("action_history", &[rate]);
        adopt(old.as_mut(), new.as_mut());
        for k in 100..150 {
            tick(new.as_mut(), k, &inputs, &mut out);
            assert!(values(&out[0]).iter().all(|f| *f == 2.0), "{rate}, tick {k}: {:?}", values(&out[0]));
        }
        // And takes samples of its own: ten of them pass in 0.1 s at the most.
        for k in 150..210 {
            tick(new.as_mut(), k, &[control(&[3.0]), control(&[30.0, 40.0])], &mut out);
        }
        assert!(values(&out[0]).iter().all(|f| *f == 3.0), "{rate}: {:?}", values(&out[0]));
    }
}

#[test]
fn a_new_gain_is_reached_in_a_straight_line_of_10_ms() {
    let ones = [audio(&[1.0; PER_TICK], true)];
    let line = |from: f64, to: f64, n: usize| from + (to - from) * (n.min(480) as f64 / 480.0);
    let mut out = silence();
    let mut check = |gain: &mut dyn Processor, from: f64, to: f64| {
        for k in 0..10 {
            tick(gain, k, &ones, &mut out);
            for (i, y) in samples(&out[0]).iter().enumerate() {
                let expected = line(from, to, k as usize * PER_TICK + i + 1);
                assert!((f64::from(*y) - expected).abs() < 1e-5, "tick {k}, sample {i}: {y}, {expected}");
            }
        }
        assert_eq!(samples(&out[0]), [to as f32; PER_TICK]);
    };
    // By the parameter; by an instance that was prepared with another factor.
    let mut old = one("gain", &[]);
    check(old.as_mut(), 1.0, 1.0);
    old.set_parameter(0, 3.0);
    check(old.as_mut(), 1.0, 3.0);
    let mut new = one("gain", &["gain=-2.0"]);
    adopt(old.as_mut(), new.as_mut());
    check(new.as_mut(), 3.0, -2.0);
}

#[test]
fn a_fade_of_the_output_goes_on_where_it_was() {
    let mut out = silence();
    let loud = |valid| [audio(&[0.5; PER_TICK], valid)];
    let mut old = one("audio_out", &[]);
    for k in 0..3 {
        tick(old.as_mut(), k, &loud(false), &mut out);
    }
    let at = samples(&out[0])[PER_TICK - 1];
    assert!((at - 0.5 * 0.4).abs() < 1e-3, "{at}");
    let mut new = one("audio_out", &[]);
    adopt(old.as_mut(), new.as_mut());
    tick(new.as_mut(), 3, &loud(true), &mut out);
    let first = samples(&out[0])[0];
    assert!(first > at && first - at < 0.002, "{at} {first}");
}

#[test]
fn phases_run_on_under_another_seed() {
    let mut old = one("spsi", &["seed=1"]);
    let frame = |k: u64| Buffer::Magnitude {
        bins: (0..101).map(|i| if i == 20 { 1.0 } else { 0.0 }).collect(),
        frame: Some((k, 5 * k)),
        valid: true,
    };
    let mut out = [Buffer::Spectrum { bins: vec![Default::default(); 101].into(), frame: None, valid: true }];
    let mut angle = |p: &mut dyn Processor, k: u64| {
        tick(p, k, &[frame(k)], &mut out);
        let Buffer::Spectrum { bins, .. } = &out[0] else { panic!("not a spectrum") };
        f64::from(bins[20].im.atan2(bins[20].re)) / std::f64::consts::TAU
    };
    for k in 0..20 {
        angle(old.as_mut(), k);
    }
    let before = angle(old.as_mut(), 20);
    let mut new = one("spsi", &["seed=2"]);
    adopt(old.as_mut(), new.as_mut());
    // Bin 20 of 250 samples turns by 0.4 in a hop of 5.
    let turned = angle(new.as_mut(), 21) - before - 0.4;
    assert!((turned - turned.round()).abs() < 1e-4, "{turned}");
}
