use asperity_diagnostics::{Diagnostic, one_of};
use asperity_numbers::Random;
use asperity_surfaces::stylus::{SAMPLE_HZ, Tool};
use asperity_surfaces::topography::{Contact, HeightField, MadeSurface, made_surfaces};

use super::GRID;
use super::strokes::along;
use crate::felt::{Felt, Hand};

/// The [made surface](made_surfaces) with a name.
///
/// # Errors
/// An unknown name; the error says the nearest one.
pub fn surface(name: &str) -> Result<MadeSurface, Diagnostic> {
    let all = made_surfaces();
    match all.iter().position(|s| s.name == name) {
        Some(at) => Ok(all[at].clone()),
        None => Err(Diagnostic::new(format!("no made surface is called `{name}`"))
            .help(one_of(name, all.iter().map(|s| s.name.as_str()).collect::<Vec<_>>()))),
    }
}

/// Pitch of a grating's ridges in mm, along x. None for other surfaces.
pub fn pitch_mm(surface: &MadeSurface) -> Option<f64> {
    surface.pitch_mm(GRID)
}

/// Largest width of a piece, in widths of those trained on.
const MOST_TIMES: usize = 8;

/// A piece of a made surface as the pen of the [simulation](asperity_surfaces::stylus) meets it: a
/// square that repeats, of 20.48 mm unless it is [wide](Ground::wide).
///
/// Making one takes 0.3 to 0.9 s, a stroke over it 7 to 10 ms for each of its seconds: measured on
/// thirteen surfaces and 8 s, in a test build, on one of two shared virtual AMD EPYC cores, so these
/// are upper bounds. The model was trained on such signals. As one signal it should have the power of
/// all three axes ([`Spectrometer`](crate::Spectrometer)).
#[derive(Clone, Debug)]
pub struct Ground {
    envelope: HeightField,
    contact: Contact,
}

impl Ground {
    /// A piece of a surface. Each seed gives another piece, as in [`MadeSurface::patch`]; none was
    /// trained on, but for the odds of 64 bits.
    pub fn new(surface: &MadeSurface, seed: u64) -> Self {
        Self::wide(surface, seed, 0.0)
    }

    /// A piece that is at least `least_mm` long and wide, at most 163.84 mm. A piece repeats after its
    /// length, so a straight stroke should be shorter where repetition is measured. A piece of 82 mm
    /// takes some seconds.
    pub fn wide(surface: &MadeSurface, seed: u64, least_mm: f64) -> Self {
        let narrow_mm = GRID.0 as f64 * GRID.1;
        let times = (least_mm / narrow_mm).ceil().clamp(1.0, MOST_TIMES as f64) as usize;
        let seed = Random::new(seed ^ 0x6e0d_91ec_e000).bits();
        let piece = surface.wide_patch(GRID, times.next_power_of_two(), seed);
        Self { envelope: Tool::PEN.track(&piece, &surface.contact), contact: surface.contact }
    }

    /// Acceleration that the pen feels along a stroke, along the normal and the surface, at
    /// [`SAMPLE_HZ`]. Each seed starts at another place of the piece. Where the hand does not press,
    /// nothing is felt. The same seeds give the same bits.
    ///
    /// Strokes may be longer and faster than those trained on. The model has seen nothing above 3.5 N
    /// or 300 mm/s.
    pub fn felt(&self, hand: &Hand, seed: u64) -> Felt {
        let random = &mut Random::new(seed ^ 0x91ac_e000);
        let length = self.envelope.length_mm();
        let place_mm = [random.range(0.0, length), random.range(0.0, length)];
        let places = hand.position_mm();
        let at = |sample: usize| places.get(sample).map_or(([0.0; 2], 0.0), |[x, y, z]| ([*x, *y], *z));
        let axes = along(&self.envelope, self.contact, places.len().saturating_sub(1), at, place_mm);
        Felt { rate_hz: f64::from(SAMPLE_HZ), acceleration_m_s2: axes.into() }
    }
}

#[cfg(test)]
#[path = "ground_tests.rs"]
mod tests;
