//! Families of surfaces, each a way to make a patch from a few parameters in the units that people give
//! them in.
//!
//! | family | parameters | what it is |
//! |---|---|---|
//! | [`sandpaper`](sandpaper()) | mean grain size of its FEPA grade | faceted grains in resin, packed at random |
//! | [`weave`](weave()) | thread pitch, binding, fibre | warp and weft that go over and under, by the binding's rule |
//! | [`grating`](grating()) | period, depth, duty, edge | straight ridges |
//! | [`foam`](foam()) | pore size, wall, open share | cells of a random tessellation, cut open |
//! | [`carpet`](carpet()) | tuft pitch, height, disorder | loops of ply yarn, bunches of cut ends, or a felt |
//! | [`wood`](wood()) | ring width, pore length, roughness | grain that is long one way, growth rings, pores |
//! | [`pebbled`](pebbled()) | pebble pitch, height, matt | a moulded texture of waves or of a hide's pebbles |
//! | [`sheet`](sheet()) | height, roll-off, Hurst exponent, lay | a smooth or finely finished sheet |

mod cells;
mod foam;
mod grating;
mod moulded;
mod sandpaper;
mod stamp;
mod tufts;
mod weave;
mod wood;

pub use foam::{Foam, foam};
pub use grating::{Grating, grating};
pub use moulded::{Mould, Pebbled, Sheet, pebbled, sheet};
pub use sandpaper::sandpaper;
pub use tufts::{Carpet, Pile, carpet};
pub use weave::{Binding, Weave, weave};
pub use wood::{Wood, wood};

/// The grid that a patch is made on: points along an edge, and their distance in millimetres.
pub type Grid = (usize, f64);

/// How often something of length `pitch_mm` fits around a patch, in multiples of `of`, at least once.
fn fits((side, step_mm): Grid, pitch_mm: f64, of: usize) -> usize {
    let length = side as f64 * step_mm / pitch_mm;
    ((length / of as f64).round() as usize).max(1) * of
}

/// The length next to `pitch_mm` that fits so.
fn fitting(grid: Grid, pitch_mm: f64, of: usize) -> f64 {
    grid.0 as f64 * grid.1 / fits(grid, pitch_mm, of) as f64
}
