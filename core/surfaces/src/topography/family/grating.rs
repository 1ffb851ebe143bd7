use super::super::HeightField;
use super::super::spectrum::{gaussian, self_affine};
use super::{Grid, fitting};
use asperity_numbers::Elementary as _;
use asperity_numbers::Random;

/// Straight ridges along y.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grating {
    /// Distance of ridges in millimetres, rounded to whole periods around the patch.
    pub period_mm: f64,
    /// From groove to ridge in millimetres.
    pub depth_mm: f64,
    /// Part of a period in ridges, at half height.
    pub duty: f64,
    /// Part of a period in each flank: near 0 is square, 0.5 is a triangle with a duty of 0.5.
    pub edge: f64,
    /// Root mean square roughness on top, in millimetres.
    pub roughness_mm: f64,
}

impl Grating {
    /// The period on a grid, in millimetres.
    pub fn period_on(&self, grid: Grid) -> f64 {
        fitting(grid, self.period_mm, 1)
    }
}

/// Ridges with flanks of half a cosine and a fine roughness.
pub fn grating(grid: Grid, of: &Grating, random: &mut Random) -> HeightField {
    let period = of.period_on(grid);
    let mut field = HeightField::from_fn(grid.0, grid.1, |x, _| {
        // Distance from the middle of the ridge, in periods.
        let away = ((x / period).fract() - 0.5).abs();
        let flank = ((away - 0.5 * of.duty) / of.edge.max(1e-6) + 0.5).clamp(0.0, 1.0);
        of.depth_mm * 0.5 * (1.0 + (std::f64::consts::PI * flank).cosine())
    });
    field.add(&gaussian(grid, of.roughness_mm, random, self_affine(1.0, 0.7)));
    field
}
