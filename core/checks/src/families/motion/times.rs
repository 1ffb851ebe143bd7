//! Places that are read at other times than those of the ticks.

use std::f64::consts::{FRAC_PI_4, TAU};

use asperity_node::random;

use super::stage::{Heard, Next, Stage};
use crate::case::{Found, Not, holds};
use crate::subject::Subject;

/// Speed and radius of the circle \[mm/s, mm\].
const SPEED_MM_S: f64 = 60.0;
const RADIUS_MM: f64 = 5.0;
/// When it begins to go wrong, and how long after that it is looked at \[s\].
const BEGINS_S: f64 = 1.0;
const LOOKS_S: f64 = 1.5;
/// How long ticks are lost in lots, and how long a gap is \[s\].
const LOSES_S: f64 = 2.5;
const GAP_S: f64 = 0.01;
/// The filter that velocities go through where a graph says nothing else \[Hz\].
const CUTOFF_HZ: f64 = 20.0;
/// The top of what textures are made of \[Hz\].
const TOP_HZ: f64 = 1000.0;

fn circle(seconds: f64) -> [f64; 2] {
    let turn = seconds * SPEED_MM_S / RADIUS_MM;
    [RADIUS_MM * turn.cos(), RADIUS_MM * turn.sin()]
}

/// Plays the circle, with what goes wrong for `wrong_s` from [`BEGINS_S`] on, if anything does. Answers what was heard of that, and from a second after it on.
fn circles(
    stage: &mut Stage,
    wrong_s: f64,
    mut wrong: Option<&mut dyn FnMut(u64) -> Next>,
) -> Result<[Heard; 2], Not> {
    let hz = stage.tick_hz();
    let [begins, ends] = [BEGINS_S, BEGINS_S + wrong_s].map(|s| (s * hz).round() as u64);
    let later = BEGINS_S + wrong_s + 1.0;
    let times = [(BEGINS_S, BEGINS_S + wrong_s + 0.3), (later, later + LOOKS_S)];
    stage.play(times, |tick| {
        let now = match &mut wrong {
            Some(next) if (begins..ends).contains(&tick) => next(tick),
            _ => Next::At(circle(tick as f64 / hz), true),
        };
        (tick as f64 / hz < times[1].1).then_some(now)
    })
}

/// What must be so later: as [`teleport`](super::teleport), where textures of random phases are other waveforms.
fn as_before(usual: &Heard, other: &Heard) -> Result<String, Not> {
    let [a, b] = [usual, other].map(Heard::rms);
    let apart = (10.0_f64.powf(1.0 / 20.0) - 1.0) * a;
    holds((a - b).abs() <= apart.max(0.02 * f64::from(usual.peak)), || {
        format!("1 s later its rms is {b:.4}, without {a:.4}")
    })?;
    Ok(format!("rms 1 s later {b:.4}, without {a:.4}"))
}

fn speeds(it: &Heard, what: &str, least: f64, most: f64) -> Result<String, Not> {
    let Some((slow, fast)) = it.speed else { return Ok("no gate tells of a speed".to_owned()) };
    holds(slow >= least && fast <= most, || {
        format!("{what} the speed goes from {slow:.1} to {fast:.1} mm/s; {least:.1} to {most:.1} are allowed")
    })?;
    Ok(format!("{what} {slow:.1} to {fast:.1} mm/s"))
}

pub(super) fn sampling(subject: &Subject<'_>) -> Found {
    let mut stage = Stage::new(subject)?;
    let (hz, wrong_s) = (stage.tick_hz(), subject.by_effort(0.5, 2.0, 600.0));
    let jitter = |tick: u64| random::uniform(0x71ff, tick) * 0.5 - 0.25;
    let late = |tick: u64| if tick % 37 == 5 || tick % 37 == 11 { -1.0 } else { 0.0 };
    let twice = |tick: u64| if tick % 2 == 1 { -1.0 } else { 0.0 };
    let all: [(&str, &dyn Fn(u64) -> f64); 3] =
        [("read off its time", &jitter), ("read late", &late), ("read twice", &twice)];
    // A place that is a tick late is a step of a tick's way, and a low-pass of two poles answers a step with w e^(-pi/4) of it at most.
    let most = (TAU * CUTOFF_HZ * (-FRAC_PI_4).exp() / hz).max(0.3);
    let usual = circles(&mut stage, wrong_s, None)?;
    let mut found = Vec::new();
    for (what, off) in all {
        let mut next = |tick: u64| Next::At(circle((tick as f64 + off(tick)) / hz), true);
        let other = circles(&mut stage, wrong_s, Some(&mut next))?;
        let speeds = speeds(&other[0], what, (1.0 - most) * SPEED_MM_S, (1.0 + most) * SPEED_MM_S)?;
        holds(other[0].changes == usual[0].changes, || {
            format!("{what} the gate changes {} times", other[0].changes)
        })?;
        let later = as_before(&usual[1], &other[1]).map_err(|e| e.after(what))?;
        found.push(format!("{speeds}, {later}"));
    }
    Ok(found.join("; "))
}

pub(super) fn lost(subject: &Subject<'_>) -> Found {
    let mut stage = Stage::new(subject)?;
    let hz = stage.tick_hz();
    // One more every time, 50 ms apart.
    let apart = (0.05 * hz) as u64;
    let (mut lose, mut at) = (0, (BEGINS_S * hz).round() as u64);
    let mut next = |tick: u64| {
        if tick < at {
            return Next::At(circle(tick as f64 / hz), true);
        }
        lose += 1;
        at = tick + lose + apart;
        Next::Skip(lose)
    };
    let usual = circles(&mut stage, LOSES_S, None)?;
    let other = circles(&mut stage, LOSES_S, Some(&mut next))?;
    let speeds = speeds(&other[0], "over lost ticks", 0.0, 1.1 * SPEED_MM_S)?;
    Ok(format!("{speeds}, {}", as_before(&usual[1], &other[1])?))
}

pub(super) fn gap(subject: &Subject<'_>) -> Found {
    let mut stage = Stage::new(subject)?;
    let hz = stage.tick_hz();
    let before = circle(((BEGINS_S * hz).round() - 1.0) / hz);
    let usual = circles(&mut stage, GAP_S, None)?;
    // A click would be a step that nothing in the band of textures makes.
    let step = usual[0].peak * (TAU * TOP_HZ / stage.audio_hz()) as f32;
    let mut found = Vec::new();
    for (valid, most, what) in [(true, 97.0 / 60.0, "held"), (false, 1.1, "marked")] {
        let other = circles(&mut stage, GAP_S, Some(&mut |_| Next::At(before, valid)))?;
        let speeds = speeds(&other[0], what, 0.0, most * SPEED_MM_S)?;
        holds(other[0].step <= step, || {
            format!("{what}: a step of {:.4} is played; {step:.4} are allowed", other[0].step)
        })?;
        let later = as_before(&usual[1], &other[1]).map_err(|e| e.after(what))?;
        found.push(format!("{speeds}, steps of {:.4} ({step:.4}), {later}", other[0].step));
    }
    Ok(found.join("; "))
}
