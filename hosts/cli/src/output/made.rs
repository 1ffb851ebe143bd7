//! Files that Asperity made: a line for each in the user's state folder. A file that was changed since does
//! not count.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

/// Above this size \[bytes\] the older half of the list is removed.
const MOST_BYTES: u64 = 1 << 20;

fn list() -> Option<PathBuf> {
    Some(dirs::state_dir().or_else(dirs::data_local_dir)?.join("asperity").join("made"))
}

/// Length, time of the last change and full name, as a line.
fn line(path: &Path) -> Option<String> {
    let meta = std::fs::metadata(path).ok()?;
    let time = meta.modified().ok()?.duration_since(UNIX_EPOCH).ok()?;
    let name = path.canonicalize().ok()?;
    // The list cannot hold names with line breaks, or that are not UTF-8.
    let name = name.to_str().filter(|name| !name.contains('\n'))?;
    Some(format!("{} {} {name}\n", meta.len(), time.as_nanos()))
}

pub fn remember(path: &Path) {
    let put_down = || {
        let line = line(path)?;
        let list = list()?;
        std::fs::create_dir_all(list.parent()?).ok()?;
        shorten(&list);
        // In one call: other processes write here too.
        OpenOptions::new().append(true).create(true).open(&list).ok()?.write_all(line.as_bytes()).ok()
    };
    let _ = put_down();
}

/// Whether Asperity made the file, and nobody changed it since.
pub fn is_ours(path: &Path) -> bool {
    let known = || {
        let line = line(path)?;
        Some(std::fs::read_to_string(list()?).ok()?.split_inclusive('\n').any(|known| known == line))
    };
    known().unwrap_or(false)
}

/// Removes the older half of a list that is too long, if that is possible.
fn shorten(list: &Path) {
    let shorter = || {
        if std::fs::metadata(list).ok()?.len() <= MOST_BYTES {
            return None;
        }
        let text = std::fs::read(list).ok()?;
        let newer = &text[text.len() / 2..];
        let from = newer.iter().position(|&b| b == b'\n')? + 1;
        let mut new = tempfile::NamedTempFile::new_in(list.parent()?).ok()?;
        new.write_all(&newer[from..]).ok()?;
        new.persist(list).ok().map(|_: File| ())
    };
    let _ = shorter();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_list_keeps_its_newer_half_in_whole_lines() {
        let dir = tempfile::tempdir().unwrap();
        let list = dir.path().join("made");
        let lines: String = (0..60_000).map(|n| format!("100 {n} /some/where/{n}.wav\n")).collect();
        std::fs::write(&list, &lines).unwrap();
        shorten(&list);
        let kept = std::fs::read_to_string(&list).unwrap();
        assert!(lines.ends_with(&kept) && kept.starts_with("100 "), "{:?}", kept.lines().next());
        assert!((lines.len() / 2 - 40..=lines.len() / 2).contains(&kept.len()), "{}", kept.len());
        shorten(&list);
        assert_eq!(std::fs::read_to_string(&list).unwrap(), kept, "now it is short enough");
    }
}
