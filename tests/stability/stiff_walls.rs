//! Walls: the energy that a sampled wall gives to a device, alone or under a hand.

use std::sync::Arc;

use asperity_checks::{Effort, Subject};
use asperity_graph::GraphFile;
use asperity_node::{NodeKind, Tick};

use crate::{fails, graph, holds, lowered, mutated, plugin, scene, subject, wrap};

/// The force of the floor.
const FORCE: usize = 0;
/// The damping of the walls of a scene, and their force with it.
const DAMPING: usize = 5;
const PUSH: usize = 6;

/// A floor whose force is changed, with the height and the force of the tick before.
fn floor(
    subject: &Subject<'_>,
    change: impl Fn(&mut Tick<'_>, f64, [f64; 2]) + Clone + Send + Sync + 'static,
) -> Subject<'static> {
    let kind = subject.kind("virtual_floor").expect("the kind");
    let mutant = wrap::with_memory(kind, move |before: &mut [f64; 2], tick| {
        let z = tick.inputs.control(0)[2];
        let force = tick.outputs.control(FORCE)[0];
        change(tick, z, *before);
        *before = [z, force];
    });
    mutated(subject, mutant)
}

/// A floor that pushes harder from a tick on, in every other stretch of so many ticks.
fn rocks(subject: &Subject<'_>, from: u64, ticks: u64, more_n: f64) -> Subject<'static> {
    floor(subject, move |tick, _, _| {
        let force = tick.outputs.control(FORCE)[0];
        if force > 0.0 && tick.index > from && (tick.index / ticks).is_multiple_of(2) {
            tick.outputs.set(FORCE, force + more_n);
        }
    })
}

/// A floor that answers a tick late.
fn late(subject: &Subject<'_>) -> Subject<'static> {
    floor(subject, |tick, _, [_, force]| tick.outputs.set(FORCE, force))
}

/// A wall whose force comes 30 ticks late, from tick 500 on: more than a hand's damping bears.
fn later(subject: &Subject<'_>, kind: &str, output: usize) -> Arc<NodeKind> {
    let kind = subject.kind(kind).expect("the kind");
    wrap::with_memory(kind, move |before: &mut [[f64; 3]; 31], tick| {
        before.rotate_right(1);
        let force = tick.outputs.control(output);
        let count = force.len();
        before[0][..count].copy_from_slice(force);
        if tick.index > 500 {
            force.copy_from_slice(&before[30][..count]);
        }
    })
}

/// A floor that pushes harder on the way out than on the way in.
fn springs(subject: &Subject<'_>) -> Subject<'static> {
    let kind = subject.kind("virtual_floor").expect("the kind");
    let mutant = wrap::with_memory(kind, |(before, out): &mut (f64, bool), tick| {
        let z = tick.inputs.control(0)[2];
        if z != *before {
            *out = z > *before;
        }
        *before = z;
        let force = tick.outputs.control(FORCE)[0];
        if force > 0.0 && *out {
            tick.outputs.set(FORCE, force + 0.04);
        }
    });
    mutated(subject, mutant)
}

/// A floor that is softer for a stylus that has been in it from the first tick on.
fn gives_way(subject: &Subject<'_>) -> Subject<'static> {
    let kind = subject.kind("virtual_floor").expect("the kind");
    let mutant = wrap::with_memory(kind, |soft: &mut bool, tick| {
        let force = tick.outputs.control(FORCE)[0];
        if tick.index == 0 {
            *soft = force > 0.0;
        }
        if *soft {
            tick.outputs.set(FORCE, 0.99 * force);
        }
    });
    mutated(subject, mutant)
}

#[test]
fn inside_its_bound() {
    let subject = subject(None);
    holds("wall_inside_its_bound", &subject);
    fails("wall_inside_its_bound", &late(&subject), "the bound is");
    fails("wall_inside_its_bound", &springs(&subject), "takes out");
    // Some time after it has begun.
    fails("wall_inside_its_bound", &rocks(&subject, 600, 22, 0.2), "of its energy at first");
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
    // As it swings, some time after it has begun.
    fails("wall_in_steps", &rocks(&subject, 3000, 22, 0.05), "tremble by");
    fails("wall_in_steps", &gives_way(&subject), "are to be had");
    // Where it is nearly 8.3 steps deep it pushes as if it were just that.
    let lulls = floor(&subject, |tick, z, _| {
        if tick.index > 3000 && (-z / 0.055 - 8.3).abs() < 2.0 {
            tick.outputs.set(FORCE, 8.3 * 0.055 * 0.5);
        }
    });
    fails("wall_in_steps", &lulls, "lie still between two steps");
}

#[test]
fn in_steps_held_by_friction() {
    let subject = subject(None);
    holds("wall_in_steps_held_by_friction", &subject);
    fails("wall_in_steps_held_by_friction", &rocks(&subject, 500, 10, 0.1), "still moves");
}

#[test]
fn under_a_hand() {
    let subject = subject(None);
    holds("wall_under_a_hand", &subject);
    fails("wall_under_a_hand", &mutated(&subject, later(&subject, "virtual_floor", FORCE)), "kg of hand");
}

/// A floor with damping and a block on it, so that there is a corner.
fn corner(dir: &tempfile::TempDir, more: &str) -> GraphFile {
    let path = dir.path().join("corner.ron");
    let text = format!(
        r#"Scene(version: 1, tick_hz: 1000, audio_hz: 48000, seed: 1, input: stroke(shape: line),
        {more} surfaces: {{
            "floor": (shape: plane, effects: (stiffness: (stiffness_n_per_mm: 0.5),
            damping: (damping_ns_per_m: 0.3))),
            "block": (shape: box(size_mm: (30, 200, 20)), place_mm: (40, 0, 5),
            effects: (stiffness: (stiffness_n_per_mm: 0.5))),
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
    // Regression: the hand has to bring the device to rest too, which is 2.6 kg where its swing takes as
    // many ticks of 10 ms.
    let mut slow = graph("texture.ron");
    slow.set("tick_hz=100", "the test").expect("a change");
    holds("own_wall_under_a_hand", &subject(Some(&slow)));
    let (plain, text) = (subject(None), graph("texture.ron"));
    fails("own_wall_energy", &late(&plain).graph(&text), "the bound is");
    fails("own_wall_in_steps", &springs(&plain).graph(&text), "borders of steps");
    let scene = corner(&dir, "");
    let subject = subject(Some(&scene));
    let late = mutated(&subject, later(&subject, "contact", PUSH));
    fails("own_wall_under_a_hand", &late.graph(&scene), "kg of hand");
}

#[test]
fn wall_in_a_slow_graph_needs_the_damping_of_its_own_rate() {
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
    for graph in
        [graph("texture.ron"), scene("every_effect.ron"), scene("side_by_side.ron"), corner(&dir, "")]
    {
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

#[test]
fn floor_out_of_reach_leaves_the_cases_to_the_others() {
    let built_in = subject(None);
    let floor = built_in.kind("virtual_floor").expect("the kind");
    // A metre below all that is looked at.
    let deep = wrap::after(floor.clone(), |tick| tick.outputs.set(FORCE, 0.0));
    let subject = built_in.clone().with(plugin(&deep, "a_deep_floor", |d| d));
    for case in ["wall_inside_its_bound", "wall_late", "wall_in_steps", "wall_under_a_hand"] {
        let found = holds(case, &subject.clone().effort(Effort::Quick));
        assert!(found.contains("`virtual_floor`") && !found.contains("deep"), "{case}: {found}");
    }
}

#[test]
fn wall_without_force_leaves_the_cases_to_the_others() {
    let dir = tempfile::tempdir().expect("a folder");
    let graph = corner(&dir, "");
    let subject = subject(Some(&graph)).effort(Effort::Quick);
    // The block, which has no damping.
    let soft = wrap::after(subject.kind("contact").expect("the kind"), |tick| {
        if tick.outputs.control(DAMPING)[0] == 0.0 {
            tick.outputs.control(PUSH).fill(0.0);
        }
    });
    let subject = subject.clone().with(soft);
    for case in ["own_wall_energy", "own_wall_in_steps", "own_wall_under_a_hand", "contact_chatter"] {
        holds(case, &subject);
    }
}
