//! Tests of the bound. It is compared with the condition whose maximum it is, with any motion between
//! ticks, and with masses on simulated walls.

use std::f64::consts::PI;

use proptest::prelude::*;

use super::*;

fn wall(stiffness_n_per_mm: f64, damping_ns_per_m: f64) -> Law {
    Law { stiffness_n_per_mm, damping_ns_per_m }
}

fn at(tick_hz: f64, delay_s: f64) -> Sampling {
    Sampling { tick_hz, delay_s }
}

#[test]
fn bound_matches_figures_of_textbook_and_paper() {
    // 1000 N/m at 1 kHz need 0.5 N s/m. Half as much at 500 Hz needs the same. One tick of delay adds
    // twice as much as the half tick of sampling.
    let p = Passivity::of(wall(1.0, 0.0), at(1000.0, 0.0), 0.6);
    assert!((p.needed_ns_per_m - 0.5).abs() < 1e-12 && (p.margin_ns_per_m - 0.1).abs() < 1e-12 && p.holds());
    assert!((p.stiffest_n_per_mm - 1.2).abs() < 1e-12);
    assert!((Passivity::of(wall(0.5, 0.0), at(500.0, 0.0), 0.6).needed_ns_per_m - 0.5).abs() < 1e-12);
    assert!((Passivity::of(wall(0.5, 0.0), at(500.0, 0.002), 0.6).needed_ns_per_m - 1.5).abs() < 1e-12);
    assert!(!Passivity::of(wall(1.0, 0.2), at(1000.0, 0.0), 0.6).holds());
    assert!(!Passivity::of(wall(1.0, -0.2), at(1000.0, 0.0), 0.6).holds());
    assert_eq!(stiffest_n_per_mm(2.0, at(1000.0, 0.0), 0.6), 0.0);
    // Diolaiti et al.: 0.5 N/mm with places in steps of 0.055 mm.
    let steps = |k, b| Quantisation::of(wall(k, b), at(500.0, 0.0), 0.055, 0.1);
    let q = steps(0.5, 0.0);
    assert!((q.needed_n - 0.01375).abs() < 1e-12 && q.holds());
    assert!(steps(q.stiffest_n_per_mm, 0.0).margin_n.abs() < 1e-12 && !steps(4.0, 0.0).holds());
    // One step in a tick is 27.5 mm/s. At 2 N s/m that is 55 mN.
    let q = steps(0.5, 2.0);
    assert!((q.needed_n - 0.06875).abs() < 1e-12 && q.holds());
    assert!(steps(q.stiffest_n_per_mm, 2.0).margin_n.abs() < 1e-12);
    assert!(!steps(0.0, 4.0).holds() && steps(0.0, 4.0).stiffest_n_per_mm == 0.0);
    assert_eq!(wall(1.0, 2.0) + wall(0.5, -3.0), wall(1.5, -1.0));
}

#[test]
fn the_text_has_the_figures_with_their_units() {
    let text = Passivity::of(wall(1.0, 0.25), at(500.0, 0.001), 0.8).to_string();
    for part in [
        "1.000 N/mm",
        "0.250 N s/m",
        "500 Hz",
        "1.00 ms",
        "2.250 N s/m",
        "0.800",
        "not passive by 1.450",
        "0.275 N/mm",
    ] {
        assert!(text.contains(part), "{part} is not in: {text}");
    }
    let text = Quantisation::of(wall(0.5, 0.0), at(500.0, 0.0), 0.055, 0.1).to_string();
    assert!(text.contains("0.500 N/mm in steps") && text.contains("100.0: passive"), "{text}");
    let text = Quantisation::of(wall(0.5, 1.0), at(500.0, 0.0), 0.055, 0.1).to_string();
    assert!(text.contains("0.500 N/mm and 1.000 N s/m in") && text.contains("41.2 mN"), "{text}");
}

