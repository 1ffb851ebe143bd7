use asperity_surfaces::stylus::{SAMPLE_HZ, Tool};
use asperity_surfaces::topography::MadeSurface;
use asperity_texture::Pattern;

use super::strokes::along;
use super::{GRID, Settings};
use crate::history::STIFFNESS_N_PER_MM;
use crate::pattern::{self, Network, Stroke};

/// Pieces with strokes.
const PIECES: usize = 6;
/// Width of a piece, in widths of those trained on. A piece repeats and is a sum of as many waves as
/// fit around it. If they are few, each looks like ridges.
const TIMES: usize = 4;
/// Speeds in mm/s of the strokes, and their angles to x in degrees.
///
/// Each speed has its own angles: many directions separate ridges that cross.
const LONG: [(f64, [f64; 6]); 4] = [
    (40.0, [17.0, 47.0, 77.0, 107.0, 137.0, 167.0]),
    (80.0, [22.0, 52.0, 82.0, 112.0, 142.0, 172.0]),
    (160.0, [9.0, 39.0, 69.0, 99.0, 129.0, 159.0]),
    (280.0, [27.0, 57.0, 87.0, 117.0, 147.0, 177.0]),
];
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
    let over = |number: usize| {
        let piece = surface.wide_patch(GRID, TIMES, settings.piece(number));
        let envelope = Tool::PEN.track(&piece, &surface.contact);
        let long = LONG.into_iter().flat_map(|(speed, angles)| angles.map(|angle| (speed, angle, SECONDS)));
        let more = MORE_DEG.map(|angle| (MORE_MM_S, angle, MORE_SECONDS));
        let mut strokes = Vec::new();
        for (stroke, (speed, angle_deg, seconds)) in long.chain(more).enumerate() {
            let (sin, cos) = angle_deg.to_radians().sin_cos();
            let place = |t: f64| [speed * t * cos, speed * t * sin];
            let rate = f64::from(SAMPLE_HZ);
            let samples = ((seconds + SETTLING_S) * rate).round() as usize;
            let at = |sample: usize| (place(sample as f64 / rate), -FORCE_N / STIFFNESS_N_PER_MM);
            // Golden sections of the piece: no two strokes begin alike.
            let part = |by: f64| envelope.length_mm() * ((stroke + 1) as f64 * by).fract();
            let axes = along(&envelope, surface.contact, samples, at, [part(0.618_034), part(0.754_878)]);
            let settled = (SETTLING_S * rate) as usize;
            let axes: Vec<&[f64]> = axes.iter().map(|axis| &axis[settled..]).collect();
            strokes.push(Stroke::new(rate, &axes, place));
        }
        strokes
    };
    (0..PIECES.min(settings.pieces[0])).map(over).collect()
}

/// Pattern of a surface from [strokes](straight_strokes) over pieces to train on; with a network's
/// magnitudes at 1 N, if there is one.
pub fn pattern(surface: &MadeSurface, settings: &Settings, network: Option<&Network<'_>>) -> Pattern {
    pattern::find(&straight_strokes(surface, settings), network)
}
