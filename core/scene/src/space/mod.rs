//! Surfaces in space, and the search for the surface that a stylus touches.
//!
//! A [`Surface`] is a [`Shape`] at a [`Pose`]. It says how deep a point is inside, and where and how the
//! point touches it ([`Touch`]). A touch has the outward normal, two directions along the surface, and a
//! place. The place is in coordinates of the surface, so that a texture does not move against it. Lengths
//! are in mm.
//!
//! An index over many surfaces says which of them a point touches. That is the deepest, and a held
//! surface stays until another is deeper by a hysteresis. All memory from tick to tick is the caller's
//! hold. The index answers exactly as a look at every surface would, from wherever the point came.
//!
//! # One-sided shapes
//!
//! Rectangles and reliefs are touched from +z, down to their thickness. A stylus that moves further than
//! that in one tick passes through: at 1 m/s and 500 Hz that is 2 mm. A stylus that comes from beneath is
//! thrown out when it is within the thickness. Nothing tells it from one that was pressed in.
//!
//! # The search
//!
//! The search is branch and bound in a tree of boxes. Each node has a ceiling: a depth that none of its
//! surfaces can exceed at a point. It follows from the box in which they are touched and from the normals of
//! sheets. The search looks into a node only if its ceiling is above the best depth so far. The best begins
//! with the held surface and the hysteresis, so the root is mostly enough. Endless planes fit in no box, so
//! the search looks at each of them.
//!
//! Only the hold is carried from tick to tick, so no tick pays for others. A tick looks at some tens of nodes
//! among 10000 surfaces, as long as few of them hold the same point or they lie over each other alike. Where
//! thousands of boxes hold the same point, it has to look at them: the answer is exact.

mod grid;
mod index;
mod pose;
mod shape;
mod surface;
mod touch;
mod tree;
mod vector;

pub use grid::{HeightGrid, MOST_POINTS};
pub(crate) use index::{Contact, Entry, Index};
pub use pose::{Pose, WORLD_MM};
pub use shape::{Form, LEAST_MM, Relief, Shape};
pub use surface::Surface;
pub(crate) use touch::Hold;
pub use touch::Touch;
pub(crate) use vector::dot;
