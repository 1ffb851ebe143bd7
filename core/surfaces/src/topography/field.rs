//! Heights over a square patch that repeats.

/// Heights of a square patch on a grid, in millimetres. The patch repeats in both directions without a
/// seam, so strokes of any length fit.
#[derive(Clone, Debug, PartialEq)]
pub struct HeightField {
    side: usize,
    step_mm: f64,
    heights: Vec<f32>,
}

impl HeightField {
    /// A flat patch of `side` x `side` points, `step_mm` apart; at least one point.
    pub fn flat(side: usize, step_mm: f64) -> Self {
        let side = side.max(1);
        Self { side, step_mm, heights: vec![0.0; side * side] }
    }

    /// A patch with heights `height_mm` at places (x, y) in millimetres.
    pub fn from_fn(side: usize, step_mm: f64, mut height_mm: impl FnMut(f64, f64) -> f64) -> Self {
        let mut field = Self::flat(side, step_mm);
        let side = field.side;
        for (row, line) in field.heights.chunks_exact_mut(side).enumerate() {
            let y = row as f64 * step_mm;
            for (column, height) in line.iter_mut().enumerate() {
                *height = height_mm(column as f64 * step_mm, y) as f32;
            }
        }
        field
    }

    /// Points along an edge.
    pub fn side(&self) -> usize {
        self.side
    }

    /// Distance of points in millimetres.
    pub fn step_mm(&self) -> f64 {
        self.step_mm
    }

    /// Length of an edge in millimetres, the patch's period.
    pub fn length_mm(&self) -> f64 {
        self.side as f64 * self.step_mm
    }

    /// Heights in millimetres, row by row: y grows with rows, x along them.
    pub fn heights(&self) -> &[f32] {
        &self.heights
    }

    /// Mutable [`heights`](Self::heights).
    pub fn heights_mut(&mut self) -> &mut [f32] {
        &mut self.heights
    }

    /// Height at a point of the endless, repeating grid.
    pub fn point(&self, column: i64, row: i64) -> f32 {
        let index = self.wrap(row) * self.side + self.wrap(column);
        self.heights.get(index).copied().unwrap_or(0.0)
    }

    /// Index of a column or row within the patch.
    fn wrap(&self, index: i64) -> usize {
        // Hot paths have sides of powers of two: a division takes as long as the rest of a sample.
        if self.side.is_power_of_two() {
            index as usize & (self.side - 1)
        } else {
            index.rem_euclid(self.side as i64) as usize
        }
    }

    /// Height in millimetres at any place, and slopes along x and y, by the Catmull-Rom cubic through
    /// the points around it.
    pub fn sample(&self, x_mm: f64, y_mm: f64) -> Sample {
        let per_mm = 1.0 / self.step_mm;
        let (column, u) = whole_and_part(x_mm * per_mm);
        let (row, v) = whole_and_part(y_mm * per_mm);
        let (along, slope_along) = weights(u);
        let (across, slope_across) = weights(v);
        let (first, row) = (self.wrap(column - 1), self.wrap(row - 1));
        let (mut height, mut dx, mut dy) = (0.0, 0.0, 0.0);
        for (j, (wy, sy)) in across.iter().zip(slope_across).enumerate() {
            let line = self.four(first, row + j);
            let (mut level, mut slope) = (0.0, 0.0);
            for ((h, wx), sx) in line.iter().zip(along).zip(slope_along) {
                level += wx * f64::from(*h);
                slope += sx * f64::from(*h);
            }
            height += wy * level;
            dx += wy * slope;
            dy += sy * level;
        }
        Sample { height_mm: height, slope: [dx * per_mm, dy * per_mm] }
    }

    /// Height in millimetres at any place by linear interpolation: cheaper than a
    /// [sample](Self::sample), without slopes.
    pub fn level(&self, x_mm: f64, y_mm: f64) -> f64 {
        let (column, u) = whole_and_part(x_mm / self.step_mm);
        let (row, v) = whole_and_part(y_mm / self.step_mm);
        let (u, v) = (u as f32, v as f32);
        let line = |row| {
            let (a, b) = (self.point(column, row), self.point(column + 1, row));
            a + u * (b - a)
        };
        let (a, b) = (line(row), line(row + 1));
        f64::from(a + v * (b - a))
    }

    /// Four points of a row from a column on, repeating past the end.
    fn four(&self, first: usize, row: usize) -> [f32; 4] {
        let base = if row < self.side { row } else { row % self.side } * self.side;
        match self.heights.get(base + first..base + first + 4) {
            Some(&[a, b, c, d]) if first + 4 <= self.side => [a, b, c, d],
            _ => std::array::from_fn(|i| {
                self.heights.get(base + (first + i) % self.side).copied().unwrap_or(0.0)
            }),
        }
    }

