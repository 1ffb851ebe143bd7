//! Files that get their names together.
//!
//! 1. All files are written and on the disk, under temporary names.
//! 2. A journal that lists all renames is written into each of their folders.
//! 3. The files are renamed.
//! 4. The journals are removed.
//!
//! If the process is killed, the next one that writes into one of the folders looks at the journal there.
//! If every folder has it, the renames may have begun, and are finished. Else none has begun, and the
//! journal is removed.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use tempfile::{NamedTempFile, TempPath};

use super::{PART, Pending, claimed, left_over, made, sync_folder};
use crate::failure::Failure;

/// A journal's name: that of the first file that it renames, with this ending.
const JOURNAL: &str = ".renames";

/// A file, and its new name.
type Rename = (PathBuf, PathBuf);

/// Gives all files their names, or none, and returns the names.
pub fn keep_all(files: Vec<Pending>) -> Result<Vec<PathBuf>, Failure> {
    for file in &files {
        file.temp.as_file().sync_all().map_err(|e| Failure::writing(&file.path, e))?;
    }
    let journals = if files.len() > 1 { write(&files)? } else { Vec::new() };
    let mut kept = Vec::new();
    for Pending { path, mut temp } in files {
        std::fs::rename(temp.path(), &path).map_err(|e| Failure::writing(&path, e))?;
        temp.disable_cleanup(true);
        made::remember(&path);
        kept.push(path);
    }
    folders(&kept).iter().for_each(|path| sync_folder(path));
    // Dropping a journal removes it.
    drop(journals);
    Ok(kept)
}

/// Writes a journal into each folder.
fn write(files: &[Pending]) -> Result<Vec<NamedTempFile>, Failure> {
    let renames: Vec<Rename> = files.iter().map(|f| (f.temp.path().to_owned(), f.path.clone())).collect();
    // A name that is not UTF-8 cannot be written: no journal.
    let Ok(text) = serde_json::to_vec(&renames) else { return Ok(Vec::new()) };
    let mut journals = Vec::new();
    for path in journals_of(&renames) {
        let journal = claimed(|| {
            let file = File::options().write(true).create_new(true).open(&path)?;
            Ok(NamedTempFile::from_parts(file, TempPath::try_from_path(&path)?))
        });
        let written = journal.and_then(|mut journal| {
            journal.write_all(&text)?;
            journal.as_file().sync_all()?;
            Ok(journal)
        });
        journals.push(written.map_err(|e| Failure::writing(&path, e))?);
        sync_folder(&path);
    }
    Ok(journals)
}

/// One file of each folder.
fn folders(paths: &[PathBuf]) -> Vec<&PathBuf> {
    let mut seen = BTreeSet::new();
    paths.iter().filter(|path| seen.insert(path.parent())).collect()
}

/// The journals of renames: one in each folder, all of one name.
fn journals_of(renames: &[Rename]) -> BTreeSet<PathBuf> {
    let Some(name) = renames.first().and_then(|(temp, _)| temp.file_name()?.to_str()) else {
        return BTreeSet::new();
    };
    renames.iter().map(|(temp, _)| temp.with_file_name(format!("{name}{JOURNAL}"))).collect()
}

