use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::Arc;

use super::*;
use crate::space::vector::{norm, sub};
use crate::space::{HeightGrid, Pose, Surface};
use proptest::prelude::*;

fn waves(amplitude: f64, repeats: bool) -> Arc<HeightGrid> {
    let heights =
        (0..100 * 100).map(|i| (amplitude * (TAU * (i % 100) as f64 / 50.0).sin()) as f32).collect();
    Arc::new(HeightGrid::new(100, heights, [0.2; 2], repeats).unwrap())
}

fn near(a: Vector, b: Vector, within: f64) -> bool {
    norm(sub(a, b)) < within
}

fn close(a: [f64; 2], b: [f64; 2]) -> bool {
    near([a[0], a[1], 0.0], [b[0], b[1], 0.0], 1e-9)
}

#[test]
fn a_plane_is_as_deep_as_the_point_is_below_it() {
    let touch = Shape::plane().touch([3.0, -4.0, -0.7], None, 0.1).unwrap();
    assert_eq!((touch.depth_mm, touch.normal, touch.place_mm), (0.7, [0.0, 0.0, 1.0], [3.0, -4.0]));
    assert_eq!(Shape::plane().depth_mm([1e5, 0.0, 2.5]), -2.5);
}

#[test]
fn a_sphere_is_as_deep_as_the_point_is_within_its_radius() {
    let sphere = Shape::sphere(10.0).unwrap();
    // 2-3-6-7
    let touch = sphere.touch([2.0, 3.0, 6.0], None, 0.1).unwrap();
    assert!((touch.depth_mm - 3.0).abs() < 1e-12);
    assert!(near(touch.normal, [2.0 / 7.0, 3.0 / 7.0, 6.0 / 7.0], 1e-12));
    assert!((sphere.depth_mm([6.0, 8.0, 24.0]) + 16.0).abs() < 1e-12);
    // At the middle no way out is the shortest, so one is taken.
    let middle = sphere.touch([0.0; 3], None, 0.1).unwrap();
    assert_eq!((middle.depth_mm, middle.normal, middle.place_mm), (10.0, [0.0, 0.0, 1.0], [0.0; 2]));
}

#[test]
fn sphere_arcs_are_exact_and_half_is_kept_past_the_equator() {
    let sphere = Shape::sphere(10.0).unwrap();
    let at = |angle: f64, along: f64, last| {
        let (s, c) = angle.sin_cos();
        sphere.touch([9.5 * s * along.cos(), 9.5 * s * along.sin(), 9.5 * c], last, 0.1).unwrap()
    };
    for along in [0.0_f64, 1.0, -2.5] {
        for angle in [0.0, 0.3, 1.5] {
            let (upper, lower) = (at(angle, along, None), at(PI - angle, along, None));
            assert_eq!((upper.feature, lower.feature), (0, 1));
            let r = 10.0 * angle;
            assert!(close(upper.place_mm, [r * along.cos(), r * along.sin()]), "{upper:?}");
            // Seen from below, y runs the other way.
            assert!(close(lower.place_mm, [r * along.cos(), -r * along.sin()]), "{lower:?}");
        }
    }
    let past = |degrees: f64, last| at(FRAC_PI_2 + degrees.to_radians(), 0.4, last).feature;
    assert_eq!([past(5.0, Some(0)), past(5.0, None), past(6.0, Some(0))], [0, 1, 1]);
    assert_eq!([past(-5.0, Some(1)), past(-5.0, None), past(-6.0, Some(1))], [1, 0, 0]);
    assert_eq!(past(5.0, Some(77)), 1);
}

