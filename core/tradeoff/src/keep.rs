//! What is finished is kept, so that a study that was stopped goes on where it was.

use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use asperity_diagnostics::{Diagnostic, MAX_TEXT_BYTES, file};
use serde::Serialize;
use serde::de::DeserializeOwned;

/// A folder of finished parts.
#[derive(Debug)]
pub(crate) struct Kept {
    folder: PathBuf,
    /// Locked for as long as this is there.
    _lock: File,
    /// Files of parts that are not as they were written.
    spoiled: Mutex<Vec<PathBuf>>,
}

/// A part's file is a JSON object: a checksum over the bytes of `part`, then `part`.
const BEFORE: [&str; 2] = ["{\"crc32\":\"", "\",\"part\":"];

/// The file by which a folder is locked.
const LOCK: &str = ".lock";

impl Kept {
    /// Makes the folder where it is not there, and locks it.
    ///
    /// # Errors
    /// It cannot be made; another run has it.
    pub(crate) fn open(folder: &Path) -> Result<Self, Diagnostic> {
        let fail =
            |what: &str, e: &dyn std::fmt::Display| Diagnostic::new(format!("{what}: {e}")).in_file(folder);
        std::fs::create_dir_all(folder).map_err(|e| fail("cannot make this folder", &e))?;
        let lock = File::create(folder.join(LOCK)).map_err(|e| fail("cannot write into this folder", &e))?;
        match lock.try_lock() {
            // Where there are no locks, as on some network disks, nobody is kept out.
            Ok(()) | Err(TryLockError::Error(_)) => {
                Ok(Self { folder: folder.to_owned(), _lock: lock, spoiled: Mutex::default() })
            }
            Err(TryLockError::WouldBlock) => Err(Diagnostic::new("another run writes into this folder")
                .in_file(folder)
                .help("each run, and each shard, has a folder of its own: --out")),
        }
    }

    /// A part that is there, if it is as it was written.
    pub(crate) fn get<T: DeserializeOwned>(&self, name: &str) -> Option<T> {
        let path = self.folder.join(format!("{name}.json"));
        let bytes = file::read(&path, MAX_TEXT_BYTES).ok()?;
        let part = part(&bytes).and_then(|part| serde_json::from_slice(part).ok());
        if part.is_none()
            && let Ok(mut spoiled) = self.spoiled.lock()
        {
            spoiled.push(path);
        }
        part
    }

    /// Files that [`get`](Self::get) found not to be as they were written, each once.
    pub(crate) fn spoiled(&self) -> Vec<PathBuf> {
        self.spoiled.lock().map(|mut spoiled| std::mem::take(&mut *spoiled)).unwrap_or_default()
    }

    /// Keeps a part: written beside, then given its name, so that it is there whole or not at all. Answers it as it will be read, whose last digits may
    /// differ, so that results are the same whether or not they were kept.
    ///
    /// # Errors
    /// It cannot be written.
    pub(crate) fn put<T: Serialize + DeserializeOwned>(&self, name: &str, part: &T) -> Result<T, Diagnostic> {
        let path = self.folder.join(format!("{name}.json"));
        let fail =
            |e: &dyn std::fmt::Display| Diagnostic::new(format!("cannot write this: {e}")).in_file(&path);
        let part = serde_json::to_string(part).map_err(|e| fail(&e))?;
        let beside = self.folder.join(format!(".{name}.{}.part", std::process::id()));
        let read = serde_json::from_str(&part).map_err(|e| fail(&e))?;
        let text = format!("{}{}{}{part}}}", BEFORE[0], checksum(part.as_bytes()), BEFORE[1]);
        std::fs::write(&beside, text).and_then(|()| std::fs::rename(&beside, &path)).map_err(|e| {
            let _ = std::fs::remove_file(&beside);
            fail(&e)
        })?;
        Ok(read)
    }

    /// Parts whose names begin so.
    pub(crate) fn all<T: DeserializeOwned>(&self, prefix: &str) -> Vec<T> {
        let Ok(entries) = std::fs::read_dir(&self.folder) else { return Vec::new() };
        let mut names: Vec<String> = entries
            .filter_map(|e| e.ok()?.file_name().into_string().ok())
            .filter(|n| n.starts_with(prefix))
            .collect();
        names.sort();
        names.iter().filter_map(|n| self.get(n.strip_suffix(".json")?)).collect()
    }

