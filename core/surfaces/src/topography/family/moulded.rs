use super::super::HeightField;
use super::super::spectrum::{gaussian, self_affine};
use super::cells::Cells;
use super::{Grid, moved};
use asperity_numbers::Elementary as _;
use asperity_numbers::Random;

/// Original of a moulded texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mould {
    /// Eroded or etched metal: waves of about one length.
    Waves,
    /// Hide: pebbles with creases between them.
    Hide,
}

/// A moulded texture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pebbled {
    /// Original.
    pub mould: Mould,
    /// Distance of pebbles in millimetres.
    pub pitch_mm: f64,
    /// From valley to top in millimetres.
    pub height_mm: f64,
    /// Flatness of tops. Waves: 0 is unchanged and 4 almost steps, with valleys as flat as tops. Hide:
    /// 1 is domes and 4 plateaus.
    pub flatness: f64,
    /// Root mean square height of the fine matt on top, in millimetres.
    pub matt_mm: f64,
}

/// A moulded texture with its matt.
pub fn pebbled(grid: Grid, of: &Pebbled, random: &mut Random) -> HeightField {
    let mut field = match of.mould {
        Mould::Waves => waves(grid, of, random),
        Mould::Hide => hide(grid, of, random),
    };
    field.add(&gaussian(grid, of.matt_mm, random, self_affine(3.0 / of.pitch_mm, 0.6)));
    field
}

/// Waves of about one length, their tops and valleys flattened.
fn waves(grid: Grid, of: &Pebbled, random: &mut Random) -> HeightField {
    let middle = 1.0 / of.pitch_mm;
    let band = |fx: f64, fy: f64| {
        let off = (fx.hypotenuse(fy) - middle) / (0.18 * middle);
        if off.abs() < 4.0 { (-0.5 * off * off).exp_e() } else { 0.0 }
    };
    let mut field = gaussian(grid, 1.0, random, band);
    let steep = of.flatness.max(1e-3);
    let most = steep.hyperbolic_tangent();
    for height in field.heights_mut() {
        *height = (0.5 * of.height_mm * (steep * f64::from(*height)).hyperbolic_tangent() / most)
            .clamp(-of.height_mm, of.height_mm) as f32;
    }
    field
}

/// Round pebbles of different heights around scattered points, with wandering creases between them.
fn hide(grid: Grid, of: &Pebbled, random: &mut Random) -> HeightField {
    let cells = Cells::new(grid, of.pitch_mm, 0.9, random);
    let heights: Vec<f64> = (0..cells.count * cells.count).map(|_| random.range(0.75, 1.0)).collect();
    let middle = 1.0 / of.pitch_mm;
    let slow = |fx: f64, fy: f64| if fx.hypotenuse(fy) < 2.0 * middle { 1.0 } else { 0.0 };
    let shift = [0, 1].map(|_| gaussian(grid, 0.07 * of.pitch_mm, random, slow));
    moved(&shift, |x, y| {
        let [near, next] = cells.two_nearest(x, y);
        // 0 in a crease, 1 where the top begins.
        let into = (of.flatness * (next.1 - near.1) / cells.pitch_mm).min(1.0);
        of.height_mm * heights[near.0] * (1.0 - (1.0 - into).powi(2))
    })
}

/// A sheet without a visible texture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sheet {
    /// Root mean square height in millimetres.
    pub height_mm: f64,
    /// Roll-off of the spectrum in cycles per millimetre.
    pub roll_off_per_mm: f64,
    /// Hurst exponent of the fall, 0 to 1.
    pub hurst: f64,
    /// Length over width of its marks along y: 1 for none, 20 for a brushed sheet.
    pub lay: f64,
}

/// A self-affine Gaussian patch, stretched along its lay.
pub fn sheet(grid: Grid, of: &Sheet, random: &mut Random) -> HeightField {
    let density = self_affine(of.roll_off_per_mm, of.hurst);
    gaussian(grid, of.height_mm, random, |fx, fy| density(fx, of.lay * fy))
}
