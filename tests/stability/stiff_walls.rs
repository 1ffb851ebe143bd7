//! Walls: what a sampled wall gives to a device that is held by nobody, or by a hand.

use std::sync::Arc;

use asperity_graph::GraphFile;
use asperity_node::Tick;
use asperity_stability::{Subject, wrap};

use crate::{fails, graph, holds, lowered, scene, subject};

/// The force of the floor.
const FORCE: usize = 0;
/// That of the walls of a scene, with their damping.
const PUSH: usize = 6;

/// Floors whose force is changed, with what was seen of the stylus in the tick before: height, force.
fn floor<F>(subject: &Subject<'_>, change: F) -> Subject<'static>
where
    F: Fn(&mut Tick<'_>, f64, [f64; 2]) + Send + Sync + Clone + 'static,
{
    let mutant = wrap::wrap(
        subject.kind("virtual_floor").expect("the kind"),
        Arc::new(move |_| {
            let (change, mut before) = (change.clone(), [0.0; 2]);
            Box::new(move |node, tick| {
                let z = tick.inputs.control(0)[2];
                let status = node.process(tick)?;
                let force = tick.outputs.control(FORCE)[0];
                change(tick, z, before);
                before = [z, force];
                Ok(status)
            })
        }),
    );
    Subject::new(subject.registry().clone()).effort(subject.allowed()).with(mutant)
}

/// A floor that answers a tick late.
fn late(subject: &Subject<'_>) -> Subject<'static> {
    floor(subject, |tick, _, [_, force]| tick.outputs.set(FORCE, force))
}

/// A wall whose output of a force comes 30 ticks late, some time after it has begun: more than a hand's damping bears.
fn later(output: usize) -> wrap::Maker {
    Arc::new(move |_| {
        let mut before = [[0.0; 3]; 31];
        Box::new(move |node, tick| {
            let status = node.process(tick)?;
            before.rotate_right(1);
            let force = tick.outputs.control(output);
            let count = force.len();
            before[0][..count].copy_from_slice(force);
            if tick.index > 500 {
                force.copy_from_slice(&before[30][..count]);
            }
            Ok(status)
        })
    })
}

/// A floor that pushes harder on the way out than on the way in.
fn springs(subject: &Subject<'_>) -> Subject<'static> {
    let mutant = wrap::wrap(
        subject.kind("virtual_floor").expect("the kind"),
        Arc::new(move |_| {
            let (mut before, mut out) = (0.0, false);
            Box::new(move |node, tick| {
                let z = tick.inputs.control(0)[2];
                let status = node.process(tick)?;
                if z != before {
                    out = z > before;
                }
                before = z;
                let force = tick.outputs.control(FORCE)[0];
                if force > 0.0 && out {
                    tick.outputs.set(FORCE, force + 0.04);
                }
                Ok(status)
            })
        }),
    );
    Subject::new(subject.registry().clone()).effort(subject.allowed()).with(mutant)
}

#[test]
fn inside_its_bound() {
    let subject = subject(None);
    holds("wall_inside_its_bound", &subject);
    fails("wall_inside_its_bound", &late(&subject), "the bound is");
    fails("wall_inside_its_bound", &springs(&subject), "takes out");
}

#[test]
fn outside_its_bound() {
    let subject = subject(None);
    holds("wall_outside_its_bound", &subject);
    // A floor that answers where the stylus will be half a tick later: less than the bound says is made.
    let ahead = floor(&subject, |tick, z, [before, _]| {
        let force = tick.outputs.control(FORCE)[0];
        if force > 0.0 {
            tick.outputs.set(FORCE, (force - 0.25 * (z - before)).max(0.0));
        }
    });
    fails("wall_outside_its_bound", &ahead, "to Hooke's force");
}

#[test]
fn late_forces() {
    let subject = subject(None);
    holds("wall_late", &subject);
    fails("wall_late", &late(&subject), "of their energy");
}

#[test]
fn in_steps() {
    let subject = subject(None);
    holds("wall_in_steps", &subject);
    fails("wall_in_steps", &springs(&subject), "borders of steps");
    // Rocks the device as it swings, some time after it has begun.
    let rocks = floor(&subject, |tick, _, _| {
        if tick.index > 3000 && (tick.index / 22).is_multiple_of(2) {
            let force = tick.outputs.control(FORCE)[0];
            tick.outputs.set(FORCE, force + 0.2);
        }
    });
    fails("wall_in_steps", &rocks, "tremble by");
}

#[test]
fn in_steps_held_by_friction() {
    let subject = subject(None);
    holds("wall_in_steps_held_by_friction", &subject);
    // Pushes now more, now less, some time after it has begun.
    let trembles = floor(&subject, |tick, _, _| {
        if tick.index > 500 && (tick.index / 10).is_multiple_of(2) {
            let force = tick.outputs.control(FORCE)[0];
            tick.outputs.set(FORCE, force + 0.1);
        }
    });
    fails("wall_in_steps_held_by_friction", &trembles, "still moves");
}

#[test]
fn under_a_hand() {
    let subject = subject(None);
    holds("wall_under_a_hand", &subject);
    let later = wrap::wrap(subject.kind("virtual_floor").expect("the kind"), later(FORCE));
    fails("wall_under_a_hand", &subject.clone().with(later), "kg of hand");
}

/// A floor with damping and a block on it, so that there is a corner.
fn corner(dir: &tempfile::TempDir, more: &str) -> GraphFile {
    let path = dir.path().join("corner.ron");
    let text = format!(
        r#"Scene(version: 1, tick_hz: 1000, audio_hz: 48000, seed: 1, input: stroke(shape: line), {more} surfaces: {{
            "floor": (shape: plane, effects: (stiffness: (stiffness_n_per_mm: 0.5), damping: (damping_ns_per_m: 0.3))),
            "block": (shape: box(size_mm: (30, 200, 20)), place_mm: (40, 0, 5), effects: (stiffness: (stiffness_n_per_mm: 0.5))),
        }})"#
    );
    std::fs::write(&path, text).expect("a file");
    lowered(&path)
}

#[test]
fn own_walls() {
    let dir = tempfile::tempdir().expect("a folder");
    for graph in [graph("texture.ron"), graph("haply.ron"), scene("every_effect.ron"), corner(&dir, "")] {
        let subject = subject(Some(&graph));
        let found = holds("own_wall_energy", &subject);
        assert!(found.contains("passive on a device with at least"), "{found}");
        holds("own_wall_in_steps", &subject);
        holds("own_wall_under_a_hand", &subject);
    }
    // As it was: the device, which is 2.6 kg where a swing takes as many ticks of 10 ms, was left out of what the hand has to bring to rest.
    let mut slow = graph("texture.ron");
    slow.set("tick_hz=100", "the test").expect("a change");
    holds("own_wall_under_a_hand", &subject(Some(&slow)));
    let (plain, text) = (subject(None), graph("texture.ron"));
    fails("own_wall_energy", &late(&plain).graph(&text), "the bound is");
    fails("own_wall_in_steps", &springs(&plain).graph(&text), "borders of steps");
    let scene = corner(&dir, "");
    let subject = subject(Some(&scene));
    let mutant = wrap::wrap(subject.kind("contact").expect("the kind"), later(PUSH));
    fails("own_wall_under_a_hand", &subject.clone().with(mutant), "kg of hand");
}

#[test]
fn a_wall_that_a_graph_runs_rarely_or_late_is_held_against_its_own_time() {
    let mut text = graph("texture.ron");
    let needs = |graph: &GraphFile| holds("own_wall_energy", &subject(Some(graph)));
    assert!(needs(&text).contains("at least 0.500 N s/m"));
    for (change, needed) in [
        ("floor.every=2", "at least 1.000 N s/m"),
        ("tick_hz=1000", "at least 0.500 N s/m"),
        ("floor.every=1", "at least 0.250 N s/m"),
        ("floor.stiffness_n_per_mm=2", "at least 1.000 N s/m"),
    ] {
        text.set(change, "the test").expect("a change");
        let found = needs(&text);
        assert!(found.contains(needed), "{change}: {found}");
    }
}

#[test]
fn chatter() {
    let dir = tempfile::tempdir().expect("a folder");
    for graph in [graph("texture.ron"), scene("every_effect.ron"), scene("study.ron"), corner(&dir, "")] {
        holds("contact_chatter", &subject(Some(&graph)));
    }
    let text = graph("texture.ron");
    let breaks = floor(&subject(None), |tick, _, _| {
        if tick.index % 64 == 0 {
            tick.outputs.set(FORCE, 0.0);
        }
    });
    fails("contact_chatter", &breaks.graph(&text), "contact is");
    // So much hysteresis in a corner that the stylus is thrown from wall to wall.
    let thrown = corner(&dir, "hysteresis_mm: 2,");
    fails("contact_chatter", &subject(Some(&thrown)), "takes turns");
}
