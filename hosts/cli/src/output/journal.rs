//! Files that get their names together.
//!
//! 1. All files are written and on the disk, under temporary names.
//! 2. A journal beside the first file lists all renames.
//! 3. The files are renamed, and the journal is removed.
//!
//! If the process is killed, the next one that writes into the folder of the journal finishes the renames.

use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use super::{PART, Pending, claimed, folder_of, is_standard, left_over, made, new_file, sync_folder};
use crate::failure::{Failure, written};

/// A journal's name: that of the first temporary file, with this ending.
const JOURNAL: &str = ".renames";

/// Gives all files their names, or none, and returns the names.
pub fn keep_all(files: Vec<Pending>) -> Result<Vec<PathBuf>, Failure> {
    let files: Vec<Pending> = files.into_iter().map(Pending::packed).collect::<Result<_, _>>()?;
    let (standard, files): (Vec<_>, Vec<_>) = files.into_iter().partition(|file| is_standard(&file.path));
    for file in &files {
        file.temp.as_file().sync_all().map_err(|e| Failure::writing(&file.path, e))?;
    }
    let journal = if files.len() > 1 { write(&files)? } else { None };
    let mut kept = Vec::new();
    for Pending { path, mut temp, .. } in files {
        std::fs::rename(temp.path(), &path).map_err(|e| Failure::writing(&path, e))?;
        temp.disable_cleanup(true);
        made::remember(&path);
        kept.push(path);
    }
    kept.iter().for_each(|path| sync_folder(path));
    // Dropping a journal removes it.
    drop(journal);
    for file in standard {
        let copied =
            File::open(file.temp.path()).and_then(|mut it| io::copy(&mut it, &mut io::stdout().lock()));
        written(copied.and_then(|_| io::stdout().flush()))?;
        kept.push(PathBuf::from("the standard output"));
    }
    Ok(kept)
}

/// Writes a journal beside the first file; `None` if a name is not UTF-8.
fn write(files: &[Pending]) -> Result<Option<NamedTempFile>, Failure> {
    let renames: Vec<_> = files.iter().map(|file| (file.temp.path(), &file.path)).collect();
    let Ok(text) = serde_json::to_vec(&renames) else { return Ok(None) };
    let first = files[0].temp.path();
    let path = first.with_file_name(name(first) + JOURNAL);
    let made = claimed(|| new_file(&path)).and_then(|mut journal| {
        journal.write_all(&text)?;
        journal.as_file().sync_all()?;
        sync_folder(&path);
        Ok(Some(journal))
    });
    made.map_err(|e| Failure::writing(&path, e))
}

/// Finishes renames that a killed process began in the folder of this file. Removes its temporary files.
pub fn tidy(path: &Path) {
    let Ok(entries) = std::fs::read_dir(folder_of(path)) else { return };
    let entries: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    let is_journal = |path: &&PathBuf| name(path).ends_with(&format!("{PART}{JOURNAL}"));
    let is_part = |part: &&PathBuf| is_part_of(part, path);
    // The next process tries again what fails here.
    for left in entries.iter().filter(is_journal).chain(entries.iter().filter(is_part)) {
        if let Ok(Some(_lock)) = left_over(left) {
            let _ = if is_part(&left) { std::fs::remove_file(left) } else { finish(left) };
        }
    }
}

/// Finishes the renames of a journal. One that is not complete lists none: they were never begun.
fn finish(journal: &Path) -> io::Result<()> {
    let renames: Vec<(PathBuf, PathBuf)> =
        serde_json::from_slice(&std::fs::read(journal)?).unwrap_or_default();
    for (temp, path) in renames.iter().filter(|(temp, path)| is_part_of(temp, path)) {
        match std::fs::rename(temp, path) {
            Err(e) if e.kind() != io::ErrorKind::NotFound => return Err(e),
            _ => sync_folder(path),
        }
    }
    std::fs::remove_file(journal)
}

fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Whether this is a temporary name of the file.
fn is_part_of(part: &Path, path: &Path) -> bool {
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
        file.into_temp_path().keep().unwrap();
    }

    /// Kills at any time are tested by `tests/stability` and `tests/it/hostile`.
    #[test]
    fn kill_leaves_no_mix_of_old_and_new_files() {
        for (at, left) in [("in the journal", "old"), ("between renames", "new")] {
            let dir = tempfile::tempdir().unwrap();
            let paths = ["a", "b"].map(|name| dir.path().canonicalize().unwrap().join(name));
            paths.iter().for_each(|path| std::fs::write(path, "old").unwrap());
            let pending = paths.each_ref().map(|path| Pending::create(path).unwrap().fill("new").unwrap());
            let journal = write(&pending).unwrap().unwrap();
            if at == "in the journal" {
                journal.as_file().set_len(9).unwrap();
            } else {
                std::fs::rename(pending[0].temp.path(), &paths[0]).unwrap();
            }
            killed(journal);
            pending.into_iter().filter(|f| f.temp.path().exists()).for_each(|f| killed(f.temp));
            paths.iter().for_each(|path| tidy(path));
            for path in &paths {
                assert_eq!(std::fs::read_to_string(path).unwrap(), left, "{at}");
            }
            assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 2, "{at}");
        }
    }

    #[test]
    fn files_of_a_living_process_are_left_alone() {
        let dir = tempfile::tempdir().unwrap();
        let paths = ["a", "b"].map(|name| dir.path().canonicalize().unwrap().join(name));
        let pending = paths.each_ref().map(|path| Pending::create(path).unwrap().fill("new").unwrap());
        let journal = write(&pending).unwrap().unwrap();
        tidy(&paths[0]);
        assert!(journal.path().exists() && pending.iter().all(|file| file.temp.path().exists()));
        drop(journal);
        assert_eq!(keep_all(pending.into()).unwrap(), paths);
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 2);
    }
}
