use asperity_numbers::Elementary as _;
use std::f64::consts::{PI, TAU};

use super::super::HeightField;
use super::super::spectrum::{gaussian, self_affine};
use super::Grid;
use super::cells::Cells;
use super::stamp::{Strand, lay, stamp};
use asperity_numbers::Random;

/// Kinds of pile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pile {
    /// Loops of yarn, in rows along y.
    Loop,
    /// Loops that lie as they fell.
    Curl,
    /// Bunches of cut ends.
    Cut,
    /// Crossed fibres.
    Felt,
}

/// Tufts on a backing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Carpet {
    /// Kind of tufts.
    pub pile: Pile,
    /// Distance of tufts in millimetres; for a felt the length of its fibres.
    pub pitch_mm: f64,
    /// Height of a tuft over the backing, in millimetres.
    pub height_mm: f64,
    /// Disorder of the tufts' lattice, 0 to 1.
    pub disorder: f64,
    /// Distance of plies along a loop's yarn, width of a cut end, or width of a felt's fibre, in
    /// millimetres.
    pub ply_mm: f64,
}

/// Height of the backing's waves, as a part of the pile's height.
const WAVES: f64 = 0.05;
/// Length and width of a loop's yarn, as parts of the pitch: half lengths.
const LOOP: [f64; 2] = [0.62, 0.38];

/// Tufts of unequal height with stray fibres on a wavy backing. Loops are arcs of twisted two-ply yarn.
/// Cut tufts are domes of fibre ends that lean one way. A felt is layers of fibres.
pub fn carpet(grid: Grid, of: &Carpet, random: &mut Random) -> HeightField {
    let mut field = HeightField::flat(grid.0, grid.1);
    if of.pile == Pile::Felt {
        felt(&mut field, of, random);
    } else {
        let cells = Cells::new(grid, of.pitch_mm, of.disorder, random);
        for (_, middle) in cells.all() {
            let height = of.height_mm * (1.0 + 0.08 * random.normal()).clamp(0.7, 1.3);
            match of.pile {
                Pile::Cut => bunch(&mut field, of, middle, height, random),
                Pile::Loop => arc(&mut field, of, middle, (height, 0.25 * PI), random),
                _ => arc(&mut field, of, middle, (height, PI), random),
            }
        }
    }
    fuzz(&mut field, 0.15, random);
    field.add(&gaussian(grid, WAVES * of.height_mm, random, self_affine(0.3 / of.pitch_mm, 0.8)));
    field
}

/// A loop: an arc of two-ply yarn, up to `spread` off the rows' direction.
fn arc(
    field: &mut HeightField,
    of: &Carpet,
    middle: [f64; 2],
    (height, spread): (f64, f64),
    random: &mut Random,
) {
    let way = 0.5 * PI + spread * (2.0 * random.unit() - 1.0) * of.disorder.max(0.2);
    let (sin, cos) = way.sine_cosine();
    let [half, radius] = LOOP.map(|part| part * of.pitch_mm * (1.0 + 0.08 * random.normal()));
    let (bend, phase) = (0.25 * random.normal() / half, TAU * random.unit());
    // Yarn wider than the pile's height lies flat.
    let thick = radius.min(0.6 * height);
    let rise = height - thick;
    stamp(field, middle, half + 0.5 * radius, |dx, dy, there| {
        let along = dx * cos + dy * sin;
        let across = (dy * cos - dx * sin + bend * along * along) / radius;
        let (part, section) = ((along / half).powi(2), 1.0 - across * across);
        if part >= 1.0 || section <= 0.0 {
            return there;
        }
        // Plies are ridges around the yarn, with filaments on them.
        let turn = across.arc_sine() + PI * along / of.ply_mm + phase;
        let groove = 1.0 - turn.cosine().abs();
        let filament = (9.0 * across + 4.0 * turn).cosine();
        let top = section.sqrt() - 0.45 * groove * groove + 0.02 * filament;
        there.max(rise * (1.0 - part) + thick * top)
    });
}

