//! Profiles that a graph names without a file.

use std::path::{Path, PathBuf};

use asperity_diagnostics::{Diagnostic, Source, one_of};

use super::ActuatorProfile;

const SHIPPED: [(&str, &str); 2] = [
    ("hapcoil_one", include_str!("../../../graphs/actuators/hapcoil_one.ron")),
    ("haptuator_mark_ii", include_str!("../../../graphs/actuators/haptuator_mark_ii.ron")),
];

impl ActuatorProfile {
    /// The shipped profile of this name, such as `hapcoil_one`, if there is one.
    ///
    /// # Errors
    /// None in practice: shipped profiles are valid.
    pub fn shipped(name: &str) -> Option<Result<Self, Diagnostic>> {
        let (name, text) = SHIPPED.iter().find(|(n, _)| *n == name)?;
        Some(Self::parse(&Source::new(format!("actuators/{name}.ron (shipped)"), *text)))
    }

    /// The names of the shipped profiles.
    pub fn shipped_names() -> impl Iterator<Item = &'static str> + Clone {
        SHIPPED.iter().map(|(name, _)| *name)
    }

    /// Path of the file that [`find`](Self::find) reads. None for a shipped profile.
    pub fn file(name: &str, base: &Path) -> Option<PathBuf> {
        Self::shipped_names().all(|shipped| shipped != name).then(|| base.join(name))
    }

    /// A profile as a graph names it: a shipped one by name, or a RON file relative to `base`.
    ///
    /// # Errors
    /// An unknown name; a file that is missing or not a profile.
    pub fn find(name: &str, base: &Path) -> Result<Self, Diagnostic> {
        if let Some(shipped) = Self::shipped(name) {
            return shipped;
        }
        if !name.ends_with(".ron") {
            let help = one_of(name, Self::shipped_names());
            return Err(Diagnostic::new(format!("there is no shipped actuator profile `{name}`"))
                .help(format!("{help}; or name a .ron file")));
        }
        let path = base.join(name);
        if path.is_file() {
            return Self::read(path);
        }
        Err(Diagnostic::new(format!("cannot find the actuator profile {}", path.display())))
    }
}