#[test]
fn a_turned_box_pushes_out_by_its_nearest_face() {
    // 30 degrees about z. The box's x is (cos 30, sin 30, 0).
    let pose = Pose::new([1.0, 2.0, 3.0], [0.0, 0.0, 30.0]).unwrap();
    let surface = Surface { shape: Shape::cuboid([4.0, 6.0, 8.0]).unwrap(), pose };
    let (c, s) = (3.0_f64.sqrt() / 2.0, 0.5);
    let (x, y, z) = ([c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]);
    let minus = |v: Vector| v.map(|x| -x);
    let faces = [
        ([1.75, 1.0, 2.0], 0.25, x, [1.0, 2.0]),
        ([-1.75, 1.0, 2.0], 0.25, minus(x), [2.0, 1.0]),
        ([0.1, 2.6, 3.0], 0.4, y, [3.0, 0.1]),
        ([0.1, -2.6, 3.0], 0.4, minus(y), [0.1, 3.0]),
        ([0.1, 0.2, 3.9], 0.1, z, [0.1, 0.2]),
        ([0.1, 0.2, -3.9], 0.1, minus(z), [0.2, 0.1]),
    ];
    for (number, (at, depth, normal, place)) in faces.into_iter().enumerate() {
        let touch = surface.touch(surface.pose.to_world(at), None, 0.0).unwrap();
        assert_eq!(usize::from(touch.feature), number);
        assert!((touch.depth_mm - depth).abs() < 1e-12 && near(touch.normal, normal, 1e-12), "{touch:?}");
        assert!(close(touch.place_mm, place), "{touch:?}");
    }
    // 3-4-12-13 off a corner, and straight off a face.
    assert!((surface.shape.depth_mm([5.0, 7.0, 16.0]) + 13.0).abs() < 1e-12);
    assert_eq!(surface.shape.depth_mm([0.0, -10.0, 1.0]), -7.0);
}

// A stylus inside a plate is never pushed through to the other face.
#[test]
fn plate_pushes_stylus_back_to_its_entry_face() {
    let plate = Shape::cuboid([40.0, 40.0, 2.0]).unwrap();
    let touch = |x, z, last| plate.touch([x, 0.0, z], last, 0.1).unwrap();
    let mut last = touch(0.0, 0.9, None);
    assert_eq!(last.feature, 4);
    for step in 0..=18 {
        let z = 0.9 - 0.1 * f64::from(step);
        last = touch(0.0, z, Some(last.feature));
        assert_eq!(last.feature, 4);
        assert!((last.depth_mm - (1.0 - z)).abs() < 1e-12);
    }
    assert!((touch(0.0, -1.25, Some(4)).depth_mm + 0.25).abs() < 1e-12, "out of the other side");
    // A stylus that came from below is held by that face. One without a past is held by the nearest face.
    assert_eq!([touch(0.0, 0.9, Some(5)).feature, touch(0.0, -0.2, None).feature], [5, 5]);
    // Along the top to the side. The side takes over when it is nearer by more than 0.1 mm.
    let side = |off: f64| touch(20.0 - off, 0.5, Some(4)).feature;
    assert_eq!([side(0.41), side(0.39)], [4, 0]);
    let back = |off: f64| touch(20.0 - off, 0.5, Some(0)).feature;
    assert_eq!([back(0.59), back(0.61)], [0, 4]);
    assert_eq!(touch(0.0, 0.9, Some(200)).feature, 4);
}

#[test]
fn rectangle_is_touched_only_within_sides_and_thickness() {
    let sheet = Shape::rectangle([10.0, 6.0], 2.0).unwrap();
    assert_eq!(sheet.depth_mm([5.0, -3.0, -1.5]), 1.5);
    assert_eq!(sheet.depth_mm([4.9, 2.9, -2.0]), 2.0);
    let nothing = f64::NEG_INFINITY;
    for at in [[0.0, 0.0, -2.01], [5.01, 0.0, -0.1], [0.0, -3.01, -1.0], [9.0, 9.0, -50.0]] {
        assert_eq!((sheet.depth_mm(at), sheet.touch(at, None, 0.1)), (nothing, None), "{at:?}");
    }
    // 2-3-6-7 off a corner.
    let off = sheet.touch([7.0, -6.0, 6.0], None, 0.1).unwrap();
    assert!((off.depth_mm + 7.0).abs() < 1e-12 && off.place_mm == [5.0, -3.0]);
    assert!(near(off.normal, [2.0 / 7.0, -3.0 / 7.0, 6.0 / 7.0], 1e-12));
    assert_eq!(sheet.depth_mm([1.0, 1.0, 4.0]), -4.0);
}

