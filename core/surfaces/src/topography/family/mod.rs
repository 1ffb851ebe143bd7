//! Families of surfaces: each makes a patch from a few parameters in everyday units.
//!
//! | family | parameters | surface |
//! |---|---|---|
//! | [`sandpaper`](sandpaper()) | mean grain size of its FEPA grade | random faceted grains in resin |
//! | [`weave`](weave()) | thread pitch, binding, fibre | warp and weft, crossed by the binding |
//! | [`grating`](grating()) | period, depth, duty, edge | straight ridges |
//! | [`foam`](foam()) | pore size, wall, open share | cells of a random tessellation, cut open |
//! | [`carpet`](carpet()) | tuft pitch, height, disorder | loops of yarn, cut bunches, or a felt |
//! | [`wood`](wood()) | ring width, pore length, roughness | long grain, growth rings, pores |
//! | [`pebbled`](pebbled()) | pebble pitch, height, matt | moulded waves or a hide's pebbles |
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

use super::HeightField;

/// Grid of a patch: points along an edge, and their distance in millimetres.
pub type Grid = (usize, f64);

/// Repetitions of `pitch_mm` around a patch in multiples of `of`, at least one multiple.
fn fits((side, step_mm): Grid, pitch_mm: f64, of: usize) -> usize {
    let length = side as f64 * step_mm / pitch_mm;
    ((length / of as f64).round() as usize).max(1) * of
}

/// A patch of the heights at places that are moved by two others, along x and y.
fn moved([dx, dy]: &[HeightField; 2], mut height_mm: impl FnMut(f64, f64) -> f64) -> HeightField {
    let mut by = dx.heights().iter().zip(dy.heights());
    HeightField::from_fn(dx.side(), dx.step_mm(), |x, y| {
        let (dx, dy) = by.next().map_or((0.0, 0.0), |(dx, dy)| (f64::from(*dx), f64::from(*dy)));
        height_mm(x + dx, y + dy)
    })
}

/// Nearest length to `pitch_mm` with whole repetitions.
fn fitting(grid: Grid, pitch_mm: f64, of: usize) -> f64 {
    grid.0 as f64 * grid.1 / fits(grid, pitch_mm, of) as f64
}
