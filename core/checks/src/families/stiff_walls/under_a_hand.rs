//! A wall under a hand that presses into it.

use super::quantum::{STEP_MM, bounds, is_deep};
use crate::case::{Found, holds};
use crate::handle::{Device, Hand, Handle, Loop};
use crate::subject::{Effort, Subject};
use crate::wall::{Near, Wall};

/// Steps of the device between two ticks, where it has dry friction or a sensor in steps.
const STEPS: usize = 4;
/// What is left to move when it lies still \[mm\].
const STILL_MM: f64 = 1e-3;

/// Hands around one: half and twice of everything.
fn hands(effort: Effort) -> Vec<Hand> {
    let part = |n: usize| [0.5, 1.0, 2.0].get(n % 3).copied().unwrap_or(1.0);
    let all = (0..27).map(|n| [part(n), part(n / 3), part(n / 9)]);
    let quick = |v: &[f64; 3]| match effort {
        Effort::Quick => v[0] == v[1] && v[1] == v[2],
        Effort::Full => v[1] == v[2],
        Effort::Long => true,
    };
    all.filter(quick).map(|v| Hand::PEN.varied(v)).collect()
}

pub(super) fn holds_on(wall: &mut Wall, near: &Near, subject: &Subject<'_>) -> Found {
    let curve = wall.curve(near);
    let bound = near.needed_ns_per_m(0.0);
    let (mut worst, mut trembles, mut fastest) = (f64::MIN, 0.0_f64, 0.0_f64);
    let hands = hands(subject.allowed());
    for hand in &hands {
        // A third of what the wall gives where Hooke's law ends.
        let push_n = 0.3 * near.law.stiffness_n_per_mm * near.deep_mm;
        let wants_mm = -1e3 * push_n / hand.arm[0];
        // The hand swings on its arm with what it holds: e^-12 of that is left.
        let mass_kg = near.mass_kg(0.14);
        let settle_s = 24.0 * (hand.mass_kg + mass_kg) / hand.arm[1];
        for step_mm in [0.0, STEP_MM] {
            if step_mm > 0.0 && !is_deep(near) {
                continue;
            }
            let part = if step_mm > 0.0 { 1.5 } else { 1.02 };
            let device = Device { mass_kg, damping_ns_per_m: part * bound, friction_n: 0.0 };
            let steps = if step_mm > 0.0 { STEPS } else { 1 };
            let handle = Handle::new(device, Some(*hand), 1.0 / wall.tick_hz() / steps as f64);
            let mut servo = Loop::new(handle, steps, 0, step_mm);
            wall.reset();
            servo.handle.put(0.5 * near.deep_mm, 0.0, wants_mm);
            let energy = |h: &Handle| h.energy_mj() + curve.energy_mj(h.x_mm());
            let first = energy(&servo.handle);
            let (mut most, mut span) = (f64::MIN, (f64::MAX, f64::MIN));
            let (mut square, mut looked) = (0.0, 0_u32);
            let ticks = (settle_s * wall.tick_hz()) as u64;
            let look = (0.5 * wall.tick_hz()) as u64;
            for tick in 0..ticks + look {
                servo.tick(
                    |x| wall.above(&near.spot, x),
                    0.0,
                    |h| {
                        if tick >= ticks {
                            span = (span.0.min(h.x_mm()), span.1.max(h.x_mm()));
                            (square, looked) = (square + h.v_mm_s().powi(2), looked + 1);
                        }
                    },
                );
                most = most.max(energy(&servo.handle));
            }
            let moves = span.1 - span.0;
            let told = || {
                format!(
                    "{:.2} kg of hand, grip {:.0} N/m, arm {:.0} N/m",
                    hand.mass_kg, hand.grip[0], hand.arm[0]
                )
            };
            if step_mm == 0.0 {
                worst = worst.max(most / first - 1.0);
                holds(most <= first * (1.0 + super::KNOWN), || {
                    format!("{}: {:.4} of the energy at first", told(), most / first)
                })?;
                holds(moves <= STILL_MM, || format!("{}: it still moves by {moves:.4} mm", told()))?;
            } else {
                let rms = (square / f64::from(looked.max(1))).sqrt();
                let (_, fast) = bounds(near, device);
                holds(rms <= fast, || {
                    format!("{}: it trembles with {rms:.2} mm/s; the bound is {fast:.2}", told())
                })?;
                (trembles, fastest) = (trembles.max(moves), fastest.max(rms));
            }
        }
    }
    Ok(format!(
        "under {} hands there is never more than {worst:+.1e} of the energy beyond what there was; in steps it trembles by {trembles:.4} mm at most, {fastest:.2} mm/s",
        hands.len()
    ))
}
