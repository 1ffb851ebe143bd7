//! Shapes that can be touched, and the depth or distance of a point.

use std::sync::Arc;

use asperity_diagnostics::Diagnostic;

use super::vector::{Vector, least, most, norm};
use super::{HeightGrid, WORLD_MM};

/// Smallest edge, radius or thickness in millimetres.
pub const LEAST_MM: f64 = 1e-3;

/// Form of a [`Shape`] in its own coordinates, around its middle.
#[derive(Clone, Debug, PartialEq)]
pub enum Form {
    /// z = 0, endless. Outside is +z, and all below is inside.
    Plane,
    /// z = 0 within the sides. Outside is +z. It is touched down to its thickness and no further, so that
    /// a stylus underneath is not thrown out.
    Rectangle {
        /// Size along x and y.
        size_mm: [f64; 2],
        /// Thickness along -z.
        thickness_mm: f64,
    },
    /// A full ball.
    Sphere {
        /// Radius.
        radius_mm: f64,
    },
    /// A full box.
    Box {
        /// Size along x, y and z.
        size_mm: [f64; 3],
    },
    /// A rectangle with heights.
    Relief(Relief),
}

/// Heights over a rectangle. Outside is +z. The first point of the grid lies at the corner of least x and
/// y.
#[derive(Clone, Debug, PartialEq)]
pub struct Relief {
    /// The heights.
    pub grid: Arc<HeightGrid>,
    /// Size along x and y.
    pub size_mm: [f64; 2],
    /// Factor of the heights.
    scale: f64,
    /// Depth below the height at a place down to which it is touched.
    pub thickness_mm: f64,
    /// Lower and upper bound of the scaled heights.
    pub bounds_mm: [f64; 2],
}

impl Relief {
    /// Height in millimetres and slopes at a place, counted from the middle of the rectangle.
    pub fn sample(&self, x_mm: f64, y_mm: f64) -> (f64, [f64; 2]) {
        let s = self.grid.sample(x_mm + 0.5 * self.size_mm[0], y_mm + 0.5 * self.size_mm[1]);
        (self.scale * s.height_mm, [self.scale * s.slope[0], self.scale * s.slope[1]])
    }

    /// Position of a point relative to the relief. `None` where the point is not felt.
    pub(super) fn over(&self, at: Vector) -> Option<Over> {
        let ([x, y, z], [lowest, highest]) = (at, self.bounds_mm);
        if z < lowest - self.thickness_mm {
            return None;
        }
        let beside = beside(at, self.size_mm);
        let (height, slope) = self.sample(x - beside[0], y - beside[1]);
        let depth = height - z;
        let depth_mm = if beside != [0.0; 2] {
            edge(beside, -depth)
        } else if depth > self.thickness_mm {
            f64::NEG_INFINITY
        } else {
            // Rounding must not make a point deeper than its greatest height allows.
            least(depth / (1.0 + slope[0] * slope[0] + slope[1] * slope[1]).sqrt(), highest - z)
        };
        Some(Over { depth_mm, beside, height, slope })
    }
}

/// Position of a point relative to a relief.
pub(super) struct Over {
    pub depth_mm: f64,
    /// Distance beside the relief along x and y.
    pub beside: [f64; 2],
    /// Height of the relief at the nearest place along x and y.
    pub height: f64,
    pub slope: [f64; 2],
}

/// A shape that can be touched: a [`Form`] with checked figures.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape(Form);

impl Shape {
    /// Makes an endless plane.
    pub fn plane() -> Self {
        Self(Form::Plane)
    }

    /// Makes a rectangle.
    ///
    /// # Errors
    /// The sides or the thickness are not from [`LEAST_MM`] to [`WORLD_MM`].
    pub fn rectangle(size_mm: [f64; 2], thickness_mm: f64) -> Result<Self, Diagnostic> {
        length("a rectangle", "x", size_mm[0])?;
        length("a rectangle", "y", size_mm[1])?;
        thickness("a rectangle", thickness_mm)?;
        Ok(Self(Form::Rectangle { size_mm, thickness_mm }))
    }

    /// Makes a sphere.
    ///
    /// # Errors
    /// The radius is not from [`LEAST_MM`] to [`WORLD_MM`].
    pub fn sphere(radius_mm: f64) -> Result<Self, Diagnostic> {
        within(radius_mm, format!("a sphere of radius {radius_mm} mm"), "")?;
        Ok(Self(Form::Sphere { radius_mm }))
    }

    /// Makes a box.
    ///
    /// # Errors
    /// The edges are not from [`LEAST_MM`] to [`WORLD_MM`].
    pub fn cuboid(size_mm: [f64; 3]) -> Result<Self, Diagnostic> {
        for (axis, size) in ["x", "y", "z"].into_iter().zip(size_mm) {
            length("a box", axis, size)?;
        }
        Ok(Self(Form::Box { size_mm }))
    }

