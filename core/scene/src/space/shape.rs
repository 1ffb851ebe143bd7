//! What can be touched, and how deep or how far off a point is.

use std::sync::Arc;

use asperity_diagnostics::Diagnostic;

use super::vector::{Vector, least, most, norm};
use super::{HeightGrid, WORLD_MM};

/// The least edge, radius or thickness in millimetres.
pub const LEAST_MM: f64 = 1e-3;

/// What a [`Shape`] is, in coordinates of its own, around their middle.
#[derive(Clone, Debug, PartialEq)]
pub enum Form {
    /// z = 0, endless; outside is +z, and all that is below is inside.
    Plane,
    /// z = 0 within the sides; outside is +z. It is touched down to its thickness and no further, so that a stylus underneath is not
    /// thrown out.
    Rectangle {
        /// Along x and y.
        size_mm: [f64; 2],
        /// Along -z.
        thickness_mm: f64,
    },
    /// A full ball.
    Sphere {
        /// Radius.
        radius_mm: f64,
    },
    /// A full box.
    Box {
        /// Along x, y and z.
        size_mm: [f64; 3],
    },
    /// A rectangle with heights.
    Relief(Relief),
}

/// Heights over a rectangle; outside is +z. The grid's first point lies at the rectangle's corner of least x and y.
#[derive(Clone, Debug, PartialEq)]
pub struct Relief {
    grid: Arc<HeightGrid>,
    size_mm: [f64; 2],
    scale: f64,
    thickness_mm: f64,
    /// Of the heights, scaled.
    bounds_mm: [f64; 2],
}

impl Relief {
    /// The heights.
    pub fn grid(&self) -> &Arc<HeightGrid> {
        &self.grid
    }

    /// Along x and y.
    pub fn size_mm(&self) -> [f64; 2] {
        self.size_mm
    }

    /// By what heights are multiplied.
    pub fn scale(&self) -> f64 {
        self.scale
    }

    /// How far below its height at a place it is touched.
    pub fn thickness_mm(&self) -> f64 {
        self.thickness_mm
    }

    /// Heights in millimetres between which all of it lies.
    pub fn bounds_mm(&self) -> [f64; 2] {
        self.bounds_mm
    }

    /// The height in millimetres at a place, counted from the rectangle's middle, and its slopes.
    pub fn sample(&self, x_mm: f64, y_mm: f64) -> (f64, [f64; 2]) {
        let s = self.grid.sample(x_mm + 0.5 * self.size_mm[0], y_mm + 0.5 * self.size_mm[1]);
        (self.scale * s.height_mm, [self.scale * s.slope[0], self.scale * s.slope[1]])
    }

    /// How a point lies to it; none where it is not felt, and outside perhaps unless that is asked for.
    pub(super) fn over<const OUTSIDE: bool>(&self, at: Vector) -> Option<Over> {
        let ([x, y, z], [lowest, highest]) = (at, self.bounds_mm);
        // Most points are far from it, and heights take longest.
        if z < lowest - self.thickness_mm || (!OUTSIDE && z > highest) {
            return None;
        }
        let beside = beside(at, self.size_mm);
        if beside != [0.0; 2] && !OUTSIDE {
            return None;
        }
        let (height, slope) = self.sample(x - beside[0], y - beside[1]);
        let depth = height - z;
        let depth_mm = if beside != [0.0; 2] {
            edge(beside, -depth)
        } else if depth > self.thickness_mm {
            f64::NEG_INFINITY
        } else {
            // Rounding may not make it deeper than its greatest height allows.
            least(depth / (1.0 + slope[0] * slope[0] + slope[1] * slope[1]).sqrt(), highest - z)
        };
        Some(Over { depth_mm, beside, height, slope })
    }
}

/// How a point lies to a relief.
pub(super) struct Over {
    pub depth_mm: f64,
    /// How far it lies beside it along x and y.
    pub beside: [f64; 2],
    /// Of the relief, where it is nearest along x and y.
    pub height: f64,
    pub slope: [f64; 2],
}

/// What can be touched: a [`Form`] whose figures were checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape(Form);

impl Shape {
    /// An endless plane.
    pub fn plane() -> Self {
        Self(Form::Plane)
    }

    /// A rectangle.
    ///
    /// # Errors
    /// Sides or a thickness that are not from [`LEAST_MM`] to [`WORLD_MM`].
    pub fn rectangle(size_mm: [f64; 2], thickness_mm: f64) -> Result<Self, Diagnostic> {
        length("a rectangle", "x", size_mm[0])?;
        length("a rectangle", "y", size_mm[1])?;
        thickness("a rectangle", thickness_mm)?;
        Ok(Self(Form::Rectangle { size_mm, thickness_mm }))
    }

