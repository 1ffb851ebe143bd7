//! A spring pulls a mass over a surface. The tests compare friction at a tick rate with an integration that
//! has no ticks.

use std::f64::consts::PI;

use super::*;

/// Mass \[kg\], spring \[N/m\], damping of the device \[N s/m\], speed of the spring's end \[m/s\], normal
/// force \[N\].
struct Pull {
    mass: f64,
    spring: f64,
    damping: f64,
    speed: f64,
    normal: f64,
}

const PULL: Pull = Pull { mass: 0.05, spring: 200.0, damping: 0.5, speed: 0.01, normal: 1.5 };

fn settings() -> LuGreSettings {
    LuGreSettings {
        stribeck_speed_mm_s: 10.0,
        bristle_stiffness_n_per_mm: 10.0,
        bristle_damping_ns_per_m: 8.0,
        ..LuGreSettings::default()
    }
}

/// Mean period \[s\], mean fall \[N\] and number of periods of a spring force that rises slowly and falls
/// fast.
fn periods(pull: &[f64], rate: f64) -> (f64, f64, usize) {
    // Not the way from rest.
    let pull = &pull[pull.len() / 4..];
    let (low, high) = pull.iter().fold((f64::MAX, f64::MIN), |(l, h), p| (l.min(*p), h.max(*p)));
    let (lower, upper) = (0.7 * low + 0.3 * high, 0.3 * low + 0.7 * high);
    let (mut up, mut peak, mut foot) = (false, (0, f64::MIN), f64::MAX);
    let (mut peaks, mut falls) = (Vec::new(), Vec::new());
    for (n, p) in pull.iter().enumerate() {
        if up {
            if *p > peak.1 {
                peak = (n, *p);
            }
            if *p < lower {
                (up, foot) = (false, *p);
                peaks.push(peak);
            }
        } else {
            foot = foot.min(*p);
            if *p > upper {
                if let Some(last) = peaks.last() {
                    falls.push(last.1 - foot);
                }
                (up, peak) = (true, (n, *p));
            }
        }
    }
    let count = peaks.len().saturating_sub(1);
    let whole = peaks.last().map_or(0, |p| p.0) - peaks.first().map_or(0, |p| p.0);
    let fall = falls.iter().sum::<f64>() / falls.len().max(1) as f64;
    (whole as f64 / rate / count.max(1) as f64, fall, count)
}

/// Spring force by ticks of the kernel. Between ticks the mass is integrated in steps too fine to matter.
fn by_ticks(p: &Pull, s: LuGreSettings, tick_hz: f64, seconds: f64) -> Vec<f64> {
    let (mut law, fine) = (Rubbing::lugre(s), (200_000.0 / tick_hz) as u32);
    let (mut x, mut v, mut t, mut before) = (0.0_f64, 0.0, 0.0, 0.0);
    let dt = 1.0 / tick_hz / f64::from(fine);
    (0..(seconds * tick_hz) as usize)
        .map(|_| {
            let seen = 1e3 * (x - before) * tick_hz;
            before = x;
            let friction = law.step([0.6 * seen, -0.8 * seen], p.normal, 1.0 / tick_hz);
            // Along the way that it is pulled, aslant to the axes.
            let friction = 0.6 * friction[0] - 0.8 * friction[1];
            let pull = p.spring * (p.speed * t - x);
            for _ in 0..fine {
                v += dt / p.mass * (p.spring * (p.speed * t - x) + friction - p.damping * v);
                x += dt * v;
                t += dt;
            }
            pull
        })
        .collect()
}

/// The same by the Runge-Kutta method at 1 MHz, straight from the equations in SI units; a value every
/// millisecond.
fn by_equations(p: &Pull, s: LuGreSettings, seconds: f64) -> Vec<f64> {
    let (s0, s1, vs) =
        (1e3 * s.bristle_stiffness_n_per_mm, s.bristle_damping_ns_per_m, 1e-3 * s.stribeck_speed_mm_s);
    let slope = |[x, v, z]: [f64; 3], t: f64| {
        let g = p.normal
            * (s.kinetic_coefficient
                + (s.static_coefficient - s.kinetic_coefficient) * (-(v / vs) * (v / vs)).exp());
        let bend = v - s0 * v.abs() * z / g;
        let friction =
            s0 * z + s1 * g / (g + s1 * v.abs()) * bend + 1e3 * s.viscosity_s_per_mm * p.normal * v;
        [v, (p.spring * (p.speed * t - x) - p.damping * v - friction) / p.mass, bend]
    };
    let h = 1e-6;
    let mut y = [0.0; 3];
    let ahead = |y: [f64; 3], by: f64, d: [f64; 3]| [0, 1, 2].map(|i| y[i] + by * d[i]);
    let mut out = Vec::new();
    for n in 0..(seconds / h) as u64 {
        let t = n as f64 * h;
        if n % 1000 == 0 {
            out.push(p.spring * (p.speed * t - y[0]));
        }
        let a = slope(y, t);
        let b = slope(ahead(y, 0.5 * h, a), t + 0.5 * h);
        let c = slope(ahead(y, 0.5 * h, b), t + 0.5 * h);
        let d = slope(ahead(y, h, c), t + h);
        y = [0, 1, 2].map(|i| y[i] + h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]));
    }
    out
}

