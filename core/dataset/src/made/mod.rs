//! Data made by physics: the [made surfaces](made_surfaces), seen by a tactile sensor and stroked by a simulated pen.
//!
//! A surface is seen and stroked on pieces of its own, each from a seed: some to train on, others to judge by, so that no place and no stroke that is
//! judged by was ever seen. [`unseen`] surfaces, two of each family, are not to be trained on at all.
//!
//! A stroke is a line, a zigzag or a circle, turned any way, of up to 300 mm/s and 3.5 N; its force swings. Where there is no force the pen is in the
//! air, and nothing is felt.

mod images;
mod strokes;

use std::sync::atomic::{AtomicUsize, Ordering};

use asperity_source::Diagnostic;
use asperity_world::material::Random;
use asperity_world::topography::{MadeSurface, made_surfaces};

pub use strokes::{Drawn, accelerations, examples};

use crate::example::{Example, Parts, Subject, Truth};

/// A piece: points along an edge, and their distance in millimetres.
const GRID: (usize, f64) = (1024, 0.02);
/// Every so-manieth surface is one that is not to be trained on.
const UNSEEN_EVERY: usize = 7;
/// Which of those.
const UNSEEN_AT: usize = 3;

/// How much is made.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Another seed is other pieces, presses and strokes of the same surfaces.
    pub seed: u64,
    /// Pieces of each surface to train on, and to judge by.
    pub pieces: [usize; 2],
    /// Images of each piece.
    pub images: usize,
    /// Strokes over each piece.
    pub strokes: usize,
    /// Length of a stroke in seconds.
    pub stroke_s: f64,
}

impl Default for Settings {
    /// 96 images and 160 s of strokes to train on, 24 images and 40 s to judge by.
    fn default() -> Self {
        Self { seed: 1, pieces: [8, 2], images: 12, strokes: 4, stroke_s: 5.0 }
    }
}

/// Whether a surface, by its number among [`made_surfaces`], is not to be trained on. With fourteen surfaces a family it is two of each.
pub fn unseen(number: usize) -> bool {
    number % UNSEEN_EVERY == UNSEEN_AT
}

/// The images and the examples of one surface. The same settings give the same bits.
///
/// # Errors
/// A stroke that cannot be, by a [length](Settings::stroke_s) of under a second or over 1e6.
pub fn subject(surface: &MadeSurface, settings: &Settings) -> Result<Subject, Diagnostic> {
    let mut images = Parts::default();
    let mut examples = Parts::default();
    let [train, held] = settings.pieces;
    let mut seeds = Random::new(settings.seed.wrapping_mul(0x9e37_79b9).wrapping_add(17));
    for number in 0..train + held {
        let seed = seeds.bits();
        let piece = surface.patch(GRID, seed);
        let (to_images, to_examples) = if number < train {
            (&mut images.train, &mut examples.train)
        } else {
            (&mut images.held, &mut examples.held)
        };
        let random = &mut Random::new(seed ^ 0x5eed);
        images::add(&piece, settings.images, random, to_images);
        strokes::add(surface, &piece, settings, random, to_examples)?;
    }
    Ok(Subject {
        name: surface.name.clone(),
        description: surface.description.clone(),
        family: Some(surface.family.name().to_owned()),
        images,
        examples,
        truth: Truth::Draws,
    })
}

/// All surfaces, those to train on first and then the [`unseen`] ones, made on all cores; `done` is called after each with how many are done.
///
/// # Errors
/// As [`subject`].
pub fn subjects(settings: &Settings, done: impl Fn(usize) + Sync) -> Result<[Vec<Subject>; 2], Diagnostic> {
    let surfaces = made_surfaces();
    let (next, finished) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let work = || -> Result<Vec<(usize, Subject)>, Diagnostic> {
        let mut made = Vec::new();
        while let Some((number, surface)) = nth(&surfaces, next.fetch_add(1, Ordering::Relaxed)) {
            made.push((number, subject(surface, settings)?));
            done(finished.fetch_add(1, Ordering::Relaxed) + 1);
        }
        Ok(made)
    };
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let mut all = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..cores).map(|_| scope.spawn(work)).collect();
        let mut all = Vec::with_capacity(surfaces.len());
        for worker in workers {
            match worker.join() {
                Ok(made) => all.extend(made?),
                Err(panic) => std::panic::resume_unwind(panic),
            }
        }
        Ok::<_, Diagnostic>(all)
    })?;
    all.sort_by_key(|(number, _)| *number);
    let (apart, seen): (Vec<_>, Vec<_>) = all.into_iter().partition(|(number, _)| unseen(*number));
    Ok([seen, apart].map(|part| part.into_iter().map(|(_, subject)| subject).collect()))
}

fn nth<T>(all: &[T], number: usize) -> Option<(usize, &T)> {
    all.get(number).map(|one| (number, one))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Instant;

    const SMALL: Settings = Settings { seed: 3, pieces: [1, 1], images: 1, strokes: 1, stroke_s: 2.0 };

    #[test]
    fn two_surfaces_of_each_family_are_unseen() {
        let surfaces = made_surfaces();
        for family in asperity_world::topography::Family::ALL {
            let of = surfaces.iter().enumerate().filter(|(n, s)| s.family == family && unseen(*n));
            assert_eq!(of.count(), 2, "{}", family.name());
        }
    }

    #[test]
    #[ignore = "prints how long the parts of a surface take"]
    fn time_of_a_surface() {
        for surface in made_surfaces().iter().step_by(7) {
            let t = Instant::now();
            let piece = surface.patch(GRID, 1);
            let patch = t.elapsed();
            let mut images = Vec::new();
            let t = Instant::now();
            images::add(&piece, 4, &mut Random::new(1), &mut images);
            let image = t.elapsed() / 4;
            let t = Instant::now();
            let mut all = Vec::new();
            strokes::add(surface, &piece, &Settings::default(), &mut Random::new(1), &mut all).unwrap();
            let rms = (all.iter().flat_map(|e| e.magnitudes).map(|m| f64::from(m * m)).sum::<f64>()
                / (3.0 * all.len() as f64))
                .sqrt();
            println!(
                "{:32} patch {patch:7.1?} image {image:7.1?} {} strokes {:7.1?}, {} examples, {rms:.2} m/s^2",
                surface.name,
                4,
                t.elapsed(),
                all.len()
            );
        }
    }
}
