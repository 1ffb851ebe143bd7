//! Finished parts of a run, in `progress.jsonl`: a stopped run resumes from it.
//!
//! The first line is a digest of everything that the parts depend on. Each further line is a finished part. A
//! last line that a killed run left unfinished is ignored. Parts of another digest are deleted.

use std::fs::{File, TryLockError};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use asperity_diagnostics::Diagnostic;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Name of the file.
const NAME: &str = "progress.jsonl";

/// The file, locked while it is open.
#[derive(Debug)]
pub(crate) struct Progress {
    path: PathBuf,
    file: File,
}

impl Progress {
    /// Opens the file in a folder, and reads the parts of this digest.
    ///
    /// # Errors
    /// A file that cannot be read or written, or that another run has open.
    pub(crate) fn open<T: DeserializeOwned>(
        folder: &Path,
        digest: &str,
    ) -> Result<(Self, Vec<T>), Diagnostic> {
        let path = folder.join(NAME);
        let fail = |e: std::io::Error| Diagnostic::new(format!("cannot open this file: {e}")).in_file(&path);
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
        let whole = bytes.iter().rposition(|b| *b == b'\n').map_or(0, |at| at + 1);
        let mut lines = bytes[..whole].split_inclusive(|b| *b == b'\n');
        let (mut parts, mut end) = (Vec::new(), 0);
        if let Some(first) = lines.next().filter(|first| first.trim_ascii() == digest.as_bytes()) {
            end = first.len();
            for line in lines {
                let Ok(part) = serde_json::from_slice(line) else { break };
                parts.push(part);
                end += line.len();
            }
        }
        let mut it = Self { path, file };
        it.cut(end as u64)?;
        if end == 0 {
            it.write(digest)?;
        }
        Ok((it, parts))
    }

    /// Appends a finished part. Returns it as it will be read: the last digit of a number may differ, and
    /// results must be the same with and without a stop.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub(crate) fn put<T: Serialize + DeserializeOwned>(&mut self, part: &T) -> Result<T, Diagnostic> {
        let json = |e: serde_json::Error| Diagnostic::new(format!("{e}")).in_file(&self.path);
        let text = serde_json::to_string(part).map_err(json)?;
        let read = serde_json::from_str(&text).map_err(json)?;
        self.write(&text)?;
        Ok(read)
    }

    fn write(&mut self, line: &str) -> Result<(), Diagnostic> {
        let before = self.file.stream_position().map_err(|e| self.failed(&e))?;
        self.file.write_all(format!("{line}\n").as_bytes()).map_err(|e| {
            let _ = self.cut(before);
            self.failed(&e)
        })
    }

    fn cut(&mut self, end: u64) -> Result<(), Diagnostic> {
        let cut = self.file.set_len(end).and_then(|()| self.file.seek(SeekFrom::Start(end)));
        cut.map(drop).map_err(|e| self.failed(&e))
    }

    fn failed(&self, e: &std::io::Error) -> Diagnostic {
        Diagnostic::new(format!("cannot write this file: {e}")).in_file(&self.path)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn open(dir: &Path, digest: &str) -> Result<(Progress, Vec<u32>), Diagnostic> {
        Progress::open(dir, digest)
    }

    #[test]
    fn finished_parts_are_read_again() {
        let dir = tempfile::tempdir().unwrap();
        let (mut progress, parts) = open(dir.path(), "one").unwrap();
        assert!(parts.is_empty());
        assert_eq!([progress.put(&1_u32).unwrap(), progress.put(&2).unwrap()], [1, 2]);
        drop(progress);
        let (progress, parts) = open(dir.path(), "one").unwrap();
        assert_eq!(parts, [1, 2]);
        drop(progress);
        // Parts of another run are deleted.
        assert!(open(dir.path(), "two").unwrap().1.is_empty());
        assert!(open(dir.path(), "one").unwrap().1.is_empty());
        assert!(open(&dir.path().join("gone"), "one").is_err());
    }

    #[test]
    fn unfinished_and_damaged_lines_are_measured_again() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(NAME);
        for (text, want) in [
            (&b"one\n1\n2\n33"[..], &[1, 2][..]),
            (b"one\n1\n2", &[1]),
            (b"one\n1\n?\n2\n", &[1]),
            (b"one", &[]),
            (b"on", &[]),
            (b"", &[]),
            (b"one\n1\n\xff\n", &[1]),
        ] {
            std::fs::write(&path, text).unwrap();
            let (mut progress, parts) = open(dir.path(), "one").unwrap();
            assert_eq!(parts, want, "{text:?}");
            progress.put(&4_u32).unwrap();
            drop(progress);
            assert_eq!(open(dir.path(), "one").unwrap().1, [want, &[4]].concat(), "{text:?}");
        }
    }

    #[test]
    fn second_run_in_a_folder_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        let first = open(dir.path(), "one").unwrap();
        assert!(open(dir.path(), "one").unwrap_err().to_string().contains("another run"));
        drop(first);
        open(dir.path(), "one").unwrap();
    }
}
