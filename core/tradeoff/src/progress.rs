//! Finished parts of a run, in `progress.jsonl`: a stopped run resumes from it.
//!
//! The first line is a digest of everything that the parts depend on. Each further line is a finished part. A
//! last line that a killed run left unfinished is ignored. Parts of another digest are deleted.

use std::fs::{File, TryLockError};
use std::io::{Error, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use asperity_diagnostics::Diagnostic;
use serde::Serialize;
use serde::de::DeserializeOwned;

const NAME: &str = "progress.jsonl";

/// The file, locked while it is open.
#[derive(Debug)]
pub(crate) struct Progress {
    path: PathBuf,
    file: File,
}

impl Progress {
    /// Opens the file in a folder, and reads the parts of this digest. Another run must not have it open.
    pub(crate) fn open<T: DeserializeOwned>(
        folder: &Path,
        digest: &str,
    ) -> Result<(Self, Vec<T>), Diagnostic> {
        let path = folder.join(NAME);
        let fail = |e: Error| Diagnostic::new(format!("cannot open this file: {e}")).in_file(&path);
        let mut file =
            File::options().read(true).write(true).create(true).truncate(false).open(&path).map_err(fail)?;
        // Some network disks have no locks; there two runs are not kept apart.
        if let Err(TryLockError::WouldBlock) = file.try_lock() {
            return Err(Diagnostic::new("another run writes into this folder")
                .in_file(folder)
                .help("each run, and each shard, needs its own --out folder"));
        }
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).map_err(fail)?;
        let mut lines = bytes.split_inclusive(|b| *b == b'\n').filter(|line| line.ends_with(b"\n"));
        let (mut parts, mut end) = (Vec::new(), 0);
        if let Some(first) = lines.next().filter(|first| first.trim_ascii() == digest.as_bytes()) {
            end = first.len();
            for (part, line) in lines.map_while(|line| Some((serde_json::from_slice(line).ok()?, line))) {
                parts.push(part);
                end += line.len();
            }
        }
        let at_end = file.set_len(end as u64).and_then(|()| file.seek(SeekFrom::Start(end as u64)));
        at_end.map_err(fail)?;
        let mut it = Self { path, file };
        if end == 0 {
            it.write(digest)?;
        }
        Ok((it, parts))
    }

    /// Appends a finished part. Returns it as it will be read: the last digit of a number may differ, and
    /// results must be the same with and without a stop.
    pub(crate) fn put<T: Serialize + DeserializeOwned>(&mut self, part: &T) -> Result<T, Diagnostic> {
        let text = serde_json::to_string(part).map_err(|e| self.failed(&e.into()))?;
        self.write(&text)?;
        serde_json::from_str(&text).map_err(|e| self.failed(&e.into()))
    }

    fn write(&mut self, line: &str) -> Result<(), Diagnostic> {
        self.file.write_all(format!("{line}\n").as_bytes()).map_err(|e| self.failed(&e))
    }

    fn failed(&self, e: &Error) -> Diagnostic {
        Diagnostic::new(format!("cannot write this file: {e}")).in_file(&self.path)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn open(dir: &Path, digest: &str) -> Result<(Progress, Vec<f64>), Diagnostic> {
        Progress::open(dir, digest)
    }

    #[test]
    fn finished_parts_are_read_again_as_they_were_returned() {
        let dir = tempfile::tempdir().unwrap();
        let (mut progress, parts) = open(dir.path(), "one").unwrap();
        assert!(parts.is_empty());
        assert!(open(dir.path(), "one").unwrap_err().to_string().contains("another run"));
        let numbers = (1..500).map(|n| progress.put(&(f64::from(n).sqrt() / 7.0)).unwrap());
        let numbers: Vec<f64> = numbers.collect();
        drop(progress);
        assert_eq!(open(dir.path(), "one").unwrap().1, numbers);
        // Parts of another run are deleted.
        assert!(open(dir.path(), "two").unwrap().1.is_empty());
        assert!(open(dir.path(), "one").unwrap().1.is_empty());
        assert!(open(&dir.path().join("gone"), "one").is_err());
    }

    #[test]
    fn unfinished_and_damaged_lines_are_measured_again() {
        let dir = tempfile::tempdir().unwrap();
        for (text, want) in [
            (&b"one\n1\n2\n33"[..], &[1.0, 2.0][..]),
            (b"one\n1\n2", &[1.0]),
            (b"one\n1\n?\n2\n", &[1.0]),
            (b"one", &[]),
            (b"on", &[]),
            (b"", &[]),
            (b"one\n1\n\xff\n", &[1.0]),
        ] {
            std::fs::write(dir.path().join(NAME), text).unwrap();
            let (mut progress, parts) = open(dir.path(), "one").unwrap();
            assert_eq!(parts, want, "{text:?}");
            progress.put(&4.0).unwrap();
            drop(progress);
            assert_eq!(open(dir.path(), "one").unwrap().1, [want, &[4.0]].concat(), "{text:?}");
        }
    }
}
