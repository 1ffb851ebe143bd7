//! Heights on a rectangular grid.

use asperity_diagnostics::Diagnostic;

use super::WORLD_MM;
use super::vector::{least, most};
use asperity_surfaces::topography::{HeightField, Sample, weights};

/// Largest number of points in a grid.
pub const MOST_POINTS: usize = 1 << 26;

/// Points beyond each end of a line that are stored with it.
const BEFORE: usize = 1;
const AFTER: usize = 2;

/// Heights on a grid, in millimetres. Between the points runs the cubic of Catmull and Rom, along x and
/// along y. It is C1: heights and slopes are continuous (Catmull and Rom 1974, "A class of local
/// interpolating splines"; Keys 1981 for images). The grid repeats, or it ends at its first and last
/// points. A grid that ends goes on in a straight line where the cubic needs one more point.
#[derive(Clone, Debug, PartialEq)]
pub struct HeightGrid {
    columns: usize,
    rows: usize,
    step_mm: [f64; 2],
    pub(super) repeats: bool,
    /// Length of a stored row: each row includes its neighbours beyond the ends, so that a sample only
    /// reads.
    stride: usize,
    heights: Box<[f32]>,
    /// Lower and upper bound of all heights, also between points.
    pub(super) bounds_mm: [f64; 2],
}

