//! The inverse before the actuator that it was made for, and before others. `core/actuator` compares them
//! with their closed forms.

use std::f64::consts::{FRAC_1_SQRT_2, TAU};
use std::sync::Arc;

use asperity_actuator::{Drive, Dynamics, Plant};
use asperity_dsp::filter::{Complex64, Section};
use asperity_node::Unit;

use super::{ACTUATORS, inverses, on_shipped};
use crate::case::{Figures, Found, Stop};
use crate::played::{Played, samples};
use crate::rig::CaseGraph;
use crate::subject::Subject;

const TICK_HZ: u32 = 500;
const RATE_HZ: u32 = 48_000;
/// Samples of a second. Each sine lasts two seconds, of which the second is measured.
const SECOND: u64 = RATE_HZ as u64;

/// Phase of a sine at a sample, in turns.
fn turn(hz: u32, n: u64) -> f64 {
    (u64::from(hz) * n % SECOND) as f64 / SECOND as f64
}

/// A kind of inverse of an actuator and a drive, with its output. The input is sines, 2 s each, then a
/// constant and silence, 1 s each, all of 1 m/s^2.
struct Driven {
    name: String,
    dynamics: Dynamics,
    drive: Drive,
    samples: Vec<f32>,
}

/// Every kind of inverse of every actuator, under a current and a voltage.
fn driven(subject: &Subject<'_>, tones: &[u32]) -> Result<Vec<Driven>, Stop> {
    let tones: Arc<[u32]> = tones.into();
    let wanted = {
        let tones = tones.clone();
        samples(move |n| match tones.get((n / (2 * SECOND)) as usize) {
            Some(hz) => (TAU * turn(*hz, n)).sin() as f32,
            None => f32::from(u8::from(n % (2 * SECOND) < SECOND)),
        })
    };
    let mut all = Vec::new();
    for kind in inverses(subject)? {
        for ((profile, grams), word) in
            ACTUATORS.into_iter().flat_map(|it| [(it, "current"), (it, "voltage")])
        {
            let source = Played::audio("sines from memory", Unit::METRE_PER_SECOND_SQUARED, wanted.clone());
            let mass = format!("{grams:?}");
            let mut rig = CaseGraph::new(TICK_HZ, RATE_HZ)
                .plays("wanted", source)?
                .node("inverse", &kind, &[("profile", profile), ("handle_mass_g", &mass), ("drive", word)])?
                .node("out", "probe", &[])?
                .chain(&["wanted", "inverse", "out"])
                .rig(subject)?;
            let name = format!("`{kind}`, {profile} on {grams} g, {word}");
            let ticks = 2 * u64::from(TICK_HZ) * (tones.len() as u64 + 1);
            let samples = rig.heard(ticks, "inverse").map_err(|e| e.after(&name))?;
            let drive = if word == "current" { Drive::Current } else { Drive::Voltage };
            all.push(Driven { name, dynamics: on_shipped(profile, grams)?, drive, samples });
        }
    }
    Ok(all)
}

impl Driven {
    /// Acceleration of the handle of an actuator \[m/s^2\].
    fn felt(&self, d: &Dynamics) -> Vec<f64> {
        let mut plant = Plant::new(d, self.drive, f64::from(RATE_HZ));
        self.samples.iter().map(|u| plant.step(f64::from(*u)).acceleration).collect()
    }
}

/// Amplitude of the response to each tone.
fn answers(felt: &[f64], tones: &[u32]) -> Vec<f64> {
    let seconds = felt.chunks(SECOND as usize).skip(1).step_by(2);
    let answer = |(hz, y): (&u32, &[f64])| {
        let turned = y.iter().zip(0..).map(|(y, n)| Complex64::from_polar(*y, -TAU * turn(*hz, n)));
        2.0 / SECOND as f64 * turned.sum::<Complex64>().norm()
    };
    tones.iter().zip(seconds).map(answer).collect()
}

fn db(x: f64) -> f64 {
    20.0 * x.max(1e-12).log10()
}

pub(super) fn band(subject: &Subject<'_>) -> Found {
    let tones: &[u32] = subject.by_effort(
        &[1, 20, 40, 65, 1000, 12_000, 23_999],
        &[1, 2, 5, 10, 20, 40, 65, 71, 90, 200, 500, 1000, 3000, 8000, 15_000, 20_000, 23_000, 23_999],
        &[
            1, 2, 3, 5, 7, 10, 14, 20, 28, 40, 57, 65, 66, 71, 80, 90, 113, 160, 226, 320, 453, 640, 905,
            1000, 1810, 3620, 7240, 14_480, 20_000, 23_000, 23_900, 23_999,
        ],
    );
    let mut figures = Figures::default();
    for it in driven(subject, tones)? {
        let felt = it.felt(&it.dynamics);
        for (hz, got) in tones.iter().zip(answers(&felt, tones)) {
            let (f, name) = (f64::from(*hz), format!("{}, {hz} Hz", it.name));
            // Below 5 Hz both push so little that half a sample of the hold is no longer small beside it.
            if (5.0..=1000.0).contains(&f) {
                // The inverse's high-pass by its defaults.
                let stated = db(Section::high_pass(20.0, FRAC_1_SQRT_2).response(f).norm());
                let off = figures.at_most((db(got) - stated).abs(), 0.3, "dB off the stated response");
                off.map_err(|e| e.after(&name))?;
            }
            figures.at_most(got, 1.1, "times the wanted acceleration").map_err(|e| e.after(&name))?;
        }
        let left = felt[felt.len() - SECOND as usize - 1].abs();
        let left = figures.at_most(left, 1e-4, "m/s^2 left of a constant after 1 s");
        left.map_err(|e| e.after(&it.name))?;
    }
    Ok(figures.to_string())
}

pub(super) fn off(subject: &Subject<'_>) -> Found {
    let count = subject.by_effort(6, 16, 60);
    let tone = |k: u32| (20.0 * 20.0_f64.powf(f64::from(k) / f64::from(count - 1))).round() as u32;
    let tones: Vec<u32> = (0..count).map(tone).collect();
    let mut figures = Figures::default();
    for it in driven(subject, &tones)? {
        let d = it.dynamics;
        let right = answers(&it.felt(&d), &tones);
        for corner in 0..8 {
            let [m, k, c] = [0, 1, 2].map(|bit| if corner >> bit & 1 == 1 { 1.2 } else { 0.8 });
            let name = format!("{}, mass {m} spring {k} damping {c}", it.name);
            let (moving_mass, stiffness, damping) = (d.moving_mass * m, d.stiffness * k, d.damping * c);
            let felt = it.felt(&Dynamics { moving_mass, stiffness, damping, ..d });
            for ((hz, got), right) in tones.iter().zip(answers(&felt, &tones)).zip(&right) {
                let off = figures.at_most((db(got) - db(*right)).abs(), 8.0, "dB off");
                off.map_err(|e| e.after(&format!("{name}, {hz} Hz")))?;
            }
            // The constant ends a second before the silence does.
            let rest = felt.len() - SECOND as usize / 2;
            let after = felt[rest..].iter().fold(0.0_f64, |m, a| m.max(a.abs()));
            let left = figures.at_most(after, 1e-6, "m/s^2 left 0.5 s after the end");
            left.map_err(|e| e.after(&name))?;
        }
    }
    Ok(figures.to_string())
}
