//! Projections against rays straight down and by hand.

use asperity_scene::space::{HeightGrid, Pose, Shape};
use proptest::prelude::*;
use std::sync::Arc;

use super::*;

/// Corners of a shape; none of a plane that is everywhere.
fn seen(shape: Shape, place_mm: [f64; 3], turn_deg: [f64; 3]) -> Vec<Point> {
    outline(&Surface { shape, pose: Pose::new(place_mm, turn_deg).unwrap() }).unwrap_or_default()
}

/// Same corners, whichever is first.
fn same(found: &[Point], want: &[Point]) -> bool {
    let near = |a: &Point, b: &Point| (a[0] - b[0]).hypot(a[1] - b[1]) < 1e-9;
    found.len() == want.len() && want.iter().all(|w| found.iter().any(|f| near(f, w)))
}

/// Inside a convex polygon or on its edge, of either order.
fn within(polygon: &[Point], p: Point, slack: f64) -> bool {
    let edges = polygon.iter().zip(polygon.iter().cycle().skip(1));
    let sides: Vec<f64> =
        edges.map(|(a, b)| left_of(*a, *b, p) / (b[0] - a[0]).hypot(b[1] - a[1]).max(1e-12)).collect();
    sides.iter().all(|s| *s >= -slack) || sides.iter().all(|s| *s <= slack)
}

#[test]
fn rectangle_is_turned_as_by_hand() {
    let shape = || Shape::rectangle([20.0, 10.0], 5.0).unwrap();
    let flat = seen(shape(), [1.0, 2.0, 3.0], [0.0; 3]);
    assert!(same(&flat, &[[-9.0, -3.0], [11.0, -3.0], [11.0, 7.0], [-9.0, 7.0]]));
    let quarter = seen(shape(), [1.0, 2.0, 3.0], [0.0, 0.0, 90.0]);
    assert!(same(&quarter, &[[-4.0, -8.0], [6.0, -8.0], [6.0, 12.0], [-4.0, 12.0]]));
    // Tilted by 60 degrees about y, its x is half as long.
    let tilted = seen(shape(), [0.0; 3], [0.0, 60.0, 0.0]);
    assert!(same(&tilted, &[[-5.0, -5.0], [5.0, -5.0], [5.0, 5.0], [-5.0, 5.0]]));
    // From the side it is a line.
    let upright = seen(shape(), [0.0; 3], [90.0, 0.0, 0.0]);
    assert!(upright.iter().all(|[x, y]| x.abs() == 10.0 && y.abs() < 1e-12));
}

#[test]
fn relief_is_a_rectangle_and_sphere_a_circle() {
    let grid = Arc::new(HeightGrid::new(8, vec![0.5; 64], [1.0; 2], true).unwrap());
    let relief = seen(Shape::relief(grid, Some([6.0, 4.0]), 1.0, 5.0).unwrap(), [0.0; 3], [0.0, 0.0, 45.0]);
    let (a, b) = (5.0 / 2.0_f64.sqrt(), 1.0 / 2.0_f64.sqrt());
    assert!(same(&relief, &[[-b, -a], [a, b], [b, a], [-a, -b]]), "{relief:?}");

    let ball = seen(Shape::sphere(3.0).unwrap(), [1.0, 2.0, 9.0], [10.0, 20.0, 30.0]);
    assert!(ball.iter().all(|p| ((p[0] - 1.0).hypot(p[1] - 2.0) - 3.0).abs() < 1e-9));
    assert!(ball.len() > 40, "{ball:?}");
}

#[test]
fn plane_is_everywhere_unless_upright() {
    for turn in [[0.0; 3], [180.0, 0.0, 0.0], [60.0, 20.0, 0.0]] {
        assert_eq!(seen(Shape::plane(), [0.0; 3], turn), Vec::<Point>::new(), "{turn:?}");
    }
    // Its normal is along -y; it runs along x through the place.
    let upright = seen(Shape::plane(), [5.0, 7.0, 0.0], [90.0, 0.0, 0.0]);
    let [a, b] = upright[..] else { panic!("{upright:?}") };
    assert!((a[1] - 7.0).abs() < 1e-6 && (b[1] - 7.0).abs() < 1e-6);
    assert!(a[0].min(b[0]) < -WORLD_MM && a[0].max(b[0]) > WORLD_MM);
}

