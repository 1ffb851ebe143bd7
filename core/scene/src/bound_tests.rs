//! Tests of the bound. It is compared with the condition whose maximum it is, and with any motion between
//! ticks.

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
    assert_eq!(
        text,
        "1.000 N/mm and 0.250 N s/m at 500 Hz, 1.00 ms late, take more than 2.250 N s/m; the device has \
         0.800: not passive by 1.450"
    );
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
