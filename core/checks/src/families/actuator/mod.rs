//! The inverse of an actuator, its limiter, and their effect on a simulated one.

mod inverse;
mod limiter;

pub use limiter::{Piece, Place, Sound, limited};

use std::path::Path;

use asperity_actuator::{ActuatorProfile, Dynamics};
use asperity_node::{Descriptor, Params, ShapeSpec, Unit, UnitSpec};

use crate::case::{Case, Family, Stop, not_applicable};
use crate::rig::has_to_be_set;
use crate::subject::Subject;

const ACTUATOR: Family = Family("actuator");

pub(super) const CASES: &[Case] = &[
    ACTUATOR.kinds(
        "inverse_band",
        inverse::band,
        "the input of the inverse is a sine, from 1 Hz (below the actuator's band) to just below half the \
         rate (far above it). Then it is a constant",
        "with current and voltage drive, inverse and simulated actuator together are within 0.3 dB of a \
         Butterworth high-pass at 20 Hz from 5 to 1000 Hz. Their output is never more than 1.1 times the \
         input. After 1 s of a constant it is zero",
    ),
    ACTUATOR.kinds(
        "inverse_off",
        inverse::off,
        "the actuator's mass, spring and damping are each 20 % above or below those of the inverse: all \
         eight corners",
        "from 20 to 400 Hz the output is at most 8 dB off that of the right actuator. Within 0.5 s of the \
         end the actuator is at rest, below 10^-6 of the input",
    ),
    ACTUATOR.kinds(
        "full_scale_at_resonance",
        limiter::resonance,
        "the input is a sine at the actuator's resonance, at its peak current or voltage. It lasts ten \
         minutes (one minute with effort `full`, 5 s with `quick`)",
        "the simulated coil stays within its rated rms current over its thermal time constant and 1 % \
         more, and the mover within its stroke. No step from sample to sample is larger than that of the \
         sine: nothing clicks",
    ),
    ACTUATOR.kinds(
        "limiter_random",
        limiter::random,
        "the limiter gets noise, sines, squares, steps, pulses, constants, random bits and muting, up to \
         1000 peaks, and a signal that follows the mover to drive it farthest",
        "every sample is finite and within the peak and the slew. The mover stays within its stroke, the \
         coil within its rated rms current and 1 % more. The mean over a time T is within 8 peak / (2 pi \
         dc_corner T)",
    ),
    ACTUATOR.graph(
        "own_limits",
        limiter::own,
        "the graph's stylus is thrown about, pressed and lifted at random, and every network in it answers \
         nonsense up to 10^6 m/s^2",
        "the drive of each sound card is finite. The simulated actuator of its limiter stays within peak, \
         slew, stroke, and rated rms current and 1 % more",
    ),
];

/// Shipped actuators, with the mass of a handle \[g\].
const ACTUATORS: [(&str, f64); 3] =
    [("hapcoil_one", 100.0), ("haptuator_mark_ii", 100.0), ("hapcoil_one", 25.0)];

/// A shipped actuator on a handle.
fn on_shipped(profile: &str, grams: f64) -> Result<Dynamics, Stop> {
    Ok(Dynamics::new(&ActuatorProfile::find(profile, Path::new(""))?, grams)?)
}

/// The actuator of a node's parameters `profile` and `handle_mass_g`, if it has them.
fn named(params: &Params) -> Option<Result<Dynamics, Stop>> {
    let (name, grams) = (params.text("profile"), params.get_number("handle_mass_g")?);
    if name.is_empty() {
        return None;
    }
    let base = params.place("profile").or(params.node_place()).and_then(|p| p.source.path().parent());
    let profile = ActuatorProfile::find(name, base.unwrap_or(Path::new("")));
    Some(profile.and_then(|profile| Dynamics::new(&profile, grams)).map_err(Stop::from))
}

/// Kinds that turn an acceleration into a drive, for any profile and handle, as `actuator_inverse`.
fn inverses(subject: &Subject<'_>) -> Result<Vec<String>, Stop> {
    let acceleration = |d: &Descriptor| d.inputs[0].unit == UnitSpec::Is(Unit::METRE_PER_SECOND_SQUARED);
    let all = ["profile", "handle_mass_g", "drive", "corner_hz", "corner_damping"];
    kinds(subject, &all, 3, acceleration, "there is no inverse of an actuator")
}

/// Kinds that limit a signal, for any profile and handle, as `limiter`.
fn limiters(subject: &Subject<'_>) -> Result<Vec<String>, Stop> {
    kinds(subject, &["profile", "handle_mass_g"], 2, |d| d.outputs[0].limited, "there is no limiter")
}

/// Names of the kinds with one audio input and output that fit. They have these parameters, of which only the
/// first `set` may have to be set.
fn kinds(
    subject: &Subject<'_>,
    params: &[&str],
    set: usize,
    fits: impl Fn(&Descriptor) -> bool,
    none: &str,
) -> Result<Vec<String>, Stop> {
    let audio = |shape: Option<&ShapeSpec>| matches!(shape, Some(ShapeSpec::Audio(_)));
    let is_one = |d: &&Descriptor| {
        audio(d.inputs.first().map(|i| &i.shape))
            && audio(d.outputs.first().map(|o| &o.shape))
            && d.inputs.iter().filter(|i| !i.optional).count() == 1
            && params.iter().all(|name| d.params.iter().any(|p| p.name == *name))
            && !has_to_be_set(d, &params[..set])
            && fits(d)
    };
    let all = subject.registry.iter().map(|k| k.descriptor()).filter(is_one);
    let all: Vec<String> = all.map(|d| d.kind.to_string()).collect();
    if all.is_empty() { not_applicable(none) } else { Ok(all) }
}