/// Finishes renames that a killed process began in the folder of this file. Removes its temporary files.
pub fn tidy(path: &Path) {
    let folder = path.parent().filter(|dir| !dir.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let entries: Vec<PathBuf> = match std::fs::read_dir(folder) {
        Ok(entries) => entries.filter_map(|entry| Some(entry.ok()?.path())).collect(),
        Err(_) => return,
    };
    // The next process tries again what fails here.
    for journal in entries.iter().filter(|path| ends_with(path, &format!("{PART}{JOURNAL}"))) {
        if let Ok(Some(_lock)) = left_over(journal) {
            let _ = finish(journal);
        }
    }
    for part in entries.iter().filter(|part| is_part_of(part, path)) {
        if let Ok(Some(_lock)) = left_over(part) {
            let _ = std::fs::remove_file(part);
        }
    }
}

/// Finishes the renames of a journal, or removes it where they were never begun.
fn finish(journal: &Path) -> io::Result<()> {
    let renames: Vec<Rename> = serde_json::from_slice(&std::fs::read(journal)?).unwrap_or_default();
    let all = journals_of(&renames);
    let counts = all.contains(journal) && all.iter().all(|journal| journal.is_file());
    if !counts {
        return std::fs::remove_file(journal);
    }
    for (temp, path) in renames.iter().filter(|(temp, path)| is_part_of(temp, path)) {
        match std::fs::rename(temp, path) {
            Err(e) if e.kind() != io::ErrorKind::NotFound => return Err(e),
            _ => sync_folder(path),
        }
    }
    all.iter().try_for_each(std::fs::remove_file)
}

fn ends_with(path: &Path, end: &str) -> bool {
    path.file_name().is_some_and(|name| name.to_string_lossy().ends_with(end))
}

/// Whether this is a temporary name of the file.
fn is_part_of(part: &Path, path: &Path) -> bool {
    let name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let (part_name, begin) = (name(part), format!(".{}.", name(path)));
    let random = part_name.strip_prefix(&begin).and_then(|rest| rest.strip_suffix(PART));
    let beside = part.parent() == path.parent();
    beside && random.is_some_and(|r| r.len() == 6 && r.bytes().all(|b| b.is_ascii_alphanumeric()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A killed process leaves its files, unlocked.
    fn killed(file: NamedTempFile) {
        let (file, path) = file.into_parts();
        path.keep().unwrap();
        drop(file);
    }

    struct Two {
        _dirs: [tempfile::TempDir; 2],
        paths: [PathBuf; 2],
    }

    /// Two new files in two folders, with old files of the same names.
    fn two() -> (Two, Vec<Pending>) {
        let dirs = [(); 2].map(|()| tempfile::tempdir().unwrap());
        let paths = [0, 1].map(|i| dirs[i].path().canonicalize().unwrap().join("a"));
        let pending = paths.iter().map(|path| {
            std::fs::write(path, "old").unwrap();
            Pending::create(path).unwrap().fill("new").unwrap()
        });
        let pending = pending.collect();
        (Two { _dirs: dirs, paths }, pending)
    }

    impl Two {
        fn texts(&self) -> [String; 2] {
            self.paths.each_ref().map(|path| std::fs::read_to_string(path).unwrap())
        }

        /// Number of other files in the folders.
        fn left(&self) -> usize {
            let count = |path: &PathBuf| std::fs::read_dir(path.parent().unwrap()).unwrap().count();
            self.paths.iter().map(count).sum::<usize>() - 2
        }
    }

    #[test]
    fn files_in_two_folders_get_their_names() {
        let (two, pending) = two();
        assert_eq!(keep_all(pending).unwrap(), two.paths);
        assert_eq!((two.texts(), two.left()), (["new", "new"].map(String::from), 0));
    }

    /// Regression: a kill between two renames left old and new files mixed.
    #[test]
    fn kill_between_renames_is_finished_by_the_next_run() {
        for next in 0..2 {
            let (two, mut pending) = two();
            write(&pending).unwrap().into_iter().for_each(killed);
            let second = pending.pop().unwrap();
            pending.pop().unwrap().temp.persist(&two.paths[0]).unwrap();
            killed(second.temp);
            assert_eq!(two.texts(), ["new", "old"]);
            tidy(&two.paths[next]);
            assert_eq!((two.texts(), two.left()), (["new", "new"].map(String::from), 0));
        }
    }

    #[test]
    fn kill_before_the_last_journal_leaves_old_files() {
        for missing in 0..2 {
            for next in [[0, 1], [1, 0]] {
                let (two, pending) = two();
                let mut journals = write(&pending).unwrap();
                drop(journals.remove(missing));
                journals.into_iter().for_each(killed);
                pending.into_iter().for_each(|p| killed(p.temp));
                next.iter().for_each(|&i| tidy(&two.paths[i]));
                assert_eq!((two.texts(), two.left()), (["old", "old"].map(String::from), 0));
            }
        }
    }

    #[test]
    fn journal_and_files_of_a_living_process_stay() {
        let (two, pending) = two();
        let journals = write(&pending).unwrap();
        two.paths.iter().for_each(|path| tidy(path));
        assert_eq!((two.texts(), two.left()), (["old", "old"].map(String::from), 4));
        drop(journals);
    }
}
