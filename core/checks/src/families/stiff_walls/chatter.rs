//! A device that falls on the walls of a graph and rests there.
//!
//! Each bounce leaves e^(-pi z) of the speed, until the device no longer leaves the wall: v m w < f. Where
//! two walls meet and one of them is felt at a time, they take turns: a force of the push's size P changes
//! its side when one is h deeper than the other. A turn gives P h sqrt(2), and between two turns the damping
//! takes 2 b v^3 m / (3 P), as with friction that turns late. So the speed is at most the cube root of 3
//! sqrt(2) h P^2 / (2 b m), and two ticks of the push.

use std::f64::consts::PI;

use super::quantum;
use crate::case::{Figures, Found, applicable};
use crate::handle::{Device, Handle, Loop};
use crate::subject::Subject;
use crate::wall::{Column, Near, Spot, Wall, pitch_mm};

/// Push on the device \[N\].
const PUSH_N: f64 = 0.3;
/// Height of the fall \[mm\].
const HEIGHT_MM: f64 = 2.0;
/// Steps of the device per tick.
const STEPS: usize = 5;
/// Time that it has to come to rest, and time without motion that counts as rest \[s\].
const TIME_S: (f64, f64) = (6.0, 0.3);
/// Default hysteresis between two walls \[mm\]: so much deeper must one be to be felt instead of the other.
const HYSTERESIS_MM: f64 = 0.1;

/// The last place of a level wall before its end or another wall.
struct Edge {
    on_mm: [f64; 2],
    /// The direction of a higher wall that makes a corner with it.
    corner: Option<[f64; 2]>,
}

/// Edges on lines between columns.
fn edges(wall: &mut Wall, columns: &[Column], most: usize) -> Vec<Edge> {
    let mut pairs: Vec<(Spot, [f64; 2], Option<[f64; 2]>)> = Vec::new();
    for column in columns {
        let Some(spot) = column.spot else { continue };
        for other in columns {
            let (dx, dy) = (other.at[0].abs_diff(column.at[0]), other.at[1].abs_diff(column.at[1]));
            if dx + dy == 1 && !other.spot.is_some_and(|s| s.goes_on(&spot)) {
                let higher = other.spot.is_some_and(|s| s.foot_mm[2] > spot.foot_mm[2] + 1.0);
                let way = [0, 1].map(|k| {
                    (other.foot_mm[k] - column.foot_mm[k]).signum() * f64::from(other.at[k] != column.at[k])
                });
                pairs.push((spot, other.foot_mm, higher.then_some(way)));
            }
        }
    }
    let step = pairs.len().div_ceil(most.max(1)).max(1);
    let mut all = Vec::new();
    for (spot, out, corner) in pairs.into_iter().step_by(step) {
        let [mut on, mut off] = [[spot.foot_mm[0], spot.foot_mm[1]], out];
        for _ in 0..24 {
            let middle = [0.5 * (on[0] + off[0]), 0.5 * (on[1] + off[1])];
            let goes_on = wall.down(middle).is_some_and(|s| s.goes_on(&spot));
            *if goes_on { &mut on } else { &mut off } = middle;
        }
        all.push(Edge { on_mm: on, corner });
    }
    all
}

/// Figures of a fall.
#[derive(Default)]
struct Rest {
    /// Number of times that contact was made, and broken.
    makes: u32,
    breaks: u32,
    /// Changes in the last half of the time.
    late: u32,
    /// Turns of the normal in the last half, and the speed of the device then \[mm/s\].
    turns: u32,
    fast_mm_s: f64,
    /// It went over an edge.
    fell: bool,
}

fn fall(wall: &mut Wall, device: Device, from_mm: [f64; 3], push_n: [f64; 3]) -> Rest {
    wall.reset();
    let tick_hz = wall.tick_hz();
    let mut axes = from_mm.map(|x| {
        let handle = Handle::new(device, None, 1.0 / tick_hz / STEPS as f64);
        let mut it = Loop::new(handle, STEPS, 0, quantum::STEP_MM);
        it.handle.put(x, 0.0, 0.0);
        it
    });
    let (mut rest, mut touched, mut normal) = (Rest::default(), false, [0.0; 3]);
    let (ticks, still) = ((TIME_S.0 * tick_hz) as u64, (TIME_S.1 * tick_hz) as u64);
    let mut since = 0;
    for tick in 0..ticks {
        let force = wall.at(std::array::from_fn(|k| axes.get(k).map_or(0.0, Loop::seen_mm)));
        let (now, last) = (wall.touched_n() > 0.0, 2 * tick >= ticks);
        let before = std::mem::replace(&mut normal, wall.normal());
        if now != touched {
            rest.makes += u32::from(now);
            rest.breaks += u32::from(!now);
            rest.late += u32::from(last);
            touched = now;
        }
        for ((axis, force), push) in axes.iter_mut().zip(force).zip(push_n) {
            axis.tick(|_| force, push, |_| {});
        }
        let fast = axes.iter().map(|axis| axis.handle.v_mm_s().abs()).fold(0.0, f64::max);
        if last {
            let along: f64 = (0..3).map(|k| normal[k] * before[k]).sum();
            rest.turns += u32::from(now && along < 0.9);
            rest.fast_mm_s = rest.fast_mm_s.max(fast);
        }
        let [.., z] = &axes;
        rest.fell = z.handle.x_mm() < from_mm[2] - 30.0;
        since = if fast == 0.0 { since + 1 } else { 0 };
        if rest.fell || since > still {
            break;
        }
    }
    rest
}

