//! Files that Asperity made: a line for each in the person's state folder. One that was changed since does not count.

use std::fs::{File, Metadata, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

/// From this size on the older half of the list is forgotten.
const MOST_BYTES: u64 = 1 << 20;

fn list() -> Option<PathBuf> {
    Some(dirs::state_dir().or_else(dirs::data_local_dir)?.join("asperity").join("made"))
}

/// Length, time of the last change and whole name, as a line.
fn line(path: &Path, meta: &Metadata) -> Option<String> {
    let time = meta.modified().ok()?.duration_since(UNIX_EPOCH).ok()?;
    let name = path.canonicalize().ok()?;
    // Of names that are no text, or of several lines, nothing is known.
    let name = name.to_str().filter(|name| !name.contains('\n'))?;
    Some(format!("{} {} {name}\n", meta.len(), time.as_nanos()))
}

/// Puts down a file that was made. Where that cannot be, nobody knows of it.
pub fn remember(path: &Path) {
    let put_down = || {
        let line = line(path, &std::fs::metadata(path).ok()?)?;
        let list = list()?;
        std::fs::create_dir_all(list.parent()?).ok()?;
        shorten(&list);
        // In one piece: other processes write here too.
        OpenOptions::new().append(true).create(true).open(&list).ok()?.write_all(line.as_bytes()).ok()
    };
    let _ = put_down();
}

/// Whether a file is as Asperity made it.
pub fn is_ours(path: &Path) -> bool {
    let known = || {
        let line = line(path, &std::fs::metadata(path).ok()?)?;
        Some(std::fs::read_to_string(list()?).ok()?.split_inclusive('\n').any(|known| known == line))
    };
    known().unwrap_or(false)
}

fn shorten(list: &Path) {
    let shorter = || {
        let long = std::fs::metadata(list).ok()?.len() > MOST_BYTES;
        let text = if long { std::fs::read_to_string(list).ok()? } else { return None };
        let half = text.len() - text.len() / 2;
        let from = text.as_bytes()[half..].iter().position(|&b| b == b'\n')? + half + 1;
        let mut new = tempfile::NamedTempFile::new_in(list.parent()?).ok()?;
        new.write_all(&text.as_bytes()[from..]).ok()?;
        new.persist(list).ok().map(|_: File| ())
    };
    let _ = shorter();
}
