//! The inverse of an actuator, its limiter, and what they do to a simulated one.

mod inverse;
mod judge;
mod limiter;
mod own;
mod response;

pub use limiter::{Piece, Place, Sound, Stood, limited};

use asperity_actuator::{ActuatorProfile, Drive, Dynamics};
use asperity_node::{Descriptor, Params, Registry, ShapeSpec, Unit, UnitSpec};

use crate::case::{Case, Family, Not, not_applicable};
use crate::small::has_to_be_set;
use crate::subject::Subject;

pub(super) const CASES: &[Case] = &[
    Case {
        family: Family::Actuator,
        name: "inverse_band",
        hard: "the inverse is asked for sines from 1 Hz, where the actuator pushes nothing, to just below half the rate, far past the band that it is for, and for a constant",
        must: "on the simulated actuator the two answer as their filters in closed form within 0.1 %, with current and voltage drive: within 0.3 dB of \
               a Butterworth high-pass at 20 Hz from 5 to 1000 Hz, nowhere more than 1.1 times what is asked, and nothing for a constant after 1 s",
        of_graph: false,
        run: inverse::band,
    },
    Case {
        family: Family::Actuator,
        name: "inverse_off",
        hard: "the actuator's mass, spring and damping are each 20 % more or less than the inverse was made for: all eight corners",
        must: "from 20 to 400 Hz it answers as the closed form of the inverse and of that actuator within 0.1 %, never more than 8 dB off what it was made for, and is at rest, \
               below 10^-6 of what was asked, within 0.5 s of the end",
        of_graph: false,
        run: inverse::off,
    },
    Case {
        family: Family::Actuator,
        name: "full_scale_at_resonance",
        hard: "ten minutes of a sine at the actuator's resonance, at its peak current or voltage; a minute in `cargo test`, and 5 s in `selftest` unless it is told to take its time",
        must: "the simulated coil stays within its rated rms current over its thermal time constant and 1 % more, the mover within its stroke, and no step from sample to sample is larger than \
               that of the sine itself: nothing clicks",
        of_graph: false,
        run: limiter::resonance,
    },
    Case {
        family: Family::Actuator,
        name: "limiter_random",
        hard: "the limiter gets noise, sines, squares, steps, pulses, constants, any bits at all, muting, and what follows the mover so as to drive it furthest, up to 1000 peaks",
        must: "every sample is finite, within the peak and the slew, the mover within its stroke, the coil within its rated rms current and 1 % more, and the mean over a time T within 8 peak / \
               (2 pi dc_corner T)",
        of_graph: false,
        run: limiter::random,
    },
    Case {
        family: Family::Actuator,
        name: "own_limits",
        hard: "the graph's stylus is thrown about, pressed and lifted at random, and every network in it answers nonsense up to 10^6 m/s^2",
        must: "what goes to each sound card is finite, and the simulated actuator of its limiter stays within peak, slew, stroke, and rated rms current and 1 % more",
        of_graph: true,
        run: own::limits,
    },
];

/// Profiles and handles, in g, that are looked at where no graph says.
const ACTUATORS: [(&str, f64); 3] =
    [("hapcoil_one", 100.0), ("haptuator_mark_ii", 100.0), ("hapcoil_one", 25.0)];

/// A shipped actuator on a handle.
fn shipped(profile: &str, grams: f64) -> Result<Dynamics, Not> {
    let profile = match ActuatorProfile::shipped(profile) {
        Some(shipped) => shipped?,
        None => return not_applicable(format!("there is no profile `{profile}`")),
    };
    on(&profile, grams)
}

fn on(profile: &ActuatorProfile, grams: f64) -> Result<Dynamics, Not> {
    Dynamics::new(profile, grams).map_err(|e| Not::Held(e.to_string()))
}

/// The actuator that a node's parameters `profile` and `handle_mass_g` name, if they do.
fn named(params: &Params) -> Option<Result<Dynamics, Not>> {
    let (name, grams) = (params.text("profile"), params.get_number("handle_mass_g")?);
    if name.is_empty() {
        return None;
    }
    if ActuatorProfile::shipped(name).is_some() {
        return Some(shipped(name, grams));
    }
    let base = params.place("profile").or(params.node_place()).and_then(|p| p.source.path().parent());
    let path = base.map(|dir| dir.join(name)).unwrap_or_default();
    Some(ActuatorProfile::read(path).map_err(Not::from).and_then(|profile| on(&profile, grams)))
}

/// The unit of a drive.
fn unit(drive: Drive) -> Unit {
    if drive == Drive::Current { Unit::AMPERE } else { Unit::VOLT }
}

fn has_params(d: &Descriptor, names: &[&str]) -> bool {
    names.iter().all(|name| d.params.iter().any(|p| p.name == *name))
}

fn one_audio_each_way(d: &Descriptor) -> bool {
    let (Some(input), Some(output)) = (d.inputs.first(), d.outputs.first()) else { return false };
    let required = d.inputs.iter().filter(|i| !i.optional).count();
    required == 1 && matches!(input.shape, ShapeSpec::Audio(_)) && matches!(output.shape, ShapeSpec::Audio(_))
}

/// Kinds that turn an acceleration into what drives a coil: of any profile and handle, as `actuator_inverse`.
fn inverses(registry: &Registry) -> Vec<String> {
    let fits = |d: &&Descriptor| {
        one_audio_each_way(d)
            && d.inputs[0].unit == UnitSpec::Is(Unit::METRE_PER_SECOND_SQUARED)
            && has_params(d, &["profile", "handle_mass_g", "drive", "corner_hz", "corner_damping"])
            && !has_to_be_set(d, &["profile", "handle_mass_g", "drive"])
    };
    registry.iter().map(|k| k.descriptor()).filter(fits).map(|d| d.kind.to_string()).collect()
}

/// Kinds behind which a signal is limited: of any profile and handle, as `limiter`.
fn limiters(subject: &Subject<'_>) -> Result<Vec<String>, Not> {
    let fits = |d: &&Descriptor| {
        one_audio_each_way(d)
            && d.outputs[0].limited
            && has_params(d, &["profile", "handle_mass_g"])
            && !has_to_be_set(d, &["profile", "handle_mass_g"])
    };
    let all: Vec<String> =
        subject.registry().iter().map(|k| k.descriptor()).filter(fits).map(|d| d.kind.to_string()).collect();
    if all.is_empty() { not_applicable("there is no limiter") } else { Ok(all) }
}
