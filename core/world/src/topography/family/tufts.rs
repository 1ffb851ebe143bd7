use std::f64::consts::TAU;

use super::super::HeightField;
use super::super::spectrum::{blur, gaussian, self_affine};
use super::Grid;
use super::cells::Cells;
use crate::material::Random;

/// Tufts on a backing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Carpet {
    /// From tuft to tuft in millimetres.
    pub pitch_mm: f64,
    /// Height of a tuft over the gaps, in millimetres.
    pub height_mm: f64,
    /// How far tufts stand off their lattice, 0 to 1.
    pub disorder: f64,
    /// Pitch of the plies on a tuft, in millimetres.
    pub ply_mm: f64,
}

/// Round-topped tufts of unequal height, each with the plies of its yarn running its own way, fuzzy.
pub fn carpet(grid: Grid, of: &Carpet, random: &mut Random) -> HeightField {
    let cells = Cells::new(grid, of.pitch_mm, of.disorder, random);
    let tufts: Vec<(f64, f64, f64)> = (0..cells.count * cells.count)
        .map(|_| (1.0 + 0.15 * random.normal(), TAU * random.unit(), TAU * random.unit()))
        .collect();
    let field = HeightField::from_fn(grid.0, grid.1, |x, y| {
        let [near, next] = cells.two_nearest(x, y);
        let (height, way, phase) = tufts[near.0];
        // 1 in the middle, 0 half way to the next one.
        let inside = ((next.1 - near.1) / next.1.max(1e-9)).clamp(0.0, 1.0);
        let top = (1.0 - (1.0 - inside).powi(2)).sqrt();
        let ply = (TAU * (x * way.cos() + y * way.sin()) / of.ply_mm + phase).sin();
        of.height_mm * (height * top + 0.06 * ply * top)
    });
    let mut field = blur(&field, 0.1 * of.ply_mm);
    field.add(&gaussian(grid, 0.05 * of.height_mm, random, self_affine(1.0 / of.pitch_mm, 0.5)));
    field
}