#[test]
fn what_is_not_a_number_is_not_passive() {
    for bad in [f64::NAN, f64::INFINITY] {
        assert!(!Passivity::of(wall(bad, 0.0), at(500.0, 0.0), 1.0).holds());
        assert!(!Passivity::of(wall(0.1, bad), at(500.0, 0.0), 1.0).holds());
        assert!(!Passivity::of(wall(0.1, 0.0), at(500.0, bad), 1.0).holds());
        let steps = |k, b, hz, step| Quantisation::of(wall(k, b), at(hz, 0.0), step, 1.0).holds();
        assert!(!steps(bad, 0.0, 500.0, 0.01) && !steps(1.0, bad, 500.0, 0.01));
        assert!(!steps(1.0, 0.0, 500.0, bad) && !steps(1.0, 1.0, bad, 0.01));
    }
    let never = Passivity::of(wall(0.1, 0.0), at(0.0, 0.0), 1.0);
    assert!(!never.holds() && never.stiffest_n_per_mm == 0.0);
    assert!(!Passivity::of(wall(0.1, 0.0), at(500.0, 0.0), f64::NAN).holds());
}

/// Computes Colgate and Schenkel's condition at one frequency, straight from its complex form.
fn condition(law: Law, s: Sampling, turn: f64) -> f64 {
    use asperity_dsp::filter::Complex64;
    let period = 1.0 / s.tick_hz;
    let one_less = Complex64::new(1.0, 0.0) - Complex64::from_polar(1.0, -turn);
    let h = (one_less * (law.damping_ns_per_m / period) + 1e3 * law.stiffness_n_per_mm)
        * Complex64::from_polar(1.0, -turn * s.delay_s / period);
    0.5 * period * (one_less * h).re / (1.0 - turn.cos())
}

#[test]
fn bound_is_the_maximum_of_the_condition_over_frequency() {
    for tick_hz in [100.0, 500.0, 1000.0, 4000.0] {
        for (stiffness, damping, late) in [
            (0.5, 0.0, 0.0),
            (0.5, 0.3, 0.0),
            (0.0, 0.3, 0.0),
            (0.0, -0.3, 0.0),
            (0.5, 0.0, 1.0),
            (0.5, 0.0, 3.0),
        ] {
            let (law, s) = (wall(stiffness, damping), at(tick_hz, late / tick_hz));
            let most = (1..=20_000)
                .map(|i| condition(law, s, PI * f64::from(i) / 20_000.0))
                .fold(f64::NEG_INFINITY, f64::max);
            let needed = Passivity::of(law, s, 0.0).needed_ns_per_m;
            assert!((most / needed - 1.0).abs() < 1e-6, "{law:?} {s:?}: {most}, not {needed}");
        }
        // The maximum of both together is at most the sum.
        for (damping, late) in [(-0.3, 0.0), (0.3, 0.5), (0.3, 1.0), (-0.2, 2.0)] {
            let (law, s) = (wall(0.5, damping), at(tick_hz, late / tick_hz));
            let needed = Passivity::of(law, s, 0.0).needed_ns_per_m;
            let all = (1..=20_000).map(|i| condition(law, s, PI * f64::from(i) / 20_000.0));
            assert!(all.fold(f64::NEG_INFINITY, f64::max) <= needed * (1.0 + 1e-9));
        }
    }
}

/// Energy that wall and device together give, in mJ. The motion runs in straight lines between the depths
/// of the ticks, since a damper takes least on a straight line.
fn given_mj(law: Law, tick_hz: f64, device_ns_per_m: f64, depths_mm: &[f64]) -> f64 {
    let (mut given, mut before) = (0.0, 0.0);
    for pair in depths_mm.windows(2) {
        let [here, there] = [pair[0], pair[1]];
        // Units are mm/s and N. The wall only pushes, and only a point that is inside.
        let rate = (here - before) * tick_hz;
        let push = law.stiffness_n_per_mm * here + 1e-3 * law.damping_ns_per_m * rate;
        let push = if here > 0.0 { push.max(0.0) } else { 0.0 };
        given += push * (here - there) - 1e-3 * device_ns_per_m * tick_hz * (there - here).powi(2);
        before = here;
    }
    given
}

