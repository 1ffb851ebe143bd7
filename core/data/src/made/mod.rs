//! Data made by physics: the [made surfaces](made_surfaces), seen by a tactile sensor and stroked by a
//! simulated pen.
//!
//! A surface is seen and stroked on pieces of its own, each from a seed: some to train on, others to judge
//! by. So no place and no stroke to judge by was ever seen. Two surfaces of each family are never trained on.
//!
//! A stroke is a line, a zigzag or a circle in any direction, of up to 300 mm/s and 3.5 N, with a swinging
//! force. Without force the pen is in the air and feels nothing.

mod expectations;
mod ground;
mod strokes;
#[cfg(test)]
mod texture_tests;

use std::f64::consts::TAU;
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};

use asperity_diagnostics::Diagnostic;
use asperity_numbers::Random;
use asperity_surfaces::tactile::{Camera, Press, indentation};
use asperity_surfaces::topography::{HeightField, MadeSurface, made_surfaces};
use asperity_texture::picture::{IMAGE, Image};
use rayon::prelude::*;

pub use expectations::expectations;
#[cfg(test)]
pub(crate) use ground::strokes_over;
pub use ground::{FORCE_N, Ground, pattern, pitch_mm, straight_strokes, surface};
pub use strokes::{BEYOND_FORCE_N, BEYOND_SPEED_MM_S, Drawn};

use crate::example::{Example, Parts, Subject, Truth};

/// A piece: points along an edge, and their distance in mm.
const GRID: (usize, f64) = (1024, 0.02);
/// One surface in this many is not trained on.
const UNSEEN_EVERY: usize = 7;
/// Its place among them.
const UNSEEN_AT: usize = 3;

/// Amount to make.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Seed of pieces, presses and strokes.
    pub seed: u64,
    /// Pieces of each surface: to train on, and to judge by.
    pub pieces: [usize; 2],
    /// Images of each piece.
    pub images: usize,
    /// Strokes over each piece, each at two places.
    pub strokes: usize,
    /// Length of a stroke in seconds.
    pub stroke_s: f64,
}

impl Default for Settings {
    /// 96 images and 480 s of strokes to train on, 32 images and 160 s to judge by.
    fn default() -> Self {
        Self { seed: 1, pieces: [12, 4], images: 8, strokes: 8, stroke_s: 5.0 }
    }
}

impl Settings {
    /// Seed of a piece. Those to train on come first.
    fn piece(&self, number: usize) -> u64 {
        Random::new(self.seed ^ ((number as u64) << 32) ^ 0x91ec_e000).bits()
    }
}

/// Whether a surface, by its number among [`made_surfaces`], is not trained on. With fourteen surfaces
/// in a family it is two of each.
fn unseen(number: usize) -> bool {
    number % UNSEEN_EVERY == UNSEEN_AT
}

/// Depth of the gel's press in mm.
const DEPTH_MM: (f64, f64) = (0.2, 0.6);

/// Presses a gel onto a piece `count` times, anywhere and in any direction, each time with another camera,
/// which `vary` may change.
fn press(
    piece: &HeightField,
    count: usize,
    vary: impl Fn(&mut Camera),
    random: &mut Random,
    images: &mut Vec<Image>,
) {
    for _ in 0..count {
        let mut camera = Camera::another(random);
        vary(&mut camera);
        let length = piece.length_mm();
        let press = Press {
            place_mm: [random.range(0.0, length), random.range(0.0, length)],
            turn: TAU * random.unit(),
            depth_mm: random.range(DEPTH_MM.0, DEPTH_MM.1),
        };
        images.push(camera.picture(&indentation(piece, &press, camera.grid()), random));
    }
}

/// Salt of the presses' random numbers.
const PRESSES: u64 = 0x5eed;

/// Pictures of a surface's pieces by their numbers: the first [images](Settings::images) of each, with a
/// camera that `vary` may change. Pieces to train on come first.
pub fn pictures(
    surface: &MadeSurface,
    settings: &Settings,
    pieces: Range<usize>,
    vary: impl Fn(&mut Camera),
) -> Vec<Image> {
    let mut images = Vec::new();
    for seed in pieces.map(|number| settings.piece(number)) {
        let piece = surface.patch(GRID, seed);
        let random = &mut Random::new(seed ^ surface.seed() ^ PRESSES);
        press(&piece, settings.images, &vary, random, &mut images);
    }
    images
}

/// Images and examples of one surface. The same settings give the same bits.
fn subject(surface: &MadeSurface, settings: &Settings) -> Result<Subject, Diagnostic> {
    let mut images = Parts::default();
    let mut examples = Parts::default();
    let [train, held] = settings.pieces;
    for number in 0..train + held {
        let seed = settings.piece(number);
        let piece = surface.patch(GRID, seed);
        let (to_images, to_examples) = match number < train {
            true => (&mut images.train, &mut examples.train),
            false => (&mut images.held, &mut examples.held),
        };
        // No two surfaces are pressed or stroked alike.
        let own = |salt: u64| Random::new(seed ^ surface.seed() ^ salt);
        press(&piece, settings.images, |_| {}, &mut own(PRESSES), to_images);
        let random = &mut own(0x5704);
        strokes::add(surface, &piece, settings, random, to_examples)?;
    }
    Ok(Subject {
        name: surface.name.clone(),
        description: surface.description.clone(),
        family: Some(surface.family.name().to_owned()),
        images,
        image_mm: Some(Camera::USUAL.pixel_mm * IMAGE[1] as f64),
        examples,
        truth: Truth::Draws,
        notes: Vec::new(),
    })
}

