//! Things that take time or memory to make, made once for all slots with the same settings.

use std::collections::HashMap;
use std::sync::Arc;

use asperity_node::{Diagnostic, Settings};

/// Things by what they are made of.
pub(super) struct Shared<T> {
    made: HashMap<String, Arc<T>>,
}

impl<T> Default for Shared<T> {
    fn default() -> Self {
        Self { made: HashMap::new() }
    }
}

impl<T> Shared<T> {
    /// The thing for some settings, but for their `gain`, made where there is none yet.
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

    /// The thing of a name, made where there is none yet.
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

    /// How many there are.
    pub(super) fn count(&self) -> u64 {
        self.made.len() as u64
    }
}