proptest! {
    #[test]
    fn wall_inside_the_bound_gives_no_energy_to_any_motion(
        tick_hz in 100.0..4000.0f64, stiffness in 0.01..5.0f64, share in 0.0..0.9f64,
        depths in proptest::collection::vec(-1.0..3.0f64, 1..60),
    ) {
        let device = 1e3 * stiffness / (2.0 * tick_hz) / (1.0 - share);
        let law = wall(stiffness, share * device);
        prop_assert!(
            Passivity::of(law, at(tick_hz, 0.0), device * (1.0 + 1e-9)).margin_ns_per_m.abs() < 1e-6 * device
        );
        let mut motion = vec![0.0];
        motion.extend(depths);
        motion.extend([0.0, 0.0]);
        let given = given_mj(law, tick_hz, device * (1.0 + 1e-9), &motion);
        prop_assert!(given <= 1e-9, "{given} mJ");
    }
}

#[test]
fn wall_outside_the_bound_gives_energy_to_a_motion() {
    for tick_hz in [100.0, 500.0, 4000.0] {
        let heavy = Passivity::of(wall(0.25, 0.0), at(tick_hz, 0.0), 0.0).needed_ns_per_m;
        for (law, motion) in [
            // In and out. With a spring alone any way does.
            (wall(0.5, 0.0), [0.0, 1.0].iter().cycle().take(41).copied().collect()),
            (wall(0.5, 0.0), (0..=40).map(|i| 1.0 - f64::from(i - 20).abs() / 20.0).collect()),
            // With a damper the motion goes to and fro in every tick, well inside the wall.
            (wall(0.25, heavy), {
                let mut motion: Vec<f64> = (0..=4000).map(|i| 0.025 * f64::from(i)).collect();
                let back: Vec<f64> = motion.iter().rev().copied().collect();
                motion.extend([98.0, 100.0].repeat(40_000));
                motion.extend(back);
                motion
            }),
        ] {
            let device = Passivity::of(law, at(tick_hz, 0.0), 0.0).needed_ns_per_m;
            assert!(given_mj(law, tick_hz, 0.98 * device, &motion) > 0.0, "{law:?} at {tick_hz} Hz");
            assert!(given_mj(law, tick_hz, 1.0001 * device, &motion) < 1e-9, "{law:?} at {tick_hz} Hz");
        }
    }
}

/// Moves a mass with a damper over the time between ticks, in kg, N s/m, N, m, m/s. Exact for a force
/// that is held.
fn hold(mass: f64, damping: f64, force: f64, time: f64, (x, v): (f64, f64)) -> (f64, f64) {
    let (decay, end) = ((-damping * time / mass).exp(), force / damping);
    (x + end * time + (v - end) * (1.0 - decay) * mass / damping, end + (v - end) * decay)
}

/// Growth factor of the amplitude of a mass after `swings` swings on a wall that pushes and pulls. The
/// force acts `late` ticks after its place.
fn swings(mass: f64, device: f64, law: Law, tick_hz: f64, late: usize, swings: f64) -> f64 {
    let stiffness = 1e3 * law.stiffness_n_per_mm;
    let count = (swings * 2.0 * PI * (mass / stiffness).sqrt() * tick_hz) as usize;
    let mut state = (0.0, 1e-3 * (stiffness / mass).sqrt());
    let mut forces = vec![0.0; late + 1];
    let (mut before, mut first, mut last) = (0.0, 0.0_f64, 0.0_f64);
    for k in 0..count {
        let here = state.0;
        forces.rotate_right(1);
        forces[0] = -stiffness * here - law.damping_ns_per_m * (here - before) * tick_hz;
        before = here;
        state = hold(mass, device, forces[late], 1.0 / tick_hz, state);
        let energy = 0.5 * mass * state.1.powi(2) + 0.5 * stiffness * state.0.powi(2);
        if k < count / 10 {
            first = first.max(energy);
        } else if k >= count - count / 10 {
            last = last.max(energy);
        }
    }
    (last / first).sqrt()
}

#[test]
fn swinging_mass_decays_inside_the_bound_and_grows_outside() {
    for tick_hz in [100.0, 500.0, 1000.0, 4000.0] {
        for late in [0, 1, 2] {
            let (device, s) = (0.8, at(tick_hz, late as f64 / tick_hz));
            let limit = stiffest_n_per_mm(0.0, s, device);
            // A mass so heavy that a swing takes 300 ticks. There a spring alone reaches the bound.
            let heavy = 1e3 * limit * (300.0 / (2.0 * PI * tick_hz)).powi(2);
            let (inside, outside) = (
                swings(heavy, device, wall(0.97 * limit, 0.0), tick_hz, late, 200.0),
                swings(heavy, device, wall(1.03 * limit, 0.0), tick_hz, late, 200.0),
            );
            assert!(inside < 0.99 && outside > 1.01, "{tick_hz} Hz, {late} late: {inside} {outside}");
            // Lighter masses swing faster and gain no more.
            for lighter in [3.0, 10.0, 100.0, 1e3, 1e4, 1e5] {
                let ratio = swings(heavy / lighter, device, wall(0.97 * limit, 0.0), tick_hz, late, 200.0);
                assert!(ratio < 0.99, "{tick_hz} Hz, {late} late, {lighter} times lighter: {ratio}");
            }
        }
    }
}

