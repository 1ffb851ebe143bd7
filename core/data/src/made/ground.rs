use asperity_diagnostics::{Diagnostic, one_of};
use asperity_numbers::Random;
use asperity_surfaces::stylus::{SAMPLE_HZ, Tool};
use asperity_surfaces::topography::{Contact, HeightField, MadeSurface, made_surfaces};

use super::GRID;
use super::strokes::along;
use crate::felt::{Felt, Hand};

/// The [made surface](made_surfaces) of a name.
///
/// # Errors
/// A name that none has, with the nearest that one has.
pub fn surface(name: &str) -> Result<MadeSurface, Diagnostic> {
    let all = made_surfaces();
    match all.iter().position(|s| s.name == name) {
        Some(at) => Ok(all[at].clone()),
        None => Err(Diagnostic::new(format!("no made surface is called `{name}`"))
            .help(one_of(name, all.iter().map(|s| s.name.as_str()).collect::<Vec<_>>()))),
    }
}

/// Distance in mm, along x, of the ridges of a grating's pieces; none of other surfaces.
pub fn pitch_mm(surface: &MadeSurface) -> Option<f64> {
    surface.pitch_mm(GRID)
}

/// A piece is at most so many times as wide as those trained on.
const MOST_TIMES: usize = 8;

/// A piece of a made surface, as the pen of the [simulation](asperity_surfaces::stylus) meets it: a square that
/// repeats, of 20.48 mm unless it is [wide](Ground::wide).
///
/// Making one takes 0.3 to 0.9 s, a stroke over it 7 to 10 ms for each of its seconds: of thirteen surfaces
/// and 8 s, in a build for tests, on a virtual AMD EPYC core of two that were shared with other builds, so
/// that these are upper bounds. What is felt is what the model was trained on: it is to answer, as one
/// signal, the power of all three axes ([`Spectrometer`](crate::Spectrometer)).
#[derive(Clone, Debug)]
pub struct Ground {
    envelope: HeightField,
    contact: Contact,
}

impl Ground {
    /// A piece of a surface; another seed is another piece, as [`MadeSurface::patch`] says, and none that
    /// was trained on but by the odds of 64 bits.
    pub fn new(surface: &MadeSurface, seed: u64) -> Self {
        Self::wide(surface, seed, 0.0)
    }

    /// The same of a piece that is at least so many millimetres long and wide, 163.84 at most. A piece
    /// repeats after its length: a straight stroke should not meet the repeat while repetition is looked for.
    /// A piece of 82 mm takes some seconds.
    pub fn wide(surface: &MadeSurface, seed: u64, least_mm: f64) -> Self {
        let narrow_mm = GRID.0 as f64 * GRID.1;
        let times = (least_mm / narrow_mm).ceil().clamp(1.0, MOST_TIMES as f64) as usize;
        let seed = Random::new(seed ^ 0x6e0d_91ec_e000).bits();
        let piece = surface.wide_patch(GRID, times.next_power_of_two(), seed);
        Self { envelope: Tool::PEN.track(&piece, &surface.contact), contact: surface.contact }
    }

    /// What the pen feels of a stroke: acceleration along the normal and along the surface at
    /// [`SAMPLE_HZ`]. Another seed is another place of the piece. Where the hand does not press nothing is
    /// felt. The same bits for the same seeds.
    ///
    /// Strokes may be longer and faster than those trained on; above 3.5 N or 300 mm/s the model has seen
    /// nothing like it.
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
