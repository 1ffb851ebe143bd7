//! A made surface and its pieces.

use super::HeightField;
use super::family::{
    Carpet, Foam, Grating, Grid, Pebbled, Sheet, Weave, Wood, carpet, foam, grating, pebbled, sandpaper,
    sheet, weave, wood,
};
use asperity_numbers::Random;

/// Families of surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Family {
    /// Coated abrasives.
    Sandpaper,
    /// Cloth.
    Weave,
    /// Straight ridges.
    Grating,
    /// Cut foam.
    Foam,
    /// Tufts.
    Carpet,
    /// Planed boards.
    Wood,
    /// Grained plastic.
    Pebbled,
    /// Smooth sheets.
    Sheet,
}

impl Family {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::Sandpaper,
        Self::Weave,
        Self::Grating,
        Self::Foam,
        Self::Carpet,
        Self::Wood,
        Self::Pebbled,
        Self::Sheet,
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sandpaper => "sandpaper",
            Self::Weave => "weave",
            Self::Grating => "grating",
            Self::Foam => "foam",
            Self::Carpet => "carpet",
            Self::Wood => "wood",
            Self::Pebbled => "pebbled plastic",
            Self::Sheet => "sheet",
        }
    }
}

/// Material figures of the contact with a tip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Modulus in MPa of the surface alone under a ball of millimetres. Asperities and lower layers
    /// yield too, so rough or thin surfaces are far below Young's modulus of the material. Chosen, not
    /// measured.
    pub modulus_mpa: f64,
    /// Coefficient of kinetic friction of a steel tip on it.
    pub friction: f64,
    /// Hunt and Crossley's damping in s/m: relative growth of the contact's force for each m/s of
    /// approach.
    pub damping_s_m: f64,
}

/// Recipe of a patch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Recipe {
    Sandpaper(f64),
    Weave(Weave),
    Grating(Grating),
    Foam(Foam),
    Carpet(Carpet),
    Wood(Wood),
    Pebbled(Pebbled),
    Sheet(Sheet),
}

/// A made surface.
#[derive(Clone, Debug, PartialEq)]
pub struct MadeSurface {
    /// Unique name.
    pub name: String,
    /// Description in a sentence.
    pub description: String,
    /// Its family.
    pub family: Family,
    /// Material figures.
    pub contact: Contact,
    pub(super) recipe: Recipe,
}

impl MadeSurface {
    /// A seed of its own, from its name.
    pub fn seed(&self) -> u64 {
        self.name.bytes().fold(0, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3))
    }

    /// A patch on a grid. Another seed gives another piece of the surface: pitches differ by 3 % and
    /// heights by 8 % (root mean square). Gratings are machined: only heights (by 4 %), edges and
    /// roughness differ. Rings of wood differ by up to 15 %.
    pub fn patch(&self, grid: Grid, seed: u64) -> HeightField {
        let random = &mut Random::new(seed ^ self.seed());
        self.recipe.piece(random).patch(grid, random)
    }

    /// A patch of this seed's piece, `times` as long and wide as the one on this grid. Its pitch fits
    /// around the smaller patch, so both have the same pitch.
    pub fn wide_patch(&self, grid: Grid, times: usize, seed: u64) -> HeightField {
        let random = &mut Random::new(seed ^ self.seed());
        self.recipe.piece(random).fitted(grid).patch((times.max(1) * grid.0, grid.1), random)
    }

    /// Distance in mm, along x, of the ridges of a grating's patches on this grid; none of other surfaces.
    pub fn pitch_mm(&self, grid: Grid) -> Option<f64> {
        match &self.recipe {
            Recipe::Grating(of) => Some(of.period_on(grid)),
            _ => None,
        }
    }

    /// A patch with exactly the stated figures, unlike any piece.
    pub fn as_stated(&self, grid: Grid, seed: u64) -> HeightField {
        self.recipe.patch(grid, &mut Random::new(seed ^ self.seed()))
    }
}

/// Spreads of lengths and of heights from piece to piece.
const SPREAD: [f64; 2] = [0.03, 0.08];

impl Recipe {
    /// A patch of exactly this recipe.
    pub(super) fn patch(&self, grid: Grid, random: &mut Random) -> HeightField {
        match self {
            Self::Sandpaper(grain_mm) => sandpaper(grid, *grain_mm, random),
            Self::Weave(of) => weave(grid, of, random),
            Self::Grating(of) => grating(grid, of, random),
            Self::Foam(of) => foam(grid, of, random),
            Self::Carpet(of) => carpet(grid, of, random),
            Self::Wood(of) => wood(grid, of, random),
            Self::Pebbled(of) => pebbled(grid, of, random),
            Self::Sheet(of) => sheet(grid, of, random),
        }
    }

    /// This recipe with pitches that fit around a patch.
    fn fitted(self, grid: Grid) -> Self {
        match self {
            Self::Weave(of) => Self::Weave(Weave { pitch_mm: of.pitch_on(grid), ..of }),
            Self::Grating(of) => Self::Grating(Grating { period_mm: of.period_on(grid), ..of }),
            Self::Wood(of) => Self::Wood(Wood { ring_mm: of.ring_on(grid), ..of }),
            other => other,
        }
    }

    /// This recipe for one piece; no two pieces are quite alike.
    fn piece(self, random: &mut Random) -> Self {
        let [long, high] = SPREAD.map(|s| 1.0 + s * random.normal().clamp(-2.5, 2.5));
        match self {
            Self::Sandpaper(grain_mm) => Self::Sandpaper(grain_mm * long),
            Self::Weave(of) => Self::Weave(Weave {
                pitch_mm: of.pitch_mm * long,
                thickness: of.thickness * high,
                fuzz: of.fuzz * random.range(0.7, 1.3),
                ..of
            }),
            // Machined, so only wear differs.
            Self::Grating(of) => Self::Grating(Grating {
                depth_mm: of.depth_mm * (0.5 + 0.5 * high),
                edge: (of.edge * random.range(1.0, 1.2)).min(0.5),
                roughness_mm: of.roughness_mm * random.range(0.7, 1.3),
                ..of
            }),
            Self::Foam(of) => Self::Foam(Foam { pore_mm: of.pore_mm * long, depth: of.depth * high, ..of }),
            Self::Carpet(of) => {
                Self::Carpet(Carpet { pitch_mm: of.pitch_mm * long, height_mm: of.height_mm * high, ..of })
            }
            Self::Wood(of) => Self::Wood(Wood {
                // Rings differ like years.
                ring_mm: of.ring_mm * random.range(0.85, 1.15),
                ring_height_mm: of.ring_height_mm * high,
                fibre_height_mm: of.fibre_height_mm * high,
                pores: of.pores * random.range(0.85, 1.15),
                ..of
            }),
            Self::Pebbled(of) => {
                Self::Pebbled(Pebbled { pitch_mm: of.pitch_mm * long, height_mm: of.height_mm * high, ..of })
            }
            Self::Sheet(of) => Self::Sheet(Sheet {
                height_mm: of.height_mm * high,
                roll_off_per_mm: of.roll_off_per_mm / long,
                ..of
            }),
        }
    }
}