// Inside the bound, a damped wall brings every mass to rest. Friction beyond the bound drives a light mass.
#[test]
fn damped_wall_inside_stops_masses_and_friction_outside_drives() {
    let (tick_hz, device) = (500.0, 0.8);
    let law = wall(stiffest_n_per_mm(0.4, at(tick_hz, 0.0), device), 0.4);
    for mass in [0.0005, 0.002, 0.01, 0.05, 0.3] {
        assert!(swings(mass, device, law, tick_hz, 0, 100.0) < 0.9, "{mass} kg");
    }
    // 2 N under 0.004 s/mm are 8 N s/m, ten times the damping of the device. A light mass rattles at half
    // the tick rate, a heavy one does not.
    let rubbed = |mass: f64, slope: f64| {
        let (mut state, mut before, mut most) = ((0.0, 0.1), 0.0, [0.0_f64; 2]);
        for k in 0..400 {
            let here = state.0;
            let force = -slope * (here - before) * tick_hz;
            before = here;
            state = hold(mass, device, force, 1.0 / tick_hz, state);
            most[k / 200] = most[k / 200].max(state.1.abs());
        }
        most[1] / most[0]
    };
    assert!(rubbed(0.004, 8.0) > 10.0, "{}", rubbed(0.004, 8.0));
    assert!(rubbed(0.004, 0.79) < 1e-3 && rubbed(0.0004, 0.79) < 1e-3 && rubbed(0.3, 8.0) < 0.1);
}

/// Greatest ratio of the kinetic energy with which a mass leaves a wall to that with which it came. The
/// maximum is over the moments between two ticks at which it comes.
fn bounce(mass: f64, device: f64, law: Law, tick_hz: f64, speed: f64) -> f64 {
    let mut most = 0.0_f64;
    for phase in 0..50 {
        let mut state = (-speed * f64::from(phase) / 50.0 / tick_hz, speed);
        let mut taken = 0.0;
        for _ in 0..100_000 {
            let push = -1e3 * law.stiffness_n_per_mm * state.0.max(0.0);
            let before = state;
            state = hold(mass, device, push, 1.0 / tick_hz, state);
            if before.0 <= 0.0 {
                // The energy that the damper takes outside does not come from the wall.
                let out = |s: (f64, f64)| 0.5 * mass * s.1 * s.1;
                taken += if state.0 <= 0.0 { out(before) - out(state) } else { 0.0 };
            }
            if state.0 <= 0.0 && state.1 < 0.0 {
                break;
            }
        }
        most = most.max((0.5 * mass * state.1.powi(2) + taken) / (0.5 * mass * speed.powi(2)));
    }
    most
}

#[test]
fn bouncing_mass_gains_energy_only_outside_the_bound() {
    for tick_hz in [100.0, 500.0, 4000.0] {
        let device = 0.5;
        let limit = stiffest_n_per_mm(0.0, at(tick_hz, 0.0), device);
        let heavy = 1e3 * limit * (100.0 / (2.0 * PI * tick_hz)).powi(2);
        for lighter in [0.1, 1.0, 10.0, 100.0, 1e3, 1e5] {
            let out = bounce(heavy / lighter, device, wall(limit, 0.0), tick_hz, 0.2);
            assert!(out <= 1.0 + 1e-9, "{tick_hz} Hz, {lighter}: {out}");
        }
        let out = bounce(heavy, device, wall(1.1 * limit, 0.0), tick_hz, 0.2);
        assert!(out > 1.0, "{tick_hz} Hz: {out}");
    }
}

