use super::super::HeightField;
use super::super::spectrum::{gaussian, self_affine};
use super::Grid;
use crate::material::Random;

/// A moulded texture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pebbled {
    /// From pebble to pebble in millimetres.
    pub pitch_mm: f64,
    /// From valley to top in millimetres.
    pub height_mm: f64,
    /// How flat tops and valleys are: 0 is as the waves come, 4 all but steps.
    pub flatness: f64,
    /// Root mean square height of the fine matt on top, in millimetres.
    pub matt_mm: f64,
}

/// Waves of about one length, their tops and valleys flattened, as in grained plastic.
pub fn pebbled(grid: Grid, of: &Pebbled, random: &mut Random) -> HeightField {
    let middle = 1.0 / of.pitch_mm;
    let band = |fx: f64, fy: f64| (-0.5 * ((fx.hypot(fy) - middle) / (0.18 * middle)).powi(2)).exp();
    let mut field = gaussian(grid, 1.0, random, band);
    let steep = of.flatness.max(1e-3);
    let most = steep.tanh();
    for height in field.heights_mut() {
        *height = (0.5 * of.height_mm * (steep * f64::from(*height)).tanh() / most)
            .clamp(-of.height_mm, of.height_mm) as f32;
    }
    field.add(&gaussian(grid, of.matt_mm, random, self_affine(3.0 * middle, 0.6)));
    field
}

/// A sheet without a texture that the eye would name.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sheet {
    /// Root mean square height in millimetres.
    pub height_mm: f64,
    /// Where the spectrum begins to fall, in cycles per millimetre.
    pub roll_off_per_mm: f64,
    /// Hurst exponent of the fall, 0 to 1.
    pub hurst: f64,
    /// How much longer than wide its marks are, along y: 1 for none, 20 for a brushed sheet.
    pub lay: f64,
}

/// A self-affine Gaussian patch, stretched along its lay.
pub fn sheet(grid: Grid, of: &Sheet, random: &mut Random) -> HeightField {
    let density = self_affine(of.roll_off_per_mm, of.hurst);
    gaussian(grid, of.height_mm, random, |fx, fy| density(fx, of.lay * fy))
}
