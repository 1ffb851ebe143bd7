//! One channel of a picture as numbers, and filters of it.

/// Values row by row.
#[derive(Clone, Debug)]
pub(crate) struct Plane {
    pub(crate) width: usize,
    pub(crate) values: Vec<f64>,
}

impl Plane {
    /// Blurs both ways by the weights 1/4, 1/2, 1/4 at places `step` apart. A rim of `step` is lost.
    pub(crate) fn blurred(&self, step: usize) -> Self {
        let width = self.width.saturating_sub(2 * step);
        let three = |a: f64, b: f64, c: f64| 0.25 * a + 0.5 * b + 0.25 * c;
        let along = |row: &[f64]| -> Vec<f64> {
            (0..width).map(|x| three(row[x], row[x + step], row[x + 2 * step])).collect()
        };
        let rows: Vec<Vec<f64>> = self.values.chunks_exact(self.width).map(along).collect();
        let across = |rows: &[Vec<f64>]| -> Vec<f64> {
            (0..width).map(|x| three(rows[0][x], rows[step][x], rows[2 * step][x])).collect()
        };
        Self { width, values: rows.windows(2 * step + 1).flat_map(across).collect() }
    }

    /// The part without a rim of `by`.
    pub(crate) fn inner(&self, by: usize) -> Self {
        let rows = self.values.len() / self.width;
        let kept = self.values.chunks_exact(self.width).take(rows.saturating_sub(by)).skip(by);
        let values = kept.flat_map(|row| row[by..self.width - by].to_vec()).collect();
        Self { width: self.width - 2 * by, values }
    }

    /// This plane without its blurred copy, which has a rim of `rim` less.
    pub(crate) fn without(&self, blurred: &Self, rim: usize) -> Self {
        let mut rest = self.inner(rim);
        rest.values.iter_mut().zip(&blurred.values).for_each(|(x, b)| *x -= b);
        rest
    }

    /// Every second value of every second row.
    pub(crate) fn halved(&self) -> Self {
        let rows = self.values.chunks_exact(self.width).step_by(2);
        Self {
            width: self.width.div_ceil(2),
            values: rows.flat_map(|row| row.iter().copied().step_by(2)).collect(),
        }
    }

    pub(crate) fn mean(&self) -> f64 {
        self.values.iter().sum::<f64>() / self.values.len().max(1) as f64
    }

    /// Standard deviation.
    pub(crate) fn deviation(&self) -> f64 {
        let mean = self.mean();
        let squares = self.values.iter().map(|x| (x - mean).powi(2)).sum::<f64>();
        (squares / self.values.len().max(1) as f64).sqrt()
    }

    /// Root mean square of each whole block of `side` x `side` values.
    pub(crate) fn blocks(&self, side: usize) -> Vec<f64> {
        let across = self.width / side;
        let mut all = Vec::new();
        for band in self.values.chunks_exact(side * self.width) {
            let square =
                |block: usize, row: &[f64]| row[block * side..][..side].iter().map(|x| x * x).sum::<f64>();
            all.extend((0..across).map(|block| {
                let sum: f64 = band.chunks_exact(self.width).map(|row| square(block, row)).sum();
                (sum / (side * side) as f64).sqrt()
            }));
        }
        all
    }
}