/// Simulates a mass with dry friction on a spring whose place is seen in steps. The rate is so high that
/// only the steps matter. Answers the amplitude in the last fifth divided by that in the first, in steps.
fn stepped(friction: f64, stiffness: f64, step: f64, swing_steps: f64) -> f64 {
    let (mass, dt, count) = (0.05, 2e-6, 2_000_000);
    let (mut x, mut v) = (0.0_f64, swing_steps * step * (stiffness / mass).sqrt());
    let (mut most, mut seen) = ([0.0_f64; 5], 0.0);
    for k in 0..count {
        // An encoder that turns late: a step is reported when it has been passed. So the place is half a
        // step behind in either direction.
        if (x - seen).abs() > step {
            seen += step * ((x - seen) / step).trunc();
        }
        let pull = -stiffness * seen;
        let rub = friction * dt / mass;
        let wanted = v + pull * dt / mass;
        v = if wanted.abs() <= rub { 0.0 } else { wanted - rub.copysign(wanted) };
        x += v * dt;
        let part = &mut most[5 * k / count];
        *part = part.max(x.abs());
    }
    most[4] / most[0]
}

#[test]
fn dry_friction_above_the_bound_stops_oscillation_from_steps() {
    let needed = Quantisation::of(wall(0.5, 0.0), at(500.0, 0.0), 0.055, 0.0).needed_n;
    let [less, more] = [0.9, 1.1].map(|share| stepped(share * needed, 500.0, 0.055e-3, 20.0));
    assert!(less > 1.2 && more < 0.8, "{less} {more}");
}

/// Energy per length of the path \[N\] that a wall with places in steps gives on a motion, beyond what
/// the bound without steps takes.
fn by_way_n(law: Law, tick_hz: f64, step_mm: f64, depths_mm: &[f64]) -> f64 {
    let seen = |x: f64| (x / step_mm).round() * step_mm;
    let device = Passivity::of(law, at(tick_hz, 0.0), 0.0).needed_ns_per_m;
    let (mut given, mut way, mut before) = (0.0, 0.0, seen(0.0));
    for pair in depths_mm.windows(2) {
        let (here, go) = (seen(pair[0]), pair[1] - pair[0]);
        let push = law.stiffness_n_per_mm * here + 1e-3 * law.damping_ns_per_m * (here - before) * tick_hz;
        let push = if here > 0.0 { push.max(0.0) } else { 0.0 };
        given += -push * go - 1e-3 * device * tick_hz * go * go;
        way += go.abs();
        before = here;
    }
    given / way
}

proptest! {
    #[test]
    fn energy_from_steps_stays_below_the_dry_friction_bound(
        tick_hz in 100.0..4000.0f64, stiffness in 0.01..5.0f64, damping in 0.0..2.0f64, step in 0.001..0.2f64,
        way in proptest::collection::vec((-1.0..1.0f64, -3.0..1.0f64), 1..200),
    ) {
        let mut motion = vec![0.0];
        for (sign, size) in way {
            let last = motion.last().copied().unwrap_or(0.0);
            motion.push((last + step * sign.signum() * 10.0_f64.powf(size)).max(-step));
        }
        motion.extend([0.0, 0.0]);
        let (law, s) = (wall(stiffness, damping), at(tick_hz, 0.0));
        let needed = Quantisation::of(law, s, step, 0.0).needed_n;
        let found = by_way_n(law, tick_hz, step, &motion);
        prop_assert!(found <= needed * (1.0 + 1e-9), "{found} N, {needed} N");
    }
}

#[test]
fn damped_wall_with_steps_needs_dry_friction_for_damping_too() {
    // To and fro over the border of a step at half the tick rate, deep in the wall and by very little.
    let border = 20.5 * 0.055;
    let mut motion = vec![border - 1e-7];
    motion.extend([border + 1e-7, border - 1e-7].repeat(500));
    for damping in [0.0, 0.3, 2.0] {
        let law = wall(0.5, damping);
        let needed = Quantisation::of(law, at(500.0, 0.0), 0.055, 0.0).needed_n;
        let found = by_way_n(law, 500.0, 0.055, &motion);
        // The first and the last tick of the path give less.
        let part = found / needed;
        assert!((0.98..=1.0 + 1e-9).contains(&part), "{damping}: {found} N, not {needed} N");
    }
}
