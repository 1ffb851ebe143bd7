//! Friction and drag: forces that only take energy.

use asperity_checks::{Effort, Subject};
use asperity_node::{Param, Tick};

use crate::{fails, holds, mutated, plugin, scene, subject, wrap};

/// Where the node of friction has its velocity and the normal force.
const VELOCITY: usize = 1;
const NORMAL: usize = 2;

/// Friction whose force is changed, with the velocity and the force of the tick before.
fn friction(
    subject: &Subject<'_>,
    change: impl Fn(&mut Tick<'_>, [f64; 2], [f64; 3]) + Clone + Send + Sync + 'static,
) -> Subject<'static> {
    let kind = subject.kind("friction").expect("the kind");
    let mutant = wrap::with_memory(kind, move |before: &mut [f64; 3], tick| {
        let velocity = [0, 1].map(|k| tick.inputs.control(VELOCITY)[k]);
        let now = [0, 1, 2].map(|k| tick.outputs.control(0)[k]);
        change(tick, velocity, *before);
        *before = now;
    });
    mutated(subject, mutant)
}

/// A tick late, so that it drives where the stylus turns.
fn late(subject: &Subject<'_>) -> Subject<'static> {
    friction(subject, |tick, _, before| tick.outputs.control(0).copy_from_slice(&before))
}

#[test]
fn takes_energy() {
    let subject = subject(None);
    holds("friction_takes_energy", &subject);
    fails("friction_takes_energy", &late(&subject), "has given");
    let drag = wrap::after(subject.kind("viscosity").expect("the kind"), |tick| {
        tick.outputs.control(0).iter_mut().for_each(|f| *f = -*f);
    });
    fails(
        "friction_takes_energy",
        &subject.clone().with(drag),
        "viscosity: (viscosity_ns_per_m: 2, max_force_n: 1.5) at 100 Hz",
    );
}

#[test]
fn is_quiet_at_rest() {
    let subject = subject(None);
    holds("friction_is_quiet_at_rest", &subject);
    // Coulomb's step, for speeds that no hand has.
    let steps = friction(&subject, |tick, velocity, _| {
        let size = tick.inputs.control(NORMAL)[0] * 1e-6;
        if velocity[0] != 0.0 && velocity[0].abs() < 1e-6 * tick.inputs.control(NORMAL)[0] {
            tick.outputs.control(0)[0] -= size * velocity[0].signum();
        }
    });
    fails("friction_is_quiet_at_rest", &steps, "the law at rest says");
}

#[test]
fn inside_its_bound() {
    let subject = subject(None);
    holds("friction_inside_its_bound", &subject);
    // Pushes along a motion that is no longer slow.
    let drives = friction(&subject, |tick, velocity, _| {
        if velocity[0].abs() > 10.0 {
            tick.outputs.control(0)[0] = 0.1 * velocity[0].signum();
        }
    });
    fails("friction_inside_its_bound", &drives, "of its energy at first");
    // Twice as strong as it says.
    let strong = friction(&subject, |tick, _, _| {
        tick.outputs.control(0).iter_mut().for_each(|f| *f *= 2.0);
    });
    fails("friction_inside_its_bound", &strong, "at rest, not");
    // Trembles by itself once the device has come to rest, or nearly.
    let trembles = friction(&subject, |tick, _, _| {
        if tick.index > 20 {
            let more = 1e-5 * tick.inputs.control(NORMAL)[0];
            tick.outputs.control(0)[0] += if tick.index.is_multiple_of(2) { more } else { -more };
        }
    });
    fails("friction_inside_its_bound", &trembles, "changes its sign");
}

#[test]
fn beyond_its_bound() {
    let subject = subject(None);
    holds("friction_beyond_its_bound", &subject);
    let unlimited = wrap::after(subject.kind("force_limiter").expect("the kind"), |tick| {
        tick.outputs.control(0).iter_mut().for_each(|f| *f *= 10.0);
    });
    fails("friction_beyond_its_bound", &subject.clone().with(unlimited), "mm/s; the bound is");
}

#[test]
fn own() {
    for graph in [scene("every_effect.ron"), scene("side_by_side.ron")] {
        holds("own_friction", &subject(Some(&graph)));
    }
    let graph = scene("side_by_side.ron");
    let subject = subject(None);
    fails("own_friction", &late(&subject).graph(&graph), "has given");
    // Pushes along what has set off at 80 to 101 mm/s, as the device does and no way that is rubbed.
    let kind = subject.kind("friction").expect("the kind");
    let drives = wrap::with_memory(kind, |(before, slides): &mut (f64, bool), tick| {
        let speed = tick.inputs.control(VELOCITY)[0];
        *slides = (*slides || *before == 0.0 && speed > 80.0) && (1.0..101.0).contains(&speed);
        *before = speed;
        if *slides {
            tick.outputs.control(0)[0] = 3.0;
        }
    });
    fails("own_friction", &mutated(&subject, drives).graph(&graph), "of its energy at first");
}

#[test]
fn friction_with_required_parameter_is_left_out() {
    let built_in = subject(None);
    let which = Param::text("surface", "", "What rubs.").required();
    let more = plugin(&built_in.kind("viscosity").expect("the kind"), "a_drag", |d| d.param(which));
    let subject = built_in.with(more).effort(Effort::Quick);
    for case in ["friction_takes_energy", "friction_is_quiet_at_rest", "friction_inside_its_bound"] {
        let found = holds(case, &subject);
        assert!(!found.contains("a_drag"), "{case}: {found}");
    }
}
