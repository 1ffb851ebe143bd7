//! Outlines of surfaces seen from above, along -z: x and y in millimetres.

use asperity_scene::space::{Form, Surface, WORLD_MM};

/// A place on x and y.
pub(super) type Point = [f64; 2];
/// Least and greatest x and y.
pub(super) type Bounds = [Point; 2];

/// A plane is upright if the upward component of its normal is below this.
const UPRIGHT: f64 = 1e-6;

/// Corners of a surface's convex outline; none of a plane, which is everywhere. A rectangle has its upper
/// face, a relief its rectangle at height 0, an upright plane a line that ends outside the world.
pub fn outline(surface: &Surface) -> Option<Vec<Point>> {
    let pose = &surface.pose;
    let seen = |at: [f64; 3]| {
        let [x, y, _] = pose.to_world(at);
        [x, y]
    };
    let face = |[x, y]: [f64; 2]| {
        let corners = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]];
        corners.map(|[a, b]| seen([a * x, b * y, 0.0])).to_vec()
    };
    Some(match surface.shape.form() {
        Form::Plane => {
            let [nx, ny, nz] = pose.vector_to_world([0.0, 0.0, 1.0]);
            if nz.abs() > UPRIGHT {
                return None;
            }
            let ([x, y], far) = (seen([0.0; 3]), 4.0 * WORLD_MM);
            vec![[x - far * ny, y + far * nx], [x + far * ny, y - far * nx]]
        }
        Form::Rectangle { size_mm, .. } => face(*size_mm),
        Form::Relief(relief) => face(relief.size_mm),
        Form::Sphere { radius_mm: r } => {
            let [x, y] = seen([0.0; 3]);
            // As many corners as keep within half a pixel where the view is smallest.
            let count = (std::f64::consts::PI * (80.0 * r).sqrt()).clamp(16.0, 16384.0) as usize;
            let turn = std::f64::consts::TAU / count as f64;
            let corner = |i: usize| (turn * i as f64).sin_cos();
            (0..count).map(corner).map(|(sin, cos)| [x + r * cos, y + r * sin]).collect()
        }
        Form::Box { size_mm } => {
            let half =
                |i: usize, k: usize| if i >> k & 1 == 1 { 0.5 * size_mm[k] } else { -0.5 * size_mm[k] };
            hull((0..8).map(|i| seen([0, 1, 2].map(|k| half(i, k)))).collect())
        }
    })
}

/// Least and greatest of the finite points.
pub fn bounds(points: impl Iterator<Item = Point>) -> Option<Bounds> {
    points.filter(|p| p.iter().all(|v| v.is_finite())).fold(None, |all: Option<Bounds>, p| {
        let [low, high] = all.unwrap_or([p, p]);
        Some([[low[0].min(p[0]), low[1].min(p[1])], [high[0].max(p[0]), high[1].max(p[1])]])
    })
}

/// Whether two bounds share a point.
pub(super) fn meet(a: Bounds, b: Bounds) -> bool {
    (0..2).all(|k| a[0][k] <= b[1][k] && b[0][k] <= a[1][k])
}

/// The convex hull, counterclockwise, without points inside its edges (A. M. Andrew, "Another efficient
/// algorithm for convex hulls in two dimensions", 1979).
pub(super) fn hull(mut points: Vec<Point>) -> Vec<Point> {
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    points.dedup();
    if points.len() < 3 {
        return points;
    }
    let chain = |points: &mut dyn Iterator<Item = &Point>| {
        let mut chain: Vec<Point> = Vec::new();
        for p in points {
            while let [.., a, b] = chain[..]
                && left_of(a, b, *p) <= 0.0
            {
                chain.pop();
            }
            chain.push(*p);
        }
        chain.pop();
        chain
    };
    let mut lower = chain(&mut points.iter());
    lower.extend(chain(&mut points.iter().rev()));
    lower
}

/// Above 0 where `p` lies left of the line from `a` to `b`.
pub(super) fn left_of(a: Point, b: Point, p: Point) -> f64 {
    (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])
}

/// The part of a convex polygon within bounds, edges included (I. E. Sutherland, G. W. Hodgman, "Reentrant
/// polygon clipping", 1974).
pub(super) fn clipped(polygon: &[Point], [low, high]: Bounds) -> Vec<Point> {
    let mut points = polygon.to_vec();
    for (axis, edge, sign) in [(0, low[0], 1.0), (0, high[0], -1.0), (1, low[1], 1.0), (1, high[1], -1.0)] {
        let within = |p: &Point| sign * (p[axis] - edge) >= 0.0;
        let mut kept: Vec<Point> = Vec::with_capacity(points.len() + 1);
        let before = points.last().copied().into_iter().chain(points.iter().copied());
        for (a, b) in before.zip(&points) {
            if within(&a) != within(b) {
                let part = (edge - a[axis]) / (b[axis] - a[axis]);
                let mut cross = [a[0] + part * (b[0] - a[0]), a[1] + part * (b[1] - a[1])];
                cross[axis] = edge;
                kept.push(cross);
            }
            if within(b) {
                kept.push(*b);
            }
        }
        points = kept;
    }
    points.dedup();
    points
}

#[cfg(test)]
#[path = "outline_tests.rs"]
mod tests;
