//! Compares paths with motions in closed form, at every rate.

use super::*;

/// First sample of a tick.
fn first(tick: u64, rate: u32, tick_hz: u32) -> u64 {
    (u128::from(tick) * u128::from(rate) / u128::from(tick_hz)) as u64
}

/// All samples of a motion that is reported tick by tick.
fn samples(
    (rate, tick_hz): (u32, u32),
    seconds: f64,
    motion: impl Fn(f64) -> ([f64; 2], [f64; 2]),
) -> Vec<Point> {
    let mut path = Path::new(tick_hz);
    let mut all = Vec::new();
    for tick in 0..(seconds * f64::from(tick_hz)) as u64 {
        let (position, velocity) = motion(tick as f64 / f64::from(tick_hz));
        path.advance(position, velocity);
        let from = first(tick, rate, tick_hz);
        let parts = Parts::new(tick, from, rate, tick_hz);
        all.extend((0..(first(tick + 1, rate, tick_hz) - from) as usize).map(|n| path.at(parts.at(n))));
    }
    all
}

const RATES: [(u32, u32); 7] =
    [(48_000, 500), (44_100, 500), (48_000, 100), (48_000, 4000), (44_100, 4000), (2500, 4000), (1000, 333)];

#[test]
fn all_samples_of_all_ticks_are_a_sample_apart() {
    for (rate, tick_hz) in RATES {
        // Long after the start too.
        for begin in [0, 1 << 40] {
            for tick in begin..begin + 1000 {
                let (from, to) = (first(tick, rate, tick_hz), first(tick + 1, rate, tick_hz));
                let parts = Parts::new(tick, from, rate, tick_hz);
                for n in 0..(to - from) as usize {
                    // (from + n + 1) / rate - tick / tick rate, of the tick, by a long way round.
                    let over = (u128::from(from) + n as u128 + 1) * u128::from(tick_hz)
                        - u128::from(tick) * u128::from(rate);
                    let part = parts.at(n);
                    assert!(part > 0.0 && part <= 1.0);
                    assert!(
                        (part - over as f64 / f64::from(rate)).abs() < 1e-14,
                        "{rate} {tick_hz} {tick} {n}"
                    );
                }
            }
        }
    }
}

#[test]
fn constant_acceleration_is_exact_but_for_a_constant_cut() {
    for acceleration in [[0.0; 2], [800.0, -1800.0]] {
        let at = |t: f64| {
            let of = |i: usize| [3.0, -1.0][i] + [120.0, 30.0][i] * t + 0.5 * acceleration[i] * t * t;
            ([of(0), of(1)], [0, 1].map(|i| [120.0, 30.0][i] + acceleration[i] * t))
        };
        for (rate, tick_hz) in RATES {
            let tick_s = 1.0 / f64::from(tick_hz);
            for (n, p) in samples((rate, tick_hz), 1.0, at).iter().enumerate() {
                let t = (n + 1) as f64 / f64::from(rate) - 1.5 * tick_s;
                // Before the second tick it goes on as it was told to begin.
                if t < 0.5 * tick_s + 1e-9 && acceleration != [0.0; 2] {
                    continue;
                }
                let (position, velocity) = at(t);
                for i in 0..2 {
                    // Between its middles a parabola is cut by an eighth of a tick's acceleration.
                    let cut = 0.125 * acceleration[i] * tick_s * tick_s;
                    assert!((p.position_mm[i] - position[i] - cut).abs() < 1e-9, "{rate} {tick_hz} {n}");
                    assert!((p.velocity_mm_s[i] - velocity[i]).abs() < 1e-7, "{rate} {tick_hz} {n}");
                    assert!((p.acceleration_mm_s2[i] - acceleration[i]).abs() < 1e-3);
                }
            }
        }
    }
}

#[test]
fn position_and_velocity_have_no_step_whatever_is_told() {
    // Noise: a velocity that has nothing to do with the positions.
    let noise = |t: f64, k: f64| (t * k * 7919.0).sin();
    let at = |t: f64| ([noise(t, 1.0), noise(t, 2.3)], [300.0 * noise(t, 3.1), 300.0 * noise(t, 4.7)]);
    let mut path = Path::new(500);
    let mut before: Option<Point> = None;
    for tick in 0..500 {
        let (position, velocity) = at(f64::from(tick) / 500.0);
        path.advance(position, velocity);
        if let Some(end) = before {
            let begin = path.at(0.0);
            for i in 0..2 {
                assert!((begin.position_mm[i] - end.position_mm[i]).abs() < 1e-12);
                assert!((begin.velocity_mm_s[i] - end.velocity_mm_s[i]).abs() < 1e-9);
            }
        }
        before = Some(path.at(1.0));
        // Velocity and acceleration are the derivatives.
        let (a, b) = (path.at(0.4), path.at(0.4 + 1e-6));
        for i in 0..2 {
            let slope = (b.position_mm[i] - a.position_mm[i]) * 500.0 / 1e-6;
            assert!((slope - a.velocity_mm_s[i]).abs() < 1e-2 * (1.0 + slope.abs()));
            let curve = (b.velocity_mm_s[i] - a.velocity_mm_s[i]) * 500.0 / 1e-6;
            assert!((curve - a.acceleration_mm_s2[i]).abs() < 10.0 + 1e-3 * curve.abs());
        }
    }
}

#[test]
fn not_finite_holds_last_position_and_reset_forgets_it() {
    let mut path = Path::new(500);
    path.advance([f64::NAN; 2], [0.0; 2]);
    assert_eq!(path.at(1.0).position_mm, [0.0; 2]);
    path.reset();
    path.advance([1.0, 2.0], [f64::NAN, 0.0]);
    assert_eq!(path.at(0.5), Point { position_mm: [1.0, 2.0], ..Point::default() });
    path.advance([1.1, 2.0], [f64::INFINITY, 0.0]);
    assert!((path.at(1.0).velocity_mm_s[0] - 50.0).abs() < 1e-9, "the difference: 0.1 mm in 2 ms");
    for bad in [f64::NAN, f64::INFINITY] {
        path.advance([bad, 2.0], [1.0, 1.0]);
        assert!((path.at(1.0).position_mm[0] - 1.1).abs() < 1e-12);
    }
    assert_eq!(path.at(1.0).velocity_mm_s, [0.0; 2]);
    for wild in [f64::MAX, -f64::MAX] {
        path.advance([wild; 2], [wild; 2]);
        let p = path.at(0.3);
        let all = p.position_mm.iter().chain(&p.velocity_mm_s).chain(&p.acceleration_mm_s2);
        assert!(all.into_iter().all(|x| x.is_finite()));
    }
    path.reset();
    path.advance([4.0, 4.0], [0.0; 2]);
    assert_eq!(path.at(0.0), Point { position_mm: [4.0, 4.0], ..Point::default() });
}
