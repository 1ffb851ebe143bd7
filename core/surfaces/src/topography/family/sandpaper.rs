use asperity_numbers::Elementary as _;
use std::f64::consts::TAU;

use super::super::HeightField;
use super::super::spectrum::{blur, gaussian, self_affine};
use super::Grid;
use super::cells::Cells;
use super::stamp::stamp;
use asperity_numbers::Random;

/// Spread of the logarithm of grain sizes of one grade.
const SPREAD: f64 = 0.15;

/// Coated abrasive of a mean grain size in millimetres (FEPA 43: P60 is 0.269, P120 0.125, P240
/// 0.0585). Grains are blunted three-sided pyramids, 0.6 of their size high, one every 1.25 sizes.
/// Resin rounds them, and the backing waves a little.
pub fn sandpaper(grid: Grid, grain_mm: f64, random: &mut Random) -> HeightField {
    let (side, step) = grid;
    let mut field = HeightField::flat(side, step);
    let cells = Cells::new(grid, 1.25 * grain_mm, 1.0, random);
    for (_, middle) in cells.all() {
        let size = grain_mm * (SPREAD * random.normal()).exp_e();
        stand(&mut field, middle, size, random);
    }
    let mut field = blur(&field, 0.12 * grain_mm);
    field.add(&gaussian(grid, 0.03 * grain_mm + 0.002, random, self_affine(0.25, 0.8)));
    field
}

/// Places a grain where it is higher than the field.
fn stand(field: &mut HeightField, middle: [f64; 2], size: f64, random: &mut Random) {
    let base = 0.6 * size;
    let turn = TAU * random.unit();
    let faces: [(f64, f64, f64); 3] = std::array::from_fn(|i| {
        let angle = turn + TAU * (i as f64 + 0.6 * (random.unit() - 0.5)) / 3.0;
        (angle.cosine(), angle.sine(), (0.8 + 0.4 * random.unit()) / (0.5 * size))
    });
    let height = base * (0.75 + 0.25 * random.unit());
    stamp(field, middle, size, |x, y, there| {
        let slope = faces.iter().map(|(c, s, steep)| (c * x + s * y) * steep).fold(0.0, f64::max);
        there.max(height * (1.0 - slope).min(0.85))
    });
}
