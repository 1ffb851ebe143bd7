//! The Penn Haptic Texture Toolkit, from a folder that the user has downloaded: a hundred real textures as
//! autoregressive models, with photographs (Culbertson, Lopez Delgado, Kuchenbecker 2014, "One hundred
//! data-driven haptic texture models and open-source methods for rendering on 3D objects"). Its licence
//! forbids passing the files on; none are in this project.
//!
//! # Files of a material
//!
//! XML files with a `modelSet`, anywhere in the folder. Each file is one material, read as in
//! [`toolkit`](asperity_autoregressive::toolkit).
//!
//! A picture belongs to the material whose file name its own name begins with; the longest counts. Only
//! letters and digits are compared, and `models`, `model`, `images` and `image` in front are ignored.
//!
//! # Examples
//!
//! Strokes are [drawn](crate::History::draw). Magnitudes are not those of a signal, but the root mean square
//! of all signals, from the models' [closed form](asperity_autoregressive): targets without noise. The 20 ms
//! before a frame have weights 1, 2, .. 10, the newest most, so that a contact that began 6 ms ago has its
//! full weight. Speeds and forces outside the recordings count as the nearest recorded ones.
//!
//! A model of 1000 Hz says nothing above 500 Hz. Its magnitudes there are 0, as in the toolkit's own
//! rendering. A network trained on them is silent there too.

use std::path::{Path, PathBuf};

use asperity_autoregressive::{Frames, Texture};
use asperity_diagnostics::{Diagnostic, Source};
use asperity_dsp::frame::BINS;
use asperity_numbers::Random;

pub use asperity_autoregressive::toolkit::parse;
use rayon::prelude::*;

use crate::example::{Example, Parts, Subject, Truth};
use crate::folder;
use crate::history::History;

/// Amount to draw.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Examples of each material: to train on, and to judge by.
    pub examples: [usize; 2],
    /// Seed of the strokes.
    pub seed: u64,
}

impl Default for Settings {
    /// 4000 examples to train on, 1000 to judge by.
    fn default() -> Self {
        Self { examples: [4000, 1000], seed: 1 }
    }
}

/// Words in front of a file's name that are not the material's.
const PREFIXES: [&str; 4] = ["models", "model", "images", "image"];

/// A material's file.
struct Found {
    key: String,
    path: PathBuf,
    texture: Texture,
    pictures: Vec<PathBuf>,
}

/// Reads a folder. Materials are in the order of their file names. The same files and settings give the
/// same bits.
///
/// # Errors
/// A folder that cannot be read or has no model set; two model sets of one name (such as of two sample
/// rates); a material without a picture; all of [`parse`] and of [`asperity_texture::picture::read`].
pub fn read(folder: &Path, settings: &Settings) -> Result<Vec<Subject>, Diagnostic> {
    let files = folder::tree(folder)?;
    let mut found = materials(&files)?;
    if found.is_empty() {
        let help = "the toolkit's models are XML files with a `modelSet` in them";
        return Err(folder::refused(folder, "no model sets in this folder", help));
    }
    for picture in files.iter().filter(|f| folder::is_picture(f)) {
        let name = key(picture);
        let owner = found.iter_mut().filter(|m| name.starts_with(&m.key)).max_by_key(|m| m.key.len());
        owner.into_iter().for_each(|owner| owner.pictures.push(picture.clone()));
    }
    let mut seeds = Random::new(settings.seed);
    let seeded: Vec<(Found, u64)> = found.into_iter().map(|material| (material, seeds.bits())).collect();
    seeded.par_iter().map(|(material, seed)| subject(material, settings, *seed)).collect()
}

fn materials(files: &[PathBuf]) -> Result<Vec<Found>, Diagnostic> {
    let mut found: Vec<Found> = Vec::new();
    for path in files.iter().filter(|f| folder::ends_with(f, &["xml"])) {
        let source = Source::read(path)?;
        if source.text().trim().is_empty() {
            return Err(folder::refused(path, "this file is empty", "remove it, or download it again"));
        }
        // The toolkit's recordings are XML too.
        if !source.text().to_ascii_lowercase().contains("<modelset") {
            continue;
        }
        let key = key(path);
        if let Some(first) = found.iter().find(|m| m.key == key) {
            let what = format!("a second material of the name of {}", first.path.display());
            return Err(folder::refused(path, &what, "keep the models of one sample rate in the folder"));
        }
        let texture = parse(&source)?;
        found.push(Found { key, path: path.clone(), texture, pictures: Vec::new() });
    }
    Ok(found)
}

/// The part of a file's name that counts.
fn key(path: &Path) -> String {
    let stem = folder::stem(path);
    let plain: String = stem.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect();
    let rest = PREFIXES.iter().find_map(|p| plain.strip_prefix(p)).filter(|rest| !rest.is_empty());
    rest.map(str::to_owned).unwrap_or(plain)
}

/// A file's name for people.
fn title(path: &Path) -> String {
    let stem = folder::stem(path);
    let lower = stem.to_ascii_lowercase();
    let rest = PREFIXES.iter().find_map(|p| {
        let rest = lower.strip_prefix(p)?.strip_prefix(['_', ' ', '-']).filter(|rest| !rest.is_empty())?;
        stem.get(stem.len() - rest.len()..)
    });
    rest.unwrap_or(&stem).replace('_', " ")
}

fn subject(material: &Found, settings: &Settings, seed: u64) -> Result<Subject, Diagnostic> {
    if material.pictures.is_empty() {
        let help = "a PNG, JPEG or BMP file in the folder whose name begins as this file's";
        return Err(folder::refused(&material.path, "no picture of this material", help));
    }
    let frames = Frames::new(material.texture.rate_hz()).map_err(|e| e.in_file(&material.path))?;
    let mut seeds = Random::new(seed);
    let mut draw = |count: usize| -> Vec<Example> {
        let mut random = Random::new(seeds.bits());
        let histories = (0..count).map(|_| History::draw(&mut random));
        histories.map(|history| example(&history, &material.texture, &frames)).collect()
    };
    let [train, held] = settings.examples;
    let (images, notes) = folder::pictures(&material.pictures)?;
    Ok(Subject {
        name: title(&material.path),
        description: "A texture of the Penn Haptic Texture Toolkit.".into(),
        family: None,
        images,
        image_mm: None,
        notes,
        examples: Parts { train: draw(train), held: draw(held) },
        truth: Truth::Rms,
    })
}

fn example(history: &History, texture: &Texture, frames: &Frames) -> Example {
    let mut power = [0.0; BINS];
    for (i, &(speed, force)) in history.clean.iter().enumerate() {
        let weight = weight(i, history.clean.len());
        for (sum, p) in power.iter_mut().zip(frames.expected_power(&texture.at(speed, force))) {
            *sum += weight * p;
        }
    }
    history.example(power.map(|p| p.sqrt() as f32))
}

/// Weight of sample `i` of a history of `n`, oldest first. The weights sum to 1.
fn weight(i: usize, n: usize) -> f64 {
    2.0 * (i + 1) as f64 / (n * (n + 1)) as f64
}

#[cfg(test)]
mod tests;
