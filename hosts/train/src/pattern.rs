//! Patterns of a model's materials: their vibration over place.

use std::cell::{Cell, RefCell};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use asperity_data::{HISTORY, made, pattern, recordings};
use asperity_diagnostics::Diagnostic;
use asperity_texture::{Choice, MAGNITUDES_LEN, Model, NOISE_RATIO, Precision, RunError, Runner, Target};
use asperity_texture::{Library, LibraryMaterial, Pattern};
use clap::Args;
use rayon::prelude::*;

use crate::Failure;
use crate::arguments::Settings;
use crate::data::{Origin, made_settings};
use crate::files::{Teller, write_whole};
use crate::training::{settings_now, settings_of};

/// Arguments of a new search for patterns.
#[derive(Args, Clone, Debug)]
pub(crate) struct FindPatterns {
    /// The model's folder.
    pub folder: PathBuf,
    /// Material to look at; repeatable. Default: all
    #[arg(long, value_name = "NAME")]
    pub material: Vec<String>,
    /// Present place of the data if they have moved: `hatt:FOLDER` or `recordings:FOLDER`.
    #[arg(long, value_name = "SOURCE")]
    pub data: Option<Origin>,
}

/// Finds the patterns of a model's materials again and writes its library with them. The rest of the
/// library stays.
pub(crate) fn find(find: &FindPatterns) -> Result<(), Failure> {
    let settings = settings_now(&find.folder, &settings_of(&find.folder)?, find.data.as_ref())?;
    let path = find.folder.join("materials.ron");
    let library = Library::read(&path)?;
    let mut materials = library.materials().to_vec();
    if let Some(unknown) = find.material.iter().find(|name| !materials.iter().any(|m| m.name == **name)) {
        library.material(unknown)?;
    }
    let mut wanted: Vec<LibraryMaterial> = materials.clone();
    wanted.retain(|m| find.material.is_empty() || find.material.contains(&m.name));
    fill(&mut wanted, &settings, &find.folder)?;
    for found in wanted {
        let same = materials.iter_mut().filter(|m| m.name == found.name);
        same.for_each(|m| m.pattern.clone_from(&found.pattern));
    }
    // Relative to the folder, as in the file.
    let folder = library.beside("");
    let encoder = library.encoder().map(|e| e.strip_prefix(&folder).map(ToOwned::to_owned).unwrap_or(e));
    let encoder = encoder.map(|e| e.to_string_lossy().into_owned());
    write_whole(&path, Library::new(&path, encoder, materials).to_ron().as_bytes())?;
    eprintln!("wrote {}", path.display());
    Ok(())
}

/// Gives each material of the data the pattern for a folder's network; other materials keep theirs.
pub(crate) fn fill(
    materials: &mut [LibraryMaterial],
    settings: &Settings,
    folder: &Path,
) -> Result<(), Failure> {
    let model = Model::load(folder.join("texture.onnx"))?;
    let teller = Mutex::new(Teller::new("patterns", materials.len()));
    let done = AtomicUsize::new(0);
    let of = |material: &mut LibraryMaterial| -> Result<(), Diagnostic> {
        if let Some(found) = one(material, settings, &model)? {
            material.pattern = found;
        }
        if let Ok(mut teller) = teller.lock() {
            teller.tell(done.fetch_add(1, Ordering::Relaxed) + 1, "found");
        }
        Ok(())
    };
    materials.par_iter_mut().try_for_each(of)?;
    Ok(())
}

/// Factor of a model's magnitudes below root mean squares.
fn means_by(model: &Model) -> f64 {
    match model.target() {
        Target::RootMeanSquare => 1.0,
        Target::Mean => f64::from(NOISE_RATIO),
    }
}

/// A network's magnitudes for steady motion at the made strokes' force.
fn answered(runner: &mut Runner, level: f64, velocity: [f64; 2]) -> Result<[f64; pattern::BINS], RunError> {
    let mut speed = [velocity[0] as f32; 2 * HISTORY];
    speed[HISTORY..].fill(velocity[1] as f32);
    let mut magnitudes = [0.0_f32; MAGNITUDES_LEN];
    let mut all = [0.0; pattern::BINS];
    runner.run(0, &[made::FORCE_N as f32; HISTORY], &speed, &mut magnitudes)?;
    // Those of the network begin at 10 Hz.
    let answers = magnitudes.iter().map(|m| f64::from(m.max(0.0)) / level);
    all.iter_mut().skip(1).zip(answers).for_each(|(to, m)| *to = m);
    Ok(all)
}

/// Pattern of a material; nothing if the data lack it.
fn one(
    material: &LibraryMaterial,
    settings: &Settings,
    model: &Model,
) -> Result<Option<Pattern>, Diagnostic> {
    match &settings.data {
        Origin::Made => {
            let Ok(surface) = made::surface(&material.name) else { return Ok(None) };
            let runner = model.runner(&[&material.vector[..]], Precision::F32, Choice::Auto)?;
            // The closure runs on one thread, but cannot change its captures.
            let (runner, level) = (RefCell::new(runner), means_by(model));
            let failed = Cell::new(None);
            let network = |velocity| {
                let answer = answered(&mut runner.borrow_mut(), level, velocity);
                answer.unwrap_or_else(|e| {
                    failed.set(Some(e));
                    [0.0; pattern::BINS]
                })
            };
            let found = made::pattern(&surface, &made_settings(settings), Some(&network));
            failed.take().map_or(Ok(Some(found)), |e| Err(Diagnostic::new(format!("{}: {e}", material.name))))
        }
        // The strokes' force varies, so their own magnitudes are used.
        Origin::Recordings(folder) => {
            let folder = folder.join(&material.name);
            if !folder.is_dir() {
                return Ok(None);
            }
            Ok(Some(pattern::find(&[recordings::strokes(&folder)?], None)))
        }
        // These files have the tool's speed but not its place.
        Origin::Hatt(_) => Ok(None),
    }
}
