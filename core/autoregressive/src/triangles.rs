use delaunator::{Point, triangulate};

/// The models at a point and their weights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blend {
    /// Three models by number. One may stand there twice, then with weight 0.
    pub models: [usize; 3],
    /// Weights, 0 to 1, with a sum of 1.
    pub weights: [f64; 3],
}

/// Points (speed in mm/s, force in N) and triangles between them.
#[derive(Clone, Debug, PartialEq)]
pub struct Triangles {
    /// In parts of the range on each axis.
    points: Vec<[f64; 2]>,
    origin: [f64; 2],
    extent: [f64; 2],
    triangles: Vec<[usize; 3]>,
    /// Edges of all triangles as pairs of points, each once.
    edges: Vec<[usize; 2]>,
}

/// Twice the least area of a triangle, in parts of the range. Thinner ones hold no point that their edges do
/// not.
const LEAST_AREA: f64 = 1e-12;
/// Allowed difference between the triangles' area and the hull's, as a part.
const AREA_TOLERANCE: f64 = 0.01;
/// Larger than any speed or force.
const FAR: f64 = 1e9;

impl Triangles {
    /// Delaunay's triangulation of points (speed in mm/s, force in N): finite, at least one. Each axis
    /// counts in parts of its range. Points on a line are joined along it.
    pub fn delaunay(points: &[[f64; 2]]) -> Self {
        let mut it = Self::unconnected(points);
        let places: Vec<Point> = it.points.iter().map(|&[x, y]| Point { x, y }).collect();
        let made = triangulate(&places);
        let corners = made.triangles.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
        it.connect(corners);
        it
    }

    /// Takes given triangles, corners by number. None where a corner is no point, or where the
    /// triangles do not tile the hull: their areas must sum to its area within 1 %.
    pub fn given(points: &[[f64; 2]], triangles: &[[usize; 3]]) -> Option<Self> {
        let mut it = Self::unconnected(points);
        if triangles.iter().flatten().any(|&i| i >= points.len()) {
            return None;
        }
        it.connect(triangles.to_vec());
        let area = |t: &Self| t.triangles.iter().map(|t| it.doubled_area(t).abs()).sum::<f64>();
        let (found, hull) = (area(&it), area(&Self::delaunay(points)));
        ((found - hull).abs() <= AREA_TOLERANCE * hull).then_some(it)
    }

    /// The triangles, corners by number.
    pub fn corners(&self) -> &[[usize; 3]] {
        &self.triangles
    }

    /// Numbers of the points on the convex hull, around it. Of points on a line it is all, from one end
    /// to the other.
    pub fn hull(&self) -> Vec<usize> {
        let places: Vec<Point> = self.points.iter().map(|&[x, y]| Point { x, y }).collect();
        triangulate(&places).hull
    }

    fn unconnected(points: &[[f64; 2]]) -> Self {
        let ranges = [0, 1].map(|axis| range(points.iter().map(|p| p[axis])));
        let origin = ranges.map(|[low, _]| low);
        let extent = ranges.map(|[low, high]| if high > low { high - low } else { 1.0 });
        let mut it = Self { points: Vec::new(), origin, extent, triangles: Vec::new(), edges: Vec::new() };
        it.points = points.iter().map(|&p| it.place(p)).collect();
        it
    }

    fn place(&self, point: [f64; 2]) -> [f64; 2] {
        std::array::from_fn(|i| (point[i].clamp(-FAR, FAR) - self.origin[i]) / self.extent[i])
    }

    fn doubled_area(&self, &[a, b, c]: &[usize; 3]) -> f64 {
        cross(self.points[a], self.points[b], self.points[c])
    }

    /// Keeps the triangles that have an area, and lists their edges.
    fn connect(&mut self, mut triangles: Vec<[usize; 3]>) {
        triangles.retain(|t| self.doubled_area(t).abs() > LEAST_AREA);
        self.triangles = triangles;
        let mut edges: Vec<[usize; 2]> = self
            .triangles
            .iter()
            .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
            .map(|[a, b]| [a.min(b), a.max(b)])
            .collect();
        edges.sort_unstable();
        edges.dedup();
        self.edges = if edges.is_empty() { self.chain() } else { edges };
    }

    /// Neighbours along the line on which all points lie. A lone point is its own neighbour.
    fn chain(&self) -> Vec<[usize; 2]> {
        let mut order: Vec<usize> = (0..self.points.len()).collect();
        order.sort_by(|&a, &b| {
            let ([ax, ay], [bx, by]) = (self.points[a], self.points[b]);
            ax.total_cmp(&bx).then(ay.total_cmp(&by))
        });
        match order.as_slice() {
            [only] => vec![[*only, *only]],
            order => order.windows(2).map(|pair| [pair[0], pair[1]]).collect(),
        }
    }

    /// Weights at a speed in mm/s and a force in N: of the corners of the triangle around the point,
    /// else of the nearest edge at its nearest point. NaN counts as the least value of its axis.
    pub fn at(&self, speed_mm_s: f64, force_n: f64) -> Blend {
        let given = [speed_mm_s, force_n];
        let point =
            self.place(std::array::from_fn(|i| if given[i].is_nan() { self.origin[i] } else { given[i] }));
        let around = self.triangles.iter().find_map(|&[a, b, c]| {
            let [pa, pb, pc] = [a, b, c].map(|i| self.points[i]);
            let whole = cross(pa, pb, pc);
            let weights =
                [cross(point, pb, pc) / whole, cross(pa, point, pc) / whole, cross(pa, pb, point) / whole];
            weights.iter().all(|w| *w >= 0.0).then_some(Blend { models: [a, b, c], weights })
        });
        around.unwrap_or_else(|| self.at_edge(point))
    }

