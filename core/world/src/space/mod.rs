//! What can be touched, in space, and which of it a stylus touches.

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
