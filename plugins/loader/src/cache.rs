//! Loaded plugins, so that a file is loaded again only if it changed.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use asperity_diagnostics::Diagnostic;

use crate::file::Copy;
use crate::{Plugin, file};

/// Loads plugins, each build of a file once, since copies are never unloaded.
#[derive(Debug, Default)]
pub struct Loader {
    loaded: HashMap<(PathBuf, u64), Plugin>,
}

impl Loader {
    /// Plugin of a file as it is now. Error: as for [`Plugin::load`].
    pub fn load(&mut self, path: &Path) -> Result<Plugin, Diagnostic> {
        self.load_tried(path, |_| Ok(()))
    }

    /// The same. A build that is not loaded yet is copied, tried, and loaded from that copy, even if the
    /// file changes meanwhile. Error: as for [`Plugin::load`], and the error of `trial`.
    pub fn load_tried(
        &mut self,
        path: &Path,
        trial: impl FnOnce(&Copy) -> Result<(), Diagnostic>,
    ) -> Result<Plugin, Diagnostic> {
        let bytes = file::read(path)?;
        let key = (path.canonicalize().unwrap_or_else(|_| path.to_owned()), file::build_of(&bytes));
        if let Some(plugin) = self.loaded.get(&key) {
            return Ok(plugin.clone());
        }
        let copy = Copy::new(path, &bytes)?;
        trial(&copy)?;
        let plugin = Plugin::from_copy(path, copy, key.1)?;
        self.loaded.insert(key, plugin.clone());
        Ok(plugin)
    }
}
