//! What can be touched, in space, and which of it a stylus touches.
//!
//! A [`Surface`] is a [`Shape`] at a [`Pose`]. It says how deep a point is inside, and where and how it touches ([`Touch`]): the way out, two directions along the surface,
//! and a place in coordinates that belong to the surface, so that a texture stays where it is. Lengths are in mm.
//!
//! An [`Index`] over many says which of them a point touches: the deepest, and what is held stays until another is deeper by a hysteresis. All that it remembers
//! from tick to tick is the caller's [`Hold`]; it answers as a look at every surface would, from wherever the point came.
//!
//! # One-sided shapes
//!
//! Rectangles and reliefs are touched from +z, down to their thickness. A stylus that moves further than that in one tick passes through: at 1 m/s
//! and 500 Hz that is 2 mm. One that comes from beneath is thrown out when it is within the thickness, since nothing tells it from one that was pressed in.
//!
//! # The search
//!
//! A tree of four parts to a block, searched by branch and bound: a part has a ceiling, a depth that none of its surfaces can have at a point, and is looked into only if
//! that is more than the best so far. The best begins with what is held and the hysteresis, so that mostly the first block is all that is looked at. Ceilings
//! come from where a part is touched (a box in the frame that its surfaces share); of sheets from a cone around their normals and the height of the highest, so
//! that endless planes need no box; of spheres and boxes from a box around their middles. What lies side by side is parted by place, what lies over each other by depth.
//! Surfaces that are alike to the bit are one.
//!
//! Nothing is carried from tick to tick but the hold, so no tick pays for others: the worst ones are those in which the held surface is left.
//!
//! # What it costs
//!
//! @@TABLE@@

mod grid;
mod index;
mod pose;
mod shape;
mod surface;
mod touch;
mod vector;

pub use grid::{HeightGrid, MOST_POINTS};
pub use index::{Contact, Entry, Index, MOST_ENTRIES};
pub use pose::{Pose, WORLD_MM};
pub use shape::{Form, LEAST_MM, Relief, Shape};
pub use surface::Surface;
pub use touch::{Hold, Touch};