#[test]
fn a_relief_is_touched_along_the_normal_of_its_heights() {
    let shape = Shape::relief(waves(0.5, true), Some([30.0, 20.0]), 2.0, 3.0).unwrap();
    // sin(k x) of amplitude 1 mm and 10 mm long, from the corner at x = -15, which is half a wave off.
    let k = TAU / 10.0;
    for x in [-14.9_f64, -6.0, 0.7, 2.5, 12.0] {
        let (height, slope) = (-(k * x).sin(), -k * (k * x).cos());
        let touch = shape.touch([x, 1.0, height - 0.8], None, 0.1).unwrap();
        let long = (1.0 + slope * slope).sqrt();
        assert!((touch.depth_mm - 0.8 / long).abs() < 2e-3, "{x}: {touch:?}");
        assert!(near(touch.normal, [-slope / long, 0.0, 1.0 / long], 3e-3), "{x}: {touch:?}");
        assert!(near(touch.tangents[0], [1.0 / long, 0.0, slope / long], 3e-3), "{x}: {touch:?}");
        assert_eq!(touch.place_mm, [x, 1.0]);
        assert_eq!(shape.depth_mm([x, 1.0, height - 3.01]), f64::NEG_INFINITY);
        assert!(shape.depth_mm([x, 1.0, height - 2.99]) > 1.0);
        assert!(shape.depth_mm([x, 1.0, height + 0.5]) < -0.3);
    }
    // Far above, the relief is no nearer than its greatest height. That is a bound with room above
    // the 1 mm of the sine.
    let Form::Relief(relief) = shape.form() else { panic!() };
    let [low, high] = relief.bounds_mm;
    assert!(low < -1.0 && high > 1.0 && high < 1.6);
    assert!((shape.depth_mm([0.0, 0.0, 50.0]) + 50.0 - high).abs() < 1e-9);
    // Beside the relief, the edge is the nearest. Lower than that nothing is felt. The edge at x = 15 is
    // at height 0.
    let beside = shape.touch([18.0, 0.0, 4.0], None, 0.1).unwrap();
    assert!((beside.depth_mm + 5.0).abs() < 1e-3 && near(beside.normal, [0.6, 0.0, 0.8], 1e-3), "{beside:?}");
    assert_eq!(shape.depth_mm([18.0, 0.0, -0.1]), f64::NEG_INFINITY);
}

#[test]
fn shapes_that_cannot_be_are_refused() {
    let error = |shape: Result<Shape, asperity_diagnostics::Diagnostic>| shape.unwrap_err().to_string();
    let (nan, infinite) = (f64::NAN, f64::INFINITY);
    assert!(error(Shape::rectangle([0.0, 1.0], 1.0)).starts_with("a rectangle of 0 mm along x (from 0.001"));
    assert!(error(Shape::rectangle([1.0, nan], 1.0)).starts_with("a rectangle of NaN mm along y"));
    assert!(error(Shape::rectangle([1.0, infinite], 1.0)).contains("endless is `plane`"));
    assert!(error(Shape::rectangle([1.0, 1.0], 0.0)).starts_with("a rectangle 0 mm thick"));
    assert!(error(Shape::sphere(-1.0)).starts_with("a sphere of radius -1 mm"));
    assert!(error(Shape::sphere(nan)).contains("from 0.001 to 100000 mm"));
    assert!(error(Shape::cuboid([1.0, 1.0, 0.0])).starts_with("a box of 0 mm along z"));
    let grid = waves(0.5, false);
    assert!(error(Shape::relief(grid.clone(), Some([20.0, 1.0]), 1.0, 1.0)).contains("end after 19.8"));
    assert!(error(Shape::relief(grid.clone(), None, nan, 1.0)).starts_with("heights times NaN"));
    assert!(error(Shape::relief(grid.clone(), None, 1e6, 1.0)).contains("within 100000 mm"));
    assert!(error(Shape::relief(grid, None, 1.0, nan)).starts_with("a relief NaN mm thick"));
}

fn any_shape() -> impl Strategy<Value = Shape> {
    let size = || 1.0..20.0f64;
    prop_oneof![
        Just(Shape::plane()),
        (size(), size(), size()).prop_map(|(x, y, t)| Shape::rectangle([x, y], t).unwrap()),
        size().prop_map(|r| Shape::sphere(r).unwrap()),
        (size(), size(), size()).prop_map(|(x, y, z)| Shape::cuboid([x, y, z]).unwrap()),
        (size(), size(), -1.0..1.0f64).prop_map(|(x, y, scale)| Shape::relief(
            waves(0.5, true),
            Some([x, y]),
            scale,
            5.0
        )
        .unwrap()),
    ]
}

