//! Writes output files whole or not at all.

use std::ffi::OsString;
use std::fs::File;
use std::io::Write;
use std::path::Path;

use asperity_diagnostics::Diagnostic;

/// Writes a file under a temporary name beside `path` and renames it.
///
/// # Errors
/// An error of the file system; no temporary file is left.
pub(crate) fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), Diagnostic> {
    let mut temporary = OsString::from(path);
    temporary.push(".tmp");
    let write = || {
        let mut file = File::create(&temporary)?;
        file.write_all(bytes)?;
        // A power cut must not replace a good file with an empty one.
        file.sync_all()?;
        std::fs::rename(&temporary, path)
    };
    write().map_err(|e| {
        let _ = std::fs::remove_file(&temporary);
        Diagnostic::new(format!("cannot write this file: {e}")).in_file(path)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn written_file_is_whole_and_leaves_no_other_file() {
        let folder = std::env::temp_dir().join(format!("asperity-train-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("a.bin");
        write_whole(&path, b"old").unwrap();
        write_whole(&path, b"new bytes").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"new bytes");
        assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 1);
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
