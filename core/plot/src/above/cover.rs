//! Which places the way and its lanes cover.

use super::outline::{Bounds, Point};

/// Edge of a cell in pixels.
pub(super) const CELL: f64 = 3.0;

/// Cells of a frame, with how many are covered up to each of them.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Cover {
    low: Point,
    cells: [usize; 2],
    /// Of those above and to the left; a row and a column more than there are cells.
    sums: Vec<u32>,
}

impl Cover {
    /// Of a frame whose cells are covered where `mark` puts a point.
    pub(super) fn of([low, high]: Bounds, mark: impl FnOnce(&mut dyn FnMut(Point))) -> Self {
        let cells = [0, 1].map(|k| ((high[k] - low[k]) / CELL).ceil().clamp(1.0, 4096.0) as usize);
        let row = cells[0] + 1;
        let mut sums = vec![0_u32; row * (cells[1] + 1)];
        mark(&mut |p| {
            let at = [0, 1].map(|k| ((p[k] - low[k]) / CELL).floor());
            if (0..2).all(|k| at[k] >= 0.0 && at[k] < cells[k] as f64) {
                sums[(at[1] as usize + 1) * row + at[0] as usize + 1] = 1;
            }
        });
        for i in row + 1..sums.len() {
            if i % row > 0 {
                sums[i] = sums[i] + sums[i - 1] + sums[i - row] - sums[i - row - 1];
            }
        }
        Self { low, cells, sums }
    }

    /// How many cells that share something with these bounds are covered.
    pub(super) fn count(&self, [low, high]: Bounds) -> u32 {
        let cell = |k: usize, v: f64| v.clamp(0.0, self.cells[k] as f64) as usize;
        let from = [0, 1].map(|k| cell(k, ((low[k] - self.low[k]) / CELL).floor()));
        let to = [0, 1].map(|k| cell(k, ((high[k] - self.low[k]) / CELL).ceil()).max(from[k]));
        let sum = |x: usize, y: usize| self.sums[y * (self.cells[0] + 1) + x];
        sum(to[0], to[1]) + sum(from[0], from[1]) - sum(from[0], to[1]) - sum(to[0], from[1])
    }
}