/// One in `every` of the [made surfaces](made_surfaces): those to train on, and the others.
pub fn surfaces(every: usize) -> [Vec<MadeSurface>; 2] {
    let all = made_surfaces().into_iter().enumerate();
    let (apart, seen): (Vec<_>, Vec<_>) = all.partition(|(number, _)| unseen(*number));
    [seen, apart].map(|part| part.into_iter().map(|(_, surface)| surface).step_by(every.max(1)).collect())
}

/// Subjects of two lists of surfaces, made on all cores. `done` is called after each with the number done.
///
/// # Errors
/// A [stroke](Settings::stroke_s) shorter than a second or longer than 1e6 s.
pub fn subjects(
    surfaces: &[Vec<MadeSurface>; 2],
    settings: &Settings,
    done: impl Fn(usize) + Sync,
) -> Result<[Vec<Subject>; 2], Diagnostic> {
    let all: Vec<&MadeSurface> = surfaces.iter().flatten().collect();
    let finished = AtomicUsize::new(0);
    let of = |surface: &&MadeSurface| {
        let made = subject(surface, settings);
        done(finished.fetch_add(1, Ordering::Relaxed) + 1);
        made
    };
    let mut made = all.par_iter().map(of).collect::<Result<Vec<Subject>, _>>()?;
    let apart = made.split_off(surfaces[0].len());
    Ok([made, apart])
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::LazyLock;

    fn power(magnitudes: &[f32; 100]) -> f64 {
        magnitudes.iter().map(|m| f64::from(m * m)).sum()
    }

    const SMALL: Settings = Settings { seed: 3, pieces: [1, 1], images: 1, strokes: 1, stroke_s: 2.0 };

    /// A surface with strokes of 16 s in all, for two tests.
    static STROKED: LazyLock<Subject> = LazyLock::new(|| {
        let settings = Settings { pieces: [1, 0], strokes: 4, stroke_s: 4.0, ..SMALL };
        subject(&made_surfaces()[4], &settings).unwrap()
    });

    #[test]
    fn same_settings_give_same_surface_with_independent_parts() {
        let surfaces = &made_surfaces()[60..62];
        let made = subject(&surfaces[0], &SMALL).unwrap();
        assert_eq!([made.images.train.len(), made.images.held.len()], [1, 1]);
        assert!(made.images.train != made.images.held);
        let Parts { train, held } = &made.examples;
        assert!(train.len() > 20 && held.len() > 20);
        let moving = train.iter().filter(|e| e.velocity != [0.0; 20]);
        assert!(moving.clone().all(|e| held.iter().all(|h| h.velocity != e.velocity)));
        let train_of = |surface: &MadeSurface, seed: u64| {
            let made = subject(surface, &Settings { seed, pieces: [1, 0], ..SMALL }).unwrap();
            (made.images.train, made.examples.train)
        };
        assert_eq!(train_of(&surfaces[0], 3), (made.images.train.clone(), train.clone()));
        let (images, seeded) = train_of(&surfaces[0], 4);
        assert!(images != made.images.train && seeded != *train);
        assert!(train[20].velocity != train_of(&surfaces[1], 3).1[20].velocity, "stroked alike");
    }

    #[test]
    fn vibration_grows_with_force_and_speed_and_is_zero_in_air() {
        let level = |e: &Example| e.magnitudes.iter().map(|m| m * m).sum::<f32>().sqrt();
        let (mut loud, mut still) = (0, 0);
        for example in &STROKED.examples.train {
            let (force, speed) = (example.force[9], example.velocity[9].hypot(example.velocity[19]));
            if force > 0.5 && speed > 60.0 {
                assert!(level(example) > 0.1, "{force} N {speed} mm/s {}", level(example));
                loud += 1;
            }
            still += usize::from(example.force == [0.0; 10] && speed < 1.0);
        }
        assert!(loud > 50 && still > 3, "{loud} {still}");
    }

    #[test]
    fn made_stroke_is_felt_at_two_places() {
        let (mut here, mut there, mut both) = (0.0, 0.0, 0.0);
        for e in &STROKED.examples.train {
            let other = e.other.expect("another place");
            let product = e.magnitudes.iter().zip(other).map(|(a, b)| f64::from(a * b)).sum::<f64>();
            (here, there, both) = (here + power(&e.magnitudes), there + power(&other), both + product);
        }
        // One touch, two draws: equally loud, and alike as two of Rayleigh's law are: pi / 4.
        let (level, alike) = (here / there, both / (here * there).sqrt());
        assert!((0.7..1.4).contains(&level) && (0.6..0.92).contains(&alike), "{level} {alike}");
    }

    #[test]
    fn expectations_are_what_draws_come_to() {
        let surface = &made_surfaces()[4];
        let strokes = [Drawn::new(3.0, &mut Random::new(9)).unwrap()];
        let expected = expectations(surface, &SMALL, &strokes, 24);
        assert!(expected.len() > 60);
        let (mut one, mut rms, mut mean) = (0.0, 0.0, 0.0);
        for e in &expected {
            one += power(&e.example.magnitudes) + power(&e.example.other.unwrap());
            rms += 2.0 * power(&e.rms);
            mean += 2.0 * power(&e.mean);
        }
        assert!((one / rms - 1.0).abs() < 0.3, "{}", one / rms);
        // A mean of magnitudes has less power than the magnitudes, by 1.05 dB at most for one axis of a
        // Gaussian signal.
        let less = 10.0 * (rms / mean).log10();
        assert!((0.2..1.2).contains(&less), "{less} dB");
    }

    #[test]
    fn two_surfaces_of_each_family_are_unseen() {
        let surfaces = made_surfaces();
        for family in asperity_surfaces::topography::Family::ALL {
            let of = surfaces.iter().enumerate().filter(|(n, s)| s.family == family && unseen(*n));
            assert_eq!(of.count(), 2, "{}", family.name());
        }
    }
}