#[test]
fn box_on_its_corner_is_a_regular_hexagon() {
    // The cube's diagonal upright: turned by 45 degrees about x, then by atan(1 / sqrt 2) about y.
    let tip = (1.0 / 2.0_f64.sqrt()).atan().to_degrees();
    let hexagon = seen(Shape::cuboid([2.0; 3]).unwrap(), [0.0; 3], [45.0, -tip, 0.0]);
    assert_eq!(hexagon.len(), 6, "{hexagon:?}");
    let radius = (8.0_f64 / 3.0).sqrt();
    assert!(hexagon.iter().all(|p| (p[0].hypot(p[1]) - radius).abs() < 1e-9), "{hexagon:?}");
    let flat = seen(Shape::cuboid([2.0, 4.0, 6.0]).unwrap(), [0.0; 3], [0.0; 3]);
    assert!(same(&flat, &[[-1.0, -2.0], [1.0, -2.0], [1.0, 2.0], [-1.0, 2.0]]));
}

#[test]
fn empty_shapes_have_no_hull_and_no_bounds() {
    assert_eq!(hull(Vec::new()), Vec::<Point>::new());
    assert_eq!(hull(vec![[1.0, 1.0]; 5]), [[1.0, 1.0]]);
    assert_eq!(bounds([[f64::NAN, 0.0], [f64::INFINITY, 1.0]].into_iter()), None);
    assert!(clipped(&[], [[0.0; 2], [1.0; 2]]).is_empty());
    assert!(clipped(&[[2.0, 2.0], [3.0, 2.0], [3.0, 3.0]], [[0.0; 2], [1.0; 2]]).is_empty());
}

#[test]
fn endless_line_is_cut_to_the_frame() {
    let line = clipped(&[[-4e5, 3.0], [4e5, 3.0]], [[0.0; 2], [10.0; 2]]);
    assert!(line.contains(&[0.0, 3.0]) && line.contains(&[10.0, 3.0]), "{line:?}");
}

proptest! {
    /// A point is in a box's outline where a line straight down through it meets the box (by slabs).
    #[test]
    fn vertical_line_meets_what_its_outline_holds(
        size in proptest::array::uniform3(1.0..40.0f64),
        turn in proptest::array::uniform3(-180.0..180.0f64),
        at in proptest::array::uniform2(-40.0..40.0f64),
    ) {
        let pose = Pose::new([3.0, -5.0, 7.0], turn).unwrap();
        let surface = Surface { shape: Shape::cuboid(size).unwrap(), pose };
        let (from, way) = (pose.to_local([at[0], at[1], 0.0]), pose.vector_to_local([0.0, 0.0, 1.0]));
        let (mut first, mut last, mut clear) = (f64::MIN, f64::MAX, 1.0_f64);
        for k in 0..3 {
            if way[k].abs() < 1e-12 {
                clear = clear.min((from[k].abs() - 0.5 * size[k]).abs());
                if from[k].abs() > 0.5 * size[k] {
                    last = f64::MIN;
                }
                continue;
            }
            let ends = [(-0.5 * size[k] - from[k]) / way[k], (0.5 * size[k] - from[k]) / way[k]];
            first = first.max(ends[0].min(ends[1]));
            last = last.min(ends[0].max(ends[1]));
        }
        let polygon = outline(&surface).unwrap();
        prop_assume!((last - first).abs() > 1e-6 && clear > 1e-6);
        prop_assert_eq!(within(&polygon, at, 1e-9), last > first, "{:?}", polygon);
    }

    #[test]
    fn clipped_polygon_holds_what_both_hold(
        points in proptest::collection::vec(proptest::array::uniform2(-10.0..10.0f64), 3..9),
        low in proptest::array::uniform2(-8.0..0.0f64),
        size in proptest::array::uniform2(1.0..8.0f64),
        at in proptest::array::uniform2(-10.0..10.0f64),
    ) {
        let polygon = hull(points.clone());
        prop_assert!(points.iter().all(|p| within(&polygon, *p, 1e-9)));
        let frame = [low, [low[0] + size[0], low[1] + size[1]]];
        let cut = clipped(&polygon, frame);
        let framed = (0..2).all(|k| (frame[0][k]..=frame[1][k]).contains(&at[k]));
        // Not on an edge, where rounding decides.
        let clear = within(&polygon, at, -1e-6) == within(&polygon, at, 1e-6);
        if clear {
            prop_assert_eq!(cut.len() > 2 && within(&cut, at, 1e-9), framed && within(&polygon, at, 0.0));
        }
    }
}
