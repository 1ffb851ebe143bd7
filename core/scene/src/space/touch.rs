//! Place and direction in which a point touches a shape.

use asperity_numbers::Elementary as _;
use asperity_state::{Keep, State};

use super::shape::{Form, Over, Shape, beside};
use super::vector::{Vector, cross, dot, most, scaled, sub, tangents, unit};

/// Sine of the latitude past the equator to which a sphere's half is kept: 5.7 degrees.
const BEYOND_EQUATOR: f64 = 0.1;

/// Touch of a point on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Touch {
    /// Depth of the point inside. Below 0 it is minus the distance outside.
    pub depth_mm: f64,
    /// Outward normal, of length 1: the direction in which the point is pushed. Outside, it is the
    /// direction from the nearest place of the surface to the point.
    pub normal: [f64; 3],
    /// Two directions along the surface, of length 1, right-handed with the normal. The first of
    /// `place_mm` grows along the first.
    pub tangents: [[f64; 3]; 2],
    /// Place on the surface, in coordinates that belong to the surface and are continuous along a face.
    ///
    /// Plane, rectangle, relief: x and y. Box: the two axes of the face, from its middle. Sphere: arc
    /// lengths from the pole of its half, x and y of the azimuthal equidistant map. These are
    /// `R a (cos l, sin l)`, with `a` the angle from the pole and `l` the longitude. Longitude and
    /// latitude themselves would spin at the poles, where a sphere on a table is touched. On this map,
    /// arcs from the pole are exact. Arcs across are too long by `a / sin a`: 1 at the pole, 1.11 at 45
    /// degrees and at most 1.68.
    pub place_mm: [f64; 2],
    /// Number of the face. A box has 0 to 5 for +x, -x, +y, -y, +z, -z. A sphere has 0 for the half
    /// around +z and 1 for the other. All others have 0.
    pub feature: u8,
}

/// Held surface and its face: the memory that a caller keeps from tick to tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Hold {
    pub(crate) entry: u32,
    /// Number of the face.
    pub(crate) feature: u8,
}

impl Keep for Hold {
    fn keep(&mut self, state: &mut State<'_>) {
        state.keep(&mut self.entry).keep(&mut self.feature);
    }
}