#[test]
fn stick_slip_has_period_and_fall_of_the_equations() {
    // With a bristle of 1 N/mm and the hand's heavier mass a tick rate of 500 Hz will do; 10 N/mm take 1 kHz.
    let heavy = Pull { mass: 0.2, spring: 300.0, damping: 1.0, speed: 0.03, normal: 1.5 };
    for (p, s, all) in [
        (&PULL, settings(), [(1000.0, 0.03, 0.002), (2000.0, 0.01, 0.001), (4000.0, 0.005, 0.001)]),
        (
            &heavy,
            LuGreSettings::default(),
            [(500.0, 0.01, 0.01), (1000.0, 0.005, 0.005), (4000.0, 0.002, 0.002)],
        ),
    ] {
        let (period, fall, count) = periods(&by_equations(p, s, 8.0), 1000.0);
        assert!(count > 10 && fall > 0.3, "{period} s {fall} N {count}");
        for (tick_hz, most_period, most_fall) in all {
            let found = periods(&by_ticks(p, s, tick_hz, 8.0), tick_hz);
            let (a, b) = (found.0 / period - 1.0, found.1 / fall - 1.0);
            assert!(
                found.2.abs_diff(count) <= 1 && a.abs() < most_period && b.abs() < most_fall,
                "{tick_hz} Hz: {a} {b}"
            );
        }
    }
}

#[test]
fn stiffer_bristle_is_nearer_to_closed_form() {
    // Where static friction ends at once, the spring falls by 2 (F_s - F_k) in half a swing. It is then
    // pulled up again. The stiffer the bristle, the nearer the result is to this closed form.
    let p = Pull { damping: 0.05, speed: 0.003, ..PULL };
    let more = p.normal * 0.3;
    let whole = 2.0 * more / (p.spring * p.speed) + PI * (p.mass / p.spring).sqrt();
    for (stiffness, tick_hz, most_period, most_fall) in
        [(10.0, 4000.0, 0.10, 0.20), (30.0, 4000.0, 0.06, 0.10), (100.0, 16_000.0, 0.04, 0.06)]
    {
        let s = LuGreSettings {
            stribeck_speed_mm_s: 3.0,
            bristle_stiffness_n_per_mm: stiffness,
            bristle_damping_ns_per_m: stiffness.sqrt(),
            ..LuGreSettings::default()
        };
        let (period, fall, count) = periods(&by_ticks(&p, s, tick_hz, 12.0), tick_hz);
        let (a, b) = (1.0 - period / whole, 1.0 - fall / (2.0 * more));
        assert!(
            count >= 4 && (0.0..most_period).contains(&a) && (0.0..most_fall).contains(&b),
            "{stiffness}: {a} {b}"
        );
    }
}

#[test]
fn dahl_sticks_as_a_spring_and_does_not_slip_by_turns() {
    // Steady motion: the pull in the spring settles at F_c and the damper's part, with no swing left.
    let (p, mut law, tick_hz) = (&PULL, Rubbing::dahl(0.8, 10.0), 4000.0);
    let (mut x, mut v, mut before, mut last) = (0.0_f64, 0.0, 0.0, Vec::new());
    let dt = 1.0 / tick_hz / 50.0;
    for k in 0..40_000 {
        let friction = law.step([1e3 * (x - before) * tick_hz, 0.0], p.normal, 1.0 / tick_hz)[0];
        before = x;
        for n in 0..50 {
            let t = (f64::from(k) + f64::from(n) / 50.0) / tick_hz;
            v += dt / p.mass * (p.spring * (p.speed * t - x) + friction - 8.0 * v);
            x += dt * v;
            if k > 38_000 {
                last.push(p.spring * (p.speed * t - x));
            }
        }
    }
    let (low, high) = last.iter().fold((f64::MAX, f64::MIN), |(l, h), p| (l.min(*p), h.max(*p)));
    assert!(high - low < 1e-3 && (high - 1.28).abs() < 1e-3, "{low} {high}");
}
