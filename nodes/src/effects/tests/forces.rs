//! `friction`, `viscosity` and `magnet`.

use crate::bench::{self, Bench};
use crate::effects::friction::{LuGreSettings, Rubbing};
use crate::effects::magnet::Pull;
use crate::effects::viscosity::Drag;

/// Out of contact, in contact with one surface, with another, out, and with the last one again.
fn touched(tick: u64) -> f64 {
    match tick {
        0..10 => -1.0,
        10..60 => 2.0,
        60..90 => 0.0,
        90..140 => -1.0,
        140..150 => 0.0,
        150..170 => 1.0,
        // Beyond the list.
        170..180 => 3.0,
        180..190 => -0.5,
        190..200 => 2.7,
        _ => -3.0,
    }
}

/// Calls: the first tick of all, those in which something is touched, and those in which the slot becomes
/// another that is none.
const CALLS: u64 = 1 + (80 + 30 + 10) + 4;

fn velocity(tick: u64) -> [f64; 2] {
    let t = tick as f64 * 0.05;
    [40.0 * t.sin(), 25.0 * (1.7 * t).cos()]
}

fn normal_force(tick: u64) -> f64 {
    1.0 + 0.5 * (tick as f64 * 0.031).sin()
}

/// Two directions at right angles, aslant.
const TANGENTS: [f64; 6] = [0.6, 0.8, 0.0, -0.48, 0.36, 0.8];

/// Inputs of `friction`.
const INPUTS: &str = "slot velocity force tangents";

const LAWS: [&str; 3] = [
    "lugre(static_coefficient: 0.7, kinetic_coefficient: 0.4)",
    "viscous_coulomb(coefficient: 0.2)",
    "dahl(coefficient: 0.5, bristle_stiffness_n_per_mm: 2)",
];

const MAGNET: &str = "(stiffness_n_per_mm: 0.5, max_force_n: 0.4, reach_mm: 2.5)";

fn friction(tick_hz: u32) -> Bench {
    let play = |tick| {
        vec![vec![touched(tick)], velocity(tick).to_vec(), vec![normal_force(tick)], TANGENTS.to_vec()]
    };
    Bench::new("friction", INPUTS, play).rates((tick_hz, 48_000)).list("laws", &LAWS)
}

// Friction is its law along the tangents, starts anew with every contact and sleeps between contacts.
#[test]
fn friction_follows_law_restarts_at_contact_and_sleeps() {
    for tick_hz in [500, 4000] {
        let (run, calls) = friction(tick_hz).run("it", 250);
        let dt = 1.0 / f64::from(tick_hz);
        let mut lugre = None;
        let mut dahl = None;
        for (tick, force) in run.control.iter().enumerate() {
            let tick = tick as u64;
            let settings = LuGreSettings {
                static_coefficient: 0.7,
                kinetic_coefficient: 0.4,
                ..LuGreSettings::default()
            };
            let (v, n) = (velocity(tick), normal_force(tick));
            let along = match touched(tick) {
                0.0 => lugre.get_or_insert_with(|| Rubbing::lugre(settings)).step(v, n, dt),
                1.0 => Rubbing::viscous_coulomb(0.2, 0.0005).step(v, n, dt),
                2.0 | 2.7 => dahl.get_or_insert_with(|| Rubbing::dahl(0.5, 2.0)).step(v, n, dt),
                _ => [0.0; 2],
            };
            if touched(tick) != 0.0 {
                lugre = None;
            }
            if !matches!(touched(tick), 2.0 | 2.7) {
                dahl = None;
            }
            for (i, f) in force.iter().enumerate() {
                assert_eq!(*f, along[0] * TANGENTS[i] + along[1] * TANGENTS[3 + i], "tick {tick}");
            }
        }
        let most = run.control.iter().flatten().fold(0.0_f64, |m, f| m.max(f.abs()));
        assert!(most > 0.3, "{most}");
        assert_eq!(calls, CALLS);
    }
}

/// A slot that comes on between two of its ticks wakes it at the next, which knows how long a tick is.
#[test]
fn friction_every_third_tick_wakes_by_a_slot_between() {
    let mut engine = friction(1000).every(3).engine("it", true).unwrap();
    let run = bench::run(&mut engine, "it", 60);
    let mut dahl = Rubbing::dahl(0.5, 2.0);
    // The slot comes on at tick 10.
    for tick in (12..60).step_by(3) {
        let [u, v] = dahl.step(velocity(tick), normal_force(tick), 3e-3);
        assert_eq!(run.control[tick as usize][2], u * TANGENTS[2] + v * TANGENTS[5]);
    }
    let it = engine.schedule().index_of("it").unwrap();
    assert_eq!(engine.report(it).unwrap().calls, 1 + 16);
}