    /// A sphere.
    ///
    /// # Errors
    /// A radius that is not from [`LEAST_MM`] to [`WORLD_MM`].
    pub fn sphere(radius_mm: f64) -> Result<Self, Diagnostic> {
        if !(LEAST_MM..=WORLD_MM).contains(&radius_mm) {
            return Err(Diagnostic::new(format!("a sphere of radius {radius_mm} mm"))
                .help(format!("a radius from {LEAST_MM} to {WORLD_MM} mm")));
        }
        Ok(Self(Form::Sphere { radius_mm }))
    }

    /// A box.
    ///
    /// # Errors
    /// Edges that are not from [`LEAST_MM`] to [`WORLD_MM`].
    pub fn cuboid(size_mm: [f64; 3]) -> Result<Self, Diagnostic> {
        for (axis, size) in ["x", "y", "z"].into_iter().zip(size_mm) {
            length("a box", axis, size)?;
        }
        Ok(Self(Form::Box { size_mm }))
    }

    /// Heights over a rectangle, or over the whole grid where no size is given; heights are multiplied by `scale`.
    ///
    /// # Errors
    /// Sides or a thickness that are not from [`LEAST_MM`] to [`WORLD_MM`], sides beyond a grid that ends, a scale that is not a number or takes heights out of
    /// the world.
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
            if !grid.repeats() && size > extent * (1.0 + 1e-9) {
                return Err(Diagnostic::new(format!(
                    "a relief of {size} mm along {axis} over heights that end after {extent} mm"
                ))
                .help("a smaller relief, or heights that repeat"));
            }
        }
        thickness("a relief", thickness_mm)?;
        let [low, high] = grid.bounds_mm().map(|h| h * scale);
        if !(low.abs() <= WORLD_MM && high.abs() <= WORLD_MM) {
            return Err(Diagnostic::new(format!("heights times {scale}"))
                .help(format!("a number that leaves heights within {WORLD_MM} mm")));
        }
        let bounds_mm = [least(low, high), most(low, high)];
        Ok(Self(Form::Relief(Relief { grid, size_mm, scale, thickness_mm, bounds_mm })))
    }

    /// What it is.
    pub fn form(&self) -> &Form {
        &self.0
    }

    /// How deep a point is inside, in millimetres, in the shape's coordinates; outside it is minus the distance. Minus infinity where a shape with one side
    /// is not felt: beneath its thickness, and beside it below its edge.
    ///
    /// Depth is the distance to the surface for a plane, a sphere and a box (to its nearest face), and to the upper face for a rectangle. For a relief
    /// it is `(h - z) / sqrt(1 + |grad h|^2)`, the distance to the plane that touches it at the same x and y; its distance outside is the same,
    /// or that to its greatest height where that is further.
    pub fn depth_mm(&self, at: [f64; 3]) -> f64 {
        self.depth::<true>(at)
    }

    /// The same, and outside minus infinity where that is less work than the distance.
    #[inline]
    pub(super) fn depth<const OUTSIDE: bool>(&self, at: Vector) -> f64 {
        let z = at[2];
        match &self.0 {
            Form::Plane => -z,
            Form::Sphere { radius_mm } => radius_mm - norm(at),
            Form::Box { size_mm } => {
                let over: Vector = std::array::from_fn(|k| at[k].abs() - 0.5 * size_mm[k]);
                let nearest = most(most(over[0], over[1]), over[2]);
                if nearest <= 0.0 {
                    -nearest
                } else if OUTSIDE {
                    -norm(over.map(|e| most(e, 0.0)))
                } else {
                    f64::NEG_INFINITY
                }
            }
            Form::Rectangle { size_mm, thickness_mm } => {
                let beside = beside(at, *size_mm);
                if beside != [0.0; 2] {
                    if OUTSIDE { edge(beside, z) } else { f64::NEG_INFINITY }
                } else if z < -thickness_mm {
                    f64::NEG_INFINITY
                } else {
                    -z
                }
            }
            Form::Relief(relief) => relief.over::<OUTSIDE>(at).map_or(f64::NEG_INFINITY, |o| o.depth_mm),
        }
    }
}

/// How far a point lies beside a rectangle along x and y, with sign; 0 above and below it.
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
    if (LEAST_MM..=WORLD_MM).contains(&size) {
        return Ok(());
    }
    Err(Diagnostic::new(format!("{what} of {size} mm along {axis}"))
        .help(format!("from {LEAST_MM} to {WORLD_MM} mm; endless is `plane`")))
}

fn thickness(what: &str, thickness_mm: f64) -> Result<(), Diagnostic> {
    if (LEAST_MM..=WORLD_MM).contains(&thickness_mm) {
        return Ok(());
    }
    Err(Diagnostic::new(format!("{what} {thickness_mm} mm thick"))
        .help(format!("from {LEAST_MM} to {WORLD_MM} mm: below it nothing is felt")))
}