    /// The nearest point of any edge. Points outside are nearest to the hull. Points that rounding puts
    /// outside both triangles of an inner edge are on that edge.
    fn at_edge(&self, point: [f64; 2]) -> Blend {
        let mut nearest = (f64::INFINITY, Blend { models: [0; 3], weights: [1.0, 0.0, 0.0] });
        for &[a, b] in &self.edges {
            let (pa, pb) = (self.points[a], self.points[b]);
            let along = [pb[0] - pa[0], pb[1] - pa[1]];
            let length = along[0] * along[0] + along[1] * along[1];
            let to = (point[0] - pa[0]) * along[0] + (point[1] - pa[1]) * along[1];
            let part = if length > 0.0 { (to / length).clamp(0.0, 1.0) } else { 0.0 };
            let off = [point[0] - pa[0] - part * along[0], point[1] - pa[1] - part * along[1]];
            let distance = off[0] * off[0] + off[1] * off[1];
            if distance < nearest.0 {
                nearest = (distance, Blend { models: [a, b, b], weights: [1.0 - part, part, 0.0] });
            }
        }
        nearest.1
    }
}

/// Least and greatest value.
pub(super) fn range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
}

/// Twice the signed area of a triangle.
fn cross(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The point that a blend stands for.
    fn point(points: &[[f64; 2]], blend: &Blend) -> [f64; 2] {
        std::array::from_fn(|axis| {
            blend.models.iter().zip(blend.weights).map(|(m, w)| w * points[*m][axis]).sum()
        })
    }

    #[test]
    fn weights_give_the_point_or_its_nearest_on_the_hull() {
        let points = [[10.0, 0.5], [100.0, 0.5], [100.0, 2.5], [10.0, 2.5], [40.0, 1.2]];
        let all = Triangles::delaunay(&points);
        assert_eq!(all.corners().len(), 4);
        for (at, want) in [
            ([55.0, 1.7], [55.0, 1.7]),
            ([10.0, 0.5], [10.0, 0.5]),
            ([40.0, 1.2], [40.0, 1.2]),
            ([50.0, 9.0], [50.0, 2.5]),
            ([0.0, 0.0], [10.0, 0.5]),
            ([f64::INFINITY, 1.0], [100.0, 1.0]),
            ([f64::NAN, 1.0], [10.0, 1.0]),
        ] {
            let blend = all.at(at[0], at[1]);
            let found = point(&points, &blend);
            assert!(
                (found[0] - want[0]).abs() < 1e-6 && (found[1] - want[1]).abs() < 1e-6,
                "{at:?}: {found:?}"
            );
            assert!((blend.weights.iter().sum::<f64>() - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn point_on_an_edge_is_within_a_triangle() {
        let mut random = asperity_numbers::Random::new(8);
        let points: Vec<[f64; 2]> =
            (0..30).map(|_| [random.range(0.0, 300.0), random.range(0.1, 3.0)]).collect();
        let all = Triangles::delaunay(&points);
        for &[a, b, c] in all.corners() {
            for part in (1..50).map(|i| f64::from(i) / 50.0) {
                for (from, to) in [(a, b), (b, c), (c, a)].map(|(i, j)| (points[i], points[j])) {
                    let at: [f64; 2] = std::array::from_fn(|i| from[i] + part * (to[i] - from[i]));
                    let found = point(&points, &all.at(at[0], at[1]));
                    assert!((0..2).all(|i| (found[i] - at[i]).abs() < 1e-6), "{at:?}: {found:?}");
                }
            }
        }
    }

    #[test]
    fn one_point_and_a_line_have_weights() {
        let one = Triangles::delaunay(&[[50.0, 1.0]]);
        assert_eq!(point(&[[50.0, 1.0]], &one.at(3.0, 0.2)), [50.0, 1.0]);
        let line = [[90.0, 1.0], [30.0, 1.0], [60.0, 1.0]];
        let all = Triangles::delaunay(&line);
        assert!(all.corners().is_empty());
        assert_eq!(point(&line, &all.at(45.0, 2.0)), [45.0, 1.0]);
        assert_eq!(point(&line, &all.at(200.0, 0.1)), [90.0, 1.0]);
        assert_eq!((one.hull(), all.hull()), (vec![0], vec![1, 2, 0]));
    }

    #[test]
    fn triangles_not_tiling_the_hull_are_refused() {
        let points = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        assert!(Triangles::given(&points, &[[0, 1, 3], [1, 2, 3]]).is_some());
        assert!(Triangles::given(&points, &[[0, 1, 3]]).is_none());
        assert!(Triangles::given(&points, &[[0, 1, 4], [1, 2, 3]]).is_none());
    }

    proptest! {
        #[test]
        fn weights_are_valid_everywhere(
            points in proptest::collection::vec((0.0..300.0f64, 0.0..4.0f64), 1..20),
            speed in -50.0..500.0f64,
            force in -1.0..6.0f64,
        ) {
            let points: Vec<[f64; 2]> = points.into_iter().map(|(v, f)| [v, f]).collect();
            let blend = Triangles::delaunay(&points).at(speed, force);
            prop_assert!(blend.weights.iter().all(|w| (-1e-12..=1.0 + 1e-9).contains(w)), "{blend:?}");
            prop_assert!((blend.weights.iter().sum::<f64>() - 1.0).abs() < 1e-6);
            prop_assert!(blend.models.iter().all(|m| *m < points.len()));
        }
    }
}
