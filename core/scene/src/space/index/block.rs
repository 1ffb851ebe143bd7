//! A block: four parts of a tree side by side, with bounds on the depth of their surfaces.

use super::super::vector::{Vector, dot, least, most};

/// Widening of bounds for rounding, in millimetres.
pub(super) const SLACK_MM: f64 = 1e-9;

/// Number of parts in a block.
pub(super) const LANES: usize = 4;

/// 1 / sqrt(3), slightly less.
const ONE_OF_THREE: f64 = 0.577_350_26;

/// One number for each part.
pub(super) type Lanes = [f64; LANES];

/// Class of the surfaces in a tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Class {
    /// Planes, rectangles, reliefs. The depth is that of a point below them.
    Sheets,
    /// Spheres and boxes. The depth is the distance to the nearest way out.
    Solids,
}

/// A group of surfaces. Places and directions are in the block's frame, a turned copy of the world's axes
/// around the same middle.
#[derive(Clone, Debug)]
pub(super) struct Part {
    /// Lowest number of an entry; the highest possible number if there is none.
    pub lowest: u32,
    /// Number of the block into which the part is split; for a leaf, number of its first item.
    pub first: u32,
    /// Number of items of a leaf; 0 for a part that is split.
    pub items: u32,
    /// Box in which the surfaces are touched.
    pub low: Vector,
    pub high: Vector,
    /// Sheets: a point in their midst. Solids: the corner of least coordinates of a box around their
    /// middles.
    pub core: Vector,
    /// Sheets: a direction in the midst of their normals. Solids: the other corner.
    pub other: Vector,
    /// Sheets: largest height of any above the point, along its own normal. Solids: radius of the largest
    /// ball around one of them.
    pub above: f64,
    /// Sheets: smallest height of all above the point. Solids: half the longest edge of any.
    pub beyond: f64,
    /// Sheets: cosine and sine of the largest angle between a normal and the direction.
    pub spread: [f64; 2],
    /// Largest possible depth.
    pub most: f64,
    /// Distance from which the surfaces are felt.
    pub reach: f64,
}

impl Part {
    /// A part without surfaces.
    pub(super) fn empty() -> Self {
        let (least, most) = ([f64::INFINITY; 3], [-f64::INFINITY; 3]);
        Self {
            lowest: u32::MAX,
            first: 0,
            items: 0,
            low: least,
            high: most,
            core: least,
            other: most,
            above: -f64::INFINITY,
            beyond: 0.0,
            spread: [1.0, 0.0],
            most: 0.0,
            reach: 0.0,
        }
    }
}

/// Up to four parts, stored coordinate by coordinate.
#[derive(Clone, Debug)]
pub(super) struct Block {
    /// Number of the frame.
    pub frame: u32,
    /// Whether all normals of sheets are the z of the frame.
    pub alike: bool,
    pub lowest: [u32; LANES],
    pub first: [u32; LANES],
    pub items: [u32; LANES],
    low: [Lanes; 3],
    high: [Lanes; 3],
    core: [Lanes; 3],
    other: [Lanes; 3],
    above: Lanes,
    beyond: Lanes,
    spread: [Lanes; 2],
    most: Lanes,
    reach: Lanes,
}

impl Block {
    pub(super) fn new(frame: u32, alike: bool, parts: &[Part; LANES]) -> Self {
        let each = |of: &dyn Fn(&Part) -> f64| std::array::from_fn(|lane| of(&parts[lane]));
        let vectors = |of: &dyn Fn(&Part) -> Vector| [0, 1, 2].map(|k| each(&|p| of(p)[k]));
        Self {
            frame,
            alike,
            lowest: std::array::from_fn(|lane| parts[lane].lowest),
            first: std::array::from_fn(|lane| parts[lane].first),
            items: std::array::from_fn(|lane| parts[lane].items),
            low: vectors(&|p| p.low),
            high: vectors(&|p| p.high),
            core: vectors(&|p| p.core),
            other: vectors(&|p| p.other),
            above: each(&|p| p.above),
            beyond: each(&|p| p.beyond),
            spread: [each(&|p| p.spread[0]), each(&|p| p.spread[1])],
            most: each(&|p| p.most),
            reach: each(&|p| p.reach),
        }
    }

