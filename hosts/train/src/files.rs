//! Output files and messages of a run.

use std::ffi::OsString;
use std::fs::File;
use std::io::{IsTerminal, Write};
use std::path::Path;

use asperity_diagnostics::Diagnostic;
use indicatif::{ProgressBar, ProgressStyle};

/// Writes a file whole or not at all: under a temporary name beside `path`, which it then gets.
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

pub(crate) fn refused(path: &Path, what: &str, help: &str) -> Diagnostic {
    Diagnostic::new(what).in_file(path).help(help)
}

pub(crate) fn make_folder(path: &Path) -> Result<(), Diagnostic> {
    std::fs::create_dir_all(path)
        .map_err(|e| Diagnostic::new(format!("cannot make this folder: {e}")).in_file(path))
}

pub(crate) struct Teller {
    bar: Option<ProgressBar>,
    what: &'static str,
    steps: usize,
    next_line: usize,
}

impl Teller {
    pub(crate) fn new(what: &'static str, steps: usize) -> Self {
        let bar = std::io::stderr().is_terminal().then(|| {
            let style = ProgressStyle::with_template("{prefix} {bar:30} {pos}/{len} {msg} {elapsed} gone");
            ProgressBar::new(steps as u64)
                .with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
                .with_prefix(what)
        });
        Self { bar, what, steps, next_line: 0 }
    }

    pub(crate) fn tell(&mut self, step: usize, remark: &str) {
        match &self.bar {
            Some(bar) => {
                bar.set_position(step as u64);
                bar.set_message(remark.to_owned());
                if step == self.steps {
                    bar.finish();
                }
            }
            None if step >= self.next_line || step == self.steps => {
                self.next_line = step + self.steps.div_ceil(40);
                eprintln!("{}: {step} of {}, {remark}", self.what, self.steps);
            }
            None => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn written_file_is_whole_and_leaves_no_other_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.bin");
        write_whole(&path, b"old").unwrap();
        write_whole(&path, b"new bytes").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"new bytes");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        assert!(write_whole(&folder.path().join("no/a.bin"), b"").is_err());
    }
}
