use asperity_diagnostics::{Diagnostic, one_of};
use asperity_numbers::Random;
use asperity_surfaces::stylus::{SAMPLE_HZ, Tool};
use asperity_surfaces::topography::{Contact, HeightField, MadeSurface, made_surfaces};
use asperity_texture::Pattern;

use super::strokes::along;
use super::{GRID, Settings};
use crate::felt::{Felt, Hand};
use crate::history::STIFFNESS_N_PER_MM;
use crate::pattern::{self, Network, Stroke};

/// The [made surface](made_surfaces) with a name.
///
/// # Errors
/// An unknown name; the error names the nearest one.
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

/// Pieces with strokes.
const PIECES: usize = 6;
/// Width of a piece, in widths of those trained on. A piece repeats and is a sum of as many waves as
/// fit around it. If they are few, each looks like ridges.
const TIMES: usize = 4;
/// Speeds in mm/s of six strokes each, and the angle of the first to x in degrees. The others follow 30
/// degrees apart.
///
/// Each speed has its own angles: many directions separate ridges that cross.
const LONG: [(f64, f64); 4] = [(40.0, 17.0), (80.0, 22.0), (160.0, 9.0), (280.0, 27.0)];
/// Speed and angles of more, shorter strokes.
const MORE_MM_S: f64 = 80.0;
const MORE_DEG: [f64; 5] = [-8.0, 41.0, 88.0, 114.0, 152.0];
const SECONDS: f64 = 4.0;
const MORE_SECONDS: f64 = 3.0;
/// Time left out while the pen comes to rest on the surface.
const SETTLING_S: f64 = 0.3;
/// Normal force of [strokes](straight_strokes) in N.
pub const FORCE_N: f64 = 1.0;

/// Straight strokes at 1 N over wide pieces of a surface to train on: 4 s at 40, 80, 160 and 280 mm/s
/// in six directions, and 3 s at 80 mm/s in five more.
pub fn straight_strokes(surface: &MadeSurface, settings: &Settings) -> Vec<Vec<Stroke>> {
    let six = |(speed, first): (f64, f64)| {
        [0, 1, 2, 3, 4, 5].map(|i| (speed, first + 30.0 * f64::from(i), SECONDS))
    };
    let long = LONG.into_iter().flat_map(six);
    let more = MORE_DEG.map(|angle| (MORE_MM_S, angle, MORE_SECONDS));
    let ways: Vec<(f64, f64, f64)> = long.chain(more).collect();
    let pieces = (0..PIECES.min(settings.pieces[0])).map(|number| settings.piece(number));
    pieces.map(|seed| strokes_over(surface, TIMES, seed, &ways)).collect()
}

/// Strokes over a piece `times` as wide as those trained on: speeds in mm/s, angles to x in degrees, and
/// lengths in seconds.
pub(crate) fn strokes_over(
    surface: &MadeSurface,
    times: usize,
    seed: u64,
    ways: &[(f64, f64, f64)],
) -> Vec<Stroke> {
    let piece = surface.wide_patch(GRID, times, seed);
    let envelope = Tool::PEN.track(&piece, &surface.contact);
    let rate = f64::from(SAMPLE_HZ);
    let over = |(stroke, &(speed, angle_deg, seconds)): (usize, &(f64, f64, f64))| {
        let (sin, cos) = angle_deg.to_radians().sin_cos();
        let place = |t: f64| [speed * t * cos, speed * t * sin];
        let samples = ((seconds + SETTLING_S) * rate).round() as usize;
        let at = |sample: usize| (place(sample as f64 / rate), -FORCE_N / STIFFNESS_N_PER_MM);
        // Golden sections of the piece: no two strokes begin alike.
        let part = |by: f64| envelope.length_mm() * ((stroke + 1) as f64 * by).fract();
        let axes = along(&envelope, surface.contact, samples, at, [part(0.618_034), part(0.754_878)]);
        let settled = (SETTLING_S * rate) as usize;
        let axes: Vec<&[f64]> = axes.iter().map(|axis| &axis[settled..]).collect();
        Stroke::new(rate, &axes, place)
    };
    ways.iter().enumerate().map(over).collect()
}

/// Pattern of a surface from [strokes](straight_strokes) over pieces to train on; with a network's
/// magnitudes at 1 N, if there is one.
pub fn pattern(surface: &MadeSurface, settings: &Settings, network: Option<&Network<'_>>) -> Pattern {
    pattern::find(&straight_strokes(surface, settings), network)
}

#[cfg(test)]
#[path = "ground_tests.rs"]
mod tests;
