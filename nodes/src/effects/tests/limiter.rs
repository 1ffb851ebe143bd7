//! `force_limiter`.

use asperity_node::{Buffer, ParamValue, Shape};

use crate::bench::Alone;
use crate::effects::bounds::length;

const FORCE: [Shape; 1] = [Shape::Control { count: 3 }];

/// A limiter to 3 N that runs every `every`-th tick.
fn limiter(tick_hz: u32, every: u32, slew: f64) -> Alone {
    let set = [("max_force_n", 3.0), ("slew_n_per_s", slew)].map(|(n, x)| (n, ParamValue::Number(x)));
    Alone::new("force_limiter", &set, (tick_hz, every, 48_000), &FORCE, &FORCE).unwrap()
}

fn step(it: &mut Alone, force: [f64; 3], valid: bool) -> [f64; 3] {
    it.give(0, &force, valid);
    it.tick(0);
    let Buffer::Control { values, .. } = &it.outputs[0] else { panic!() };
    values[..].try_into().unwrap()
}

// A force within the limit passes unchanged. A longer one is shortened and keeps its direction.
#[test]
fn force_within_limit_passes_longer_keeps_direction() {
    let mut it = limiter(500, 1, 0.0);
    for force in [[0.1, -2.0, 1.5], [0.0; 3], [0.0, 3.0, 0.0], [-1e-300, 0.0, 1e-9]] {
        assert_eq!(step(&mut it, force, true), force);
    }
    let out = step(&mut it, [-30.0, 0.0, 40.0], true);
    assert!((out[0] + 1.8).abs() < 1e-12 && out[1] == 0.0 && (out[2] - 2.4).abs() < 1e-12, "{out:?}");
    for force in [[1e300, -1e300, 1e300], [f64::MAX; 3]] {
        assert!((length(step(&mut it, force, true)) - 3.0).abs() < 1e-9);
    }
    it.node().set_parameter(0, 0.5);
    assert!((length(step(&mut it, [3.0, 0.0, 0.0], true)) - 0.5).abs() < 1e-12);
}

#[test]
fn a_change_is_no_faster_than_the_slew_and_arrives() {
    for (tick_hz, every) in [(500, 1), (4000, 1), (1000, 5)] {
        let mut it = limiter(tick_hz, every, 100.0);
        let most = 100.0 * f64::from(every) / f64::from(tick_hz);
        let (mut before, target) = ([0.0; 3], [1.2, -1.6, 0.0]);
        let runs = (2.0 / most).round() as usize;
        for n in 1..=runs + 3 {
            let now = step(&mut it, target, true);
            let change = length::<3>(std::array::from_fn(|i| now[i] - before[i]));
            assert!(change <= most * (1.0 + 1e-12), "{change} N in a run");
            // In a straight line.
            assert!((length(now) - 2.0_f64.min(most * n as f64)).abs() < 1e-9, "run {n}");
            before = now;
        }
        assert_eq!(before, target);
        // A limit that was lowered counts at once.
        it.node().set_parameter(0, 0.3);
        assert!((length(step(&mut it, target, true)) - 0.3).abs() < 1e-12);
    }
}

#[test]
fn invalid_force_fades_in_20_ms_and_returns_as_slowly() {
    for (tick_hz, every, slew) in
        [(500, 1, 0.0), (4000, 1, 0.0), (500, 1, 1.0), (100, 1, 0.0), (1000, 100, 0.0)]
    {
        let mut it = limiter(tick_hz, every, slew);
        let force = [0.0, 1.5, -2.0];
        for _ in 0..(3.0 * f64::from(tick_hz)) as u64 {
            step(&mut it, force, true);
        }
        let full = step(&mut it, force, true);
        assert!(length(full) > 2.4);
        let runs = ((0.02 * f64::from(tick_hz) / f64::from(every)) as usize).max(1);
        let mut last = full;
        for n in 1..=runs {
            // Whatever comes meanwhile does not count.
            let now = step(&mut it, [9.0, f64::from(n as u32), 0.0], false);
            let want = 2.5 * (1.0 - n as f64 / runs as f64);
            assert!((length(now) - want).abs() < 1e-9 && now[0] == 0.0, "{n}: {now:?}");
            last = now;
        }
        assert_eq!(last, [0.0; 3]);
        assert_eq!(step(&mut it, force, false), [0.0; 3]);
        for n in 1..=runs {
            let now = length(step(&mut it, force, true));
            assert!(now <= 2.5 * n as f64 / runs as f64 + 1e-12, "{n}: {now}");
            let most = if slew > 0.0 { slew * f64::from(every) / f64::from(tick_hz) * n as f64 } else { 3.0 };
            assert!(now <= most + 1e-12, "{n}: {now} N faster than the slew");
        }
        if slew == 0.0 {
            assert_eq!(step(&mut it, force, true), force);
        }
        // A force that is not a number counts as invalid.
        assert!(length(step(&mut it, [f64::NAN, 0.0, 0.0], true)) < 2.5);
    }
    let mut it = limiter(500, 1, 0.0);
    assert_eq!(step(&mut it, [1.0; 3], false), [0.0; 3], "nothing to fade at the beginning");
}
