//! The last stages before the coil: `actuator_inverse` and `limiter`.

mod actuator_inverse;
mod limiter;

pub use actuator_inverse::ActuatorInverse;
pub use limiter::Limiter;

use std::path::{Path, PathBuf};

use crate::prelude::*;
use asperity_actuator::{ActuatorProfile, Dynamics};
use asperity_diagnostics::Place;

fn profile_params() -> [Param; 2] {
    [
        text("profile", "hapcoil_one")
            .doc("Actuator: name of a shipped profile, or a RON file relative to the graph file."),
        number("handle_mass_g", 100.0, 1.0..=10_000.0, "g")
            .doc("Mass of the handle that the actuator is mounted on."),
    ]
}

/// The folder that a profile's file is looked for in.
fn base<'s>(setup: &Setup<'s>) -> &'s Path {
    let place = setup.params.place("profile").or(setup.params.node_place());
    place.and_then(|p| p.source.path().parent()).unwrap_or(Path::new(""))
}

/// The file of the profile, where it is not a shipped one.
fn files(setup: &Setup<'_>) -> Vec<PathBuf> {
    ActuatorProfile::file(setup.params.text("profile"), base(setup)).into_iter().collect()
}

/// The actuator that the parameters `profile` and `handle_mass_g` name.
fn dynamics(setup: &Setup<'_>) -> Result<Dynamics, Diagnostic> {
    let (p, base) = (setup.params, base(setup));
    let profile = ActuatorProfile::find(p.text("profile"), base).map_err(|e| {
        // Errors within a file point at the file.
        if e.path().is_some() {
            return e;
        }
        // A path on the command line has the option for its source.
        let typed = |p: &Place| p.source.path().to_string_lossy().starts_with("--");
        let typed = p.place("profile").is_some_and(typed);
        let base = if typed { "where the program runs" } else { "the graph file" };
        let helpless = e.help.is_none();
        let placed = error_at(p, "profile", e);
        if helpless { placed.help(format!("paths are relative to {base}")) } else { placed }
    })?;
    Dynamics::new(&profile, setup.params.number("handle_mass_g"))
        .map_err(|e| setup.params.error("handle_mass_g", e.to_string()))
}

#[cfg(test)]
mod tests {
    use asperity_diagnostics::Source;
    use asperity_graph::{GraphFile, compile};
    use asperity_node::Role;

    // A host that watches files for changes also watches the profile's file.
    #[test]
    fn profile_file_is_listed_unless_shipped() {
        let dir = tempfile::tempdir().unwrap();
        let shipped = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/actuators/hapcoil_one.ron");
        let mine = dir.path().join("mine.ron");
        std::fs::copy(shipped, &mine).unwrap();
        for (profile, files) in [("mine.ron", vec![mine]), ("hapcoil_one", Vec::new())] {
            let text = format!(
                r#"Graph(version: 1, nodes: {{
                    "tone": (kind: "sine"),
                    "limiter": (kind: "limiter", params: (profile: "{profile}")),
                    "out": (kind: "probe"),
                }}, wires: [("tone", "limiter"), ("limiter", "out")])"#
            );
            let source = Source::new(dir.path().join("g.ron").display().to_string(), text);
            let graph = GraphFile::parse(&source).unwrap();
            let compiled = compile(&graph, &crate::registry(), Default::default()).unwrap();
            let limiter = compiled.schedule.with_role(Role::Limiter).next().unwrap().1;
            assert_eq!(limiter.files, files);
        }
    }
}