    /// Removes parts that are not needed, and what runs that were killed left half written: nobody else writes while this is there.
    ///
    /// # Errors
    /// The folder cannot be read.
    pub(crate) fn tidy(&self, needed: impl Fn(&str) -> bool) -> Result<(), Diagnostic> {
        let entries = std::fs::read_dir(&self.folder)
            .map_err(|e| Diagnostic::new(format!("cannot read this folder: {e}")).in_file(&self.folder))?;
        for name in entries.filter_map(|e| e.ok()?.file_name().into_string().ok()) {
            let half = name.starts_with('.') && name.ends_with(".part");
            if half || name.strip_suffix(".json").is_some_and(|part| !needed(part)) {
                // What stays is only in the way.
                let _ = std::fs::remove_file(self.folder.join(&name));
            }
        }
        Ok(())
    }
}

/// The part in a file, if its checksum is right.
fn part(file: &[u8]) -> Option<&[u8]> {
    let (told, rest) = file.strip_prefix(BEFORE[0].as_bytes())?.split_at_checked(8)?;
    let part = rest.strip_prefix(BEFORE[1].as_bytes())?.strip_suffix(b"}")?;
    (told == checksum(part).as_bytes()).then_some(part)
}

fn checksum(bytes: &[u8]) -> String {
    format!("{:08x}", crc32fast::hash(bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_is_there_whole_or_not_at_all() {
        let dir = tempfile::tempdir().unwrap();
        let kept = Kept::open(&dir.path().join("a/b")).unwrap();
        assert_eq!(kept.get::<Vec<u32>>("one"), None);
        kept.put("one", &vec![1, 2]).unwrap();
        kept.put("other", &vec![3]).unwrap();
        assert_eq!(kept.get("one"), Some(vec![1, 2]));
        std::fs::write(dir.path().join("a/b/one half.json"), "[1, 2").unwrap();
        assert_eq!(kept.get::<Vec<u32>>("one half"), None);
        assert_eq!(kept.all::<Vec<u32>>("o"), [vec![1, 2], vec![3]]);
        assert!(Kept::open(&dir.path().join("a/b/one.json/c")).is_err());
    }

    #[test]
    fn part_changed_by_hand_is_not_read() {
        let dir = tempfile::tempdir().unwrap();
        let kept = Kept::open(dir.path()).unwrap();
        kept.put("one", &vec![1234]).unwrap();
        kept.put("other", &vec![5]).unwrap();
        let path = dir.path().join("one.json");
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(serde_json::from_str::<serde_json::Value>(&text).is_ok(), "{text}");
        std::fs::write(&path, text.replace("1234", "1235")).unwrap();
        assert_eq!(kept.all::<Vec<u32>>("o"), [[5]]);
        assert_eq!(kept.spoiled(), [path]);
        assert!(kept.spoiled().is_empty());
    }

    #[test]
    fn what_nobody_needs_is_removed_and_what_is_no_part_stays() {
        let dir = tempfile::tempdir().unwrap();
        let kept = Kept::open(dir.path()).unwrap();
        for name in ["figures-1", "figures-2", "cases-1", "batch-1"] {
            kept.put(name, &1).unwrap();
        }
        for name in [".figures-3.77.part", "notes.txt"] {
            std::fs::write(dir.path().join(name), "mine").unwrap();
        }
        kept.tidy(|name| matches!(name, "figures-2" | "batch-1")).unwrap();
        assert_eq!(
            ["figures-1", "figures-2", "cases-1", "batch-1"].map(|n| kept.get::<i32>(n)),
            [None, Some(1), None, Some(1)]
        );
        let there = [".figures-3.77.part", "notes.txt", LOCK].map(|n| dir.path().join(n).exists());
        assert_eq!(there, [false, true, true]);
    }

    #[test]
    fn two_runs_do_not_share_a_folder() {
        let dir = tempfile::tempdir().unwrap();
        let first = Kept::open(dir.path()).unwrap();
        assert!(Kept::open(dir.path()).unwrap_err().to_string().contains("another run"));
        drop(first);
        Kept::open(dir.path()).unwrap();
    }
}
