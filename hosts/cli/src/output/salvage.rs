//! Completes a recording whose run was killed: the rows that reached the disk make a valid file.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use asperity_accuracy::npy;
use tempfile::{NamedTempFile, TempPath};

use super::{ending, left_over, made, sync_folder};

/// Ending of a recording's name while it grows.
pub const GROWING: &str = ".recording";

/// Limit for the length of a line of a CSV file \[bytes\].
const LONGEST_LINE: u64 = 1 << 20;

#[derive(Debug, PartialEq, Eq)]
pub enum Recovered {
    Kept(PathBuf),
    /// Removed, because it had no rows.
    Empty,
    /// Not touched, because a run still writes it.
    Busy,
}

/// Completes a recording of a killed run under a free name, with a number from `first` on; 0 is none.
pub fn recover(growing: &Path, first: u32) -> io::Result<Recovered> {
    let not_growing = || io::Error::new(io::ErrorKind::InvalidInput, "not a recording of a killed run");
    let name = growing.file_name().and_then(|n| n.to_str()).and_then(|n| n.strip_suffix(GROWING));
    let mut path = growing.with_file_name(name.filter(|name| !name.is_empty()).ok_or_else(not_growing)?);
    if ending(&path) == "npz" {
        // An archive is packed at the end of a run. Until then its rows are an array.
        path.set_extension("npy");
    }
    let Some(mut file) = left_over(growing)? else { return Ok(Recovered::Busy) };
    let empty = file.metadata()?.len() == 0;
    if empty || salvage(&mut file, &ending(&path))? == Some(0) {
        std::fs::remove_file(growing)?;
        return Ok(Recovered::Empty);
    }
    file.sync_all()?;
    let mut part = NamedTempFile::from_parts(file, TempPath::try_from_path(growing)?);
    part.disable_cleanup(true);
    for number in first.. {
        let name = numbered(&path, number);
        match part.persist_noclobber(&name) {
            Ok(_) => {
                sync_folder(&name);
                made::remember(&name);
                return Ok(Recovered::Kept(name));
            }
            Err(e) if e.error.kind() == io::ErrorKind::AlreadyExists => part = e.file,
            Err(e) => return Err(e.error),
        }
    }
    Err(io::ErrorKind::AlreadyExists.into())
}

/// A file's name with a number before its extension; 0 for no number.
fn numbered(path: &Path, number: u32) -> PathBuf {
    if number == 0 {
        return path.to_owned();
    }
    let part = |part: Option<&std::ffi::OsStr>| part.unwrap_or_default().to_string_lossy().into_owned();
    path.with_file_name(format!("{}-{number}.{}", part(path.file_stem()), part(path.extension())))
}

/// Cuts a file after its last complete row, and corrects its header. Answers the rows; `None` for CSV.
pub fn salvage(file: &mut File, ending: &str) -> io::Result<Option<u64>> {
    let len = file.metadata()?.len();
    match ending {
        "wav" => wav(file, len).map(Some),
        "npy" | "npz" => npy(file, len).map(Some),
        "csv" => csv(file, len).map(|()| None),
        _ => Err(io::ErrorKind::InvalidData.into()),
    }
}

fn head(file: &mut File) -> io::Result<Vec<u8>> {
    let mut head = Vec::new();
    file.seek(SeekFrom::Start(0))?;
    file.take(256).read_to_end(&mut head)?;
    Ok(head)
}

fn wav(file: &mut File, len: u64) -> io::Result<u64> {
    let head = head(file)?;
    if !head.starts_with(b"RIFF") || head.get(8..16) != Some(b"WAVEfmt ") {
        return Err(io::ErrorKind::InvalidData.into());
    }
    let align: [u8; 2] = head.get(32..34).and_then(|b| b.try_into().ok()).unwrap_or_default();
    let align = u64::from(u16::from_le_bytes(align)).max(1);
    let at = head.windows(4).position(|w| w == b"data").ok_or(io::ErrorKind::UnexpectedEof)? as u64 + 8;
    let rows = len.checked_sub(at).ok_or(io::ErrorKind::UnexpectedEof)? / align;
    let bytes = rows * align;
    let size = |n: u64| u32::try_from(n).map_err(|_| io::Error::from(io::ErrorKind::FileTooLarge));
    file.set_len(at + bytes)?;
    file.seek(SeekFrom::Start(4))?;
    file.write_all(&size(at + bytes - 8)?.to_le_bytes())?;
    file.seek(SeekFrom::Start(at - 4))?;
    file.write_all(&size(bytes)?.to_le_bytes())?;
    Ok(rows)
}

fn npy(file: &mut File, len: u64) -> io::Result<u64> {
    let head = head(file)?;
    let (at, columns) = npy::begun(&head).ok_or(io::ErrorKind::InvalidData)?;
    let row = 4 * columns.unwrap_or(1).max(1) as u64;
    let rows = len.checked_sub(at).ok_or(io::ErrorKind::UnexpectedEof)? / row;
    file.set_len(at + rows * row)?;
    npy::set_rows(file, rows as usize, columns)?;
    Ok(rows)
}

fn csv(file: &mut File, len: u64) -> io::Result<()> {
    let from = len.saturating_sub(LONGEST_LINE);
    let mut end = Vec::new();
    file.seek(SeekFrom::Start(from))?;
    file.read_to_end(&mut end)?;
    let whole = end.iter().rposition(|b| *b == b'\n').ok_or(io::ErrorKind::UnexpectedEof)?;
    file.set_len(from + whole as u64 + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn left(path: &Path) -> PathBuf {
        let growing = path.with_file_name(format!("{}{GROWING}", path.file_name().unwrap().display()));
        std::fs::write(&growing, "t_s,m\n0,1\n0.1,2\n0.2").unwrap();
        growing
    }

    #[test]
    fn recovered_recording_overwrites_no_file() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.csv");
        let read = |name: &str| std::fs::read_to_string(dir.path().join(name)).unwrap();
        assert_eq!(recover(&left(&path), 0).unwrap(), Recovered::Kept(path.clone()));
        std::fs::write(&path, "mine").unwrap();
        for name in ["a-1.csv", "a-2.csv"] {
            assert_eq!(recover(&left(&path), 0).unwrap(), Recovered::Kept(dir.path().join(name)));
            assert_eq!(read(name), "t_s,m\n0,1\n0.1,2\n");
        }
        assert_eq!(read("a.csv"), "mine");
    }

    #[test]
    fn recording_under_way_is_not_recovered() {
        let dir = tempfile::tempdir().unwrap();
        let growing = left(&dir.path().join("a.csv"));
        let file = File::open(&growing).unwrap();
        file.lock().unwrap();
        assert_eq!(recover(&growing, 0).unwrap(), Recovered::Busy);
        drop(file);
        std::fs::write(&growing, "").unwrap();
        assert_eq!(recover(&growing, 0).unwrap(), Recovered::Empty);
        assert!(!growing.exists());
    }

    #[test]
    fn file_that_is_no_recording_stays() {
        let dir = tempfile::tempdir().unwrap();
        for name in ["a.csv", "a.txt.recording", "a.wav.recording", "a.npy.recording"] {
            let path = dir.path().join(name);
            std::fs::write(&path, "text of somebody\n").unwrap();
            assert!(recover(&path, 0).is_err());
            assert_eq!(std::fs::read_to_string(&path).unwrap(), "text of somebody\n");
        }
    }
}
