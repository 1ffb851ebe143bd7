//! What is finished is kept, so that a study that was stopped goes on where it was.

use std::path::{Path, PathBuf};

use asperity_source::Diagnostic;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// A folder of finished parts.
#[derive(Clone, Debug)]
pub(crate) struct Kept(PathBuf);

impl Kept {
    /// Makes the folder where it is not there.
    ///
    /// # Errors
    /// It cannot be made.
    pub(crate) fn open(folder: &Path) -> Result<Self, Diagnostic> {
        std::fs::create_dir_all(folder)
            .map_err(|e| Diagnostic::new(format!("cannot make this folder: {e}")).in_file(folder))?;
        Ok(Self(folder.to_owned()))
    }

    /// A part that is there and can be read.
    pub(crate) fn get<T: DeserializeOwned>(&self, name: &str) -> Option<T> {
        let bytes = std::fs::read(self.0.join(format!("{name}.json"))).ok()?;
        serde_json::from_slice(&bytes).ok()
    }

    /// Keeps a part: written beside, then given its name, so that it is there whole or not at all. Answers it as it will be read, whose last digits may
    /// differ, so that results are the same whether or not they were kept.
    ///
    /// # Errors
    /// It cannot be written.
    pub(crate) fn put<T: Serialize + DeserializeOwned>(&self, name: &str, part: &T) -> Result<T, Diagnostic> {
        let path = self.0.join(format!("{name}.json"));
        let fail =
            |e: &dyn std::fmt::Display| Diagnostic::new(format!("cannot write this: {e}")).in_file(&path);
        let text = serde_json::to_vec(part).map_err(|e| fail(&e))?;
        let beside = self.0.join(format!(".{name}.{}.part", std::process::id()));
        let read = serde_json::from_slice(&text).map_err(|e| fail(&e))?;
        std::fs::write(&beside, text).and_then(|()| std::fs::rename(&beside, &path)).map_err(|e| {
            let _ = std::fs::remove_file(&beside);
            fail(&e)
        })?;
        Ok(read)
    }

    /// Parts whose names begin so.
    pub(crate) fn all<T: DeserializeOwned>(&self, prefix: &str) -> Vec<T> {
        let Ok(entries) = std::fs::read_dir(&self.0) else { return Vec::new() };
        let mut names: Vec<String> = entries
            .filter_map(|e| e.ok()?.file_name().into_string().ok())
            .filter(|n| n.starts_with(prefix))
            .collect();
        names.sort();
        names.iter().filter_map(|n| self.get(n.strip_suffix(".json")?)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_is_there_whole_or_not_at_all() {
        let dir = tempfile::tempdir().unwrap();
        let kept = Kept::open(&dir.path().join("a/b")).unwrap();
        assert_eq!(kept.get::<Vec<u32>>("one"), None);
        kept.put("one", &vec![1, 2]).unwrap();
        kept.put("other", &vec![3]).unwrap();
        assert_eq!(kept.get("one"), Some(vec![1, 2]));
        std::fs::write(dir.path().join("a/b/one half.json"), "[1, 2").unwrap();
        assert_eq!(kept.get::<Vec<u32>>("one half"), None);
        assert_eq!(kept.all::<Vec<u32>>("o"), [vec![1, 2], vec![3]]);
        assert!(Kept::open(&dir.path().join("a/b/one.json/c")).is_err());
    }
}
