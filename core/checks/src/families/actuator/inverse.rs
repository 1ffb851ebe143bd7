//! The inverse in front of an actuator that is as it was made for, and of one that is not.

use std::f64::consts::TAU;
use std::sync::Arc;

use asperity_actuator::{Drive, Dynamics, Plant};
use asperity_dsp::filter::{Complex64, Section};
use asperity_node::Unit;

use super::response::{self, lock_in};
use super::{ACTUATORS, inverses, shipped};
use crate::case::{Found, Not, holds, not_applicable};
use crate::played::Played;
use crate::small::Small;
use crate::subject::Subject;

const TICK_HZ: u32 = 500;
const RATE_HZ: u32 = 48_000;
const RATE: f64 = RATE_HZ as f64;
/// Each sine lasts two seconds; the second is looked at.
const SECOND: u64 = RATE_HZ as u64;

/// The drive \[A or V\] that a kind makes of sines of 1 m/s^2, one after the other of 2 s each, then of a constant of 1 m/s^2 and of silence, 1 s each.
fn driven(
    subject: &Subject<'_>,
    kind: &str,
    (profile, grams): (&str, f64),
    drive: Drive,
    tones: &[u32],
) -> Result<Vec<f32>, Not> {
    let list: Vec<u32> = tones.to_vec();
    let wanted = Arc::new(move |first: u64, out: &mut [f32]| {
        for (x, n) in out.iter_mut().zip(first..) {
            let (which, at) = ((n / (2 * SECOND)) as usize, n % (2 * SECOND));
            *x = match list.get(which) {
                Some(hz) => (TAU * ((u64::from(*hz) * at % SECOND) as f64 / RATE)).sin() as f32,
                None => f32::from(u8::from(at < SECOND)),
            };
        }
    });
    let word = if drive == Drive::Current { "current" } else { "voltage" };
    let mut rig = Small::new(TICK_HZ, RATE_HZ)
        .plays("wanted", Played::audio("sines from memory", Unit::METRE_PER_SECOND_SQUARED, wanted))?
        .node(
            "inverse",
            kind,
            &[("profile", profile), ("handle_mass_g", &format!("{grams:?}")), ("drive", word)],
        )?
        .node("out", "probe", &[])?
        .chain(&["wanted", "inverse", "out"])
        .rig(subject)?;
    let mut out = Vec::with_capacity((2 * SECOND) as usize * (tones.len() + 1));
    rig.run(2 * u64::from(TICK_HZ) * (tones.len() as u64 + 1), |rig, _| {
        out.extend_from_slice(rig.audio("inverse", 0));
        Ok(())
    })?;
    holds(rig.engine.faults() == 0, || format!("`{kind}` failed {} times", rig.engine.faults()))?;
    Ok(out)
}

/// What the handle of an actuator does under a drive \[m/s^2\].
fn felt(d: &Dynamics, drive: Drive, driven: &[f32]) -> Vec<f64> {
    let mut plant = Plant::new(d, drive, RATE);
    driven.iter().map(|u| plant.step(f64::from(*u)).acceleration).collect()
}

/// The answer to each tone.
fn answers(felt: &[f64], tones: &[u32]) -> Vec<Complex64> {
    let seconds = felt.chunks(SECOND as usize).skip(1).step_by(2);
    tones.iter().zip(seconds).map(|(hz, y)| lock_in(y, 0, f64::from(*hz), RATE)).collect()
}

fn db(x: f64) -> f64 {
    20.0 * x.max(1e-12).log10()
}

