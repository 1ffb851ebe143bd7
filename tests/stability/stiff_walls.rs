//! Walls: the energy that a sampled wall gives to a device, alone or under a hand. `core/checks` has the
//! cases of a plain floor.

use asperity_checks::Effort;
use asperity_graph::GraphFile;

use crate::{broken, fails, graph, holds, holds_on, subject};

/// The damping of the walls of a scene, and their force with it.
const DAMPING: usize = 5;
const PUSH: usize = 6;

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
    harness::graph::lowered(&path)
}

#[test]
fn own_walls() {
    let dir = tempfile::tempdir().expect("a folder");
    let [text, haply, every] = ["texture.ron", "haply.ron", "scenes/every_effect.ron"].map(graph);
    let graphs = [text, corner(&dir, ""), haply, every];
    for case in ["own_wall_energy", "own_wall_in_steps", "own_wall_under_a_hand"] {
        holds_on(case, &graphs);
    }
    // Regression: the hand has to bring the device to rest too, which is 2.6 kg where its swing takes as
    // many ticks of 10 ms.
    holds("own_wall_under_a_hand", &subject(Some(&graph("texture.ron tick_hz=100"))));
    let plain = subject(Some(&graphs[0]));
    let late = broken(&plain, "virtual_floor", |before: &mut f64, tick| {
        let force = tick.outputs.control(0)[0];
        tick.outputs.set(0, std::mem::replace(before, force));
    });
    fails("own_wall_energy", &late, "the bound is");
    // Pushes harder on the way out than on the way in.
    let springs = broken(&plain, "virtual_floor", |(before, out): &mut (f64, bool), tick| {
        let z = tick.inputs.control(0)[2];
        if z != *before {
            *out = z > *before;
        }
        *before = z;
        let force = tick.outputs.control(0)[0];
        if force > 0.0 && *out {
            tick.outputs.set(0, force + 0.04);
        }
    });
    fails("own_wall_in_steps", &springs, "borders of steps");
    // 30 ticks late, from tick 500 on: more than a hand's damping bears.
    let later = broken(&subject(Some(&graphs[1])), "contact", |before: &mut [[f64; 3]; 31], tick| {
        before.rotate_right(1);
        let force = tick.outputs.control(PUSH);
        before[0].copy_from_slice(force);
        if tick.index > 500 {
            force.copy_from_slice(&before[30]);
        }
    });
    fails("own_wall_under_a_hand", &later, "kg of hand");
}

#[test]
fn wall_in_a_slow_graph_needs_the_damping_of_its_own_rate() {
    for (changes, needed) in [
        ("", "0.500"),
        (" floor.every=2", "1.000"),
        (" floor.every=2 tick_hz=1000", "0.500"),
        (" tick_hz=1000", "0.250"),
        (" tick_hz=1000 floor.stiffness_n_per_mm=2", "1.000"),
    ] {
        let graph = graph(&format!("texture.ron{changes}"));
        let found = holds("own_wall_energy", &subject(Some(&graph)).effort(Effort::Quick));
        let needed = format!("passive on a device with at least {needed} N s/m");
        assert!(found.contains(&needed), "{changes}: {found}");
    }
}

#[test]
fn chatter() {
    let dir = tempfile::tempdir().expect("a folder");
    let [text, every, side] =
        ["texture.ron", "scenes/every_effect.ron", "scenes/side_by_side.ron"].map(graph);
    let graphs = [text, corner(&dir, ""), every, side];
    holds_on("contact_chatter", &graphs);
    let breaks = broken(&subject(Some(&graphs[0])), "virtual_floor", |(): &mut (), tick| {
        if tick.index % 64 == 0 {
            tick.outputs.set(0, 0.0);
        }
    });
    fails("contact_chatter", &breaks, "contact is");
    // So much hysteresis in a corner that the stylus is thrown from wall to wall.
    let thrown = corner(&dir, "hysteresis_mm: 2,");
    fails("contact_chatter", &subject(Some(&thrown)), "take turns");
}

#[test]
fn wall_without_force_leaves_the_cases_to_the_others() {
    let dir = tempfile::tempdir().expect("a folder");
    let graph = corner(&dir, "");
    // The block, which has no damping.
    let soft = broken(&subject(Some(&graph)).effort(Effort::Quick), "contact", |(): &mut (), tick| {
        if tick.outputs.control(DAMPING)[0] == 0.0 {
            tick.outputs.control(PUSH).fill(0.0);
        }
    });
    for case in ["own_wall_energy", "own_wall_in_steps", "own_wall_under_a_hand", "contact_chatter"] {
        holds(case, &soft);
    }
}