proptest! {
    #[test]
    fn normals_point_out_and_places_run_along_tangents(
        shape in any_shape(),
        turn in proptest::array::uniform3(-180.0..180.0f64),
        at in proptest::array::uniform3(-12.0..12.0f64),
        last in proptest::option::of(0..6u8),
    ) {
        let surface = Surface { pose: Pose::new([5.0, -3.0, 2.0], turn).unwrap(), shape };
        let point = surface.pose.to_world(at);
        let Some(touch) = surface.touch(point, last, 0.3) else {
            prop_assert_eq!(surface.depth_mm(point), f64::NEG_INFINITY);
            return Ok(());
        };
        let ([t, u], n) = (touch.tangents, touch.normal);
        for (a, b, want) in [(n, n, 1.0), (t, t, 1.0), (u, u, 1.0), (n, t, 0.0), (n, u, 0.0), (t, u, 0.0)] {
            prop_assert!((dot(a, b) - want).abs() < 1e-9, "{:?}", touch);
        }
        prop_assert!(near(cross(t, u), n, 1e-9), "left-handed {:?}", touch);
        let e = 1e-5;
        let moved = |way: Vector| {
            let to = std::array::from_fn(|k| point[k] + e * way[k]);
            surface.touch(to, Some(touch.feature), 0.3).filter(|t| t.feature == touch.feature)
        };
        let relief = matches!(surface.shape.form(), Form::Relief(_));
        // The normal of a relief is that of the surface below. Its depth is an estimate with the slope in
        // it.
        if let Some(out) = moved(n).filter(|_| !relief) {
            prop_assert!(((touch.depth_mm - out.depth_mm) / e - 1.0).abs() < 1e-3, "{:?} {:?}", touch, out);
        }
        let (Some(a), Some(b)) = (moved(t), moved(u)) else { return Ok(()) };
        if !relief {
            prop_assert!(((a.depth_mm - touch.depth_mm) / e).abs() < 1e-3);
            prop_assert!(((b.depth_mm - touch.depth_mm) / e).abs() < 1e-3);
        }
        // Inside one face, places are continuous and grow along the tangents.
        let rate = |to: &Touch, k: usize| (to.place_mm[k] - touch.place_mm[k]) / e;
        let far = [a, b].iter().flat_map(|m| [rate(m, 0).abs(), rate(m, 1).abs()]).fold(0.0, most);
        prop_assert!(far < 60.0, "{:?} jumps by {}", touch, far * e);
        let flat = touch.depth_mm > 0.0
            && !matches!(surface.shape.form(), Form::Sphere { .. } | Form::Relief(_));
        if flat {
            let rates = [rate(&a, 0), rate(&a, 1), rate(&b, 0), rate(&b, 1)];
            prop_assert!(
                rates.iter().zip([1.0, 0.0, 0.0, 1.0]).all(|(r, w)| (r - w).abs() < 1e-4),
                "{:?}",
                rates
            );
        }
        if let Form::Sphere { radius_mm } = surface.shape.form() {
            // Areas of the map are larger by a / sin a, and none is mirrored.
            let from = radius_mm - touch.depth_mm;
            let angle = touch.place_mm[0].hypot(touch.place_mm[1]) / radius_mm;
            let grown = (rate(&a, 0) * rate(&b, 1) - rate(&a, 1) * rate(&b, 0)) * (from / radius_mm).powi(2);
            let want = if angle > 1e-6 { angle / angle.sin() } else { 1.0 };
            prop_assert!(from < 0.5 || (grown / want - 1.0).abs() < 1e-2, "{} {}", grown, want);
        }
    }

    #[test]
    fn no_depth_changes_faster_than_the_point_moves(
        shape in any_shape(),
        at in proptest::array::uniform3(-12.0..12.0f64),
        step in proptest::array::uniform3(-0.5..0.5f64),
    ) {
        // The estimate of a relief can change faster. One-sided shapes begin and end.
        if matches!(shape.form(), Form::Relief(_)) {
            return Ok(());
        }
        let to = std::array::from_fn(|k| at[k] + step[k]);
        let (a, b) = (shape.depth_mm(at), shape.depth_mm(to));
        let both = a.is_finite() && b.is_finite() && (a > 0.0) == (b > 0.0);
        prop_assert!(!both || (a - b).abs() <= norm(step) + 1e-12, "{} {}", a, b);
    }
}