impl Shape {
    /// Touch of a point, all in the shape's coordinates. `None` where the [depth](Self::depth_mm) is
    /// minus infinity.
    ///
    /// Within a box, the face of `last` is kept until another is nearer by more than `hysteresis_mm`. The
    /// face across never takes over. So a stylus that presses through the middle of a plate is pushed
    /// back to where it came from, until it is out. The depth is then that below the kept face. For other
    /// shapes, `last` only keeps a sphere's half, up to 5.7 degrees past the equator.
    pub fn touch(&self, at: [f64; 3], last: Option<u8>, hysteresis_mm: f64) -> Option<Touch> {
        // Computing heights takes longest, so it is done once.
        let over = match self.form() {
            Form::Relief(relief) => Some(relief.over(at)?),
            _ => None,
        };
        let depth_mm = over.as_ref().map_or_else(|| self.depth_mm(at), |o| o.depth_mm);
        if depth_mm == f64::NEG_INFINITY || depth_mm.is_nan() {
            return None;
        }
        let [x, y, z] = at;
        let sheet =
            |normal: Vector, tangents, place_mm| Touch { depth_mm, normal, tangents, place_mm, feature: 0 };
        let flat = ([0.0, 0.0, 1.0], [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        Some(match self.form() {
            Form::Plane => sheet(flat.0, flat.1, [x, y]),
            Form::Sphere { radius_mm } => sphere(*radius_mm, at, depth_mm, last),
            Form::Box { size_mm } => {
                let half = size_mm.map(|s| 0.5 * s);
                if depth_mm >= 0.0 {
                    inside(half, at, last, hysteresis_mm)
                } else {
                    outside(half, at, depth_mm)
                }
            }
            Form::Rectangle { size_mm, .. } => {
                let [dx, dy] = beside(at, *size_mm);
                if [dx, dy] == [0.0; 2] {
                    sheet(flat.0, flat.1, [x, y])
                } else {
                    let (normal, _) = unit([dx, dy, z]);
                    sheet(normal, tangents(normal), [x - dx, y - dy])
                }
            }
            Form::Relief(_) => {
                let Over { beside: [dx, dy], height, slope: [a, b], .. } = over?;
                let place = [x - dx, y - dy];
                if [dx, dy] == [0.0; 2] {
                    let (normal, _) = unit([-a, -b, 1.0]);
                    let (first, _) = unit([1.0, 0.0, a]);
                    sheet(normal, [first, cross(normal, first)], place)
                } else {
                    let (normal, _) = unit([dx, dy, z - height]);
                    sheet(normal, tangents(normal), place)
                }
            }
        })
    }
}

fn sphere(radius_mm: f64, at: Vector, depth_mm: f64, last: Option<u8>) -> Touch {
    let (normal, _) = unit(at);
    let upper = match last {
        Some(0) => normal[2] >= -BEYOND_EQUATOR,
        Some(1) => normal[2] > BEYOND_EQUATOR,
        _ => normal[2] >= 0.0,
    };
    // The other half is the same, turned half around x.
    let turned = |[x, y, z]: Vector| if upper { [x, y, z] } else { [x, -y, -z] };
    let [x, y, z] = turned(normal);
    let sine = x.hypotenuse(y);
    let arc = if sine > 1e-9 { sine.arc_tangent(z) / sine } else { 1.0 };
    Touch {
        depth_mm,
        normal,
        tangents: tangents([x, y, z]).map(turned),
        place_mm: [radius_mm * arc * x, radius_mm * arc * y],
        feature: u8::from(!upper),
    }
}

/// Axis of a face's normal, its sign, and the axes along the face, right-handed with the normal.
fn face(feature: u8) -> (usize, f64, [usize; 2]) {
    let axis = usize::from(feature / 2) % 3;
    let (next, after) = ((axis + 1) % 3, (axis + 2) % 3);
    if feature.is_multiple_of(2) { (axis, 1.0, [next, after]) } else { (axis, -1.0, [after, next]) }
}

fn one(axis: usize) -> Vector {
    std::array::from_fn(|k| if k == axis { 1.0 } else { 0.0 })
}

fn inside(half: Vector, at: Vector, last: Option<u8>, hysteresis_mm: f64) -> Touch {
    let below = |feature: u8| {
        let (axis, sense, _) = face(feature);
        half[axis] - sense * at[axis]
    };
    let nearest = |but: Option<u8>| {
        let faces = (0..6).filter(|f| but.is_none_or(|b| f / 2 != b / 2));
        faces.fold((0, f64::INFINITY), |best, f| if below(f) < best.1 { (f, below(f)) } else { best })
    };
    let (feature, depth_mm) = match last.filter(|f| *f < 6) {
        Some(held) => {
            let rival = nearest(Some(held));
            if below(held) <= rival.1 + hysteresis_mm { (held, below(held)) } else { rival }
        }
        None => nearest(None),
    };
    let (axis, sense, along) = face(feature);
    Touch {
        depth_mm,
        normal: scaled(one(axis), sense),
        tangents: along.map(one),
        place_mm: along.map(|k| at[k]),
        feature,
    }
}

fn outside(half: Vector, at: Vector, depth_mm: f64) -> Touch {
    let nearest: Vector = std::array::from_fn(|k| at[k].clamp(-half[k], half[k]));
    let (normal, _) = unit(sub(at, nearest));
    let size = normal.map(f64::abs);
    let axis = if size[0] >= most(size[1], size[2]) { 0 } else { 1 + usize::from(size[2] > size[1]) };
    let feature = 2 * axis as u8 + u8::from(normal[axis] < 0.0);
    let (_, _, along) = face(feature);
    let first = one(along[0]);
    // Past an edge the normal leans out of the normal of the face, at most as far as at a corner.
    let (first, _) = unit(sub(first, scaled(normal, dot(first, normal))));
    Touch {
        depth_mm,
        normal,
        tangents: [first, cross(normal, first)],
        place_mm: along.map(|k| nearest[k]),
        feature,
    }
}

#[cfg(test)]
#[path = "touch_tests.rs"]
mod tests;
