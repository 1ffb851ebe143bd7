use asperity_numbers::Elementary as _;
use std::f64::consts::TAU;

use crate::topography::HeightField;
use crate::topography::spectrum::blur;
use asperity_numbers::Random;
use asperity_texture::picture::{IMAGE, Image};

/// Elevation of the lights in radians.
const ELEVATION: f64 = 0.25;
/// Softness of a shadow's edge: width of the lights in radians.
const SOFT: f64 = 0.12;
/// Radii and heights of specks in millimetres.
const SPECK_MM: [[f64; 2]; 2] = [[0.03, 0.12], [0.004, 0.03]];

/// A camera and its lights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Millimetres a pixel.
    pub pixel_mm: f64,
    /// Brightness of a flat skin under the lights: red, green and blue as parts of full scale.
    pub light: [f64; 3],
    /// Brightness without the lights.
    pub ambient: [f64; 3],
    /// Turn of the lights in radians.
    pub turn: f64,
    /// Darkening of the corners.
    pub fall: f64,
    /// Brightening of each light at its own edge against the middle.
    pub near: f64,
    /// Blur of the lens in millimetres.
    pub blur_mm: f64,
    /// Noise of a bright pixel: root mean square as a part of full scale.
    pub noise: f64,
    /// Mean number of dust specks on the skin.
    pub specks: f64,
}

impl Camera {
    /// A new camera with a field of 10.2 mm by 7.7 mm.
    pub const USUAL: Self = Self {
        pixel_mm: 0.04,
        light: [0.38, 0.37, 0.39],
        ambient: [0.05, 0.06, 0.05],
        turn: 0.0,
        fall: 0.25,
        near: 0.12,
        blur_mm: 0.02,
        noise: 0.006,
        specks: 3.0,
    };

    /// A random camera: lights, turn, blur, noise and dust differ a little.
    pub fn another(random: &mut Random) -> Self {
        let mut it = Self::USUAL;
        it.light = it.light.map(|l| l * random.range(0.85, 1.15));
        it.ambient = it.ambient.map(|a| a * random.range(0.5, 1.5));
        it.turn = random.range(-0.1, 0.1);
        it.fall = random.range(0.1, 0.4);
        it.near = random.range(0.04, 0.2);
        it.blur_mm = random.range(0.012, 0.028);
        it.noise = random.range(0.004, 0.008);
        it.specks = random.range(0.0, 8.0);
        it
    }

    /// Side and step of the grid for a [skin](super::indentation): the image and a rim.
    pub fn grid(&self) -> (usize, f64) {
        (IMAGE[1] + 64, self.pixel_mm)
    }

    /// Picture of a skin on its [grid](Self::grid).
    pub fn picture(&self, skin: &HeightField, random: &mut Random) -> Image {
        let skin = blur(&self.dusty(skin, random), self.blur_mm);
        let [rows, columns] = IMAGE;
        let (top, left) = ((skin.side().saturating_sub(rows)) / 2, (skin.side().saturating_sub(columns)) / 2);
        let lights = self.lights();
        let mut pixels = Vec::with_capacity(rows * columns * 3);
        for row in 0..rows {
            for column in 0..columns {
                let [gx, gy] = slopes(&skin, (column + left) as i64, (row + top) as i64);
                let norm = (1.0 + gx * gx + gy * gy).sqrt();
                let (u, v) = (column as f64 / columns as f64 - 0.5, row as f64 / rows as f64 - 0.5);
                let fall = 1.0 - self.fall * 2.0 * (u * u + v * v);
                for ((light, strength), ambient) in lights.iter().zip(self.light).zip(self.ambient) {
                    let facing = (light.towards[2] - gx * light.towards[0] - gy * light.towards[1]) / norm;
                    let edge = 1.0 + self.near * 2.0 * (u * light.side[0] + v * light.side[1]);
                    let clean = ambient + strength * lit(facing) / light.flat * fall * edge;
                    let noise = self.noise * clean.max(0.05).sqrt() * random.normal();
                    pixels.push((255.0 * (clean + noise)).clamp(0.0, 255.0).round() as u8);
                }
            }
        }
        Image { size: IMAGE, pixels }
    }

    fn lights(&self) -> [Light; 3] {
        std::array::from_fn(|i| {
            let (sin, cos) = (self.turn + TAU * (i as f64 / 3.0 + 0.25)).sine_cosine();
            let (high, low) = ELEVATION.sine_cosine();
            Light { towards: [low * cos, low * sin, high], side: [cos, sin], flat: lit(high) }
        })
    }

    /// The skin with round specks on it.
    fn dusty(&self, skin: &HeightField, random: &mut Random) -> HeightField {
        let mut skin = skin.clone();
        let (side, step) = (skin.side() as i64, skin.step_mm());
        for _ in 0..(self.specks + random.unit()) as usize {
            let [radius, height] = SPECK_MM.map(|[low, high]| random.range(low, high));
            let [x, y] = [0, 1].map(|_| random.range(0.0, skin.length_mm()));
            let reach = (2.5 * radius / step).ceil() as i64;
            let (column, row) = ((x / step) as i64, (y / step) as i64);
            for j in (row - reach).max(0)..=(row + reach).min(side - 1) {
                for i in (column - reach).max(0)..=(column + reach).min(side - 1) {
                    let away = (i as f64 * step - x).hypotenuse(j as f64 * step - y) / radius;
                    let speck = height * (-0.5 * away * away).exp_e();
                    skin.heights_mut()[(j * side + i) as usize] += speck as f32;
                }
            }
        }
        skin
    }
}

/// A light: its direction, its edge of the picture, and its share on a flat skin.
struct Light {
    towards: [f64; 3],
    side: [f64; 2],
    flat: f64,
}

/// Brightness under a light of width [`SOFT`] by the cosine towards its middle.
fn lit(facing: f64) -> f64 {
    0.5 * (facing + (facing * facing + SOFT * SOFT).sqrt())
}

/// Slopes in the middle of four points. Differences over one step pass finer detail than those over
/// two.
fn slopes(skin: &HeightField, column: i64, row: i64) -> [f64; 2] {
    let at = |i: i64, j: i64| f64::from(skin.point(column + i, row + j));
    let [a, b, c, d] = [at(0, 0), at(1, 0), at(0, 1), at(1, 1)];
    let step = 2.0 * skin.step_mm();
    [(b - a + d - c) / step, (c - a + d - b) / step]
}

#[cfg(test)]
#[path = "camera_tests.rs"]
mod tests;
