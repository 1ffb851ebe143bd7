//! A folder of a test, in which the program runs.

use std::ops::Deref;
use std::path::{Path, PathBuf};

use crate::{Ran, run};

/// A folder that is removed with its test.
pub struct Room(tempfile::TempDir);

impl Deref for Room {
    type Target = Path;

    fn deref(&self) -> &Path {
        self.0.path()
    }
}

impl AsRef<Path> for Room {
    fn as_ref(&self) -> &Path {
        self
    }
}

impl Room {
    #[expect(clippy::new_without_default, reason = "a folder is made")]
    pub fn new() -> Self {
        Self(tempfile::tempdir().expect("a folder"))
    }

    /// Leaves it behind.
    pub fn keep(self) -> PathBuf {
        self.0.keep()
    }

    /// Runs the program to its end. Words are separated by spaces; one with spaces stands between `'`.
    pub fn run(&self, line: &str) -> Ran {
        let mut quoted = false;
        let words = line.split(|c: char| {
            quoted ^= c == '\'';
            c.is_whitespace() && !quoted
        });
        let words: Vec<String> = words.filter(|w| !w.is_empty()).map(|w| w.replace('\'', "")).collect();
        run(self, &words.iter().map(String::as_str).collect::<Vec<_>>())
    }

    pub fn write(&self, name: impl AsRef<Path>, bytes: impl AsRef<[u8]>) {
        std::fs::write(self.join(name), bytes).expect("a file");
    }

    pub fn bytes(&self, name: impl AsRef<Path>) -> Vec<u8> {
        std::fs::read(self.join(name)).expect("a file")
    }

    pub fn text(&self, name: impl AsRef<Path>) -> String {
        String::from_utf8(self.bytes(name)).expect("text")
    }

    pub fn json(&self, name: &str) -> serde_json::Value {
        serde_json::from_str(&self.text(name)).expect("JSON")
    }

    /// Samples of a float WAV file, and its rate.
    pub fn wav(&self, name: &str) -> (Vec<f32>, u32) {
        crate::wav(&self.join(name))
    }

    pub fn npy(&self, name: &str) -> Vec<f32> {
        crate::live::npy(&self.join(name))
    }

    /// Its files, hidden ones too, sorted.
    pub fn files(&self) -> Vec<String> {
        crate::files(self)
    }
}
