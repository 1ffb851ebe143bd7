//! Scattered points on a repeating patch, and their neighbours.

use super::Grid;
use asperity_numbers::Random;

/// Randomly moved points of a square lattice, found by place.
pub(super) struct Cells {
    /// Cells along an edge.
    pub(super) count: usize,
    /// Edge of a cell in millimetres.
    pub(super) pitch_mm: f64,
    /// Place of each cell's point as parts of the cell.
    places: Vec<[f64; 2]>,
}

impl Cells {
    /// One point about every `pitch_mm`; `jitter` 0 is the lattice, 1 anywhere in the cell.
    pub(super) fn new((side, step_mm): Grid, pitch_mm: f64, jitter: f64, random: &mut Random) -> Self {
        let length = side as f64 * step_mm;
        let count = ((length / pitch_mm).round() as usize).max(1);
        let mut place = || 0.5 + jitter * (random.unit() - 0.5);
        let places = (0..count * count).map(|_| [place(), place()]).collect();
        Self { count, pitch_mm: length / count as f64, places }
    }

    /// All points, by number, with their places in millimetres.
    pub(super) fn all(&self) -> impl Iterator<Item = (usize, [f64; 2])> {
        self.places.iter().enumerate().map(|(i, [u, v])| {
            let (column, row) = ((i % self.count) as f64, (i / self.count) as f64);
            (i, [(column + u) * self.pitch_mm, (row + v) * self.pitch_mm])
        })
    }

    /// Number and distance in millimetres of the two nearest points, exact for points within a cell's
    /// edge.
    pub(super) fn two_nearest(&self, x_mm: f64, y_mm: f64) -> [(usize, f64); 2] {
        // Squares of distances, in cells.
        let mut nearest = [(0, f64::INFINITY); 2];
        let (u, v) = (x_mm / self.pitch_mm, y_mm / self.pitch_mm);
        let (column, row) = (u.floor() as i64, v.floor() as i64);
        let count = self.count as i64;
        for j in row - 2..=row + 2 {
            let base = j.rem_euclid(count) * count;
            let mut number = (column - 2).rem_euclid(count);
            for i in column - 2..=column + 2 {
                let [du, dv] = self.places[(base + number) as usize];
                let (du, dv) = (i as f64 + du - u, j as f64 + dv - v);
                let away = du * du + dv * dv;
                if away < nearest[0].1 {
                    nearest = [((base + number) as usize, away), nearest[0]];
                } else if away < nearest[1].1 {
                    nearest[1] = ((base + number) as usize, away);
                }
                number = if number + 1 == count { 0 } else { number + 1 };
            }
        }
        nearest.map(|(number, away)| (number, away.sqrt() * self.pitch_mm))
    }
}
