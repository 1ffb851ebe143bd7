use super::super::HeightField;
use super::super::spectrum::{blur, gaussian, self_affine};
use super::Grid;
use super::cells::Cells;
use asperity_numbers::Random;

/// A cut through cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Foam {
    /// Distance of cells in millimetres.
    pub pore_mm: f64,
    /// Thickness of the walls as a part of the distance.
    pub wall: f64,
    /// Depth of an open cell as a part of the distance.
    pub depth: f64,
    /// Part of the cells opened by the cut.
    pub open: f64,
}

/// A Voronoi tessellation of scattered points with a bowl in each cell, as deep as the cut left it.
pub fn foam(grid: Grid, of: &Foam, random: &mut Random) -> HeightField {
    let cells = Cells::new(grid, of.pore_mm, 0.9, random);
    let depths: Vec<f64> = (0..cells.count * cells.count)
        .map(|_| {
            let part = if random.chance(of.open) { 0.5 + 0.5 * random.unit() } else { 0.15 * random.unit() };
            part * of.depth * cells.pitch_mm
        })
        .collect();
    let wall = of.wall * cells.pitch_mm;
    let field = HeightField::from_fn(grid.0, grid.1, |x, y| {
        let [near, next] = cells.two_nearest(x, y);
        // Distance into the cell from the wall's face.
        let into = (0.5 * (next.1 - near.1 - wall) / (0.3 * cells.pitch_mm)).clamp(0.0, 1.0);
        -depths[near.0] * (1.0 - (1.0 - into).powi(2))
    });
    let mut field = blur(&field, 0.25 * wall);
    field.add(&gaussian(grid, 0.02 * of.pore_mm, random, self_affine(0.3 / of.pore_mm, 0.8)));
    field
}
