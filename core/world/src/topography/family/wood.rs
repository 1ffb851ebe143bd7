use std::f64::consts::TAU;

use super::super::HeightField;
use super::super::spectrum::gaussian;
use super::{Grid, fits};
use crate::material::Random;

/// A planed board, its grain along y.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wood {
    /// From growth ring to growth ring in millimetres.
    pub ring_mm: f64,
    /// How far late wood stands over early wood, in millimetres.
    pub ring_height_mm: f64,
    /// Width of the fibres' bundles in millimetres, across the grain.
    pub fibre_mm: f64,
    /// Root mean square height of the fibres in millimetres.
    pub fibre_height_mm: f64,
    /// Depth of the pores in millimetres; 0 for a wood without.
    pub pore_mm: f64,
}

/// How much longer than wide fibres and pores are.
const ASPECT: f64 = 25.0;

/// Rings that wander, steeper on one side; fibres and pores 25 times as long as wide. Pores are the lowest 8 % of a Gaussian patch of their own, in
/// early wood.
pub fn wood(grid: Grid, of: &Wood, random: &mut Random) -> HeightField {
    let (side, step) = grid;
    let grain = |width: f64| {
        move |fx: f64, fy: f64| {
            let q = (width * fx).hypot(ASPECT * width * fy);
            if q <= 1.0 { 1.0 } else { q.powf(-3.4) }
        }
    };
    let wander = gaussian(grid, 0.3 * of.ring_mm, random, grain(2.0 * of.ring_mm));
    let pores = gaussian(grid, 1.0, random, grain(1.5 * of.fibre_mm));
    let mut field = gaussian(grid, of.fibre_height_mm, random, grain(of.fibre_mm));
    let ring = side as f64 * step / fits(grid, of.ring_mm, 1) as f64;
    let (shift, pore) = (wander.heights(), pores.heights());
    for (at, height) in field.heights_mut().iter_mut().enumerate() {
        let x = (at % side) as f64 * step + f64::from(shift[at]);
        let phase = TAU * x / ring;
        let late = 0.5 + 0.4 * phase.sin() + 0.1 * (2.0 * phase).sin();
        let sunk = ((-1.4 - f64::from(pore[at])) / 0.6).clamp(0.0, 1.0) * (1.0 - late);
        *height += (of.ring_height_mm * late - of.pore_mm * sunk) as f32;
    }
    field
}
