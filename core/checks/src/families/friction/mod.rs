//! Friction and drag: forces that may only take.
//!
//! Of every kind in the registry that answers a velocity in a slot with a force, between a stylus and nothing else, at every tick rate. The built-in kinds by
//! several laws: viscous, Dahl's, LuGre's, soft and stiff; a plugin's as it is without parameters, if it needs none.

mod own;
mod rubbed;

use std::f64::consts::{PI, TAU};

use asperity_node::random;
use asperity_scene::effect::passivity::{Law, Passivity, Sampling};

use crate::case::{Case, Family, Found, Not, holds, not_applicable};
use crate::handle::{Device, Handle, Loop};
use crate::subject::Subject;
use rubbed::{Rub, Rubbed, all};

pub(super) const CASES: &[Case] = &[
    Family::Friction.case(
        "friction_takes_energy",
        false,
        |s| each(s, &[1e-9, 1e-3, 1.0, 1e4], None, takes),
        [
            "velocities that turn through zero, creep, stop and jump, under a normal force of 1e-9 to 1e4 N that changes, at tick rates from 100 to 4000 Hz",
            "the force is finite and at no time has it given more than it took: the sum of -F v T is never below 0 (1e-9 of what went to and fro)",
        ],
    ),
    Family::Friction.case(
        "friction_is_quiet_at_rest",
        false,
        |s| each(s, &[1e-9, 1.0, 1e4], None, quiet),
        [
            "a stylus that rests, but for a way of 1e-9 mm for each N of normal force to and fro in every tick",
            "no step of Coulomb's force: at most what stiffness and damping at rest make of that way, K x + B x/T, within 1 %",
        ],
    ),
    Family::Friction.case(
        "friction_inside_its_bound",
        false,
        |s| each(s, &[1e-9, 0.3, 3.3, 1e4], None, inside),
        [
            "a device of 0.1 kg that slides at 100 mm/s is stopped by friction with its steps in time, on 5 % and 50 % more damping of its own than K T/2 + B, the bristle's stiffness being the K",
            "its energy never grows; with 50 % more it stops, but for 0.01 mm/s, within 40 m / (b + B - K T/2), where that is below 4 s, and until it moves by a millionth the force changes its sign at most 2 + 6 ln 10 (1 / (pi z) + 1 / ln(b / B)) times, z = (b + B - K T/2) / (2 sqrt(K m)), and a quarter more for rates near the swing",
        ],
    ),
    Family::Friction.case(
        "friction_beyond_its_bound",
        false,
        |s| each(s, &[30.0, 1e3, 1e4], Some(LIMIT_N), beyond),
        [
            "the same on 0.1 N s/m under up to 1e4 N, behind a force limiter of 3.3 N: no device bears such a law, it chatters",
            "no faster than F sqrt(3 T / (b m)) + 2 F T / m from half a second on: what a force that turns a tick late gives on every turn, 2 F v T at most, against what the damping takes until the next, 2 b v^3 m / (3 F); and a tick or two of the force",
        ],
    ),
    Family::Friction.case(
        "own_friction",
        true,
        own::rubs,
        [
            "a stylus rubs over the level walls of the graph with 0.3 N and with the most that they push, and a device slides there on 5 % more damping than K T/2 + B as the force along the surface is found",
            "friction takes and never gives; the device's energy never grows",
        ],
    ),
];

