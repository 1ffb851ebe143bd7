//! Reads regular files up to a size limit.

use std::fs::{File, Metadata};
use std::io::{Read, Take};
use std::path::Path;
use std::sync::OnceLock;

use crate::{Diagnostic, MAX_TEXT_BYTES, budget};

/// The standard input, once a program has taken it.
static TAKEN: OnceLock<Vec<u8>> = OnceLock::new();

/// Reads the standard input to its end. From then on the path `-` names it, and can be read again and again.
/// Error: it cannot be read, or has more than [`MAX_TEXT_BYTES`].
pub fn take_stdin() -> Result<(), Diagnostic> {
    if TAKEN.get().is_none() {
        let (path, mut bytes) = (Path::new("-"), Vec::new());
        let mut input = std::io::stdin().lock().take(MAX_TEXT_BYTES + 1);
        input.read_to_end(&mut bytes).map_err(|e| refuse(path, format!("cannot read it: {e}")))?;
        let _ = TAKEN.set(bytes);
    }
    Ok(())
}

/// Whether a path names the standard input, and a program has taken it.
pub fn is_stdin(path: &Path) -> bool {
    path == Path::new("-") && TAKEN.get().is_some()
}

/// Opens a regular file. At most `most` bytes of it can be read, even if it grows.
///
/// # Errors
/// A file that is missing, cannot be opened, is no regular file, is larger or beyond the [`budget`]. A pipe
/// is refused before it is opened, which would wait for its other end.
pub fn open(path: &Path, most: u64) -> Result<Take<File>, Diagnostic> {
    let fits = |meta: &Metadata| match (irregular(meta), meta.len()) {
        (Some(what), _) => Err(refuse(path, format!("this is {what}"))),
        (None, len) if len > most => Err(too_large(path, len, most)),
        (_, len) => budget::needs(len).map_err(|e| e.in_file(path)),
    };
    // Opening a pipe waits, and opening a device may do something: both are seen beforehand.
    fits(&std::fs::metadata(path).map_err(|e| unreadable(path, &e))?)?;
    let file = File::open(path).map_err(|e| unreadable(path, &e))?;
    fits(&file.metadata().map_err(|e| unreadable(path, &e))?)?;
    Ok(file.take(most))
}

/// Reads a whole regular file of at most `most` bytes. Error: as [`open`]; a file that cannot be read to its
/// end, or that grows beyond `most` meanwhile.
pub fn read(path: &Path, most: u64) -> Result<Vec<u8>, Diagnostic> {
    if let Some(bytes) = TAKEN.get().filter(|_| is_stdin(path)) {
        let len = bytes.len() as u64;
        return if len > most { Err(too_large(path, len, most)) } else { Ok(bytes.clone()) };
    }
    let mut file = open(path, most)?;
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes).map_err(|e| unreadable(path, &e))?;
    match file.get_ref().metadata().map_err(|e| unreadable(path, &e))?.len() {
        len if len > most => Err(too_large(path, len, most)),
        _ => Ok(bytes),
    }
}

/// Names the kind of a file that is not regular, such as "a named pipe; a regular file is needed".
pub fn irregular(meta: &Metadata) -> Option<String> {
    (!meta.is_file()).then(|| format!("{}; a regular file is needed", kind(meta)))
}

#[cfg(unix)]
fn kind(meta: &Metadata) -> &'static str {
    use std::os::unix::fs::FileTypeExt;
    let kind = meta.file_type();
    match () {
        () if kind.is_dir() => "a folder",
        () if kind.is_fifo() => "a named pipe",
        () if kind.is_socket() => "a socket",
        () if kind.is_char_device() || kind.is_block_device() => "a device",
        () => "no file",
    }
}

#[cfg(not(unix))]
fn kind(meta: &Metadata) -> &'static str {
    if meta.is_dir() { "a folder" } else { "no file" }
}

fn refuse(path: &Path, what: String) -> Diagnostic {
    Diagnostic::new(what).in_file(path)
}

fn unreadable(path: &Path, error: &std::io::Error) -> Diagnostic {
    refuse(path, format!("cannot read this file: {error}"))
}

fn too_large(path: &Path, len: u64, most: u64) -> Diagnostic {
    refuse(path, format!("this file has {len} bytes; at most {most} are read"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(path: &Path) -> String {
        read(path, 3).unwrap_err().message
    }

    #[test]
    fn file_above_its_limit_is_refused() {
        let path = std::env::temp_dir().join(format!("asperity_limit_{}", std::process::id()));
        std::fs::write(&path, "123").unwrap();
        assert_eq!(read(&path, 3).unwrap(), b"123");
        std::fs::write(&path, "1234").unwrap();
        assert_eq!(error(&path), "this file has 4 bytes; at most 3 are read");
        std::fs::remove_file(&path).unwrap();
    }

    #[cfg(unix)]
    #[test]
    fn irregular_file_is_named_by_its_kind() {
        let path = std::env::temp_dir().join(format!("asperity_socket_{}", std::process::id()));
        let _socket = std::os::unix::net::UnixListener::bind(&path).unwrap();
        assert_eq!(error(&path), "this is a socket; a regular file is needed");
        std::fs::remove_file(&path).unwrap();
        assert_eq!(error(Path::new("/dev/zero")), "this is a device; a regular file is needed");
        assert_eq!(error(Path::new("/")), "this is a folder; a regular file is needed");
    }
}
