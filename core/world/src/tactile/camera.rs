use std::f64::consts::TAU;

use crate::material::Random;
use crate::topography::HeightField;
use crate::topography::spectrum::blur;

/// Rows and columns of an image.
pub const IMAGE: [usize; 2] = [192, 256];
/// Elevation of the lights in radians.
const ELEVATION: f64 = 0.55;

/// A picture of three channels, row by row, red, green and blue in turn.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// Rows and columns.
    pub size: [usize; 2],
    /// 8 bits a channel.
    pub pixels: Vec<u8>,
}

/// A camera and its lights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Millimetres a pixel.
    pub pixel_mm: f64,
    /// Brightness of the lights, red, green and blue, in parts of full scale.
    pub light: [f64; 3],
    /// What is there without them.
    pub ambient: [f64; 3],
    /// How far the lights are turned, in radians.
    pub turn: f64,
    /// How much the corners are darker.
    pub fall: f64,
    /// Blur in millimetres.
    pub blur_mm: f64,
    /// Noise of a bright pixel, root mean square, in parts of full scale.
    pub noise: f64,
}

impl Camera {
    /// As it leaves the factory: 15.4 mm by 11.5 mm.
    pub const USUAL: Self = Self {
        pixel_mm: 0.06,
        light: [0.62, 0.6, 0.64],
        ambient: [0.08, 0.09, 0.08],
        turn: 0.0,
        fall: 0.25,
        blur_mm: 0.05,
        noise: 0.012,
    };

    /// One of many: lights, turn, blur and noise a little different.
    pub fn another(random: &mut Random) -> Self {
        let mut it = Self::USUAL;
        it.light = it.light.map(|l| l * random.range(0.85, 1.15));
        it.ambient = it.ambient.map(|a| a * random.range(0.5, 1.5));
        it.turn = random.range(-0.1, 0.1);
        it.fall = random.range(0.1, 0.4);
        it.blur_mm = random.range(0.03, 0.08);
        it.noise = random.range(0.006, 0.018);
        it
    }

    /// The side and the step of the grid on which a [skin](super::indentation) is wanted: the image and a rim.
    pub fn grid(&self) -> (usize, f64) {
        (IMAGE[1] + 64, self.pixel_mm)
    }

    /// What it sees of a skin on its [grid](Self::grid).
    pub fn picture(&self, skin: &HeightField, random: &mut Random) -> Image {
        let skin = blur(skin, self.blur_mm);
        let [rows, columns] = IMAGE;
        let (top, left) = ((skin.side().saturating_sub(rows)) / 2, (skin.side().saturating_sub(columns)) / 2);
        let lights: [[f64; 3]; 3] = std::array::from_fn(|i| {
            let azimuth = self.turn + TAU * (i as f64 / 3.0 + 0.25);
            [ELEVATION.cos() * azimuth.cos(), ELEVATION.cos() * azimuth.sin(), ELEVATION.sin()]
        });
        let mut pixels = Vec::with_capacity(rows * columns * 3);
        for row in 0..rows {
            for column in 0..columns {
                let (x, y) = ((column + left) as i64, (row + top) as i64);
                let slope = |a: f32, b: f32| f64::from(a - b) / (2.0 * skin.step_mm());
                let gx = slope(skin.point(x + 1, y), skin.point(x - 1, y));
                let gy = slope(skin.point(x, y + 1), skin.point(x, y - 1));
                let norm = (1.0 + gx * gx + gy * gy).sqrt();
                let (u, v) = (column as f64 / columns as f64 - 0.5, row as f64 / rows as f64 - 0.5);
                let fall = 1.0 - self.fall * 2.0 * (u * u + v * v);
                for ((light, strength), ambient) in lights.iter().zip(self.light).zip(self.ambient) {
                    let facing = ((light[2] - gx * light[0] - gy * light[1]) / norm).max(0.0);
                    let clean = ambient + strength * facing * fall;
                    let noise = self.noise * clean.max(0.05).sqrt() * random.normal();
                    pixels.push((255.0 * (clean + noise)).clamp(0.0, 255.0).round() as u8);
                }
            }
        }
        Image { size: IMAGE, pixels }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flat_skin_is_grey_and_a_slope_takes_the_colour_of_the_light_it_faces() {
        let camera = Camera { noise: 0.0, fall: 0.0, light: [0.6; 3], ambient: [0.1; 3], ..Camera::USUAL };
        let (side, step) = camera.grid();
        let tilted = |gx: f64, gy: f64| {
            let middle = 0.5 * side as f64 * step;
            // Away from the seam, which is a cliff.
            let skin = HeightField::from_fn(side, step, |x, y| gx * (x - middle) + gy * (y - middle));
            let image = camera.picture(&skin, &mut Random::new(1));
            let at = 3 * (96 * IMAGE[1] + 128);
            [image.pixels[at], image.pixels[at + 1], image.pixels[at + 2]].map(i32::from)
        };
        let flat = tilted(0.0, 0.0);
        let want = 255.0 * (0.1 + 0.6 * ELEVATION.sin());
        assert!(flat.iter().all(|c| (f64::from(*c) - want).abs() <= 1.0), "{flat:?}");
        // Red stands at +y: a skin that falls towards it faces it.
        let [red, green, blue] = tilted(0.0, -0.4);
        assert!(red > flat[0] && green < flat[1] && blue < flat[2] && (green - blue).abs() <= 2);
    }
}

#[cfg(test)]
mod look {
    use super::super::{Press, indentation};
    use super::*;
    use crate::topography::made_surfaces;

    #[test]
    #[ignore = "writes a picture to look at: ASPERITY_LOOK names the file, a .ppm"]
    fn a_sheet_of_tactile_images() {
        let Ok(path) = std::env::var("ASPERITY_LOOK") else { return };
        let [rows, columns] = IMAGE.map(|n| n / 2);
        let surfaces = made_surfaces();
        let mut pixels = vec![0_u8; 14 * columns * 8 * rows * 3];
        for (n, surface) in surfaces.iter().enumerate() {
            let patch = surface.patch((512, 0.04), 1);
            let random = &mut Random::new(n as u64);
            let press = Press { place_mm: [5.0, 6.0], turn: 0.2, depth_mm: 0.4 };
            let skin = indentation(&patch, &press, Camera::USUAL.grid());
            let image = Camera::USUAL.picture(&skin, random);
            for y in 0..rows {
                for x in 0..columns {
                    let to = 3 * (((n / 14) * rows + y) * 14 * columns + (n % 14) * columns + x);
                    let from = 3 * (2 * y * IMAGE[1] + 2 * x);
                    pixels[to..to + 3].copy_from_slice(&image.pixels[from..from + 3]);
                }
            }
        }
        let mut file = format!("P6 {} {} 255\n", 14 * columns, 8 * rows).into_bytes();
        file.extend(pixels);
        std::fs::write(path, file).expect("a picture");
    }
}
