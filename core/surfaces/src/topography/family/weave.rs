use asperity_numbers::Elementary as _;
use std::f64::consts::{PI, TAU};

use super::super::HeightField;
use super::super::spectrum::{gaussian, self_affine};
use super::tufts::fuzz;
use super::{Grid, fits, fitting, moved};
use asperity_numbers::Random;

/// Order of crossing threads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Binding {
    /// Every other one.
    Plain,
    /// Over two, under two, one further in every row.
    Twill,
    /// Over four, under one, two further in every row.
    Satin,
}

impl Binding {
    /// Period in threads.
    fn repeat(self) -> usize {
        match self {
            Self::Plain => 2,
            Self::Twill => 4,
            Self::Satin => 5,
        }
    }

    /// Whether the warp is on top where thread `i` crosses row `j`.
    fn warp_on_top(self, i: usize, j: usize) -> bool {
        match self {
            Self::Plain => (i + j).is_multiple_of(2),
            Self::Twill => (i + j) % 4 < 2,
            Self::Satin => !(i + 2 * j).is_multiple_of(5),
        }
    }
}

/// Cloth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weave {
    /// Distance of warp threads in millimetres; wefts are equally close.
    pub pitch_mm: f64,
    /// Order of crossing threads.
    pub binding: Binding,
    /// Width of a thread, as a part of the pitch.
    pub cover: f64,
    /// Thickness of a thread, as a part of the pitch.
    pub thickness: f64,
    /// Root mean square height of fibres and slubs, as a part of the pitch.
    pub fibre: f64,
    /// Root mean square wander of threads, as a part of the pitch.
    pub wander: f64,
    /// Stray fibres on a square millimetre.
    pub fuzz: f64,
}

impl Weave {
    /// The pitch on a grid, in millimetres.
    pub fn pitch_on(&self, grid: Grid) -> f64 {
        fitting(grid, self.pitch_mm, self.binding.repeat())
    }
}

/// Height of the twisted yarn's ridges, as a part of its thickness, and ridges in a pitch.
const TWIST: (f64, f64) = (0.05, 2.5);

/// One set of threads: thickness and start of the twist of each.
struct Threads(Vec<[f64; 2]>);

impl Threads {
    fn new(count: usize, random: &mut Random) -> Self {
        let one = |_| [(1.0 + 0.06 * random.normal()).clamp(0.8, 1.2), TAU * random.unit()];
        Self((0..count).map(one).collect())
    }

    /// Height over the middle plane of thread `i`, in thicknesses; `None` beside it. `u` is across it
    /// (-0.5 to 0.5), `v` along it in crossings; `up` says whether it is on top at a crossing.
    fn height(&self, i: usize, u: f64, v: f64, cover: f64, up: impl Fn(i64) -> bool) -> Option<f64> {
        let [size, phase] = self.0[i];
        let across = 2.0 * u / (cover * size);
        let section = 1.0 - across * across;
        if section <= 0.0 {
            return None;
        }
        // Between crossings it rises or falls along half a cosine, or stays where the binding lets it
        // float.
        let before = (v - 0.5).floor();
        let [from, to] = [before as i64, before as i64 + 1].map(|j| if up(j) { 0.5 } else { -0.5 });
        let part = 0.5 - 0.5 * (PI * (v - 0.5 - before)).cosine();
        let twist = (TAU * (TWIST.1 * v + 0.6 * across) + phase).cosine();
        Some(from + (to - from) * part + 0.5 * size * section.sqrt() + TWIST.0 * twist)
    }
}

/// Warp along y and weft along x: twisted threads of flat elliptic section over and under each other in
/// the binding's order. Thickness differs from thread to thread, threads wander, and stray fibres lie
/// on top.
pub fn weave(grid: Grid, of: &Weave, random: &mut Random) -> HeightField {
    let (count, pitch) = (fits(grid, of.pitch_mm, of.binding.repeat()), of.pitch_on(grid));
    let slow = self_affine(0.15 / pitch, 1.5);
    let shift =
        [gaussian(grid, of.wander * pitch, random, &slow), gaussian(grid, of.wander * pitch, random, &slow)];
    let (warps, wefts) = (Threads::new(count, random), Threads::new(count, random));
    let thick = of.thickness * pitch;
    let number = |n: i64| n.rem_euclid(count as i64) as usize;
    let mut field = moved(&shift, |x, y| {
        let (x, y) = (x / pitch, y / pitch);
        let (i, j) = (x.floor(), y.floor());
        let on_top = |i: i64, j: i64| of.binding.warp_on_top(number(i), number(j));
        let warp = warps.height(number(i as i64), x - i - 0.5, y, of.cover, |j| on_top(i as i64, j));
        let weft = wefts.height(number(j as i64), y - j - 0.5, x, of.cover, |i| !on_top(i, j as i64));
        // A hole between threads is a little below both.
        thick * warp.unwrap_or(-0.6).max(weft.unwrap_or(-0.6))
    });
    fuzz(&mut field, of.fuzz, random);
    field.add(&gaussian(grid, of.fibre * pitch, random, self_affine(2.0 / pitch, 0.6)));
    field
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cloth(binding: Binding, cover: f64) -> HeightField {
        let of = Weave { pitch_mm: 0.8, binding, cover, thickness: 0.5, fibre: 0.0, wander: 0.0, fuzz: 0.0 };
        weave((800, 0.02), &of, &mut Random::new(2))
    }

    #[test]
    fn weave_thread_floats_over_its_binding_and_dips_elsewhere() {
        // One thickness is 0.4 mm. Tops of threads lie at one thickness, apart from twist and size.
        for binding in [Binding::Plain, Binding::Twill, Binding::Satin] {
            let field = cloth(binding, 0.95);
            for (i, j) in [(2, 3), (3, 5), (4, 1), (5, 5), (7, 8)] {
                let top = field.sample((i as f64 + 0.5) * 0.8, (j as f64 + 0.5) * 0.8).height_mm;
                assert!((top - 0.4).abs() < 0.05, "{binding:?} {i} {j}: {top}");
                let floats = binding.warp_on_top(i, j) && binding.warp_on_top(i, j + 1);
                let between = field.sample((i as f64 + 0.5) * 0.8, (j as f64 + 1.0) * 0.8).height_mm;
                assert!((between > 0.3) == floats, "{binding:?} {i} {j}: {between}");
            }
        }
    }

    #[test]
    fn an_open_cloth_has_holes_and_a_dense_one_has_none() {
        let holes = |cover: f64| {
            let field = cloth(Binding::Plain, cover);
            field.heights().iter().filter(|h| **h < -0.23).count() as f64 / field.heights().len() as f64
        };
        // Square holes between threads of so much of the pitch.
        assert!((holes(0.6) - 0.16).abs() < 0.04, "{}", holes(0.6));
        assert!(holes(1.0) < 0.02, "{}", holes(1.0));
    }
}
