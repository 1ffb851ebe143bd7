//! Walls: what a sampled wall gives to a device that is held by nobody, or by a hand.
//!
//! Every wall here is that of a graph, and the device is simulated around it ([`crate::handle`]). Walls of a kind are floors of all kinds in the registry
//! that are one, at 500 and 1000 Hz; a user's own is what the graph answers to its stylus, at its own rate.

mod chatter;
mod energy;
mod quantum;
mod under_a_hand;

use asperity_scene::effect::passivity::Passivity;

use crate::case::{Case, Family, Found, Not, applicable, holds, not_applicable};
use crate::handle::Device;
use crate::subject::Subject;
use crate::wall::{Near, Wall, floors, pitch_mm};

use energy::{Fall, Fallen, Swings, by_chance, fall, swings};

/// Rates at which walls of a kind are looked at \[Hz\].
const RATES_HZ: [u32; 2] = [500, 1000];

pub(super) const CASES: &[Case] = &[
    Family::StiffWalls.case(
        "wall_inside_its_bound",
        false,
        |s| each_floor(s, inside),
        [
            "a device without a hand is thrown at a wall and falls on it, with 2 % more damping than b = K T/2 + B, the wall's steps in time read by an ideal sensor",
            "no energy: in no tick have device and wall together more than at first (1e-4: the wall's energy is measured); with twice the damping it lies still after 60 m / b",
        ],
    ),
    Family::StiffWalls.case(
        "wall_outside_its_bound",
        false,
        |s| floor(s, "virtual_floor", outside),
        [
            "the same with less damping than the bound: were none made there, the case inside would show nothing",
            "energy is made: motions of constant speed from tick to tick take out within 0.1 % of what K T/2 stands for at every frequency, and a device with 0.8 of that damping leaves the wall faster than it came",
        ],
    ),
    Family::StiffWalls.case(
        "wall_late",
        false,
        |s| each_floor(s, late),
        [
            "forces come 1/2, 1 and 2 ticks late",
            "a delay counts as K t_d: with 2 % more damping than K (T/2 + t_d) + B no energy is made, with 0.8 of it a device leaves the wall faster than it came",
        ],
    ),
    Family::StiffWalls.case(
        "wall_in_steps",
        false,
        |s| each_floor(s, quantum::below),
        [
            "the sensor tells places in steps D = 0.055 mm, and the device's dry friction c is below K D / 2 (13.8 mN at 0.5 N/mm): the wall trembles",
            "on 1.5 and 4 times the damping b that is needed, once 40 m / (b - K T/2) have gone by, it trembles within a tenth no further than (D/2 + c/K) coth(pi z / (2 sqrt(1 - z^2))) around rest, z = (b - K T/2) / (2 sqrt(K m)), and no faster (rms) than (K D / 2 - c) / (b - K T/2); at rest between two steps a device without dry friction is no slower than f / b sqrt(1 - tanh(s/2) / (s/2)), f the least that K D is off there, s = b T/m; motions to and fro over the border of a step take out what K D / 2 stands for within 0.1 %",
        ],
    ),
    Family::StiffWalls.case(
        "wall_in_steps_held_by_friction",
        false,
        |s| each_floor(s, quantum::above),
        [
            "the same with dry friction above K D / 2",
            "it lies still, to the last bit, after as many swings as friction needs for it: A K / (4 (c - K D / 2)) and one more",
        ],
    ),
    Family::StiffWalls.case(
        "wall_under_a_hand",
        false,
        |s| each_floor(s, under_a_hand::holds_on),
        [
            "a hand in a pen grip presses the device into the wall and lets it go, light and heavy, loose and firm (9 hands; 3 in a quick look, 27 in a long one)",
            "with 2 % more damping than the bound no energy is made, and it lies still to 1 um once 24 M / B of hand, device and arm have gone by (8 s of the usual hand); with a sensor in steps its rms speed is within the bound of the wall in steps",
        ],
    ),
    Family::StiffWalls.case(
        "own_wall_energy",
        true,
        |s| own(s, inside),
        [
            "a device without a hand is thrown at the graph's own walls, at the graph's own rate, with 2 % more damping than b = K (T/2 + t_d) + B, K as the force at rest has it, B as the wall tells it (more where drags add to it), t_d as the graph declares",
            "no energy: in no tick have device and wall together more than at first (1e-4: the wall's energy is measured); no motion takes out more than the bound",
        ],
    ),
    Family::StiffWalls.case(
        "own_wall_in_steps",
        true,
        |s| own(s, |w, n, s| Ok(format!("{}; {}", quantum::below(w, n, s)?, quantum::above(w, n, s)?))),
        [
            "the graph's own walls, by a sensor that tells places in steps of 0.055 mm",
            "they tremble within the bounds of a wall in steps, and lie still where dry friction is above K D / 2",
        ],
    ),
    Family::StiffWalls.case(
        "own_wall_under_a_hand",
        true,
        |s| own(s, under_a_hand::holds_on),
        [
            "a hand in a pen grip presses a device into the graph's own walls, light and heavy, loose and firm (9 hands; 3 in a quick look, 27 in a long one)",
            "no energy is made, it lies still to 1 um once 24 M / B of hand, device and arm have gone by, and with a sensor in steps its rms speed is within the bound of the wall in steps",
        ],
    ),
    Family::StiffWalls.case(
        "contact_chatter",
        true,
        chatter::rests,
        [
            "a device of 0.1 kg falls on the walls of the graph at their edges, in their middle and into their corners, and rests there under f = 0.3 N, with a sensor in steps of 0.055 mm",
            "contact is made at most 2 + ln(v m w / f) / (pi z) times, and neither made nor broken in the last half of 6 s; where what is touched takes turns, between two walls or the slopes of one, it is no faster than (3 sqrt(2) h f^2 / (2 b m))^(1/3) + 2 f T / m, h = 0.1 mm being the usual hysteresis",
        ],
    ),
];

