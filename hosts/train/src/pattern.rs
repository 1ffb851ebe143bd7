//! How the materials of a model vibrate over place.

use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use asperity_dataset::{made, pattern, recordings};
use asperity_source::Diagnostic;
use asperity_world::material::{Library, LibraryMaterial, Pattern};
use clap::Args;
use rayon::prelude::*;

use crate::arguments::Settings;
use crate::data::{Origin, made_settings};
use crate::failure::Failure;
use crate::files::write_whole;
use crate::progress::Teller;
use crate::training::{settings_now, settings_of};

/// Which model's patterns are found anew.
#[derive(Args, Clone, Debug)]
pub(crate) struct FindPatterns {
    /// The model's folder.
    pub folder: PathBuf,
    /// Where the data are now, if not where they were: `hatt:FOLDER` or `recordings:FOLDER`.
    #[arg(long, value_name = "SOURCE")]
    pub data: Option<Origin>,
}

/// Finds the patterns of a model's materials anew, and writes its library with them. All else in the library stays.
///
/// # Errors
/// What the files say, and the data.
pub(crate) fn find(find: &FindPatterns) -> Result<(), Failure> {
    let settings = settings_now(&find.folder, &settings_of(&find.folder)?, find.data.as_ref())?;
    let path = find.folder.join("materials.ron");
    let library = Library::read(&path)?;
    let mut materials = library.materials().to_vec();
    fill(&mut materials, &settings)?;
    // As the file says it: relative to the folder.
    let folder = library.beside("");
    let encoder = library.encoder().map(|e| e.strip_prefix(&folder).map(ToOwned::to_owned).unwrap_or(e));
    let encoder = encoder.map(|e| e.to_string_lossy().into_owned());
    write_whole(&path, Library::new(&path, encoder, materials).to_ron().as_bytes())?;
    eprintln!("wrote {}", path.display());
    Ok(())
}

/// Gives each material of the data its pattern; others keep theirs.
///
/// # Errors
/// What the recordings say.
pub(crate) fn fill(materials: &mut [LibraryMaterial], settings: &Settings) -> Result<(), Failure> {
    let teller = Mutex::new(Teller::new("patterns", materials.len()));
    let done = AtomicUsize::new(0);
    let of = |material: &mut LibraryMaterial| -> Result<(), Diagnostic> {
        if let Some(found) = one(&material.name, settings)? {
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

/// The pattern of a material; nothing where the data have no such material.
fn one(name: &str, settings: &Settings) -> Result<Option<Pattern>, Diagnostic> {
    match &settings.data {
        Origin::Made => {
            let surface = made::surface(name).ok();
            Ok(surface.map(|surface| made::pattern(&surface, &made_settings(settings))))
        }
        Origin::Recordings(folder) => {
            let folder = folder.join(name);
            if !folder.is_dir() {
                return Ok(None);
            }
            Ok(Some(pattern::find(&[recordings::strokes(&folder)?])))
        }
        // These say how fast the tool went, but not where.
        Origin::Hatt(_) => Ok(Some(Pattern::default())),
    }
}
