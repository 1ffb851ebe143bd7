//! Stamps of small shapes on a repeating patch, and strands of fibres.

use asperity_numbers::Elementary as _;
use std::f64::consts::TAU;

use super::super::HeightField;
use asperity_numbers::Random;

/// Changes the heights in a square of `reach_mm` around a place, at most half the patch. `height(dx,
/// dy, there)` gives a point's new height from its distance to the place in millimetres and its old
/// height.
pub(super) fn stamp(
    field: &mut HeightField,
    [x, y]: [f64; 2],
    reach_mm: f64,
    mut height: impl FnMut(f64, f64, f64) -> f64,
) {
    let (side, step) = (field.side() as i64, field.step_mm());
    let reach = ((reach_mm / step).ceil() as i64).min((side - 1) / 2);
    let (column, row) = ((x / step).round() as i64, (y / step).round() as i64);
    for j in row - reach..=row + reach {
        let base = j.rem_euclid(side) * side;
        let dy = j as f64 * step - y;
        let mut i = (column - reach).rem_euclid(side);
        for k in column - reach..=column + reach {
            if let Some(there) = field.heights_mut().get_mut((base + i) as usize) {
                *there = height(k as f64 * step - x, dy, f64::from(*there)) as f32;
            }
            i = if i + 1 == side { 0 } else { i + 1 };
        }
    }
}

/// A strand that lies on a patch.
pub(super) struct Strand {
    /// Start in millimetres.
    pub(super) from: [f64; 2],
    /// Its length in millimetres.
    pub(super) length_mm: f64,
    /// Its radius in millimetres.
    pub(super) radius_mm: f64,
    /// Turn over a length of a hundred radii, root mean square, in radians.
    pub(super) curl: f64,
    /// Height of its axis; `None` lays it on the field.
    pub(super) axis_mm: Option<f64>,
}

/// Lays a strand of round section, as short pieces one after another.
pub(super) fn lay(field: &mut HeightField, strand: &Strand, random: &mut Random) {
    let radius = strand.radius_mm;
    let piece = 5.0 * radius;
    let mut way = TAU * random.unit();
    let mut at = strand.from;
    for _ in 0..(strand.length_mm / piece) as usize {
        let (sin, cos) = way.sine_cosine();
        stamp(field, at, 0.5 * piece + radius, |dx, dy, there| {
            let along = dx * cos + dy * sin;
            let across = (dy * cos - dx * sin) / radius;
            let beyond = (along.abs() - 0.5 * piece).max(0.0) / radius;
            let section = 1.0 - across * across - beyond * beyond;
            if section <= 0.0 {
                return there;
            }
            match strand.axis_mm {
                Some(axis) => there.max(axis + radius * section.sqrt()),
                // Ends of pieces overlap.
                None if beyond > 0.0 || along < -0.5 * piece => there,
                None => there + radius * section.sqrt(),
            }
        });
        at = [at[0] + piece * cos, at[1] + piece * sin];
        way += strand.curl * (piece / (100.0 * radius)).sqrt() * random.normal();
    }
}
