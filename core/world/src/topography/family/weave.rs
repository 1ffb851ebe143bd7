use super::super::HeightField;
use super::super::spectrum::{gaussian, self_affine};
use super::{Grid, fits};
use crate::material::Random;

/// Which threads lie on top.
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
    /// Threads after which it repeats.
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
    /// From warp thread to warp thread in millimetres; wefts lie as close.
    pub pitch_mm: f64,
    /// How the threads cross.
    pub binding: Binding,
    /// Thickness of a thread, as a part of the pitch.
    pub thickness: f64,
    /// Root mean square height of fibres and slubs, as a part of the pitch.
    pub fibre: f64,
    /// Root mean square wander of threads, as a part of the pitch.
    pub wander: f64,
}

/// Warp along y and weft along x, flattened ellipses in section, the upper one of each crossing arched over the lower; fibres twist along
/// the threads, and the threads wander.
pub fn weave(grid: Grid, of: &Weave, random: &mut Random) -> HeightField {
    let (side, step) = grid;
    let count = fits(grid, of.pitch_mm, of.binding.repeat());
    let pitch = side as f64 * step / count as f64;
    let slow = self_affine(0.15 / pitch, 1.5);
    let shift =
        [gaussian(grid, of.wander * pitch, random, &slow), gaussian(grid, of.wander * pitch, random, &slow)];
    let thick = of.thickness * pitch;
    // A thread's height over the middle plane: where it is in its section (u) and along (v) a crossing, both -0.5 to 0.5.
    let thread = |u: f64, v: f64, top: bool| {
        let section = (1.0 - (2.0 * u / 0.92).powi(2)).max(0.0).sqrt();
        let arch = (std::f64::consts::PI * v).cos();
        if section == 0.0 {
            -0.6 * thick
        } else {
            0.5 * thick * (section + if top { arch } else { -arch } - 1.0)
        }
    };
    let mut field = HeightField::flat(side, step);
    let (dx, dy) = (shift[0].heights(), shift[1].heights());
    for (at, height) in field.heights_mut().iter_mut().enumerate() {
        let x = ((at % side) as f64 * step + f64::from(dx[at])) / pitch;
        let y = ((at / side) as f64 * step + f64::from(dy[at])) / pitch;
        let (i, j) = (x.floor(), y.floor());
        let (u, v) = (x - i - 0.5, y - j - 0.5);
        let number = |n: f64| (n as i64).rem_euclid(count as i64) as usize;
        let warp = of.binding.warp_on_top(number(i), number(j));
        let twist = 0.02 * thick * (std::f64::consts::TAU * 4.0 * (x + y)).sin();
        *height = (thread(u, v, warp).max(thread(v, u, !warp)) + twist) as f32;
    }
    field.add(&gaussian(grid, of.fibre * pitch, random, self_affine(2.0 / pitch, 0.6)));
    field
}
