//! The theory of walls on a plain floor, at 500 and 1000 Hz. Each check has mutants that must fail it.

use asperity_node::Tick;

use super::*;
use crate::rig::CaseGraph;
use crate::wrap::with_memory;

/// Less damping than the bound makes energy. Motions of constant speed from tick to tick take out within 0.1
/// % of what K T/2 stands for at every frequency: `K T/2 sin((1/2 + n) w T) / sin(w T / 2) - B cos((1 + n) w
/// T)` for a delay of n ticks. With 0.8 of that damping a thrown device leaves the wall faster than it came.
/// Were it not so, the other checks would show nothing.
fn outside(wall: &mut Wall, near: &Near, _: &Subject<'_>, figures: &mut Figures) -> Result<(), Stop> {
    let (bound, law) = (near.needed_ns_per_m(0.0), near.law);
    ensure!(law.damping_ns_per_m == 0.0, "speed adds {:.3} N s/m to Hooke's force", law.damping_ns_per_m);
    let (tick_s, late) = (near.tick_s(), near.sampling.delay_s / near.tick_s());
    let (mut most, mut off) = (f64::MIN, 0.0_f64);
    for (angle, found) in swings(wall, near) {
        let spring =
            0.5e3 * law.stiffness_n_per_mm * tick_s * ((0.5 + late) * angle).sin() / (0.5 * angle).sin();
        (most, off) = (most.max(found), off.max((found - spring).abs()));
    }
    ensure!(off <= 1e-3 * bound, "a motion is {off:.2e} N s/m off the closed form");
    ensure!(most >= 0.999 * bound, "no motion takes out more than {most:.4} N s/m; the bound is {bound:.4}");
    gains(wall, near, 0.8 * bound, (0, 1), figures)
}

/// Checks that devices that swing slowly in a wall gain energy.
fn gains(
    wall: &mut Wall,
    near: &Near,
    damping_ns_per_m: f64,
    late: (usize, usize),
    figures: &mut Figures,
) -> Result<(), Stop> {
    thrown(wall, near, (damping_ns_per_m, late), &[0.05], |done, _| {
        let gain = done.back_mj / done.first_mj - 1.0;
        figures.note(gain, "of its energy gained outside the bound");
        ensure!(
            gain > 0.0,
            "with {damping_ns_per_m:.3} N s/m a device comes back with {gain:+.4} of its energy"
        );
        Ok(())
    })
}

/// Forces that come 1/2, 1 and 2 ticks late: a delay t_d counts as K t_d. With 2 % more damping than K (T/2 +
/// t_d) + B no energy is made. With 0.8 of that damping a device leaves the wall faster than it came.
fn late(wall: &mut Wall, near: &Near, _: &Subject<'_>, figures: &mut Figures) -> Result<(), Stop> {
    for late in [(1, 2), (1, 1), (2, 1)] {
        let bound = near.needed_ns_per_m(late.0 as f64 / late.1 as f64 * near.tick_s());
        thrown(wall, near, (1.02 * bound, late), &[0.02, 0.1, 0.5, 1.0], |done, it| {
            // A late force comes after contact: only the energy after it counts.
            let (more, mass) = (done.back_mj / done.first_mj - 1.0, it.device.mass_kg);
            ensure!(more <= KNOWN, "{late:?}: {mass:.3} kg come back with {more:+.4} of their energy");
            Ok(())
        })?;
        gains(wall, near, 0.8 * bound, late, figures)?;
    }
    Ok(())
}

/// Checks a floor at both rates.
fn on_floors(subject: &Subject<'_>, about: About) -> Found {
    let mut figures = Figures::default();
    for tick_hz in [500, 1000] {
        let graph = CaseGraph::new(tick_hz, 48_000)
            .node("stylus", "trajectory", &[])?
            .node("floor", "virtual_floor", &[])?
            .wire("stylus.position", "floor.position");
        let mut wall = Wall::new(subject, &graph.graph)?;
        let near = wall.walls(50.0).first().map(|spot| wall.near(*spot)).expect("a wall")?;
        about(&mut wall, &near, subject, &mut figures)?;
    }
    Ok(figures.to_string())
}

/// A check holds for the built-in floor.
fn holds_on_floors(about: About) -> Subject<'static> {
    let subject = Subject::new(asperity_nodes::registry()).effort(Effort::Full);
    println!("{}", on_floors(&subject, about).expect("it holds"));
    subject
}

