//! Path of a round tip's middle: a sphere rolls over finer detail.

use super::HeightField;

/// Height of a round tip's lowest point at every place of its middle, for a radius of `radius_mm`:
/// `E(x) = max_y [h(y) - |x - y|^2 / (2 R)]`. This is the morphological dilation by a paraboloid. It
/// has the sphere's curvature at its apex and is less than 7 % of the depth too low within half a
/// radius. It splits into lines along x and along y, each the upper envelope of parabolas (Felzenszwalb
/// and Huttenlocher 2012, "Distance transforms of sampled functions").
pub fn envelope(field: &HeightField, radius_mm: f64) -> HeightField {
    let side = field.side();
    let curvature = field.step_mm().powi(2) / (2.0 * radius_mm.max(1e-6));
    let mut out = field.clone();
    let mut lines = Lines::new(side);
    out.heights_mut().chunks_exact_mut(side).for_each(|row| lines.envelope(row, curvature));
    let mut turned = transpose(out.heights(), side);
    turned.chunks_exact_mut(side).for_each(|row| lines.envelope(row, curvature));
    out.heights_mut().copy_from_slice(&transpose(&turned, side));
    out
}

fn transpose(values: &[f32], side: usize) -> Vec<f32> {
    let mut out = vec![0.0; values.len()];
    for (row, line) in values.chunks_exact(side).enumerate() {
        for (column, value) in line.iter().enumerate() {
            out[column * side + row] = *value;
        }
    }
    out
}

/// Room for the envelope of a line.
struct Lines {
    /// The line and enough of its repetitions at both ends.
    padded: Vec<f64>,
    /// Places of the visible parabolas, and the start of each.
    apexes: Vec<usize>,
    begins: Vec<f64>,
}

impl Lines {
    fn new(side: usize) -> Self {
        let most = 3 * side;
        Self {
            padded: Vec::with_capacity(most),
            apexes: Vec::with_capacity(most),
            begins: Vec::with_capacity(most),
        }
    }

    /// `max_j [h_j - c (i - j)^2]` of a line that repeats.
    fn envelope(&mut self, line: &mut [f32], c: f64) {
        let side = line.len();
        let (low, high) =
            line.iter().fold((f32::MAX, f32::MIN), |(low, high), h| (low.min(*h), high.max(*h)));
        let reach = ((f64::from(high - low) / c).sqrt().ceil() as usize).min(side);
        self.padded.clear();
        self.padded
            .extend(line[side - reach..].iter().chain(&*line).chain(&line[..reach]).map(|h| f64::from(*h)));
        self.apexes.clear();
        self.begins.clear();
        for (j, h) in self.padded.iter().enumerate() {
            let mut begin = f64::NEG_INFINITY;
            while let (Some(&k), Some(&from)) = (self.apexes.last(), self.begins.last()) {
                // From here on, j's parabola lies above k's.
                begin = 0.5 * ((j + k) as f64 - (h - self.padded[k]) / (c * (j - k) as f64));
                if begin > from {
                    break;
                }
                self.apexes.pop();
                self.begins.pop();
                begin = f64::NEG_INFINITY;
            }
            self.apexes.push(j);
            self.begins.push(begin);
        }
        let mut at = 0;
        for (i, out) in line.iter_mut().enumerate() {
            let x = (i + reach) as f64;
            while self.begins.get(at + 1).is_some_and(|begin| *begin <= x) {
                at += 1;
            }
            let away = x - self.apexes[at] as f64;
            *out = (self.padded[self.apexes[at]] - c * away * away) as f32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::spectrum::{gaussian, self_affine};
    use super::*;
    use asperity_numbers::Random;

    #[test]
    fn the_envelope_is_the_highest_of_all_parabolas() {
        let (side, step, radius) = (48, 0.05, 0.4);
        let field = gaussian((side, step), 0.05, &mut Random::new(3), self_affine(0.8, 0.7));
        let found = envelope(&field, radius);
        for (x, y) in [(0, 0), (47, 3), (20, 31), (5, 47)] {
            let mut most = f64::MIN;
            for dy in -47_i64..48 {
                for dx in -47_i64..48 {
                    let away = (dx * dx + dy * dy) as f64 * step * step / (2.0 * radius);
                    most = most.max(f64::from(field.point(x + dx, y + dy)) - away);
                }
            }
            assert!((f64::from(found.point(x, y)) - most).abs() < 1e-6, "{x} {y}");
        }
    }

    #[test]
    fn tip_bridges_narrow_groove_and_follows_wide_one() {
        let groove = |width: f64| {
            HeightField::from_fn(512, 0.02, |x, _| if (x - 5.0).abs() < 0.5 * width { -0.2 } else { 0.0 })
        };
        let depth = |width: f64, radius: f64| -envelope(&groove(width), radius).sample(5.0, 1.0).height_mm;
        // It sags between the edges by the chord's depth, w^2 / (8 R).
        assert!((depth(0.4, 1.0) - 0.4 * 0.4 / 8.0).abs() < 0.003, "{}", depth(0.4, 1.0));
        assert!((depth(3.0, 1.0) - 0.2).abs() < 1e-6);
        assert!((depth(0.1, 0.01) - 0.1 * 0.1 / 0.08).abs() < 0.1);
    }
}
