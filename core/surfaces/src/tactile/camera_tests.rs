use super::super::{Press, indentation};
use super::*;
use crate::topography::made_surfaces;

#[test]
fn flat_skin_is_grey_and_slope_has_colour_of_its_light() {
    let camera = Camera {
        noise: 0.0,
        fall: 0.0,
        near: 0.0,
        specks: 0.0,
        light: [0.4; 3],
        ambient: [0.1; 3],
        ..Camera::USUAL
    };
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
    let want = 255.0 * (0.1 + 0.4);
    assert!(flat.iter().all(|c| (f64::from(*c) - want).abs() <= 1.0), "{flat:?}");
    // Red stands at +y: a skin that falls towards it faces it.
    let [red, green, blue] = tilted(0.0, -0.4);
    assert!(red > flat[0] && green < flat[1] && blue < flat[2] && (green - blue).abs() <= 2);
}

/// Root mean square change by a surface in the picture of a flat skin, in parts of 255, and the part of
/// values at either end.
fn contrast(patch: &HeightField) -> (f64, f64) {
    let camera = Camera { noise: 0.0, specks: 0.0, ..Camera::USUAL };
    let press = Press { place_mm: [4.0, 3.0], turn: 0.3, depth_mm: 0.4 };
    let skin = indentation(patch, &press, camera.grid());
    let flat = HeightField::flat(skin.side(), skin.step_mm());
    let [seen, flat] = [&skin, &flat].map(|s| camera.picture(s, &mut Random::new(1)).pixels);
    let squares: f64 = seen.iter().zip(&flat).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum();
    let ends = seen.iter().filter(|p| matches!(p, 0 | 255)).count();
    ((squares / seen.len() as f64).sqrt(), ends as f64 / seen.len() as f64)
}

#[test]
fn fine_surfaces_exceed_noise_and_coarse_ones_do_not_clip() {
    let noise = 255.0 * Camera::USUAL.noise * (Camera::USUAL.light[0] + Camera::USUAL.ambient[0]).sqrt();
    for surface in made_surfaces() {
        let (rms, ends) = contrast(&surface.patch((512, 0.02), 1));
        println!("{:32} {rms:.1} of 255, noise {noise:.1}, {:.1} % at an end", surface.name, 100.0 * ends);
        assert!(ends < 0.1, "{}: {ends} at an end", surface.name);
        let polished = ["float glass", "acrylic sheet"].contains(&surface.name.as_str());
        assert!(rms > noise || polished, "{}: {rms}, noise {noise}", surface.name);
    }
}