/// Something about a law that runs, under a normal force.
type About = fn(&mut Rubbed, &Rub, f64, &Subject<'_>) -> Result<f64, Not>;

/// Asks it of all laws, rates and normal forces; they answer a figure of which the largest is told.
fn each(subject: &Subject<'_>, normals_n: &[f64], limit_n: Option<f64>, about: About) -> Found {
    let laws = all(subject);
    if laws.is_empty() {
        return not_applicable("there is no kind of friction or drag");
    }
    let rates: &[u32] = subject.by_effort(
        &[100, 500, 4000],
        &[100, 250, 500, 1000, 2000, 4000],
        &[100, 125, 200, 250, 333, 400, 500, 700, 1000, 1500, 2000, 3000, 4000],
    );
    let mut found = Vec::new();
    for rub in &laws {
        let mut most = f64::MIN;
        for &tick_hz in rates {
            let mut it = Rubbed::new(subject, rub, tick_hz, limit_n)?;
            for &normal in normals_n {
                let figure = about(&mut it, rub, normal, subject)
                    .map_err(|e| e.after(&format!("{} at {tick_hz} Hz, {normal:e} N", rub.name)))?;
                most = most.max(figure);
            }
            it.sound()?;
        }
        found.push(format!("{} {most:.3e}", rub.name));
    }
    Ok(format!("at {} rates, at most: {}", rates.len(), found.join(", ")))
}

/// Ways along a surface by time \[mm\], and what the normal force is times; all begin at rest at 0.
type Way = fn(f64) -> ([f64; 2], f64);

const WAYS: [Way; 6] = [
    // To and fro, slowly and fast, far and near.
    |t| ([20.0 * (1.0 - (TAU * t).cos()), 0.0], 1.0),
    |t| ([0.3 * (1.0 - (TAU * 13.0 * t).cos()), 0.1 * (TAU * 7.0 * t).sin().powi(2)], 1.0),
    // Round a circle, so that the speed never is 0, and pressed in turns.
    |t| ([5.0 * (1.0 - (9.0 * t).cos()), 5.0 * (9.0 * t).sin()], 0.5 + 0.5 * (31.0 * t).sin()),
    // Creeping and back.
    |t| ([1e-3 * (1.0 - (TAU * 2.0 * t).cos()), 0.0], 1.0 + 0.9 * (50.0 * t).sin()),
    // Stop and go, the normal force gone at times.
    |t| {
        let part = (4.0 * t).fract();
        ([10.0 * (4.0 * t).floor() + 10.0 * (2.0 * part).min(1.0), 0.0], if part > 0.9 { 0.0 } else { 1.0 })
    },
    // By chance.
    |t| {
        let random = |k| random::uniform(0xf41c, (1e5 * t) as u64 * 3 + k);
        ([4.0 * random(0) - 2.0, 1e-3 * random(1)], 2.0 * random(2))
    },
];

/// Answers the least part of what went to and fro that the force has taken up to any time, below 0 what it gave; with its sign turned.
fn takes(it: &mut Rubbed, _rub: &Rub, normal_n: f64, subject: &Subject<'_>) -> Result<f64, Not> {
    let ticks = (subject.by_effort(0.3, 1.0, 20.0) * f64::from(it.tick_hz)) as u64;
    let mut worst = f64::MIN;
    for way in WAYS {
        it.begin(normal_n);
        let (mut before, mut sum, mut sizes) = ([0.0; 2], 0.0, 0.0);
        let tick_s = it.tick_s();
        for tick in 1..=ticks {
            let (place, part) = way(tick as f64 * tick_s);
            let force = it.at(place, part * normal_n);
            holds(force.iter().all(|f| f.is_finite()), || "the force is not finite".to_owned())?;
            let taken: f64 = (0..2).map(|k| -force[k] * (place[k] - before[k])).sum();
            before = place;
            sum += taken;
            sizes += taken.abs();
            holds(sum >= -1e-9 * sizes, || {
                format!("after {tick} ticks it has given {:.3e} mJ of {sizes:.3e}", -sum)
            })?;
            if sizes > 0.0 {
                worst = worst.max(-sum / sizes);
            }
        }
    }
    Ok(worst)
}

/// Answers the largest force over what stiffness and damping at rest say.
fn quiet(it: &mut Rubbed, rub: &Rub, normal_n: f64, _subject: &Subject<'_>) -> Result<f64, Not> {
    let law = it.law(rub, normal_n)?;
    let size = 1e-9 * normal_n;
    let most = (law.stiffness_n_per_mm + 1e-3 * law.damping_ns_per_m / it.tick_s()) * size;
    it.begin(normal_n);
    let mut largest = 0.0_f64;
    for tick in 0..200_u32 {
        let x = if tick.is_multiple_of(2) { size } else { 0.0 };
        largest = largest.max(it.at([x, 0.0], normal_n)[0].abs());
    }
    holds(largest <= 1.01 * most, || {
        format!("it answers with {largest:.3e} N; the law at rest says {most:.3e}")
    })?;
    Ok(largest / most)
}

/// A slide into rest.
struct Slide {
    /// The most kinetic energy there was, over that at first.
    most: f64,
    /// What is left of the speed \[mm/s\].
    last_mm_s: f64,
    /// How often the force has changed its sign.
    turns: u32,
}

/// How far the closed form of a swing is off where a swing takes few ticks.
const NEARLY: f64 = 1.25;
const MASS_KG: f64 = 0.1;
const SPEED_MM_S: f64 = 100.0;

fn slide(force: &mut dyn FnMut(f64) -> f64, device: Device, tick_hz: f64, ticks: u64) -> Slide {
    let mut servo = Loop::new(Handle::new(device, None, 1.0 / tick_hz), 1, 0, 0.0);
    servo.handle.put(0.0, SPEED_MM_S, 0.0);
    let first = servo.handle.energy_mj();
    let mut it = Slide { most: 0.0, last_mm_s: 0.0, turns: 0 };
    let (mut largest, mut sign) = (0.0_f64, 0.0);
    for tick in 0..ticks {
        let mut now = 0.0;
        servo.tick(
            |x| {
                now = force(x);
                now
            },
            0.0,
            |_| {},
        );
        it.most = it.most.max(servo.handle.energy_mj() / first);
        largest = largest.max(now.abs());
        // What is as small as that is rest.
        if now.abs() > 1e-6 * largest {
            it.turns += u32::from(sign * now < 0.0);
            sign = now.signum();
        }
        if 10 * tick >= 9 * ticks {
            it.last_mm_s = it.last_mm_s.max(servo.handle.v_mm_s().abs());
        }
    }
    it
}

/// The damping that a device needs for a law \[N s/m\].
fn needed(law: Law, tick_hz: f64) -> f64 {
    Passivity::of(law, Sampling { tick_hz, delay_s: 0.0 }, 0.0).needed_ns_per_m
}

/// Answers how often the force changed its sign over how often it may.
fn inside(it: &mut Rubbed, rub: &Rub, normal_n: f64, _subject: &Subject<'_>) -> Result<f64, Not> {
    let law = it.law(rub, normal_n)?;
    let (tick_hz, bound) = (f64::from(it.tick_hz), needed(law, f64::from(it.tick_hz)));
    let mut figure = 0.0;
    for part in [1.05, 1.5] {
        let device = Device { mass_kg: MASS_KG, damping_ns_per_m: part * bound, friction_n: 0.0 };
        let k = 1e3 * law.stiffness_n_per_mm;
        let spare = device.damping_ns_per_m + law.damping_ns_per_m - 0.5 * k / tick_hz;
        let z = spare / (2.0 * (k * MASS_KG).sqrt());
        // As long as its swings, or without a spring its speed, take to fall to 1e-6; no longer than some seconds.
        let rest_s = (40.0 * MASS_KG / spare).min(4.0);
        it.begin(normal_n);
        let ticks = ((rest_s * tick_hz) as u64).max(20);
        let slid = slide(&mut |x| it.at([x, 0.0], normal_n)[0], device, tick_hz, ticks);
        holds(slid.most <= 1.0 + 1e-9, || {
            format!("{part} times {bound:.4} N s/m: {:.6} of its energy at first", slid.most)
        })?;
        if part > 1.1 {
            // A spring's swings, and a damper that answers a tick late: each takes that part of the one before.
            let swings = if z > 0.0 && z < 1.0 { 1.0 / (PI * z) } else { 0.0 };
            let rattles = 1.0 / (device.damping_ns_per_m / law.damping_ns_per_m).ln();
            let rattles = if rattles.is_finite() { rattles } else { 0.0 };
            let bound = NEARLY * (2.0 + 6.0 * 10.0_f64.ln() * (swings + rattles));
            holds(f64::from(slid.turns) <= bound, || {
                format!("its force changes its sign {} times; the bound is {bound:.0}", slid.turns)
            })?;
            holds(rest_s >= 4.0 || slid.last_mm_s <= 1e-4 * SPEED_MM_S, || {
                format!("it still moves with {:.3e} mm/s after {rest_s:.2} s", slid.last_mm_s)
            })?;
            figure = f64::from(slid.turns) / bound;
        }
    }
    Ok(figure)
}

/// What a device that pushes back may push with \[N\].
const LIMIT_N: f64 = 3.3;

/// Answers the speed that is left over its bound.
fn beyond(it: &mut Rubbed, _rub: &Rub, normal_n: f64, subject: &Subject<'_>) -> Result<f64, Not> {
    let tick_hz = f64::from(it.tick_hz);
    let device = Device { mass_kg: MASS_KG, damping_ns_per_m: 0.1, friction_n: 0.0 };
    let (mass, damping) = (device.mass_kg, device.damping_ns_per_m);
    let bound = 1e3 * LIMIT_N * ((3.0 / (tick_hz * damping * mass)).sqrt() + 2.0 / (tick_hz * mass));
    let stops_s = 0.5;
    let look_s = subject.by_effort(0.5, 2.0, 60.0);
    it.begin(normal_n);
    let mut servo = Loop::new(Handle::new(device, None, 1.0 / tick_hz), 1, 0, 0.0);
    servo.handle.put(0.0, SPEED_MM_S, 0.0);
    let mut fastest = 0.0_f64;
    let ticks = ((stops_s + look_s) * tick_hz) as u64;
    for tick in 0..ticks {
        servo.tick(|x| it.at([x, 0.0], normal_n)[0], 0.0, |_| {});
        if tick as f64 >= stops_s * tick_hz {
            fastest = fastest.max(servo.handle.v_mm_s().abs());
        }
    }
    holds(fastest <= bound, || format!("{fastest:.1} mm/s; the bound is {bound:.1}"))?;
    Ok(fastest / bound)
}
