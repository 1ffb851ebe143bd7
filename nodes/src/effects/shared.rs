//! Things that take time or memory to make, made once for all slots with the same settings.

use std::collections::HashMap;
use std::sync::Arc;

use asperity_node::{Diagnostic, Settings};

/// Things that were made, by their settings.
pub(super) struct Shared<T> {
    made: HashMap<String, Arc<T>>,
}

impl<T> Default for Shared<T> {
    fn default() -> Self {
        Self { made: HashMap::new() }
    }
}

impl<T> Shared<T> {
    /// Returns the thing for some settings without their `gain`; makes it if there is none yet.
    ///
    /// # Errors
    /// Those of making it.
    pub(super) fn get(
        &mut self,
        settings: &Settings,
        make: impl FnOnce() -> Result<T, Diagnostic>,
    ) -> Result<Arc<T>, Diagnostic> {
        self.get_by(settings.text_without("gain"), make)
    }

    /// Returns the thing of a name; makes it if there is none yet.
    ///
    /// # Errors
    /// Those of making it.
    pub(super) fn get_by(
        &mut self,
        name: String,
        make: impl FnOnce() -> Result<T, Diagnostic>,
    ) -> Result<Arc<T>, Diagnostic> {
        if let Some(made) = self.made.get(&name) {
            return Ok(made.clone());
        }
        let made = Arc::new(make()?);
        self.made.insert(name, made.clone());
        Ok(made)
    }

    /// Number of things.
    pub(super) fn count(&self) -> u64 {
        self.made.len() as u64
    }
}