    /// Mean height in millimetres.
    pub fn mean_mm(&self) -> f64 {
        self.heights.iter().map(|h| f64::from(*h)).sum::<f64>() / self.heights.len() as f64
    }

    /// Root mean square height about the mean, in millimetres (Sq of ISO 25178).
    pub fn rms_mm(&self) -> f64 {
        let mean = self.mean_mm();
        let sum: f64 = self.heights.iter().map(|h| (f64::from(*h) - mean).powi(2)).sum();
        (sum / self.heights.len() as f64).sqrt()
    }

    /// Root mean square slope of both directions together (Sdq of ISO 25178), from differences of
    /// neighbours.
    pub fn rms_slope(&self) -> f64 {
        let (mut sum, side) = (0.0, self.side as i64);
        for row in 0..side {
            for column in 0..side {
                let here = self.point(column, row);
                let (dx, dy) = (self.point(column + 1, row) - here, self.point(column, row + 1) - here);
                sum += f64::from(dx * dx + dy * dy);
            }
        }
        (sum / self.heights.len() as f64).sqrt() / self.step_mm
    }

    /// Moves and scales heights to a mean of 0 and a root mean square of `rms_mm`; a flat patch stays
    /// flat.
    pub fn with_rms(mut self, rms_mm: f64) -> Self {
        let (mean, rms) = (self.mean_mm(), self.rms_mm());
        let gain = if rms > 0.0 { rms_mm / rms } else { 0.0 };
        self.heights.iter_mut().for_each(|h| *h = ((f64::from(*h) - mean) * gain) as f32);
        self
    }

    /// Adds another patch of the same grid, point by point.
    pub fn add(&mut self, other: &Self) {
        debug_assert!(self.side == other.side);
        self.heights.iter_mut().zip(&other.heights).for_each(|(a, b)| *a += b);
    }
}

/// Height and slopes of a patch at a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Height in millimetres.
    pub height_mm: f64,
    /// Slopes along x and y, without unit.
    pub slope: [f64; 2],
}

/// Next whole number below, and the remainder. `f64::floor` is a call on processors without that
/// instruction.
fn whole_and_part(x: f64) -> (i64, f64) {
    let near = x as i64;
    let whole = near - i64::from(x < near as f64);
    (whole, x - whole as f64)
}

/// Weights of four neighbours at a place `t` of 0 to 1 between the middle two, and their derivatives.
pub fn weights(t: f64) -> ([f64; 4], [f64; 4]) {
    let (t2, t3) = (t * t, t * t * t);
    (
        [
            0.5 * (-t3 + 2.0 * t2 - t),
            0.5 * (3.0 * t3 - 5.0 * t2 + 2.0),
            0.5 * (-3.0 * t3 + 4.0 * t2 + t),
            0.5 * (t3 - t2),
        ],
        [
            0.5 * (-3.0 * t2 + 4.0 * t - 1.0),
            0.5 * (9.0 * t2 - 10.0 * t),
            0.5 * (-9.0 * t2 + 8.0 * t + 1.0),
            0.5 * (3.0 * t2 - 2.0 * t),
        ],
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn sine_is_right_between_points_and_over_the_seam() {
        let (side, step) = (256, 0.05);
        let wave = TAU / (side as f64 * step) * 4.0;
        let field = HeightField::from_fn(side, step, |x, y| 0.3 * (wave * x).sin() + 0.1 * (wave * y).cos());
        for (x, y) in [(0.013, 0.4), (12.79, 3.3), (-7.7, 100.02)] {
            let s = field.sample(x, y);
            assert!((s.height_mm - 0.3 * (wave * x).sin() - 0.1 * (wave * y).cos()).abs() < 1e-4);
            assert!((s.slope[0] - 0.3 * wave * (wave * x).cos()).abs() < 1e-3, "{s:?}");
            assert!((s.slope[1] + 0.1 * wave * (wave * y).sin()).abs() < 1e-3, "{s:?}");
        }
        let rms = (0.5_f64 * (0.09 + 0.01)).sqrt();
        assert!((field.rms_mm() - rms).abs() < 1e-6 && field.mean_mm().abs() < 1e-6);
        assert!((field.rms_slope() / (wave * rms) - 1.0).abs() < 2e-3);
        let scaled = field.with_rms(2.0);
        assert!((scaled.rms_mm() - 2.0).abs() < 1e-5);
        assert_eq!(HeightField::flat(4, 0.1).with_rms(1.0), HeightField::flat(4, 0.1));
    }
}
