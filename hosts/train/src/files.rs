//! Output files that are whole or not there.

use std::ffi::OsString;
use std::path::Path;

use asperity_source::Diagnostic;

/// Writes a file under a temporary name beside `path` and renames it.
///
/// # Errors
/// What the file system answers; then no temporary file is left.
pub(crate) fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), Diagnostic> {
    let mut temporary = OsString::from(path);
    temporary.push(".tmp");
    std::fs::write(&temporary, bytes).and_then(|()| std::fs::rename(&temporary, path)).map_err(|e| {
        let _ = std::fs::remove_file(&temporary);
        Diagnostic::new(format!("cannot write this file: {e}")).in_file(path)
    })
}

/// Refuses, before any work is done, a path whose folder is not there.
///
/// # Errors
/// The folder is missing.
pub(crate) fn check_folder(path: &Path) -> Result<(), Diagnostic> {
    let folder = match path.parent() {
        Some(p) if !p.as_os_str().is_empty() => p,
        _ => Path::new("."),
    };
    if folder.is_dir() && path.file_name().is_some() {
        return Ok(());
    }
    Err(Diagnostic::new("cannot write here: there is no such folder")
        .in_file(path)
        .help(format!("make the folder {} first", folder.display())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_written_file_is_whole_and_leaves_nothing_beside_it() {
        let folder = std::env::temp_dir().join(format!("asperity-train-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("a.bin");
        write_whole(&path, b"old").unwrap();
        write_whole(&path, b"new bytes").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"new bytes");
        assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 1);
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn a_missing_folder_is_refused_by_name() {
        let e = check_folder(Path::new("no/such/folder/made.onnx")).unwrap_err().to_string();
        assert!(e.starts_with("no/such/folder/made.onnx:") && e.contains("no/such/folder first"), "{e}");
    }
}
