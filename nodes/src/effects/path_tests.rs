//! Compares paths with motions in closed form, at every rate.

use std::f64::consts::TAU;

use super::*;

/// First sample of a tick.
fn first(tick: u64, rate: u32, tick_hz: u32) -> u64 {
    (u128::from(tick) * u128::from(rate) / u128::from(tick_hz)) as u64
}

/// All samples of a motion that is reported tick by tick.
fn samples(
    smoothing: Smoothing,
    (rate, tick_hz): (u32, u32),
    seconds: f64,
    motion: impl Fn(f64) -> ([f64; 2], [f64; 2]),
) -> Vec<Point> {
    let mut path = Path::new(smoothing, tick_hz);
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
fn constant_acceleration_is_exact_tick_less_sample_late() {
    let at = |t: f64| {
        (
            [0, 1].map(|i| [3.0, -1.0][i] + [120.0, 30.0][i] * t + [400.0, -900.0][i] * t * t),
            [120.0 + 800.0 * t, 30.0 - 1800.0 * t],
        )
    };
    for (rate, tick_hz) in RATES {
        let delay = Path::new(Smoothing::Hermite, tick_hz).delay_s(rate);
        for (n, p) in samples(Smoothing::Hermite, (rate, tick_hz), 1.0, at).iter().enumerate() {
            let t = n as f64 / f64::from(rate) - delay;
            // Before the second tick it goes on as it was told to begin.
            if t < 1e-9 {
                continue;
            }
            let (position, velocity) = at(t);
            for i in 0..2 {
                assert!((p.position_mm[i] - position[i]).abs() < 1e-9, "{rate} {tick_hz} {n}");
                assert!((p.velocity_mm_s[i] - velocity[i]).abs() < 1e-7);
                assert!((p.acceleration_mm_s2[i] - [800.0, -1800.0][i]).abs() < 1e-3);
            }
        }
    }
}

#[test]
fn constant_velocity_is_exact_from_the_first_tick_on_either_way() {
    for smoothing in [Smoothing::Hermite, Smoothing::Parabola] {
        for (rate, tick_hz) in RATES {
            let at = |t: f64| ([5.0 + 80.0 * t, -20.0 * t], [80.0, -20.0]);
            let delay = Path::new(smoothing, tick_hz).delay_s(rate);
            for (n, p) in samples(smoothing, (rate, tick_hz), 0.5, at).iter().enumerate() {
                let (position, velocity) = at(n as f64 / f64::from(rate) - delay);
                assert!((0..2).all(|i| {
                    (p.position_mm[i] - position[i]).abs() < 1e-9
                        && (p.velocity_mm_s[i] - velocity[i]).abs() < 1e-8
                        && p.acceleration_mm_s2[i].abs() < 1e-3
                }));
            }
        }
    }
}

#[test]
fn position_and_velocity_have_no_step_whatever_is_told() {
    // Noise: a velocity that has nothing to do with the positions.
    let noise = |t: f64, k: f64| (t * k * 7919.0).sin();
    for smoothing in [Smoothing::Hermite, Smoothing::Parabola] {
        let at = |t: f64| ([noise(t, 1.0), noise(t, 2.3)], [300.0 * noise(t, 3.1), 300.0 * noise(t, 4.7)]);
        let mut path = Path::new(smoothing, 500);
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
}

#[test]
fn a_circle_is_followed_to_the_fourth_order() {
    let at = |t: f64| {
        let (sin, cos) = (TAU * 2.0 * t).sin_cos();
        ([30.0 * cos, 30.0 * sin], [-30.0 * TAU * 2.0 * sin, 30.0 * TAU * 2.0 * cos])
    };
    // Hermite's error is h^4 x'''' / 384.
    let bound = 1.01 * 0.01_f64.powi(4) * 30.0 * (TAU * 2.0).powi(4) / 384.0;
    let delay = Path::new(Smoothing::Hermite, 100).delay_s(48_000);
    for (n, p) in samples(Smoothing::Hermite, (48_000, 100), 1.0, at).iter().enumerate().skip(480) {
        let (position, _) = at(n as f64 / 48_000.0 - delay);
        assert!((0..2).all(|i| (p.position_mm[i] - position[i]).abs() < bound));
    }
}

#[test]
fn not_finite_holds_last_position_and_reset_forgets_it() {
    let mut path = Path::new(Smoothing::Hermite, 500);
    path.advance([f64::NAN; 2], [1.0; 2]);
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

#[test]
fn a_path_goes_on_from_its_state() {
    for smoothing in [Smoothing::Hermite, Smoothing::Parabola] {
        let mut one = Path::new(smoothing, 500);
        one.advance([1.0, 2.0], [30.0, 4.0]);
        one.advance([1.1, 2.1], [31.0, 4.0]);
        let mut bytes = vec![0; State::measure(|s| one.state(s))];
        State::save(&mut bytes, |s| one.state(s)).unwrap();
        let mut other = Path::new(smoothing, 500);
        assert!(State::restore(&bytes, |s| other.state(s)));
        assert_eq!(one, other);
        bytes[9..17].copy_from_slice(&f64::NAN.to_le_bytes());
        assert!(!State::restore(&bytes, |s| other.state(s)));
        assert_eq!(other, Path::new(smoothing, 500));
    }
}
