//! The last stages before the coil: `actuator_inverse` and `limiter`.

mod actuator_inverse;
mod limiter;

pub use actuator_inverse::ActuatorInverse;
pub use limiter::Limiter;

use std::path::Path;

use asperity_node::{Diagnostic, Param, Setup};
use asperity_source::Place;
use asperity_world::actuator::{ActuatorProfile, Dynamics};

fn profile_params() -> [Param; 2] {
    [
        Param::text(
            "profile",
            "hapcoil_one",
            "The actuator: a shipped profile's name, or a RON file relative to the graph file.",
        ),
        Param::number("handle_mass_g", 100.0, 1.0..=10_000.0, "Mass of what the actuator is mounted on.")
            .unit("g"),
    ]
}

/// The actuator that the parameters `profile` and `handle_mass_g` name.
fn dynamics(setup: &Setup<'_>) -> Result<Dynamics, Diagnostic> {
    let p = setup.params;
    let place = p.place("profile").or(p.node_place());
    let base = place.and_then(|p| p.source.path().parent()).unwrap_or(Path::new(""));
    let profile = ActuatorProfile::find(p.text("profile"), base).map_err(|e| {
        // What is wrong within a file is said of the file.
        if e.path().is_some() {
            return e;
        }
        let placed = p.error("profile", e.message);
        match e.help {
            Some(help) => placed.help(help),
            None => {
                // A path on the command line has the option for its source.
                let typed = |p: &Place| p.source.path().to_string_lossy().starts_with("--");
                let typed = p.place("profile").is_some_and(typed);
                let base = if typed { "where the program runs" } else { "the graph file" };
                placed.help(format!("paths are relative to {base}"))
            }
        }
    })?;
    Dynamics::new(&profile, setup.params.number("handle_mass_g"))
        .map_err(|e| setup.params.error("handle_mass_g", e.to_string()))
}