/// A hand goes round over a plane whose directions change from time to time, with the same velocity in space.
#[test]
fn a_bristle_stays_as_it_is_bent_where_directions_turn_round() {
    let forces = |slot: f64, turning: bool| {
        let play = move |tick| {
            let [u, v] = velocity(tick);
            let (velocity, tangents) = match tick / 7 % 3 {
                1 if turning => ([-u, -v], TANGENTS.map(|x| -x).to_vec()),
                2 if turning => ([v, -u], [&TANGENTS[3..], &TANGENTS.map(|x| -x)[..3]].concat()),
                _ => ([u, v], TANGENTS.to_vec()),
            };
            vec![vec![slot], velocity.to_vec(), vec![normal_force(tick)], tangents]
        };
        Bench::new("friction", INPUTS, play).list("laws", &LAWS).run("it", 200).0.control
    };
    for slot in [0.0, 1.0, 2.0] {
        let (still, turning) = (forces(slot, false), forces(slot, true));
        for (tick, (a, b)) in still.iter().flatten().zip(turning.iter().flatten()).enumerate() {
            assert!((a - b).abs() < 1e-12, "slot {slot}, tick {}: {a} and {b}", tick / 3);
        }
    }
}

#[test]
fn a_graph_of_one_floor_needs_neither_slot_nor_directions() {
    let play = |_| vec![vec![30.0, -40.0], vec![2.0]];
    let bench = Bench::new("friction", "velocity force", play).list("laws", &LAWS);
    let (run, calls) = bench.run("it", 200);
    // LuGre's in steady motion, against it.
    let [x, y, z] = run.control[199][..] else { panic!() };
    assert!(
        (x / y + 0.75).abs() < 1e-9 && (x * x + y * y).sqrt() > 0.79 && x < 0.0 && z == 0.0,
        "{x} {y} {z}"
    );
    assert_eq!(calls, 200);
    let bench = Bench::new("magnet", "distance", |_| vec![vec![0.3]]).list("magnets", &[MAGNET]);
    let (run, _) = bench.run("it", 2);
    assert!(run.control[1][2] == -0.15 && run.control[1][..2].iter().all(|f| *f == 0.0), "{:?}", run.control);
}

#[test]
fn what_is_no_direction_is_no_force() {
    let play = |tick| {
        let tangents = if tick % 2 == 0 { vec![f64::MAX; 6] } else { vec![1.0; 6] };
        vec![vec![0.0], vec![30.0, 0.0], vec![1e6], tangents]
    };
    let (run, _) = Bench::new("friction", INPUTS, play).list("laws", &["viscous_coulomb"]).run("it", 4);
    assert_eq!(run.control[2], [0.0; 3]);
    assert_eq!(run.control[3], [-1.5e4; 3], "0.0005 s/mm of a million newtons at 30 mm/s");
}

#[test]
fn drag_is_against_the_velocity_and_sleeps_outside() {
    let velocity = |tick: u64| [30.0 * (tick as f64 * 0.1).sin(), -400.0, 12.0];
    let play = move |tick| vec![vec![touched(tick)], velocity(tick).to_vec()];
    let drags =
        ["(viscosity_ns_per_m: 2)", "(viscosity_ns_per_m: 8, max_force_n: 1.5)", "(viscosity_ns_per_m: 0)"];
    let (run, calls) = Bench::new("viscosity", "slot velocity", play).list("drags", &drags).run("it", 250);
    let kernels = [(2.0, 3.3), (8.0, 1.5), (0.0, 3.3)].map(|(c, most)| Drag::new(c, most));
    for (tick, force) in run.control.iter().enumerate() {
        let tick = tick as u64;
        let slot = touched(tick);
        let want = if (0.0..3.0).contains(&slot) {
            kernels[slot as usize].force_n(velocity(tick))
        } else {
            [0.0; 3]
        };
        assert_eq!(*force, want, "tick {tick}");
        if slot == 0.0 {
            // 2 N s/m at 400 mm/s.
            assert!((force[1] - 0.8).abs() < 1e-12);
        }
    }
    assert_eq!(calls, CALLS);
}

#[test]
fn a_magnet_pulls_to_the_surface_from_both_sides() {
    let normal = [0.0, 0.6, 0.8];
    let distance = |tick: u64| 3.0 * (tick as f64 * 0.07).sin();
    let play = move |tick| vec![vec![touched(tick)], vec![distance(tick)], normal.to_vec()];
    let bench = Bench::new("magnet", "slot distance normal", play).list("magnets", &[MAGNET; 3]);
    let (run, calls) = bench.run("it", 250);
    let kernel = Pull::new(0.5, 0.4, 2.5);
    for (tick, force) in run.control.iter().enumerate() {
        let d = distance(tick as u64);
        if !(0.0..3.0).contains(&touched(tick as u64)) {
            assert_eq!(*force, [0.0; 3]);
            continue;
        }
        let along: f64 = force.iter().zip(normal).map(|(f, n)| f * n).sum();
        assert!((along - kernel.force_n(d)).abs() < 1e-15 && force[0] == 0.0);
        if d.abs() < 2.4 && d.abs() > 0.01 {
            assert!(along * d < 0.0, "toward the surface from both sides: {along} N at {d} mm");
        }
        // Halfway up the spring.
        if d.abs() < 0.4 {
            assert!((along + 0.5 * d).abs() < 1e-12);
        }
    }
    assert_eq!(calls, CALLS);
}