/// Something about a wall near its surface.
type About = fn(&mut Wall, &Near, &Subject<'_>) -> Found;

/// Asks it of a kind of floor, at all rates.
fn floor(subject: &Subject<'_>, kind: &str, about: About) -> Found {
    let mut found = Vec::new();
    for tick_hz in RATES_HZ {
        let mut wall = Wall::of_floor(subject, kind, &[], tick_hz)?;
        let spot = wall.walls(50.0).into_iter().next();
        let Some(spot) = spot else { return not_applicable(format!("no wall was found of `{kind}`")) };
        let near = wall.near(spot)?;
        found.push(format!("at {tick_hz} Hz {}", about(&mut wall, &near, subject)?));
    }
    Ok(format!("`{kind}` {}", found.join("; ")))
}

/// Asks it of every kind of floor.
fn each_floor(subject: &Subject<'_>, about: About) -> Found {
    let kinds = floors(subject);
    // What needs parameters to be anything is looked at in a graph that has it.
    let plain = kinds.iter().map(|k| &k.descriptor().kind);
    let plain = plain.filter(|kind| Wall::of_floor(subject, kind, &[], RATES_HZ[0]).is_ok());
    let all = plain.map(|kind| floor(subject, kind, about));
    Ok(applicable(all, "there is no kind of floor")?.join("; "))
}

/// Asks it of the graph's own walls, those that need most damping first.
fn own(subject: &Subject<'_>, about: About) -> Found {
    let mut wall = Wall::of_graph(subject)?;
    let spots = wall.walls(pitch_mm(subject));
    let near = spots.into_iter().map(|spot| wall.near(spot));
    let mut all: Vec<Near> = applicable(near, "no wall was found in this graph")?;
    all.sort_by(|a, b| b.needed_ns_per_m(0.0).total_cmp(&a.needed_ns_per_m(0.0)));
    let Some(first) = all.first() else { return not_applicable("no wall was found in this graph") };
    let tells = format!(
        "`{}`: {:.3} N/mm and {:.3} N s/m, passive on a device with at least {:.3} N s/m",
        wall.source(),
        first.law.stiffness_n_per_mm,
        first.law.damping_ns_per_m,
        first.needed_ns_per_m(0.0),
    );
    let tells = if wall.is_handed_on() {
        format!("{tells} at the graph's rate; a device with a loop of its own bears more")
    } else {
        tells
    };
    let stiffens = all.iter().filter_map(|near| near.stiffens_mm).fold(f64::INFINITY, f64::min);
    let tells = if stiffens.is_finite() {
        format!("{tells}; a wall is stiffer from {stiffens:.2} mm on, where its shape goes on another way")
    } else {
        tells
    };
    let count = all.len();
    let mut found = Vec::new();
    for near in all.iter().take(subject.by_effort(1, 4, 16)) {
        found.push(about(&mut wall, near, subject)?);
    }
    Ok(format!("{tells} (the first of {count} that differ); {}", found.join("; ")))
}

/// Throws and drops of devices on a wall: masses that swing in it from slowly to once in a few ticks, from places all over a tick's way.
fn thrown(
    wall: &mut Wall,
    near: &Near,
    (damping_ns_per_m, late): (f64, (usize, usize)),
    radians: &[f64],
    mut each: impl FnMut(Fallen, &Fall<'_>) -> Result<(), Not>,
) -> Result<(), Not> {
    let curve = wall.curve(near);
    for &radians in radians {
        let mass_kg = near.mass_kg(radians);
        // Half as deep as Hooke's law holds.
        let speed_mm_s = 0.5 * near.deep_mm * radians / near.tick_s();
        for phase in 0..5 {
            let from_mm = (1.0 + 0.2 * f64::from(phase)) * speed_mm_s * near.tick_s();
            let device = Device { mass_kg, damping_ns_per_m, friction_n: 0.0 };
            let it =
                Fall { near, curve: &curve, device, push_n: 0.0, late, from_mm, speed_mm_s: -speed_mm_s };
            // In and out, and some way after that.
            let ticks = (20.0 + 8.0 / radians) * wall.every() as f64;
            each(fall(wall, &it, ticks as u64)?, &it)?;
        }
    }
    Ok(())
}

/// Where a wall's energy is measured, it is known so well.
const KNOWN: f64 = 1e-4;

fn inside(wall: &mut Wall, near: &Near, subject: &Subject<'_>) -> Found {
    let bound = near.needed_ns_per_m(0.0);
    let Swings { most_ns_per_m, at_hz, .. } = swings(wall, near);
    holds(most_ns_per_m <= bound * (1.0 + 1e-6), || {
        format!(
            "a motion of {at_hz:.0} Hz takes out what {most_ns_per_m:.4} N s/m stand for; the bound is {bound:.4}"
        )
    })?;
    let chance = by_chance(wall, near, subject.by_effort(10, 50, 2000));
    holds(chance <= bound * (1.0 + 1e-6), || {
        format!("a way in and out takes out what {chance:.4} N s/m stand for; the bound is {bound:.4}")
    })?;
    let damping_ns_per_m = 1.02 * bound;
    let mut worst = f64::MIN;
    let check = |done: Fallen, it: &Fall<'_>, worst: &mut f64| {
        let more = done.most_mj / done.first_mj - 1.0;
        *worst = worst.max(more);
        holds(more <= KNOWN, || {
            format!(
                "{:.3} kg with {damping_ns_per_m:.3} N s/m had {:.4} of its energy at first",
                it.device.mass_kg,
                1.0 + more
            )
        })
    };
    thrown(wall, near, (damping_ns_per_m, (0, 1)), &[0.05, 0.3, 1.0, 2.5], |done, it| {
        check(done, it, &mut worst)
    })?;
    // A fall, with bounces, for seconds.
    let curve = wall.curve(near);
    let seconds = subject.by_effort(1.0, 4.0, 600.0);
    let (mut left, mut contacts) = (0.0_f64, 0);
    for (part, seconds) in [(1.02, seconds), (2.0, 0.0)] {
        let mass_kg = near.mass_kg(0.2);
        let push_n = 0.2 * near.law.stiffness_n_per_mm * near.deep_mm;
        let device = Device { mass_kg, damping_ns_per_m: part * bound, friction_n: 0.0 };
        // What it falls through is what the spring takes half as deep as Hooke's law holds.
        let from_mm = 0.125 * near.law.stiffness_n_per_mm * near.deep_mm.powi(2) / push_n;
        let it = Fall { near, curve: &curve, device, push_n, late: (0, 1), from_mm, speed_mm_s: 0.0 };
        let seconds = if seconds > 0.0 { seconds } else { 60.0 * mass_kg / device.damping_ns_per_m };
        let done = fall(wall, &it, (seconds * wall.tick_hz()) as u64)?;
        check(done, &it, &mut worst)?;
        (left, contacts) = (done.last_mj / (done.first_mj + 1e-300), done.contacts.max(contacts));
    }
    holds(left <= 1e-6, || format!("60 m / b after a fall {left:.2e} of its energy still moves"))?;
    Ok(format!(
        "a motion takes out {:.4} of the bound at most, a way by chance {:.4}; thrown and dropped ({contacts} contacts) a device has {:+.1e} of its energy more at most",
        most_ns_per_m / bound,
        chance / bound,
        worst,
    ))
}

fn outside(wall: &mut Wall, near: &Near, _subject: &Subject<'_>) -> Found {
    let bound = near.needed_ns_per_m(0.0);
    holds(near.law.damping_ns_per_m == 0.0, || {
        format!("speed adds {:.3} N s/m to Hooke's force", near.law.damping_ns_per_m)
    })?;
    let found = swings(wall, near);
    holds(found.off_ns_per_m <= 1e-3 * bound, || {
        format!("a motion takes out what is {:.2e} N s/m off the closed form", found.off_ns_per_m)
    })?;
    holds(found.most_ns_per_m >= 0.999 * bound, || {
        format!("no motion takes out more than {:.4} N s/m; the bound is {bound:.4}", found.most_ns_per_m)
    })?;
    let gain = gained(wall, near, 0.8 * bound, (0, 1))?;
    Ok(format!(
        "every motion takes out {bound:.4} N s/m within {:.1e}; with 0.8 of it thrown devices come back with {gain:+.4} of their energy",
        found.off_ns_per_m
    ))
}

/// What devices that swing slowly in a wall come back with at least, in parts of their energy.
fn gained(wall: &mut Wall, near: &Near, damping_ns_per_m: f64, late: (usize, usize)) -> Result<f64, Not> {
    let mut least = f64::MAX;
    thrown(wall, near, (damping_ns_per_m, late), &[0.05], |done, _| {
        least = least.min(done.back_mj / done.first_mj - 1.0);
        Ok(())
    })?;
    holds(least > 0.0, || {
        format!("with {damping_ns_per_m:.3} N s/m a thrown device comes back with {least:+.4} of its energy")
    })?;
    Ok(least)
}

fn late(wall: &mut Wall, near: &Near, _subject: &Subject<'_>) -> Found {
    let mut found = Vec::new();
    for late in [(1, 2), (1, 1), (2, 1)] {
        let late_s = late.0 as f64 / late.1 as f64 * near.tick_s();
        let bound = near.needed_ns_per_m(late_s);
        let mut worst = f64::MIN;
        thrown(wall, near, (1.02 * bound, late), &[0.02, 0.1, 0.5, 1.0], |done, it| {
            // A late force has not come yet when the device is in: what counts is what it leaves with.
            let more = done.back_mj / done.first_mj - 1.0;
            worst = worst.max(more);
            holds(more <= KNOWN, || {
                format!(
                    "{:.3} kg with {:.3} N s/m, {:.1} ms late, come back with {more:+.4} of their energy",
                    it.device.mass_kg,
                    1.02 * bound,
                    1e3 * late_s
                )
            })
        })?;
        let gain = gained(wall, near, 0.8 * bound, late)?;
        let told = Passivity::of(near.law, near.sampling, bound);
        found.push(format!(
            "{:.1} ms late {bound:.3} N s/m are needed ({:.3} without), and 0.8 of it give {gain:+.4}",
            1e3 * late_s,
            told.needed_ns_per_m
        ));
    }
    Ok(found.join(", "))
}
