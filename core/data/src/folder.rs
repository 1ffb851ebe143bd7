//! Folders of a user's data: their files, and the pictures among them.

use std::path::{Path, PathBuf};

use asperity_diagnostics::Diagnostic;
use asperity_texture::picture::{self, Image};

use crate::example::{Note, Parts};

/// Depth to which folders are searched.
const MAX_DEPTH: usize = 8;

/// The error about a file or a folder.
pub(crate) fn refused(path: &Path, what: &str, help: &str) -> Diagnostic {
    Diagnostic::new(what).in_file(path).help(help)
}

/// Entries of a folder, sorted by name. Names that begin with a point are hidden and left out.
pub(crate) fn entries(folder: &Path) -> Result<Vec<PathBuf>, Diagnostic> {
    let fail = |e: std::io::Error| Diagnostic::new(format!("cannot read this folder: {e}")).in_file(folder);
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(fail)? {
        let path = entry.map_err(fail)?.path();
        if !name(&path).starts_with('.') {
            paths.push(path);
        }
    }
    paths.sort();
    Ok(paths)
}

/// All files in a folder and its folders, sorted.
pub(crate) fn tree(folder: &Path) -> Result<Vec<PathBuf>, Diagnostic> {
    let mut files = Vec::new();
    let mut folders = vec![(folder.to_owned(), 0)];
    while let Some((folder, depth)) = folders.pop() {
        for path in entries(&folder)? {
            if !path.is_dir() {
                files.push(path);
            } else if depth < MAX_DEPTH {
                folders.push((path, depth + 1));
            }
        }
    }
    files.sort();
    Ok(files)
}

/// The last part of a path.
pub(crate) fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// A file's name without its extension.
pub(crate) fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// Whether a file has one of these extensions, in any case.
pub(crate) fn ends_with(path: &Path, extensions: &[&str]) -> bool {
    let found = path.extension().unwrap_or_default();
    extensions.iter().any(|e| found.eq_ignore_ascii_case(e))
}

/// Whether a file's name is a picture's.
pub(crate) fn is_picture(path: &Path) -> bool {
    ends_with(path, &["png", "jpg", "jpeg", "bmp"])
}

/// Reads pictures and notes about them. Of two or more the last fifth, at least one, is held apart.
pub(crate) fn pictures(paths: &[PathBuf]) -> Result<(Parts<Image>, Vec<Note>), Diagnostic> {
    let mut notes = Vec::new();
    let mut read = |paths: &[PathBuf]| -> Result<Vec<Image>, Diagnostic> {
        let one = |path: &PathBuf| {
            let picture = picture::read(path)?;
            notes.extend(picture.notes.into_iter().map(|note| (path.clone(), note)));
            Ok(picture.image)
        };
        paths.iter().map(one).collect()
    };
    let (train, held) = paths.split_at(paths.len() - held_of(paths.len()));
    let parts = Parts { train: read(train)?, held: read(held)? };
    Ok((parts, notes))
}

/// Number to hold apart: a fifth, at least one of two, none of one.
pub(crate) fn held_of(count: usize) -> usize {
    if count < 2 { 0 } else { (count / 5).max(1) }
}

/// Writes a grey picture of 320 x 240 pixels.
#[cfg(test)]
pub(crate) fn write_picture(path: &Path, grey: u8) {
    let mut encoder = png::Encoder::new(std::fs::File::create(path).unwrap(), 320, 240);
    encoder.set_color(png::ColorType::Rgb);
    encoder.write_header().unwrap().write_image_data(&vec![grey; 320 * 240 * 3]).unwrap();
}
