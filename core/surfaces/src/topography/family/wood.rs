use asperity_numbers::Elementary as _;
use std::f64::consts::PI;

use super::super::HeightField;
use super::super::spectrum::gaussian;
use super::stamp::stamp;
use super::{Grid, fitting};
use asperity_numbers::Random;

/// A planed board with its grain along y.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wood {
    /// Distance of growth rings in millimetres.
    pub ring_mm: f64,
    /// Height of late wood over early wood in millimetres.
    pub ring_height_mm: f64,
    /// Width of the fibres' bundles in millimetres, across the grain.
    pub fibre_mm: f64,
    /// Root mean square height of the fibres in millimetres.
    pub fibre_height_mm: f64,
    /// Depth of the pores in millimetres.
    pub pore_mm: f64,
    /// Pores on a square millimetre, 0 for none.
    pub pores: f64,
    /// Preference of pores for early wood: 0 none, 1 full.
    pub rings_porous: f64,
}

impl Wood {
    /// Distance of rings on a grid in millimetres.
    pub fn ring_on(&self, grid: Grid) -> f64 {
        fitting(grid, self.ring_mm, 1)
    }
}

/// Length over width of fibres and pores.
const ASPECT: f64 = 25.0;

/// Wandering rings, steep at the end of late wood; fibres 25 times as long as wide; pores cut open
/// along the grain, 1.5 times as wide as deep.
pub fn wood(grid: Grid, of: &Wood, random: &mut Random) -> HeightField {
    let (side, step) = grid;
    let grain = |width: f64| {
        move |fx: f64, fy: f64| {
            let q = (width * fx).hypotenuse(ASPECT * width * fy);
            if q <= 1.0 { 1.0 } else { q.power(-3.4) }
        }
    };
    let wander = gaussian(grid, 0.25 * of.ring_mm, random, |fx, fy| {
        // Powers are slow, so near-zero terms are skipped.
        if of.ring_mm * fx > 3.0 || of.ring_mm * fy.abs() > 0.3 {
            0.0
        } else {
            grain(2.0 * of.ring_mm)(fx, fy)
        }
    });
    let mut field = gaussian(grid, of.fibre_height_mm, random, grain(of.fibre_mm));
    let ring = of.ring_on(grid);
    let shift = wander.heights();
    let phase = |at: usize| ((at % side) as f64 * step + f64::from(shift[at])) / ring;
    for (at, height) in field.heights_mut().iter_mut().enumerate() {
        *height += (of.ring_height_mm * late(phase(at))) as f32;
    }
    let length = field.length_mm();
    for _ in 0..(of.pores * length * length) as usize {
        let place = [length * random.unit(), length * random.unit()];
        let at = (place[1] / step) as usize % side * side + (place[0] / step) as usize % side;
        let early = 1.0 - late(phase(at));
        if !random.chance(of.rings_porous * early.powi(3) + 1.0 - of.rings_porous) {
            continue;
        }
        pore(&mut field, place, of.pore_mm * random.range(0.5, 1.2), random);
    }
    field
}

/// Lateness of the wood at a place in the rings: it rises over three quarters of a ring and falls in
/// the rest.
fn late(rings: f64) -> f64 {
    let part = rings - rings.floor();
    if part < 0.75 {
        0.5 - 0.5 * (PI * part / 0.75).cosine()
    } else {
        0.5 + 0.5 * (PI * (part - 0.75) / 0.25).cosine()
    }
}

/// A vessel cut open: a slender trough along the grain.
fn pore(field: &mut HeightField, place: [f64; 2], depth: f64, random: &mut Random) {
    let width = (1.5 * depth).max(1.5 * field.step_mm());
    let half = 0.5 * ASPECT * width * random.range(0.3, 1.0);
    let (tilt, pieces) = (0.03 * random.normal(), (half / width).ceil());
    for piece in 0..pieces as usize {
        // Square pieces in a row, one width each way.
        let along = (piece as f64 + 0.5) * 2.0 * width - half;
        let middle = [place[0] + tilt * along, place[1] + along];
        stamp(field, middle, width, |dx, dy, there| {
            let (u, v) = ((dx - tilt * dy) / (0.5 * width), (along + dy) / half);
            let section = 1.0 - u * u - v * v;
            if section > 0.0 && (-width..width).contains(&dy) { there - depth * section } else { there }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pores_have_stated_depth_along_grain_in_early_wood() {
        let board = |rings_porous: f64| {
            let of = Wood {
                ring_mm: 4.0,
                ring_height_mm: 1e-6,
                fibre_mm: 0.1,
                fibre_height_mm: 0.0,
                pore_mm: 0.1,
                pores: 2.0,
                rings_porous,
            };
            wood((512, 0.04), &of, &mut Random::new(5))
        };
        let (even, ringed) = (board(0.0), board(1.0));
        let sunk = |f: &HeightField| f.heights().iter().filter(|h| **h < -0.02).count();
        assert!(
            3 * sunk(&ringed) < 2 * sunk(&even) && sunk(&ringed) > 0,
            "{} {}",
            sunk(&ringed),
            sunk(&even)
        );
        let mut sorted: Vec<f32> = even.heights().iter().copied().filter(|h| *h < -0.02).collect();
        sorted.sort_by(f32::total_cmp);
        let deep = f64::from(-sorted[sorted.len() / 20]);
        assert!((0.07..0.25).contains(&deep), "{deep}");
        let (mut along, mut across) = (0.0, 0.0);
        for i in 0..512 {
            for j in 0..512 {
                along += f64::from(even.point(i, j + 1) - even.point(i, j)).powi(2);
                across += f64::from(even.point(i + 1, j) - even.point(i, j)).powi(2);
            }
        }
        assert!(across > 8.0 * along, "{across} {along}");
    }
}
