use super::*;
use asperity_numbers::Random;
use proptest::prelude::*;
use std::f64::consts::TAU;

fn grid(
    columns: usize,
    rows: usize,
    step: [f64; 2],
    repeats: bool,
    f: impl Fn(f64, f64) -> f64,
) -> HeightGrid {
    let heights = (0..columns * rows)
        .map(|i| f((i % columns) as f64 * step[0], (i / columns) as f64 * step[1]) as f32)
        .collect();
    HeightGrid::new(columns, heights, step, repeats).unwrap()
}

#[test]
fn sine_keeps_height_and_slopes_between_points_and_at_the_seam() {
    let (columns, rows, step) = (128, 96, [0.05, 0.08]);
    let (a, b) = (TAU / (128.0 * 0.05) * 3.0, TAU / (96.0 * 0.08) * 2.0);
    let waves = grid(columns, rows, step, true, |x, y| 0.3 * (a * x).sin() + 0.1 * (b * y).cos());
    assert_eq!((waves.columns, waves.rows, waves.repeats), (128, 96, true));
    assert!((waves.extent_mm()[0] - 6.4).abs() < 1e-12 && (waves.extent_mm()[1] - 7.68).abs() < 1e-12);
    for (x, y) in [(0.013, 0.4), (6.39, 3.3), (-7.7, 100.02), (0.0, -0.01), (3.2, 7.679)] {
        let s = waves.sample(x, y);
        assert!((s.height_mm - 0.3 * (a * x).sin() - 0.1 * (b * y).cos()).abs() < 2e-4, "{x} {y} {s:?}");
        assert!((s.slope[0] - 0.3 * a * (a * x).cos()).abs() < 5e-3, "{x} {y} {s:?}");
        assert!((s.slope[1] + 0.1 * b * (b * y).sin()).abs() < 3e-3, "{x} {y} {s:?}");
    }
}

#[test]
fn ending_grid_keeps_slope_to_its_edge_and_is_clamped_beyond() {
    let ramp = grid(7, 4, [0.5, 0.25], false, |x, y| 2.0 * x - 0.5 * y + 1.0);
    assert_eq!(ramp.extent_mm(), [3.0, 0.75]);
    for (x, y) in [(0.0, 0.0), (3.0, 0.75), (2.99, 0.01), (1.3, 0.4), (0.2, 0.75)] {
        let s = ramp.sample(x, y);
        assert!((s.height_mm - (2.0 * x - 0.5 * y + 1.0)).abs() < 1e-6, "{x} {y} {s:?}");
        assert!((s.slope[0] - 2.0).abs() < 1e-5 && (s.slope[1] + 0.5).abs() < 1e-5, "{x} {y} {s:?}");
    }
    for (x, y) in [(-1.0, 0.3), (9.0, 0.3), (f64::INFINITY, 0.3)] {
        assert_eq!(ramp.sample(x, y).height_mm, ramp.sample(x.clamp(0.0, 3.0), y).height_mm);
    }
    for (x, y) in [(f64::NAN, 0.0), (0.0, f64::NAN)] {
        assert!(ramp.sample(x, y).height_mm.is_finite());
    }
    let smallest = grid(2, 2, [1.0, 1.0], false, |x, y| x + 3.0 * y);
    assert!((smallest.sample(0.25, 0.5).height_mm - 1.75).abs() < 1e-6);
    let one = HeightGrid::new(1, vec![0.7], [1.0, 1.0], true).unwrap().sample(0.3, -1e300);
    assert!((one.height_mm - 0.7).abs() < 1e-6 && one.slope.iter().all(|s| s.abs() < 1e-6));
}

#[test]
fn a_patch_is_sampled_as_it_samples_itself() {
    for side in [16, 21] {
        let mut random = Random::new(5);
        let field = HeightField::from_fn(side, 0.3, |_, _| random.normal());
        let grid = HeightGrid::from_field(&field).unwrap();
        for _ in 0..500 {
            let (x, y) = (random.range(-20.0, 20.0), random.range(-20.0, 20.0));
            let (a, b) = (grid.sample(x, y), field.sample(x, y));
            assert!((a.height_mm - b.height_mm).abs() < 1e-12, "{a:?} {b:?}");
            assert!((0..2).all(|k| (a.slope[k] - b.slope[k]).abs() < 1e-11), "{a:?} {b:?}");
        }
    }
}