/// A cut tuft: a dome, and the ends of its fibres.
fn bunch(field: &mut HeightField, of: &Carpet, middle: [f64; 2], height: f64, random: &mut Random) {
    let spread = 0.55 * of.pitch_mm;
    stamp(field, middle, spread, |dx, dy, there| {
        let part = (dx * dx + dy * dy) / (spread * spread);
        there.max(0.8 * height * (1.0 - part))
    });
    let ends = (2.5 * (spread / of.ply_mm).powi(2)).ceil() as usize;
    // A tuft leans; its ends are seen aslant.
    let (sin, cos) = (TAU * random.unit()).sine_cosine();
    for _ in 0..ends {
        let (away, angle) = (spread * random.unit().sqrt(), TAU * random.unit());
        let place = [middle[0] + away * angle.cosine(), middle[1] + away * angle.sine()];
        let radius = 0.5 * of.ply_mm * random.range(0.7, 1.2);
        let top = height * (0.95 - 0.75 * (away / spread).powi(2) + 0.06 * random.normal());
        stamp(field, place, 1.7 * radius, |dx, dy, there| {
            let (along, across) = (dx * cos + dy * sin, dy * cos - dx * sin);
            let part = ((along / 1.7).powi(2) + across * across) / (radius * radius);
            if part < 1.0 { there.max(top - radius * (1.0 - (1.0 - part).sqrt())) } else { there }
        });
    }
}

/// Fibres, three deep.
fn felt(field: &mut HeightField, of: &Carpet, random: &mut Random) {
    let length = field.length_mm();
    let (radius, long) = (0.5 * of.ply_mm, 2.0 * of.pitch_mm);
    let many = (3.0 * length * length / (2.0 * radius * long)).ceil() as usize;
    for n in 0..many {
        let layer = n as f64 / many as f64 + 0.05 * random.normal();
        let axis_mm = Some((of.height_mm - radius) * layer);
        let from = [length * random.unit(), length * random.unit()];
        let curl = 0.5 + of.disorder;
        lay(field, &Strand { from, length_mm: long, radius_mm: radius, curl, axis_mm }, random);
    }
}

/// Lays this many thin stray fibres a square millimetre on the field.
pub(super) fn fuzz(field: &mut HeightField, per_mm2: f64, random: &mut Random) {
    let length = field.length_mm();
    let radius_mm = 0.012_f64.max(0.75 * field.step_mm());
    for _ in 0..(per_mm2 * length * length) as usize {
        let from = [length * random.unit(), length * random.unit()];
        let strand = Strand { from, length_mm: random.range(0.4, 1.5), radius_mm, curl: 1.2, axis_mm: None };
        lay(field, &strand, random);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tufts_stand_as_high_as_stated_over_a_backing() {
        for pile in [Pile::Loop, Pile::Curl, Pile::Cut, Pile::Felt] {
            let of = Carpet { pile, pitch_mm: 2.0, height_mm: 0.6, disorder: 0.5, ply_mm: 0.3 };
            let field = carpet((512, 0.04), &of, &mut Random::new(4));
            let mut sorted = field.heights().to_vec();
            sorted.sort_by(f32::total_cmp);
            let high = f64::from(sorted[sorted.len() * 98 / 100]);
            assert!((high / 0.6 - 1.0).abs() < 0.25, "{pile:?}: {high}");
            let low = f64::from(sorted[sorted.len() / 100]);
            assert!(low < 0.3, "{pile:?}: {low}");
        }
    }

    #[test]
    fn cut_pile_is_isotropic_and_loops_lie_in_rows() {
        let ratio = |pile: Pile| {
            let of = Carpet { pile, pitch_mm: 2.0, height_mm: 0.6, disorder: 0.2, ply_mm: 0.5 };
            let field = carpet((512, 0.04), &of, &mut Random::new(4));
            // Part of the height left in means over rows and columns: rows of tufts remain.
            let line = |at: &dyn Fn(i64, i64) -> f32| {
                let means: Vec<f64> =
                    (0..512).map(|i| (0..512).map(|j| f64::from(at(i, j))).sum::<f64>() / 512.0).collect();
                let mean = means.iter().sum::<f64>() / 512.0;
                means.iter().map(|m| (m - mean).powi(2)).sum::<f64>()
            };
            line(&|i, j| field.point(i, j)) / line(&|i, j| field.point(j, i))
        };
        assert!(ratio(Pile::Loop) > 3.0, "{}", ratio(Pile::Loop));
        assert!((0.4..2.5).contains(&ratio(Pile::Cut)), "{}", ratio(Pile::Cut));
    }
}
