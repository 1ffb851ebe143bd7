//! Slow motion, and none, at a gate that opens at a speed.

use std::f64::consts::{FRAC_PI_4, SQRT_2, TAU};

use asperity_node::random;

use super::stage::{Next, Stage};
use crate::case::{Found, holds};
use crate::subject::Subject;

/// One count of a usual sensor \[mm\].
const COUNT_MM: f64 = 0.055;
/// How long a start takes \[s\].
const START_S: f64 = 0.5;
/// A sensor without steps, along its first axis.
const IDEAL: (f64, f64) = (0.0, 0.0);
const ALWAYS: (f64, f64) = (0.0, f64::INFINITY);
/// Longest time between two flickers \[ticks\].
const PERIODS: u64 = 60;

pub(super) fn one_count(subject: &Subject<'_>) -> Found {
    let mut stage = Stage::new(subject)?;
    let opens = stage.opens_mm_s()?;
    let ticks = (subject.by_effort(0.3, 1.0, 10.0) * stage.tick_hz()) as u64;
    // 5 % for axes that flicker in turns.
    let bound = stage.cutoff_hz().map(|hz| 1.05 * SQRT_2 * COUNT_MM * TAU * hz * (-FRAC_PI_4).exp());
    let mut fastest = (0.0, String::new());
    let mut hold = |how: String, on: &dyn Fn(u64) -> [bool; 2]| {
        let [heard] = stage.play([ALWAYS], |tick| {
            let at = on(tick).map(|on| if on { COUNT_MM } else { 0.0 });
            (tick < ticks).then_some(Next::At(at, true))
        })?;
        let speed = heard.speed.map_or(0.0, |(_, most)| most);
        holds(bound.is_none_or(|most| speed <= most), || {
            format!("flickering {how}, up to {speed:.2} mm/s: {:.2} are allowed", bound.unwrap_or_default())
        })?;
        holds(heard.open == 0, || {
            format!("flickering {how}, up to {speed:.2} mm/s, opens the gate of {opens} mm/s")
        })?;
        if speed > fastest.0 {
            fastest = (speed, how);
        }
        Ok::<_, crate::Not>(())
    };
    hold("once".into(), &|tick| [tick >= 20; 2])?;
    for period in (1..=PERIODS).step_by(subject.by_effort(5, 1, 1)) {
        hold(format!("every {period} ticks"), &|tick| [(tick / period) % 2 == 1; 2])?;
        hold(format!("in turns every {period} ticks"), &|tick| {
            [(tick / period) % 2 == 1, (tick / period.div_ceil(2)) % 2 == 1]
        })?;
    }
    for seed in 0..subject.by_effort(3, 20, 500) {
        // Now often, now rarely.
        let share = 0.5 / (1.0 + seed as f64);
        hold("by chance".into(), &|tick| [0, 1].map(|axis| random::uniform(seed, 2 * tick + axis) < share))?;
    }
    let allowed = bound.map_or_else(String::new, |most| format!(" ({most:.2} are allowed)"));
    Ok(format!(
        "the gate of {opens} mm/s stays shut; {:.2} mm/s at most, flickering {}{allowed}",
        fastest.0, fastest.1
    ))
}

pub(super) fn around(subject: &Subject<'_>) -> Found {
    let mut stage = Stage::new(subject)?;
    let (opens, hz) = (stage.opens_mm_s()?, stage.tick_hz());
    let seen = |x: f64, count: f64| if count > 0.0 { (x / count).round() * count } else { x };
    // From a side of the spot over it, so that the way is on the wall.
    let straight =
        |stage: &mut Stage, seconds: f64, (count, angle): (f64, f64), speed: &dyn Fn(f64) -> f64| {
            let mut along = -0.5 * opens * seconds;
            let all = stage.play([ALWAYS], |tick| {
                let t = tick as f64 / hz;
                let at = [angle.cos(), angle.sin()].map(|part| seen(along * part, count));
                // A start at once would overshoot by 4 % behind the low-pass.
                along += (t / START_S).min(1.0) * speed(t) / hz;
                (t < seconds).then_some(Next::At(at, true))
            })?;
            let [heard] = all;
            Ok::<_, crate::Not>(heard)
        };
    let slow = straight(&mut stage, 2.0, IDEAL, &|_| 0.98 * opens)?;
    holds(slow.open == 0, || format!("at {:.2} mm/s the gate of {opens} opens", 0.98 * opens))?;
    let fast = straight(&mut stage, 2.0, IDEAL, &|_| 1.02 * opens)?;
    holds(fast.changes == 1 && fast.changed as f64 <= (START_S + 0.3) * hz, || {
        format!(
            "at {:.2} mm/s the gate of {opens} changes {} times, the last after {:.2} s",
            1.02 * opens,
            fast.changes,
            fast.changed as f64 / hz
        )
    })?;
    // No longer: 60 s are 300 mm, and lead off the surfaces of a scene, where the gate shuts by right.
    let turns = subject.by_effort(2.0, 4.0, 8.0);
    let between = straight(&mut stage, turns, IDEAL, &|t| {
        if ((t / 0.25) as u64).is_multiple_of(2) { 1.02 * opens } else { 0.98 * opens }
    })?;
    holds(between.changes == 1, || {
        format!("now faster, now slower the gate changes {} times", between.changes)
    })?;
    let mut most = 0;
    let (speeds, angles) = subject.by_effort((7, 2), (25, 4), (121, 19));
    let between = |n: u32, of: u32, from: f64, to: f64| from + (to - from) * f64::from(n) / f64::from(of - 1);
    let all = (0..angles).flat_map(|a| (0..speeds).map(move |s| (s, a)));
    let all = all.map(|(s, a)| (between(s, speeds, 0.5, 1.1), between(a, angles, 0.0, 45.0)));
    for (speed, degrees) in all.chain([(0.98, 0.0), (1.02, 0.0)]) {
        let steps = straight(&mut stage, turns, (COUNT_MM, degrees.to_radians()), &|_| speed * opens)?;
        holds(steps.changes <= 1, || {
            format!(
                "at {:.2} mm/s in steps, at {degrees:.0} degrees to them, the gate changes {} times",
                speed * opens,
                steps.changes
            )
        })?;
        most = most.max(steps.changes);
    }
    Ok(format!(
        "the gate of {opens} mm/s stays shut at {:.2} and opens at {:.2} after {:.0} ms; between them it changes once, in steps {most} times at most",
        0.98 * opens,
        1.02 * opens,
        1e3 * fast.changed as f64 / hz
    ))
}
