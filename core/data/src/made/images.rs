use std::f64::consts::TAU;

use asperity_numbers::Random;
use asperity_surfaces::tactile::{Camera, Press, indentation};
use asperity_surfaces::topography::HeightField;
use asperity_texture::picture::Image;

/// Depth of the gel's press in mm.
const DEPTH_MM: (f64, f64) = (0.2, 0.6);

/// Presses a gel onto a piece `count` times, anywhere and in any direction, each time with another
/// camera.
pub(super) fn add(piece: &HeightField, count: usize, random: &mut Random, images: &mut Vec<Image>) {
    for _ in 0..count {
        let camera = Camera::another(random);
        let length = piece.length_mm();
        let press = Press {
            place_mm: [random.range(0.0, length), random.range(0.0, length)],
            turn: TAU * random.unit(),
            depth_mm: random.range(DEPTH_MM.0, DEPTH_MM.1),
        };
        images.push(camera.picture(&indentation(piece, &press, camera.grid()), random));
    }
}
