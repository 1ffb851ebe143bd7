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
//! Nanoseconds that [`Index::deepest`] takes in a tick of a stroke at 100 mm/s under 500 Hz that wanders over 40 mm, touching and lifting: the median of all ticks, and the worst
//! (`examples/space_cost.rs`, on a virtual AMD EPYC core). An empty search takes 20, one touched sheet 50, one touched relief 160.
//!
//! | | 1 | 10 | 100 | 1000 | 10000 |
//! |---|---|---|---|---|---|
//! | one sheet, balls 3 to 33 mm above it | 50 / 90 | 60 / 110 | 60 / 110 | 60 / 110 | 60 / 110 |
//! | one sheet, others 1 m off | 50 / 90 | 50 / 100 | 50 / 100 | 50 / 100 | 50 / 100 |
//! | a floor of tiles of 5 mm | 20 / 90 | 20 / 130 | 50 / 230 | 50 / 240 | 50 / 280 |
//! | the same, uneven and over each other | 20 / 90 | 20 / 160 | 180 / 420 | 260 / 660 | 340 / 690 |
//! | a floor of reliefs of 5 mm | 20 / 170 | 20 / 270 | 190 / 390 | 220 / 440 | 260 / 510 |
//! | a dome of tiles | 20 / 30 | 70 / 140 | 230 / 410 | 200 / 450 | 220 / 730 |
//! | balls in 200 mm, each way | 20 / 30 | 20 / 30 | 60 / 110 | 160 / 400 | 270 / 550 |
//! | boxes in 200 mm, of all turns | 20 / 30 | 20 / 100 | 80 / 180 | 140 / 290 | 300 / 740 |
//! | sheets in a stack, 1 um apart | 20 / 90 | 20 / 140 | 30 / 200 | 50 / 280 | 50 / 370 |
//! | balls of 10 mm on one spot | 20 / 180 | 30 / 230 | 30 / 430 | 30 / 610 | 30 / 850 |
//! | planes of all turns through one spot | 20 / 90 | 110 / 170 | 260 / 580 | 450 / 1160 | 540 / 1630 |
//! | boxes of 20 mm on one spot, of all turns | 20 / 110 | 70 / 200 | 480 / 1530 | 1720 / 8170 | 5270 / 44890 |
//! | sheets of 50 mm on one spot, of all turns | 20 / 90 | 90 / 220 | 800 / 1520 | 3530 / 7690 | 22190 / 60950 |
//! | reliefs of 50 mm on one spot | 160 / 170 | 190 / 490 | 480 / 1380 | 1420 / 6020 | 10890 / 92740 |
//!
//! So with one touched it matters little how many there are: what is held is compared with the root alone, and what is far is parted from what is near. To leave one for another among
//! 10000 takes 0.3 us, to lift off into the midst of them as well. Only where hundreds or thousands hold the same point, at depths or in directions that bounds
//! cannot tell apart, as in the last three rows, does the search grow with them: it answers exactly, and has to look at them.
//!
//! [`Index::nearest`] takes as long, or up to twice that. To make an index of 10000 takes 6 to 15 ms and 90 to 160 bytes each beside the 168 of an entry.

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
