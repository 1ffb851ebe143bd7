//! Finds errors in the parts of a scene, whether the scene needs these parts or not.

use std::collections::HashSet;
use std::sync::Arc;

use crate::Part;
use crate::read::error;
use asperity_diagnostics::file::irregular;
use asperity_diagnostics::{Diagnostic, one_of};
use asperity_graph::{Setting, check_settings};
use asperity_node::{Descriptor, ShapeSpec};
use asperity_texture::Library;

use crate::lower::acoustic::STAGES;
use crate::lower::builder::{Builder, handed_on};

impl Builder<'_> {
    /// Checks all parts, also those that the scene does not need, so that errors show early.
    pub(crate) fn look(&self) -> Result<(), Diagnostic> {
        let scene = self.scene;
        self.settings(&scene.motion)?;
        self.settings(&scene.gate)?;
        let phase = self.settings(&scene.phase)?;
        if !retrieves_phase(phase) {
            let fits =
                |name: &&str| self.registry.get(name).is_some_and(|kind| retrieves_phase(kind.descriptor()));
            let kinds: Vec<&str> = self.registry.names().filter(fits).collect();
            return Err(cannot(&scene.phase, "retrieves no phase", &one_of("", kinds)));
        }
        if let Some(output) = &scene.output {
            let descriptor = self.settings(output)?;
            let plays = descriptor.inputs.iter().any(|i| matches!(i.shape, ShapeSpec::Audio(_)));
            if !descriptor.sink || !plays {
                return Err(cannot(output, "plays nothing", "audio_out"));
            }
        }
        if let Some(network) = &scene.network {
            if let Some((key, value)) =
                network.settings.iter().find(|(key, _)| matches!(key.name.as_str(), "material" | "materials"))
            {
                return Err(Diagnostic::new("a scene's materials are those of its surfaces")
                    .at(value.source(), key.span)
                    .help("material: \"NAME\" in a surface, beside `shape`"));
            }
            self.settings(network)?;
        }
        self.actuator_settings()?;
        self.files_of_the_unheard()?;
        self.known_materials()
    }

    /// Checks a part's settings and answers the descriptor of its kind.
    fn settings(&self, part: &Part) -> Result<&Descriptor, Diagnostic> {
        let descriptor = self.descriptor(&part.kind, &part.place)?;
        check_settings(&handed_on(part), descriptor).into_iter().next().map_or(Ok(descriptor), Err)
    }

    /// Checks the settings of the actuator, which are those of two nodes.
    fn actuator_settings(&self) -> Result<(), Diagnostic> {
        let part = &self.scene.actuator;
        let mut unknown = handed_on(part);
        let mut names: Vec<&str> = Vec::new();
        for (_, kind) in STAGES {
            let descriptor = self.descriptor(kind, &part.place)?;
            let has = |setting: &Setting| descriptor.params.iter().any(|p| p.name == setting.name);
            let known: Vec<Setting> = handed_on(part).into_iter().filter(has).collect();
            if let Some(wrong) = check_settings(&known, descriptor).into_iter().next() {
                return Err(wrong);
            }
            unknown.retain(|setting| !has(setting));
            names.extend(descriptor.params.iter().map(|p| p.name.as_ref()));
        }
        let Some(unknown) = unknown.first() else { return Ok(()) };
        names.sort_unstable();
        names.dedup();
        Err(error(&unknown.place, format!("`actuator` has no field `{}`", unknown.name))
            .help(one_of(&unknown.name, names)))
    }

    /// Checks that the files of effects exist if no node plays them. The other files are read when their
    /// nodes are made.
    fn files_of_the_unheard(&self) -> Result<(), Diagnostic> {
        let scene = self.scene;
        if scene.output.is_some() {
            return Ok(());
        }
        let mut known = HashSet::new();
        for surface in &scene.surfaces {
            for named in &surface.effects.named {
                let settings = named.settings(self.registry)?;
                for file in settings.files().into_iter().filter(|file| known.insert(file.clone())) {
                    let wrong = match std::fs::metadata(&file) {
                        Err(_) => Some(format!("there is no file {}", file.display())),
                        Ok(meta) => irregular(&meta).map(|what| format!("{} is {what}", file.display())),
                    };
                    if let Some(wrong) = wrong {
                        return Err(error(&surface.place, wrong).help("an effect of this surface uses it"));
                    }
                }
            }
        }
        Ok(())
    }

    /// Checks that the library has every material that a surface names, if the scene has a library.
    fn known_materials(&self) -> Result<(), Diagnostic> {
        let mut known = HashSet::new();
        let named = self.scene.surfaces.iter().filter_map(|surface| surface.material.as_ref());
        let mut named = named.filter(|material| known.insert(material.of.as_str())).peekable();
        let Some(library) = named.peek().and_then(|_| self.library()) else { return Ok(()) };
        for material in named {
            let found = library.material(&material.of);
            found.map_err(|e| e.at(&material.place.source, material.place.span))?;
        }
        Ok(())
    }

    /// Library of the network. If it cannot be read, the node reports the error, with its own place.
    pub(crate) fn library(&self) -> Option<Arc<Library>> {
        let (_, file) =
            self.scene.network.as_ref()?.settings.iter().find(|(key, _)| key.name == "library")?;
        let folder = self.scene.source.path().parent()?;
        Library::shared(folder.join(file.text().ok()?)).ok()
    }
}

/// Whether a kind turns magnitudes into a signal or spectra.
fn retrieves_phase(descriptor: &Descriptor) -> bool {
    descriptor.inputs.iter().any(|i| matches!(i.shape, ShapeSpec::Magnitude(_)))
        && descriptor.outputs.iter().any(|o| matches!(o.shape, ShapeSpec::Audio(_) | ShapeSpec::Spectrum(_)))
}

fn cannot(part: &Part, what: &str, help: &str) -> Diagnostic {
    error(&part.place, format!("`{}` {what}", part.kind)).help(help)
}
