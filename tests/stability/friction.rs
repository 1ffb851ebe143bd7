//! Friction and drag: forces that may only take.

use std::sync::Arc;

use asperity_node::Tick;
use asperity_stability::{Subject, wrap};

use crate::{fails, holds, scene, subject};

/// Where the node of friction has its velocity.
const VELOCITY: usize = 1;

/// Friction whose force is changed, with the velocity and the force of the tick before.
fn friction<F>(subject: &Subject<'_>, change: F) -> Subject<'static>
where
    F: Fn(&mut Tick<'_>, [f64; 2], [f64; 3]) + Send + Sync + Clone + 'static,
{
    let mutant = wrap::wrap(
        subject.kind("friction").expect("the kind"),
        Arc::new(move |_| {
            let (change, mut before) = (change.clone(), [0.0; 3]);
            Box::new(move |node, tick| {
                let status = node.process(tick)?;
                let velocity = [0, 1].map(|k| tick.inputs.control(VELOCITY)[k]);
                let now = [0, 1, 2].map(|k| tick.outputs.control(0)[k]);
                change(tick, velocity, before);
                before = now;
                Ok(status)
            })
        }),
    );
    Subject::new(subject.registry().clone()).effort(subject.allowed()).with(mutant)
}

#[test]
fn takes_energy() {
    let subject = subject(None);
    holds("friction_takes_energy", &subject);
    // A tick late, so that it drives where the stylus turns.
    let late = friction(&subject, |tick, _, before| tick.outputs.control(0).copy_from_slice(&before));
    fails("friction_takes_energy", &late, "has given");
    let drag = wrap::after(subject.kind("viscosity").expect("the kind"), |tick| {
        tick.outputs.control(0).iter_mut().for_each(|f| *f = -*f);
    });
    fails("friction_takes_energy", &subject.clone().with(drag), "drag at 100 Hz");
}

#[test]
fn is_quiet_at_rest() {
    let subject = subject(None);
    holds("friction_is_quiet_at_rest", &subject);
    // Coulomb's step, for speeds that no hand has.
    let steps = friction(&subject, |tick, velocity, _| {
        let size = tick.inputs.control(2)[0] * 1e-6;
        if velocity[0] != 0.0 && velocity[0].abs() < 1e-6 * tick.inputs.control(2)[0] {
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
    for graph in [scene("every_effect.ron"), scene("study.ron")] {
        holds("own_friction", &subject(Some(&graph)));
    }
    let graph = scene("study.ron");
    let late = friction(&subject(None), |tick, _, before| tick.outputs.control(0).copy_from_slice(&before));
    fails("own_friction", &late.graph(&graph), "has given");
}