impl HeightGrid {
    /// Makes a grid from its heights in millimetres, row by row, and the distances between points along x
    /// and y. Along a row x grows; from row to row y grows. A grid that repeats does so after `columns`
    /// and `rows` steps.
    ///
    /// # Errors
    /// - A step is not above 0.
    /// - The extent is beyond [`WORLD_MM`].
    /// - A height is not finite or larger than that.
    /// - A row is not complete.
    /// - There are fewer than two columns or rows (fewer than one if the grid repeats).
    /// - There are more than [`MOST_POINTS`] points.
    pub fn new(
        columns: usize,
        heights_mm: Vec<f32>,
        step_mm: [f64; 2],
        repeats: bool,
    ) -> Result<Self, Diagnostic> {
        let (points, least_side) = (heights_mm.len(), if repeats { 1 } else { 2 });
        let rows = points.checked_div(columns).unwrap_or(0);
        if columns < least_side || rows < least_side || rows * columns != points {
            return Err(Diagnostic::new(format!("{points} heights in rows of {columns}")).help(format!(
                "whole rows, and at least {least_side} columns and rows where the heights {}",
                if repeats { "repeat" } else { "end" }
            )));
        }
        if points > MOST_POINTS {
            return Err(Diagnostic::new(format!("{points} heights")).help(format!("at most {MOST_POINTS}")));
        }
        for (step, count) in step_mm.into_iter().zip([columns, rows]) {
            if !(step > 0.0 && step * count as f64 <= WORLD_MM) {
                return Err(Diagnostic::new(format!("{count} heights {step} mm apart"))
                    .help(format!("a step above 0 mm, and at most {WORLD_MM} mm in all")));
            }
        }
        if let Some(bad) = heights_mm.iter().position(|h| h.is_nan() || f64::from(h.abs()) > WORLD_MM) {
            let (row, column) = (bad / columns, bad % columns);
            return Err(Diagnostic::new(format!(
                "a height of {} mm in column {column} of row {row}",
                heights_mm.get(bad).copied().unwrap_or(f32::NAN)
            ))
            .help(format!("a number from -{WORLD_MM} to {WORLD_MM} mm")));
        }
        let (low, high) = heights_mm.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), h| {
            (least(low, f64::from(*h)), most(high, f64::from(*h)))
        });
        // The weights of a cubic sum to 1. Their absolute values sum to at most 5/4, with the straight
        // ends to less than 7/5.
        let factor: f64 = if repeats { 1.25 } else { 1.4 };
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low) * factor * factor * (1.0 + 1e-6));
        let bounds_mm = [middle - half, middle + half];
        let lines: Vec<Vec<f32>> = heights_mm.chunks_exact(columns).map(|row| padded(row, repeats)).collect();
        let stride = columns + BEFORE + AFTER;
        let mut heights = vec![0.0; stride * (rows + BEFORE + AFTER)];
        for column in 0..stride {
            let line: Vec<f32> = lines.iter().filter_map(|line| line.get(column).copied()).collect();
            let places = heights.iter_mut().skip(column).step_by(stride);
            places.zip(padded(&line, repeats)).for_each(|(to, height)| *to = height);
        }
        Ok(Self { columns, rows, step_mm, repeats, stride, heights: heights.into(), bounds_mm })
    }

    /// Makes a grid from a patch of a surface, which repeats.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn from_field(field: &HeightField) -> Result<Self, Diagnostic> {
        Self::new(field.side(), field.heights().to_vec(), [field.step_mm(); 2], true)
    }

    /// Extent along x and y in millimetres: from the first point to the last, or until the grid repeats.
    pub fn extent_mm(&self) -> [f64; 2] {
        let steps = |count: usize| if self.repeats { count } else { count - 1 } as f64;
        [steps(self.columns) * self.step_mm[0], steps(self.rows) * self.step_mm[1]]
    }

    /// Height in millimetres and slopes at a place, counted from the first point. Beyond the edge of a
    /// grid that ends, the answer is that at the edge.
    pub fn sample(&self, x_mm: f64, y_mm: f64) -> Sample {
        let per_mm = [1.0 / self.step_mm[0], 1.0 / self.step_mm[1]];
        let (column, u) = self.cell(x_mm * per_mm[0], self.columns);
        let (row, v) = self.cell(y_mm * per_mm[1], self.rows);
        let ((along, slope_along), (across, slope_across)) = (weights(u), weights(v));
        let (mut height_mm, mut dx, mut dy) = (0.0, 0.0, 0.0);
        for j in 0..4 {
            let first = (row + j) * self.stride + column;
            let Some(&[a, b, c, d]) = self.heights.get(first..first + 4) else { continue };
            let line = [a, b, c, d].map(f64::from);
            let (mut level, mut slope) = (0.0, 0.0);
            for k in 0..4 {
                level += along[k] * line[k];
                slope += slope_along[k] * line[k];
            }
            height_mm += across[j] * level;
            dx += across[j] * slope;
            dy += slope_across[j] * level;
        }
        Sample { height_mm, slope: [dx * per_mm[0], dy * per_mm[1]] }
    }

    /// Point before a place that is counted in steps, and how far beyond it the place is, 0 to 1.
    fn cell(&self, place: f64, count: usize) -> (usize, f64) {
        let place = if self.repeats {
            place
        } else {
            // A place that is not a number counts as an end.
            most(least(place, (count - 1) as f64), 0.0)
        };
        let near = place as i64;
        let whole = near.saturating_sub(i64::from(place < near as f64));
        let part = place - whole as f64;
        if !self.repeats {
            // The last point is the end of the last cell.
            let first = (whole as usize).min(count - 2);
            return (first, part + (whole as usize - first) as f64);
        }
        let part = if (0.0..=1.0).contains(&part) { part } else { 0.0 };
        // Avoids a division, which takes as long as the rest of a sample.
        let wrapped = if count.is_power_of_two() {
            whole as usize & (count - 1)
        } else {
            whole.rem_euclid(count as i64) as usize
        };
        (wrapped, part)
    }
}

/// A line with the points that the cubic needs beyond its ends.
fn padded(line: &[f32], repeats: bool) -> Vec<f32> {
    let at = |index: i64| line.get(index.rem_euclid(line.len() as i64) as usize).copied().unwrap_or(0.0);
    let last = line.len() as i64 - 1;
    (-(BEFORE as i64)..=last + AFTER as i64)
        .map(|index| match index {
            _ if repeats => at(index),
            ..0 => 2.0 * at(0) - at(1),
            _ if index > last => 2.0 * at(last) - at(last - 1),
            _ => at(index),
        })
        .collect()
}

#[cfg(test)]
#[path = "grid_tests.rs"]
mod tests;