pub(super) fn rests(subject: &Subject<'_>) -> Found {
    let mut wall = Wall::of_graph(subject)?;
    let mut columns = wall.columns(pitch_mm(subject));
    let mut level: Vec<Spot> = Vec::new();
    for spot in columns.iter().filter_map(|c| c.spot).filter(|s| s.normal[2] > 1.0 - 1e-9) {
        if !level.iter().any(|known| known.alike(&spot)) {
            level.push(spot);
        }
    }
    let near = level.iter().map(|spot| wall.near(*spot));
    let near: Vec<Near> = applicable(near, "no level wall was found in this graph")?;
    // The device falls through a wall that does not push out.
    level.retain(|spot| !near.iter().any(|n| n.spot.alike(spot)));
    for column in &mut columns {
        column.spot = column.spot.filter(|s| !level.iter().any(|through| through.alike(s)));
    }
    let most = |of: fn(&Near) -> f64| near.iter().map(of).fold(0.0, f64::max);
    let (needed, dry) = (most(|n| n.needed_ns_per_m(0.0)), most(quantum::needed_n));
    let stiffest = most(|n| n.law.stiffness_n_per_mm);
    let device = Device { mass_kg: 0.1, damping_ns_per_m: 2.0 * needed, friction_n: 1.5 * dry };
    // Its speed at the wall without damping.
    let fast = (2e-3 * PUSH_N * HEIGHT_MM / device.mass_kg).sqrt();
    let (k, sampled) = (1e3 * stiffest, needed);
    let z = (device.damping_ns_per_m - sampled) / (2.0 * (k * device.mass_kg).sqrt());
    let bounces = (fast * (k * device.mass_kg).sqrt() / PUSH_N).ln().max(0.0) / (PI * z);
    let bound = 2 + bounces.ceil() as u32;
    let (b, m, tick_s) = (device.damping_ns_per_m, device.mass_kg, near.first().map_or(0.0, Near::tick_s));
    let fastest = 1e3
        * ((1.5e-3 * 2.0_f64.sqrt() * HYSTERESIS_MM * PUSH_N * PUSH_N / (b * m)).cbrt()
            + 2.0 * PUSH_N * tick_s / m);
    let edges = edges(&mut wall, &columns, subject.by_effort(4, 16, 400));
    let down = [0.0, 0.0, -PUSH_N];
    let mut falls: Vec<([f64; 2], [f64; 3])> = Vec::new();
    for Edge { on_mm, corner } in &edges {
        // On the edge, beside it by parts of a step of the sensor, and well on the wall.
        falls.extend([0.0, 0.4, -0.4, 3.0].map(|part| (on_mm.map(|x| x + part * quantum::STEP_MM), down)));
        if let Some(way) = corner {
            // Pressed into the corner.
            let push = [way[0], way[1], -1.0].map(|x| PUSH_N * x * 0.5_f64.sqrt());
            falls.push(([0, 1].map(|k| on_mm[k] - way[k] * HEIGHT_MM), push));
        }
    }
    let middles = subject.by_effort(2, 8, 100);
    falls.extend(near.iter().take(middles).map(|n| ([n.spot.foot_mm[0], n.spot.foot_mm[1]], down)));
    let mut figures = Figures::default();
    for (at, push) in &falls {
        let top = wall.down(*at).map_or(0.0, |s| s.foot_mm[2]);
        let Rest { makes, breaks, late, turns, fast_mm_s, fell } =
            fall(&mut wall, device, [at[0], at[1], top + HEIGHT_MM], *push);
        let into = if push[0] == 0.0 && push[1] == 0.0 { "" } else { " into a corner" };
        let here = format!("at x {:.2}, y {:.2} mm{into}", at[0], at[1]);
        ensure!(
            makes <= bound,
            "{here} contact is made {makes} times and broken {breaks}; the bound is {bound}"
        );
        figures.note(f64::from(makes) / f64::from(bound), "of the contacts that are allowed");
        ensure!(late == 0, "{here} contact is still made or broken {late} times in the last half of 6 s");
        if turns > 0 && !fell {
            ensure!(
                fast_mm_s <= fastest,
                "{here} two sides take turns at {fast_mm_s:.1} mm/s; the bound is {fastest:.1}"
            );
            figures.note(fast_mm_s, "mm/s where two sides take turns");
        }
    }
    wall.sound()?;
    Ok(format!("{} falls, on {} edges: {figures}", falls.len(), edges.len()))
}
