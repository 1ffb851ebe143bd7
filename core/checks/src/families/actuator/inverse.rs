//! The inverse before the actuator that it was made for, and before others.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use asperity_actuator::{Drive, Dynamics, Plant};
use asperity_dsp::filter::{Complex64, Section};
use asperity_node::{Role, Unit};

use super::{ACTUATORS, inverses, shipped};
use crate::case::{Found, Stop, holds};
use crate::played::Played;
use crate::rig::CaseGraph;
use crate::subject::Subject;

const TICK_HZ: u32 = 500;
const RATE_HZ: u32 = 48_000;
const RATE: f64 = RATE_HZ as f64;
/// Samples of a second. Each sine lasts two seconds, of which the second is measured.
const SECOND: u64 = RATE_HZ as u64;

/// The drive \[A or V\] that a kind makes of sines of 1 m/s^2, 2 s each, then of a constant of 1 m/s^2 and of
/// silence, 1 s each.
fn driven(
    subject: &Subject<'_>,
    kind: &str,
    (profile, grams): (&str, f64),
    drive: Drive,
    tones: &[u32],
) -> Result<Vec<f32>, Stop> {
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
    let mut rig = CaseGraph::new(TICK_HZ, RATE_HZ)
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

/// Acceleration of the handle under a drive \[m/s^2\].
fn felt(d: &Dynamics, drive: Drive, driven: &[f32]) -> Vec<f64> {
    let mut plant = Plant::new(d, drive, RATE);
    driven.iter().map(|u| plant.step(f64::from(*u)).acceleration).collect()
}

/// The response to each tone.
fn answers(felt: &[f64], tones: &[u32]) -> Vec<Complex64> {
    let seconds = felt.chunks(SECOND as usize).skip(1).step_by(2);
    tones.iter().zip(seconds).map(|(hz, y)| lock_in(y, f64::from(*hz), RATE)).collect()
}

fn db(x: f64) -> f64 {
    20.0 * x.max(1e-12).log10()
}

pub(super) fn band(subject: &Subject<'_>) -> Found {
    let kinds = inverses(subject)?;
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
        let ours = subject.registry().role(kind) == Some(Role::ActuatorInverse);
        let d = shipped(actuator.0, actuator.1)?;
        for drive in [Drive::Current, Drive::Voltage] {
            let place = |hz: u32| format!("`{kind}`, {} on {} g, {drive:?}, {hz} Hz", actuator.0, actuator.1);
            let driven = driven(subject, kind, actuator, drive, tones)?;
            let felt = felt(&d, drive, &driven);
            for (hz, got) in tones.iter().zip(answers(&felt, tones)) {
                let f = f64::from(*hz);
                let stated = inverse(&d, drive, f, RATE) * plant(&d, drive, f, RATE);
                let off = (got - stated).norm();
                // f32 rounds away 10^-5 of what is asked at most.
                if ours {
                    worst = worst.max((off - 1e-5).max(0.0) / stated.norm());
                    holds(off <= 1e-3 * stated.norm() + 1e-5, || {
                        format!("{}: {got:.5} and not {stated:.5}", place(*hz))
                    })?;
                }
                let analog = Section::high_pass(CORNER.0, CORNER.1).response(f).norm();
                // Below 5 Hz both push so little that half a sample of the hold is no longer small beside it.
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
    let kinds = inverses(subject)?;
    let count = subject.by_effort(6, 16, 60);
    let tone = |k: u32| (20.0 * 20.0_f64.powf(f64::from(k) / f64::from(count - 1))).round() as u32;
    let tones: Vec<u32> = (0..count).map(tone).collect();
    let (mut worst, mut apart, mut left) = (0.0_f64, (0.0_f64, 0), 0.0_f64);
    for (kind, actuator) in kinds.iter().flat_map(|k| ACTUATORS.map(|a| (k, a))) {
        let ours = subject.registry().role(kind) == Some(Role::ActuatorInverse);
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
                    let stated = inverse(&d, drive, f, RATE) * plant(&other, drive, f, RATE);
                    if ours {
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
        "off its closed form by at most {:.4} %; {:.1} dB off at {} Hz, nowhere more; {left:.0e} m/s^2 \
         left 0.5 s after the end",
        100.0 * worst,
        apart.0,
        apart.1
    ))
}

/// Corner \[Hz\] and damping ratio of the inverse's high-pass: its defaults.
const CORNER: (f64, f64) = (20.0, std::f64::consts::FRAC_1_SQRT_2);

/// Drive per acceleration of the inverse of `d` \[A or V per m/s^2\], by the bilinear transform that is
/// exact at the resonance w: `s = j c tan(pi f / rate)`, `c = w / tan(w / 2 rate)`.
fn inverse(d: &Dynamics, drive: Drive, hz: f64, rate_hz: f64) -> Complex64 {
    let w = d.natural_rad_s();
    let c = w / (w / 2.0 / rate_hz).tan();
    let s = Complex64::new(0.0, c * (PI * hz / rate_hz).tan());
    let (mu, wc) = (d.reduced_mass(), TAU * CORNER.0);
    let corner = s * s + s * (2.0 * CORNER.1 * wc) + wc * wc;
    let current =
        -(d.handle_mass / d.force_factor) * (s * s + s * (d.damping / mu) + d.stiffness / mu) / corner;
    match drive {
        Drive::Current => current,
        Drive::Voltage => {
            let emf = -(d.force_factor * d.handle_mass / mu) * s / corner;
            let roof = s / (TAU * (rate_hz / 4.0).min(10_000.0)) + 1.0;
            ((s * d.inductance + d.resistance) * current + emf) / roof
        }
    }
}

/// Acceleration per drive of the actuator \[m/s^2 per A or V\]; the drive is held from sample to sample.
///
/// By partial fractions: the hold makes `r (e^(p T) - 1) / p / (z - e^(p T))` of a part `r / (s - p)`.
fn plant(d: &Dynamics, drive: Drive, hz: f64, rate_hz: f64) -> Complex64 {
    let (mu, push) = (d.reduced_mass(), d.force_factor / d.handle_mass);
    let (b, ww) = (d.damping / mu, d.stiffness / mu);
    // A/u = direct + part / den, highest power first; den is monic.
    let (direct, part, den) = match drive {
        Drive::Current => (-push, vec![push * b, push * ww], vec![1.0, b, ww]),
        Drive::Voltage => {
            let (r, l) = (d.resistance, d.inductance);
            let brake = d.force_factor * d.force_factor / mu;
            (0.0, vec![-push / l, 0.0, 0.0], vec![1.0, r / l + b, r * b / l + ww + brake / l, r * ww / l])
        }
    };
    let derivative: Vec<f64> =
        den.iter().zip((1..den.len()).rev()).map(|(a, power)| a * power as f64).collect();
    let z = Complex64::from_polar(1.0, TAU * hz / rate_hz);
    let parts = roots(&den).into_iter().map(|p| {
        let held = (p / rate_hz).exp();
        at(&part, p) / at(&derivative, p) * (held - 1.0) / p / (z - held)
    });
    parts.sum::<Complex64>() + direct
}

fn at(polynomial: &[f64], s: Complex64) -> Complex64 {
    polynomial.iter().fold(Complex64::new(0.0, 0.0), |sum, a| sum * s + *a)
}

/// The roots of a monic polynomial, all at once (K. Weierstrass 1891, E. Durand 1960, I. Kerner 1966).
fn roots(monic: &[f64]) -> Vec<Complex64> {
    let degree = monic.len() - 1;
    // A circle around all of them (Fujiwara).
    let radius = monic.iter().enumerate().skip(1).map(|(k, a)| 2.0 * a.abs().powf(1.0 / k as f64));
    let radius = radius.fold(0.0, f64::max);
    let start = |k: usize| Complex64::from_polar(radius, TAU * k as f64 / degree as f64 + 0.4);
    let mut all: Vec<Complex64> = (0..degree).map(start).collect();
    for _ in 0..500 {
        for k in 0..degree {
            let others = (0..degree).filter(|i| *i != k).map(|i| all[k] - all[i]);
            let step = at(monic, all[k]) / others.product::<Complex64>();
            all[k] -= step;
        }
    }
    all
}

/// Amplitude and phase of the part of `y` at `hz`, against a sine, over whole periods.
fn lock_in(y: &[f64], hz: f64, rate_hz: f64) -> Complex64 {
    // The phase by the remainder, which is exact for whole numbers.
    let turn = |n: u64| (hz * n as f64) % rate_hz / rate_hz;
    let sum: Complex64 = y.iter().zip(0..).map(|(y, n)| Complex64::from_polar(*y, -TAU * turn(n))).sum();
    sum * Complex64::new(0.0, 2.0 / y.len().max(1) as f64)
}