#[test]
fn bounds_hold_where_the_cubic_overshoots_most() {
    // In the middle of a cell with four high corners, whose neighbours along both axes are low.
    let high = |x: f64| (1.5..3.5).contains(&x);
    let bump = grid(6, 6, [1.0, 1.0], true, |x, y| if high(x) == high(y) { 1.0 } else { -1.0 });
    let top = bump.sample(2.5, 2.5).height_mm;
    assert!((top - 1.5625).abs() < 1e-6, "{top}");
    assert!(bump.bounds_mm[0] < -1.5625 && bump.bounds_mm[0] > -1.5626, "{:?}", bump.bounds_mm);
    assert!(bump.bounds_mm[1] > top && bump.bounds_mm[1] < 1.5626);
}

#[test]
fn grids_that_cannot_be_are_refused() {
    let error = |columns, heights: Vec<f32>, step, repeats| {
        HeightGrid::new(columns, heights, step, repeats).unwrap_err().to_string()
    };
    assert!(error(0, vec![], [1.0; 2], true).starts_with("0 heights in rows of 0 (whole rows"));
    assert!(error(3, vec![0.0; 4], [1.0; 2], true).starts_with("4 heights in rows of 3"));
    assert!(error(4, vec![0.0; 4], [1.0; 2], false).contains("at least 2 columns and rows"));
    assert!(error(2, vec![0.0; 4], [1.0, 0.0], false).starts_with("2 heights 0 mm apart"));
    assert!(error(2, vec![0.0; 4], [f64::NAN, 1.0], false).starts_with("2 heights NaN mm"));
    assert!(error(2, vec![0.0; 4], [1e5, 1.0], true).contains("at most 100000 mm in all"));
    let bad = error(2, vec![0.0, 0.0, 0.0, f32::NAN], [1.0; 2], true);
    assert!(bad.starts_with("a height of NaN mm in column 1 of row 1"), "{bad}");
    assert!(error(1, vec![f32::INFINITY], [1.0; 2], true).contains("inf"));
}

proptest! {
    #[test]
    fn slopes_match_heights_and_are_continuous(
        seed in 0..1000u64,
        repeats in proptest::bool::ANY,
        columns in 2..9usize,
        rows in 2..9usize,
        x in 0.0..1.0f64,
        y in 0.0..1.0f64,
    ) {
        let mut random = Random::new(seed);
        let heights = (0..columns * rows).map(|_| random.range(-1.0, 1.0) as f32).collect();
        let grid = HeightGrid::new(columns, heights, [0.5, 0.25], repeats).unwrap();
        let [w, h] = grid.extent_mm();
        let [low, high] = grid.bounds_mm;
        // Anywhere, also on the lines between cells.
        for (x, y) in
            [(x * w, y * h), ((x * w / 0.5).round() * 0.5, y * h), (x * w, (y * h / 0.25).round() * 0.25)]
        {
            let s = grid.sample(x, y);
            prop_assert!((low..=high).contains(&s.height_mm));
            let e = 1e-6;
            let inside = |at: f64, most: f64| repeats || (at > e && at < most - e);
            if inside(x, w) {
                let d = (grid.sample(x + e, y).height_mm - grid.sample(x - e, y).height_mm) / (2.0 * e);
                prop_assert!((d - s.slope[0]).abs() < 1e-4, "{d} {s:?}");
            }
            if inside(y, h) {
                let d = (grid.sample(x, y + e).height_mm - grid.sample(x, y - e).height_mm) / (2.0 * e);
                prop_assert!((d - s.slope[1]).abs() < 1e-4, "{d} {s:?}");
            }
        }
    }
}
