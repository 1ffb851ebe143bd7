//! Surfaces in space, and the search for the surface that a stylus touches.
//!
//! A [`Surface`] is a [`Shape`] at a [`Pose`]. It says how deep a point is inside, and where and how the
//! point touches it ([`Touch`]). A touch has the outward normal, two directions along the surface, and a
//! place. The place is in coordinates of the surface, so that a texture does not move against it. Lengths
//! are in mm.
//!
//! An [`Index`] over many surfaces says which of them a point touches. That is the deepest, and a held
//! surface stays until another is deeper by a hysteresis. All memory from tick to tick is the caller's
//! [`Hold`]. The index answers exactly as a look at every surface would, from wherever the point came.
//!
//! # One-sided shapes
//!
//! Rectangles and reliefs are touched from +z, down to their thickness. A stylus that moves further than
//! that in one tick passes through: at 1 m/s and 500 Hz that is 2 mm. A stylus that comes from beneath is
//! thrown out when it is within the thickness. Nothing tells it from one that was pressed in.
//!
//! # The search
//!
//! The search is branch and bound in a tree with four parts per block. Each part has a ceiling: a depth
//! that none of its surfaces can exceed at a point. The search looks into a part only if its ceiling is
//! above the best depth so far. The best begins with the held surface and the hysteresis, so the first
//! block is mostly enough.
//!
//! Ceilings come from where a part is touched (a box in the frame that its surfaces share). For sheets
//! they also come from a cone around the normals and the height of the highest sheet. So endless planes
//! need no box. For spheres and boxes they come from a box around the middles. The tree parts surfaces
//! side by side by place, and surfaces over each other by depth. Surfaces that are alike to the bit count
//! as one.
//!
//! Only the hold is carried from tick to tick, so no tick pays for others. The slowest ticks are those in
//! which the stylus leaves the held surface.
//!
//! # Cost
//!
//! The table has the time of [`Index::deepest`] per tick in nanoseconds: median of all ticks / worst
//! tick. The stroke wanders over 40 mm at 100 mm/s under 500 Hz, touching and lifting
//! (`examples/space_cost.rs`, on a virtual AMD EPYC core). The columns are numbers of surfaces. An empty
//! search takes 20, one touched sheet 50, one touched relief 160.
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
//! | boxes of 20 mm on one spot, all turns | 20 / 110 | 70 / 200 | 480 / 1530 | 1720 / 8170 | 5270 / 44890 |
//! | sheets of 50 mm on one spot, all turns | 20 / 90 | 90 / 220 | 800 / 1520 | 3530 / 7690 | 22190 / 60950 |
//! | reliefs of 50 mm on one spot | 160 / 170 | 190 / 490 | 480 / 1380 | 1420 / 6020 | 10890 / 92740 |
//!
//! So with one surface touched, the number of surfaces matters little. The held surface is compared with
//! the root alone, and far surfaces are parted from near ones. To leave one surface for another among
//! 10000 takes 0.3 us. To lift off into the midst of 10000 takes as long.
//!
//! The search grows with the number of surfaces only if hundreds or thousands hold the same point. This
//! happens if bounds cannot tell them apart by depth or direction, as in the last three rows. The index
//! answers exactly, so it has to look at them.
//!
//! [`Index::nearest`] takes as long, or up to twice that. To make an index of 10000 takes 6 to 15 ms. It
//! takes 90 to 160 bytes for each entry, beside the 168 of the entry itself.

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
