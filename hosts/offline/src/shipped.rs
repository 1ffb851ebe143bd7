//! The shipped files: the folder `graphs/` with its models and materials, which the program carries.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::io;
use std::path::{Path, PathBuf};

use include_dir::{Dir, File, include_dir};

/// The folder `graphs/`.
pub static FILES: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/../../graphs");

/// The path of a file to be read. One that begins with `graphs/` and does not exist in the working directory
/// names a shipped file. The first one unpacks all of them to the user's data folder.
///
/// # Errors
/// The files cannot be unpacked.
pub fn found(path: PathBuf) -> io::Result<PathBuf> {
    let here = !matches!(path.try_exists(), Ok(false));
    Ok(if here { None } else { shipped(&path)? }.unwrap_or(path))
}

/// A shipped file by a path that begins with `graphs/`, for graph files.
pub fn file(path: &Path) -> Option<PathBuf> {
    shipped(path).ok().flatten()
}

fn shipped(path: &Path) -> io::Result<Option<PathBuf>> {
    let named = path.strip_prefix("graphs").is_ok_and(|within| FILES.get_entry(within).is_some());
    if named { Ok(Some(unpacked()?.join(path))) } else { Ok(None) }
}

/// The folder that holds `graphs/`. Another version of the program has another folder.
fn unpacked() -> io::Result<PathBuf> {
    let mut hasher = DefaultHasher::new();
    for file in files(&FILES) {
        (file.path(), file.contents()).hash(&mut hasher);
    }
    let home = dirs::data_dir().ok_or_else(|| io::Error::other("there is no folder for the user's data"))?;
    let home = home.join("asperity");
    let folder = home.join(format!("shipped-{:016x}", hasher.finish()));
    if !folder.is_dir() {
        std::fs::create_dir_all(&home)?;
        let fresh = tempfile::tempdir_in(&home)?;
        std::fs::create_dir(fresh.path().join("graphs"))?;
        FILES.extract(fresh.path().join("graphs"))?;
        // Another process may have been quicker.
        std::fs::rename(fresh.path(), &folder).or_else(|e| if folder.is_dir() { Ok(()) } else { Err(e) })?;
    }
    Ok(folder)
}

/// All files of a folder and of the folders within.
pub fn files<'a>(dir: &'a Dir<'a>) -> Vec<&'a File<'a>> {
    let mut all: Vec<_> = dir.files().collect();
    all.extend(dir.dirs().flat_map(files));
    all
}