    /// Makes a relief: heights over a rectangle, or over the whole grid if no size is given. Heights are
    /// multiplied by `scale`.
    ///
    /// # Errors
    /// - The sides or the thickness are not from [`LEAST_MM`] to [`WORLD_MM`].
    /// - The sides are beyond a grid that ends.
    /// - The scale is not a number, or takes heights out of the world.
    pub fn relief(
        grid: Arc<HeightGrid>,
        size_mm: Option<[f64; 2]>,
        scale: f64,
        thickness_mm: f64,
    ) -> Result<Self, Diagnostic> {
        let extent = grid.extent_mm();
        let size_mm = size_mm.unwrap_or(extent);
        for (axis, (size, extent)) in ["x", "y"].into_iter().zip(size_mm.into_iter().zip(extent)) {
            length("a relief", axis, size)?;
            if !grid.repeats && size > extent * (1.0 + 1e-9) {
                return Err(Diagnostic::new(format!(
                    "a relief of {size} mm along {axis} over heights that end after {extent} mm"
                ))
                .help("a smaller relief, or heights that repeat"));
            }
        }
        thickness("a relief", thickness_mm)?;
        let [low, high] = grid.bounds_mm.map(|h| h * scale);
        if !(low.abs() <= WORLD_MM && high.abs() <= WORLD_MM) {
            return Err(Diagnostic::new(format!("heights times {scale}"))
                .help(format!("a number that leaves heights within {WORLD_MM} mm")));
        }
        let bounds_mm = [least(low, high), most(low, high)];
        Ok(Self(Form::Relief(Relief { grid, size_mm, scale, thickness_mm, bounds_mm })))
    }

    /// Form of the shape.
    pub fn form(&self) -> &Form {
        &self.0
    }

    /// Depth of a point inside the shape in millimetres, in the shape's coordinates. Outside it is minus
    /// the distance. It is minus infinity where a one-sided shape is not felt: beneath its thickness, and
    /// beside it below its edge.
    ///
    /// For a plane, a sphere and a box, depth is the distance to the surface (to the nearest face of a
    /// box). For a rectangle it is the distance to the upper face. For a relief it is
    /// `(h - z) / sqrt(1 + |grad h|^2)`, the distance to the plane that touches it at the same x and y.
    /// The distance outside a relief is the same, or that to its greatest height if that is further.
    #[inline]
    pub fn depth_mm(&self, at: [f64; 3]) -> f64 {
        let z = at[2];
        match &self.0 {
            Form::Plane => -z,
            Form::Sphere { radius_mm } => radius_mm - norm(at),
            Form::Box { size_mm } => {
                let over: Vector = std::array::from_fn(|k| at[k].abs() - 0.5 * size_mm[k]);
                let nearest = most(most(over[0], over[1]), over[2]);
                if nearest <= 0.0 { -nearest } else { -norm(over.map(|e| most(e, 0.0))) }
            }
            Form::Rectangle { size_mm, thickness_mm } => {
                let beside = beside(at, *size_mm);
                if beside != [0.0; 2] {
                    edge(beside, z)
                } else if z < -thickness_mm {
                    f64::NEG_INFINITY
                } else {
                    -z
                }
            }
            Form::Relief(relief) => relief.over(at).map_or(f64::NEG_INFINITY, |o| o.depth_mm),
        }
    }
}

/// Signed distance of a point beside a rectangle along x and y; 0 above and below it.
pub(super) fn beside(at: Vector, size_mm: [f64; 2]) -> [f64; 2] {
    std::array::from_fn(|k| {
        let half = 0.5 * size_mm[k];
        if at[k] > half {
            at[k] - half
        } else if at[k] < -half {
            at[k] + half
        } else {
            0.0
        }
    })
}

/// Minus the distance of a point beside an edge and `z` above it.
fn edge([x, y]: [f64; 2], z: f64) -> f64 {
    if z < 0.0 { f64::NEG_INFINITY } else { -norm([x, y, z]) }
}

fn length(what: &str, axis: &str, size: f64) -> Result<(), Diagnostic> {
    within(size, format!("{what} of {size} mm along {axis}"), "; endless is `plane`")
}

fn thickness(what: &str, thickness_mm: f64) -> Result<(), Diagnostic> {
    within(thickness_mm, format!("{what} {thickness_mm} mm thick"), ": below it nothing is felt")
}

fn within(size: f64, what: String, hint: &str) -> Result<(), Diagnostic> {
    if (LEAST_MM..=WORLD_MM).contains(&size) {
        return Ok(());
    }
    Err(Diagnostic::new(what).help(format!("from {LEAST_MM} to {WORLD_MM} mm{hint}")))
}