/// A check fails for a floor that is changed by the place and the force, for a reason with these words.
fn fails_on<M: Default + Send + 'static>(
    subject: &Subject<'_>,
    about: About,
    why: &str,
    change: impl Fn(&mut M, &mut Tick<'_>, f64, f64) + Clone + Send + Sync + 'static,
) {
    let floor = with_memory(subject.kind("virtual_floor").expect("the kind"), move |memory: &mut M, tick| {
        let (z, force) = (tick.inputs.control(0)[2], tick.outputs.control(0)[0]);
        change(memory, tick, z, force);
    });
    match on_floors(&subject.clone().with(floor), about) {
        Err(Stop::Failed(found)) => assert!(found.contains(why), "another reason: {found}"),
        other => panic!("the mutant passes, {why}: {other:?}"),
    }
}

/// A tick late.
fn by_a_tick(before: &mut f64, tick: &mut Tick<'_>, _: f64, force: f64) {
    tick.outputs.set(0, std::mem::replace(before, force));
}

/// Pushes harder on the way out than on the way in.
fn springs((before, out): &mut (f64, bool), tick: &mut Tick<'_>, z: f64, force: f64) {
    if z != *before {
        *out = z > *before;
    }
    *before = z;
    if force > 0.0 && *out {
        tick.outputs.set(0, force + 0.04);
    }
}

/// Pushes harder from tick `from` on, in every other stretch of so many ticks.
fn rocks(
    from: u64,
    ticks: u64,
    more_n: f64,
) -> impl Fn(&mut (), &mut Tick<'_>, f64, f64) + Clone + Send + Sync + 'static {
    move |(), tick, _, force| {
        if force > 0.0 && tick.index > from && (tick.index / ticks).is_multiple_of(2) {
            tick.outputs.set(0, force + more_n);
        }
    }
}

/// Answers the place of half a tick later for long ways in a tick: less energy is made.
fn by_way(from_mm: f64) -> impl Fn(&mut f64, &mut Tick<'_>, f64, f64) + Clone + Send + Sync + 'static {
    move |before, tick, z, force| {
        let way = z - std::mem::replace(before, z);
        if force > 0.0 && way.abs() > from_mm {
            tick.outputs.set(0, (force - 0.25 * way).max(0.0));
        }
    }
}

#[test]
fn wall_outside_its_bound_makes_energy() {
    let subject = holds_on_floors(outside);
    // At all speeds, and at high speeds only.
    fails_on(&subject, outside, "to Hooke's force", by_way(0.0));
    fails_on(&subject, outside, "off the closed form", by_way(0.01));
}

#[test]
fn wall_inside_its_bound_makes_no_energy() {
    let subject = holds_on_floors(inside);
    fails_on(&subject, inside, "the bound is", by_a_tick);
    fails_on(&subject, inside, "takes out", springs);
    // Some time after it has begun.
    fails_on(&subject, inside, "of its energy at first", rocks(600, 22, 0.2));
}

#[test]
fn wall_late_counts_as_its_delay() {
    let subject = holds_on_floors(late);
    fails_on(&subject, late, "of their energy", by_a_tick);
}

#[test]
fn wall_in_steps_trembles_within_its_bounds() {
    let subject = holds_on_floors(quantum::below);
    fails_on(&subject, quantum::below, "borders of steps", springs);
    // As it swings, some time after it has begun.
    fails_on(&subject, quantum::below, "tremble by", rocks(3000, 22, 0.05));
    // Softer for a stylus that has been in it from the first tick on.
    fails_on(&subject, quantum::below, "instead of", |soft: &mut bool, tick, _, force| {
        if tick.index == 0 {
            *soft = force > 0.0;
        }
        if *soft {
            tick.outputs.set(0, 0.99 * force);
        }
    });
    // Where it is nearly 8.3 steps deep it pushes as if it were just that.
    fails_on(&subject, quantum::below, "lie still between two steps", |(): &mut (), tick, z, _| {
        if tick.index > 3000 && (-z / 0.055 - 8.3).abs() < 2.0 {
            tick.outputs.set(0, 8.3 * 0.055 * 0.5);
        }
    });
}

#[test]
fn wall_in_steps_is_held_by_friction() {
    let subject = holds_on_floors(quantum::above);
    fails_on(&subject, quantum::above, "still moves", rocks(500, 10, 0.1));
}

#[test]
fn wall_under_a_hand_makes_no_energy() {
    let subject = holds_on_floors(under_a_hand);
    // 30 ticks late, from tick 500 on: more than a hand's damping bears.
    fails_on(&subject, under_a_hand, "kg of hand", |before: &mut [f64; 31], tick, _, force| {
        before.rotate_right(1);
        before[0] = force;
        if tick.index > 500 {
            tick.outputs.set(0, before[30]);
        }
    });
}
