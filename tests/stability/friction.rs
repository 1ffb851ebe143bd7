//! Friction and drag: forces that only take energy.

use asperity_checks::Subject;
use asperity_node::Tick;

use crate::{broken, fails, graph, holds, holds_on, pushing, subject};

/// Where the node of friction has its velocity and the normal force.
const VELOCITY: usize = 1;
const NORMAL: usize = 2;

/// A tick late, so that it drives where the stylus turns.
fn late<'g>(subject: &Subject<'g>) -> Subject<'g> {
    broken(subject, "friction", |before: &mut [f64; 3], tick| tick.outputs.control(0).swap_with_slice(before))
}

/// Friction whose force is changed by the velocity along x.
fn friction(subject: &Subject<'static>, change: fn(&mut Tick<'_>, f64)) -> Subject<'static> {
    broken(subject, "friction", move |(): &mut (), tick| {
        let velocity = tick.inputs.control(VELOCITY)[0];
        change(tick, velocity);
    })
}

#[test]
fn takes_energy() {
    let subject = subject(None);
    holds("friction_takes_energy", &subject);
    fails("friction_takes_energy", &late(&subject), "has given");
    let drag = pushing(&subject, "viscosity", |f| -f);
    fails("friction_takes_energy", &drag, "viscosity: (viscosity_ns_per_m: 1, max_force_n: 1.5) at 100 Hz");
}

#[test]
fn is_quiet_at_rest() {
    let subject = subject(None);
    holds("friction_is_quiet_at_rest", &subject);
    // Coulomb's step, for speeds that no hand has.
    let steps = friction(&subject, |tick, velocity| {
        let size = tick.inputs.control(NORMAL)[0] * 1e-6;
        if velocity != 0.0 && velocity.abs() < 1e-6 * tick.inputs.control(NORMAL)[0] {
            tick.outputs.control(0)[0] -= size * velocity.signum();
        }
    });
    fails("friction_is_quiet_at_rest", &steps, "by the law at rest");
}

#[test]
fn inside_its_bound() {
    let subject = subject(None);
    holds("friction_inside_its_bound", &subject);
    // Pushes along a motion that is no longer slow.
    let drives = friction(&subject, |tick, velocity| {
        if velocity.abs() > 10.0 {
            tick.outputs.control(0)[0] = 0.1 * velocity.signum();
        }
    });
    fails("friction_inside_its_bound", &drives, "it still moves");
    // Twice as strong as it says.
    let strong = pushing(&subject, "friction", |f| 2.0 * f);
    fails("friction_inside_its_bound", &strong, "at rest, not");
    // Trembles by itself once the device has come to rest, or nearly.
    let trembles = friction(&subject, |tick, _| {
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
    let unlimited = pushing(&subject, "force_limiter", |f| 10.0 * f);
    fails("friction_beyond_its_bound", &unlimited, "mm/s; the bound is");
}

#[test]
fn own() {
    let graphs = ["scenes/side_by_side.ron", "scenes/every_effect.ron"].map(graph);
    holds_on("own_friction", &graphs);
    let subject = subject(Some(&graphs[0]));
    fails("own_friction", &late(&subject), "has given");
    // Pushes along what has set off at 80 to 101 mm/s, as the device does and no way that is rubbed.
    let drives = broken(&subject, "friction", |(before, slides): &mut (f64, bool), tick| {
        let speed = tick.inputs.control(VELOCITY)[0];
        *slides = (*slides || *before == 0.0 && speed > 80.0) && (1.0..101.0).contains(&speed);
        *before = speed;
        if *slides {
            tick.outputs.control(0)[0] = 3.0;
        }
    });
    fails("own_friction", &drives, "of its energy at first");
}
