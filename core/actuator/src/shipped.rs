//! Profiles that can be named without a file.

use std::path::{Path, PathBuf};

use asperity_diagnostics::{Diagnostic, Source, one_of};

use super::ActuatorProfile;

const SHIPPED: [(&str, &str); 2] = [
    ("hapcoil_one", include_str!("../../../graphs/actuators/hapcoil_one.ron")),
    ("haptuator_mark_ii", include_str!("../../../graphs/actuators/haptuator_mark_ii.ron")),
];

impl ActuatorProfile {
    /// The shipped profile of that name, such as `hapcoil_one`; none where nothing of that name is shipped.
    ///
    /// # Errors
    /// None in practice: what is shipped can be read.
    pub fn shipped(name: &str) -> Option<Result<Self, Diagnostic>> {
        let (name, text) = SHIPPED.iter().find(|(n, _)| *n == name)?;
        Some(Self::parse(&Source::new(format!("actuators/{name}.ron (shipped)"), *text)))
    }

    /// The names of the shipped profiles.
    pub fn shipped_names() -> impl Iterator<Item = &'static str> + Clone {
        SHIPPED.iter().map(|(name, _)| *name)
    }

    /// The file that [`find`](Self::find) reads; none for a shipped profile.
    pub fn file(name: &str, base: &Path) -> Option<PathBuf> {
        Self::shipped_names().all(|shipped| shipped != name).then(|| base.join(name))
    }

    /// What a graph may call a profile: the name of a shipped one, or a RON file relative to `base`.
    ///
    /// # Errors
    /// A name of none that is shipped, a file that is not there or is no profile.
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