    /// Upper bounds on the depth of the surfaces of each part at a point in the block's frame. Minus
    /// infinity where none is felt.
    ///
    /// Let `p` be the point and `m` a point in the midst of the sheets. Let a sheet have the normal `n`
    /// and contain the point `c`. The depth of `p` is at most `n . (c - p) = n . (c - m) + n . (m - p)`.
    /// Let `n` be at most an angle `b` from a direction that is at an angle `a` to `m - p`. Then
    /// `n . (m - p)` is within `|m - p| cos(a - b)` and `|m - p| cos(a + b)`. A point that lies deeper
    /// than the sheet is thick is not felt.
    ///
    /// A solid is no deeper than the distance to the nearest way out of a body that holds it: the part's
    /// box, or a ball around the middle. A box is also no deeper than `max_k h_k - max_k |v_k|`, however
    /// it is turned. Here `h` are its half edges and `v` goes from its middle to the point. The greatest
    /// of three coordinates is at least `|v| / sqrt(3)`.
    #[inline]
    pub(super) fn ceilings<const REACHING: bool>(&self, class: Class, point: Vector) -> Lanes {
        let (mut exit, mut outside) = ([f64::INFINITY; LANES], [0.0; LANES]);
        for ((low, high), at) in self.low.iter().zip(&self.high).zip(point) {
            for lane in 0..LANES {
                let within = least(at - low[lane], high[lane] - at);
                exit[lane] = least(exit[lane], within);
                if REACHING {
                    let over = least(within, 0.0);
                    outside[lane] += over * over;
                }
            }
        }
        std::array::from_fn(|lane| {
            let inside = exit[lane] >= 0.0;
            let near = inside || (REACHING && outside[lane] <= self.reach[lane] * self.reach[lane]);
            // Most parts are excluded by now.
            if !near {
                return f64::NEG_INFINITY;
            }
            let bound = match class {
                Class::Sheets if self.alike => self.above[lane] + (self.core[2][lane] - point[2]),
                Class::Sheets => self.below(lane, point),
                Class::Solids => least(exit[lane], self.around(lane, point)),
            };
            let bound = least(bound, self.most[lane]);
            let bound = if inside { bound } else { least(bound, SLACK_MM - outside[lane].sqrt()) };
            if REACHING && bound < -self.reach[lane] { f64::NEG_INFINITY } else { bound }
        })
    }

    #[inline]
    fn below(&self, lane: usize, point: Vector) -> f64 {
        let to: Vector = std::array::from_fn(|k| self.core[k][lane] - point[k]);
        let axis = std::array::from_fn(|k| self.other[k][lane]);
        let (square, along) = (dot(to, to), dot(to, axis));
        let aside = most(square - along * along, 0.0).sqrt();
        let (cos, sin) = (self.spread[0][lane], self.spread[1][lane]);
        // Uses the sines of a - b and a + b. Past 0 the least angle is 0. Past 180 degrees the greatest
        // angle is 180 degrees.
        let down = if cos * aside > -sin * along { cos * along - sin * aside } else { -square.sqrt() };
        if self.beyond[lane] + down > self.most[lane] {
            return f64::NEG_INFINITY;
        }
        let up = if cos * aside > sin * along { cos * along + sin * aside } else { square.sqrt() };
        self.above[lane] + up
    }

    #[inline]
    fn around(&self, lane: usize, point: Vector) -> f64 {
        let off: Vector = std::array::from_fn(|k| {
            most(most(self.core[k][lane] - point[k], point[k] - self.other[k][lane]), 0.0)
        });
        let off = dot(off, off).sqrt();
        least(self.above[lane] - off, self.beyond[lane] - ONE_OF_THREE * off)
    }
}
