//! Made strokes keep to their closed forms, limits and seeds.

use super::*;
use proptest::prelude::*;

/// No tremor, no rounding, steady force.
fn bare(shape: Shape) -> StrokeParams {
    StrokeParams { shape, tremor_mm: 0.0, quantum_mm: 0.0, force_swing: 0.0, ..Default::default() }
}

fn made(params: StrokeParams) -> Stroke {
    Stroke::new(params).unwrap()
}

#[test]
fn a_line_is_minimum_jerk_from_turn_to_turn() {
    // 80 mm at 100 mm/s: 0.8 s a movement, nine in 7.2 s.
    let s = made(bare(Shape::Line));
    for i in 0..=7200 {
        let t = f64::from(i) * 1e-3;
        let (leg, u) = ((t / 0.8).floor(), (t / 0.8).fract());
        let way = 10.0 * u.powi(3) - 15.0 * u.powi(4) + 6.0 * u.powi(5);
        let sign = if leg % 2.0 == 0.0 { 1.0 } else { -1.0 };
        let [x, y, z] = s.sample(t + 0.4).position;
        assert!((x - sign * (-40.0 + 80.0 * way)).abs() < 1e-6, "{t}: {x}");
        assert_eq!(y, 0.0);
        assert!((z + 2.0).abs() < 1e-12, "{z}");
    }
}

#[test]
fn the_mean_speed_is_the_one_asked_for() {
    for (shape, duration_s) in
        [(Shape::Line, 8.0), (Shape::Zigzag, 0.8 + 70.0_f64.hypot(8.75) / 90.0 * 17.75), (Shape::Circle, 6.3)]
    {
        let (extent_mm, mean_speed_mm_s) = if shape == Shape::Line { (80.0, 100.0) } else { (70.0, 90.0) };
        let s = made(StrokeParams { extent_mm, mean_speed_mm_s, duration_s, ..bare(shape) });
        let (steps, h) = (100_000, (duration_s - 0.8) / 100_000.0);
        let at = |i: i32| s.sample(0.4 + f64::from(i) * h).position;
        let way: f64 = (0..steps)
            .map(|i| {
                let (a, b) = (at(i), at(i + 1));
                (b[0] - a[0]).hypot(b[1] - a[1])
            })
            .sum();
        let mean = way / (duration_s - 0.8);
        assert!((mean / mean_speed_mm_s - 1.0).abs() < 1e-3, "{shape:?}: {mean}");
    }
}

#[test]
fn zigzag_sweeps_its_square_and_circle_keeps_its_radius() {
    let zigzag = made(StrokeParams { duration_s: 20.0, ..bare(Shape::Zigzag) });
    let circle = made(bare(Shape::Circle));
    let (mut low, mut high) = ([f64::MAX; 2], [f64::MIN; 2]);
    for i in 0..20_000 {
        let p = zigzag.sample(f64::from(i) * 1e-3).position;
        for k in 0..2 {
            low[k] = low[k].min(p[k]);
            high[k] = high[k].max(p[k]);
        }
        let [x, y, _] = circle.sample(f64::from(i) * 1e-3).position;
        assert!((x.hypot(y) - 40.0).abs() < 1e-9);
    }
    for k in 0..2 {
        assert!((low[k] + 40.0).abs() < 1e-3 && (high[k] - 40.0).abs() < 1e-3, "{low:?} {high:?}");
    }
}

/// Position and velocity do not jump, also where approach, turns and lift-off meet.
#[test]
fn every_shape_is_smooth_and_rests_at_both_ends() {
    for shape in [Shape::Line, Shape::Zigzag, Shape::Circle] {
        for duration_s in [1.0, 3.33, 8.0] {
            let s = made(StrokeParams { duration_s, force_swing: 0.5, ..bare(shape) });
            let h = 1e-4;
            let at = |i: i32| s.sample(f64::from(i) * h).position;
            for i in -100..(duration_s / h) as i32 + 100 {
                let (a, b, c) = (at(i - 1), at(i), at(i + 1));
                for k in 0..3 {
                    let speed = (c[k] - b[k]) / h;
                    assert!(speed.abs() < 250.0, "{shape:?} {i} {speed}");
                    // The shortest movement, 20 mm in 0.2 s, peaks at 5.77 * 20 / 0.04 mm/s^2.
                    let acceleration = (c[k] - 2.0 * b[k] + a[k]) / (h * h);
                    assert!(acceleration.abs() < 4000.0, "{shape:?} {i} axis {k}: {acceleration}");
                }
            }
            for t in [-1.0, 0.0, duration_s, duration_s + 5.0, f64::INFINITY] {
                assert!((s.sample(t).position[2] - 10.0).abs() < 1e-9);
            }
        }
    }
}

#[test]
fn the_depth_over_a_hookean_floor_gives_the_force() {
    let s =
        made(StrokeParams { force_n: 1.5, force_swing: 0.4, stiffness_n_per_mm: 0.8, ..bare(Shape::Line) });
    let (mut low, mut high) = (f64::MAX, f64::MIN);
    for i in 0..7200 {
        let t = 0.4 + f64::from(i) * 1e-3;
        let force = -0.8 * s.sample(t).position[2];
        assert!((force - s.force_at(t)).abs() < 1e-9);
        low = low.min(force);
        high = high.max(force);
    }
    assert!((low - 0.9).abs() < 1e-3 && (high - 2.1).abs() < 1e-3, "{low} {high}");
}

