//! The last stages before the coil: `actuator_inverse` and `limiter`.

mod actuator_inverse;
mod limiter;

pub use actuator_inverse::ActuatorInverse;
pub use limiter::Limiter;

use asperity_node::{Diagnostic, Param, Setup};
use asperity_source::{Place, Source, one_of};
use asperity_world::actuator::{ActuatorProfile, Dynamics};

/// Profiles that a graph may name without a file.
const SHIPPED: [(&str, &str); 2] = [
    ("hapcoil_one", include_str!("../../../graphs/actuators/hapcoil_one.ron")),
    ("haptuator_mark_ii", include_str!("../../../graphs/actuators/haptuator_mark_ii.ron")),
];

/// The shipped profile of that name, such as `hapcoil_one`; none where nothing of that name is shipped.
///
/// # Errors
/// None in practice: what is shipped can be read.
pub fn shipped_profile(name: &str) -> Option<Result<ActuatorProfile, Diagnostic>> {
    let (name, text) = SHIPPED.iter().find(|(n, _)| *n == name)?;
    Some(ActuatorProfile::parse(&Source::new(format!("actuators/{name}.ron (shipped)"), *text)))
}

/// The names of the shipped profiles.
pub fn shipped_profiles() -> impl Iterator<Item = &'static str> + Clone {
    SHIPPED.iter().map(|(name, _)| *name)
}

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
    let name = setup.params.text("profile");
    let profile = match shipped_profile(name) {
        Some(shipped) => shipped?,
        None if name.ends_with(".ron") => {
            let path = setup.resolve("profile");
            if !path.is_file() {
                let message = format!("cannot find the actuator profile {}", path.display());
                // A path on the command line has the option for its source.
                let typed = |p: &Place| p.source.path().to_string_lossy().starts_with("--");
                let typed = setup.params.place("profile").is_some_and(typed);
                let base = if typed { "where the program runs" } else { "the graph file" };
                return Err(setup
                    .params
                    .error("profile", message)
                    .help(format!("paths are relative to {base}")));
            }
            ActuatorProfile::read(path)?
        }
        None => {
            let help = one_of(name, shipped_profiles());
            let message = format!("there is no shipped actuator profile `{name}`");
            return Err(setup.params.error("profile", message).help(format!("{help}; or name a .ron file")));
        }
    };
    Dynamics::new(&profile, setup.params.number("handle_mass_g"))
        .map_err(|e| setup.params.error("handle_mass_g", e.to_string()))
}