pub(super) fn band(subject: &Subject<'_>) -> Found {
    let kinds = inverses(subject.registry());
    if kinds.is_empty() {
        return not_applicable("there is no inverse of an actuator");
    }
    let tones: &[u32] = subject.by_effort(
        &[1, 20, 40, 65, 1000, 12_000, 23_999],
        &[1, 2, 5, 10, 20, 40, 65, 71, 90, 200, 500, 1000, 3000, 8000, 15_000, 20_000, 23_000, 23_999],
        &[
            1, 2, 3, 5, 7, 10, 14, 20, 28, 40, 57, 65, 66, 71, 80, 90, 113, 160, 226, 320, 453, 640, 905,
            1000, 1810, 3620, 7240, 14_480, 20_000, 23_000, 23_900, 23_999,
        ],
    );
    let (mut least, mut worst, mut most) = (f64::MAX, 0.0_f64, 0.0_f64);
    for (kind, actuator) in kinds.iter().flat_map(|k| ACTUATORS.map(|a| (k, a))) {
        let d = shipped(actuator.0, actuator.1)?;
        for drive in [Drive::Current, Drive::Voltage] {
            let place = |hz: u32| format!("`{kind}`, {} on {} g, {drive:?}, {hz} Hz", actuator.0, actuator.1);
            let driven = driven(subject, kind, actuator, drive, tones)?;
            let felt = felt(&d, drive, &driven);
            for (hz, got) in tones.iter().zip(answers(&felt, tones)) {
                let f = f64::from(*hz);
                let stated = response::inverse(&d, drive, f, RATE) * response::plant(&d, drive, f, RATE);
                let off = (got - stated).norm();
                // What f32 rounds away is 10^-5 of what is asked at the most.
                if kind == "actuator_inverse" {
                    worst = worst.max((off - 1e-5).max(0.0) / stated.norm());
                    holds(off <= 1e-3 * stated.norm() + 1e-5, || {
                        format!("{}: {got:.5} and not {stated:.5}", place(*hz))
                    })?;
                }
                let analog = Section::high_pass(response::CORNER.0, response::CORNER.1).response(f).norm();
                // Below, half a sample of the hold is no longer small beside what little the two push.
                if (5.0..=1000.0).contains(&f) {
                    holds((db(got.norm()) - db(analog)).abs() <= 0.3, || {
                        format!("{}: {:.2} dB, stated {:.2} dB", place(*hz), db(got.norm()), db(analog))
                    })?;
                }
                holds(got.norm() <= 1.1, || {
                    format!("{}: {:.3} times what was asked", place(*hz), got.norm())
                })?;
                (least, most) = (least.min(got.norm()), most.max(got.norm()));
            }
            let constant = felt.len() - SECOND as usize - 1;
            holds(felt[constant].abs() < 1e-4, || {
                format!("{}: {:.5} m/s^2 left of a constant after 1 s", place(0), felt[constant])
            })?;
        }
    }
    Ok(format!(
        "off its closed form by at most {:.4} %; {least:.5} at 1 Hz, never more than {most:.3}",
        100.0 * worst
    ))
}

pub(super) fn off(subject: &Subject<'_>) -> Found {
    let kinds = inverses(subject.registry());
    if kinds.is_empty() {
        return not_applicable("there is no inverse of an actuator");
    }
    let count = subject.by_effort(6, 16, 60);
    let tone = |k: u32| (20.0 * 20.0_f64.powf(f64::from(k) / f64::from(count - 1))).round() as u32;
    let tones: Vec<u32> = (0..count).map(tone).collect();
    let (mut worst, mut apart, mut left) = (0.0_f64, (0.0_f64, 0), 0.0_f64);
    for (kind, actuator) in kinds.iter().flat_map(|k| ACTUATORS.map(|a| (k, a))) {
        let d = shipped(actuator.0, actuator.1)?;
        for drive in [Drive::Current, Drive::Voltage] {
            let driven = driven(subject, kind, actuator, drive, &tones)?;
            let right = answers(&felt(&d, drive, &driven), &tones);
            for corner in 0..8 {
                let by = |bit: u32| if corner >> bit & 1 == 1 { 1.2 } else { 0.8 };
                let other = Dynamics {
                    moving_mass: d.moving_mass * by(0),
                    stiffness: d.stiffness * by(1),
                    damping: d.damping * by(2),
                    ..d
                };
                let place = |hz: u32| {
                    format!(
                        "`{kind}`, {} on {} g, {drive:?}, mass {} spring {} damping {}, {hz} Hz",
                        actuator.0,
                        actuator.1,
                        by(0),
                        by(1),
                        by(2)
                    )
                };
                let felt = felt(&other, drive, &driven);
                for ((hz, got), right) in tones.iter().zip(answers(&felt, &tones)).zip(&right) {
                    let f = f64::from(*hz);
                    let stated =
                        response::inverse(&d, drive, f, RATE) * response::plant(&other, drive, f, RATE);
                    if kind == "actuator_inverse" {
                        let off = (got - stated).norm() / stated.norm();
                        worst = worst.max(off);
                        holds(off <= 1e-3, || format!("{}: {got:.5} and not {stated:.5}", place(*hz)))?;
                    }
                    let by = db(got.norm()) - db(right.norm());
                    if by.abs() > f64::abs(apart.0) {
                        apart = (by, *hz);
                    }
                    holds(by.abs() <= 8.0, || format!("{}: {by:.1} dB off", place(*hz)))?;
                }
                // The constant ends a second before the silence does.
                let rest = felt.len() - SECOND as usize / 2;
                let after = felt[rest..].iter().fold(0.0_f64, |m, a| m.max(a.abs()));
                left = left.max(after);
                holds(after < 1e-6, || format!("{}: {after:e} m/s^2 0.5 s after the end", place(0)))?;
            }
        }
    }
    Ok(format!(
        "off its closed form by at most {:.4} %; {:.1} dB off at {} Hz, nowhere more; {left:.0e} m/s^2 left 0.5 s after the end",
        100.0 * worst,
        apart.0,
        apart.1
    ))
}