#[test]
fn positions_are_multiples_of_the_quantum() {
    let (rounded, exact) = (StrokeParams::default(), StrokeParams { quantum_mm: 0.0, ..Default::default() });
    let (rounded, exact) = (made(rounded), made(exact));
    for i in 0..8000 {
        let t = f64::from(i) * 1e-3;
        for (a, b) in rounded.sample(t).position.into_iter().zip(exact.sample(t).position) {
            assert!((a / 0.055 - (a / 0.055).round()).abs() < 1e-9);
            assert!((a - b).abs() <= 0.0275 + 1e-12);
        }
    }
}

#[test]
fn a_seed_fixes_the_stroke_and_another_changes_it() {
    let (a, b) = (made(StrokeParams::default()), made(StrokeParams::default()));
    let other = made(StrokeParams { seed: 2, ..Default::default() });
    let mut differ = 0;
    for i in (0..4000).rev() {
        let t = f64::from(i) * 2e-3;
        assert_eq!(a.sample(t), b.sample(t));
        differ += usize::from(a.sample(t) != other.sample(t));
    }
    assert!(differ > 3000, "{differ}");
}

#[test]
fn parameters_out_of_range_are_named() {
    let d = StrokeParams::default;
    for (params, name) in [
        (StrokeParams { extent_mm: 0.0, ..d() }, "`extent_mm` is 0"),
        (StrokeParams { mean_speed_mm_s: f64::NAN, ..d() }, "`mean_speed_mm_s` is NaN"),
        (StrokeParams { force_n: -1.0, ..d() }, "`force_n` is -1"),
        (StrokeParams { force_swing: 1.1, ..d() }, "`force_swing` is 1.1"),
        (StrokeParams { stiffness_n_per_mm: 0.0, ..d() }, "`stiffness_n_per_mm` is 0"),
        (StrokeParams { clearance_mm: 1e50, ..d() }, "`clearance_mm` is 1"),
        (StrokeParams { duration_s: 0.8, ..d() }, "`duration_s` is 0.8"),
        (StrokeParams { tremor_mm: f64::INFINITY, ..d() }, "`tremor_mm` is inf"),
        (StrokeParams { quantum_mm: -0.1, ..d() }, "`quantum_mm` is -0.1"),
    ] {
        let e = Stroke::new(params).unwrap_err();
        assert!(e.message.starts_with(name), "{e}");
        assert!(e.help.is_some());
    }
}

#[test]
fn names_and_shapes_agree() {
    assert_eq!(
        Shape::NAMES.map(Shape::from_name),
        [Some(Shape::Line), Some(Shape::Zigzag), Some(Shape::Circle)]
    );
    assert_eq!(Shape::from_name("spiral"), None);
}

#[test]
fn ends_are_at_rest_with_no_acceleration() {
    assert_eq!(minimum_jerk(0.0), 0.0);
    assert_eq!(minimum_jerk(1.0), 1.0);
    assert_eq!(minimum_jerk(-3.0), 0.0);
    assert_eq!(minimum_jerk(7.0), 1.0);
    // Near an end the way grows as 10 h^3: without speed and acceleration.
    let h = 1e-4;
    assert!((minimum_jerk(h) / (10.0 * h.powi(3)) - 1.0).abs() < 1e-3);
    assert!(((1.0 - minimum_jerk(1.0 - h)) / (10.0 * h.powi(3)) - 1.0).abs() < 1e-3);
}

#[test]
fn integral_is_the_antiderivative() {
    let h = 1e-5;
    for i in 1..100 {
        let s = f64::from(i) / 100.0;
        let slope = (minimum_jerk_ramp_integral(s + h) - minimum_jerk_ramp_integral(s - h)) / (2.0 * h);
        assert!((slope - minimum_jerk(s)).abs() < 1e-7);
    }
    assert_eq!(minimum_jerk_ramp_integral(1.0), 0.5);
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn every_accepted_stroke_stays_in_its_box(
        shape in 0..3usize, extent_mm in 1e-9..1000.0f64, mean_speed_mm_s in 1e-9..2000.0f64,
        force_n in 0.0..100.0f64, stiffness_n_per_mm in 0.001..10.0f64, approach_s in 0.01..1.0f64,
        path_s in 0.11..100.0f64, seed: u64, t in -10.0..120.0f64,
    ) {
        let shape = [Shape::Line, Shape::Zigzag, Shape::Circle][shape];
        let duration_s = path_s + 2.0 * approach_s;
        let p = StrokeParams {
            shape, extent_mm, mean_speed_mm_s, force_n, stiffness_n_per_mm, approach_s, duration_s, seed,
            ..Default::default()
        };
        let [x, y, z] = made(p).sample(t).position;
        let slack = 0.05 + 0.0276;
        prop_assert!(x.abs() <= extent_mm / 2.0 + slack && y.abs() <= extent_mm / 2.0 + slack, "{x} {y}");
        prop_assert!(z <= 10.0 + slack && z >= -1.3 * force_n / stiffness_n_per_mm - slack, "{z}");
    }
}
