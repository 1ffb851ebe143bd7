//! A wall under a sensor that tells places in steps.
//!
//! A place that is off by e, half a step at most, is a force that is off by `K e + B (e_k - e_k-1) / T`, at most `P = K D/2 + B D/T`, and gives P for every length of
//! way at most: dry friction c of the device takes that away where c > P. Below that the rest of the balance is
//!
//! ```text
//! dE/dt <= (P - c) |v| - (b - K T/2 - B) v^2
//! ```
//!
//! so that over a time in which the energy comes back to where it was the rms speed is (P - c) / (b - K T/2 - B) at most. How far it goes: a mass in a spring that is
//! disturbed by no more than F goes no further than F times the integral of the size of its impulse response, `coth(pi z / (2 sqrt(1 - z^2))) / K`, with
//! z the damping ratio; dry friction counts as part of the disturbance.
//!
//! Without dry friction it cannot lie still between two steps, where forces are those of the one or the other: with f the least that they differ from the push, a
//! speed that follows `m dv/dt + b v = +-f` or more over a tick has an rms of `f / b sqrt(1 - tanh(s/2) / (s/2))` at least, s = b T/m, whatever it begins with.

use std::f64::consts::{PI, TAU};

use asperity_scene::effect::passivity::Quantisation;

use crate::case::{Found, holds};
use crate::handle::{Device, Handle, Loop};
use crate::subject::Subject;
use crate::wall::{Near, Wall};

/// Step of a usual sensor \[mm\].
pub(super) const STEP_MM: f64 = 0.055;
/// Steps of the device between two ticks.
const STEPS: usize = 40;
/// Where the closed form of a spring is not quite that of one in ticks.
const NEARLY: f64 = 1.1;

/// The dry friction that a wall needs of a device \[N\].
pub(super) fn needed_n(near: &Near) -> f64 {
    Quantisation::of(near.law, near.sampling, STEP_MM, 0.0).needed_n
}

/// Whether Hooke's law holds deep enough for steps to be seen.
pub(super) fn is_deep(near: &Near) -> bool {
    near.deep_mm >= 20.0 * STEP_MM
}

/// What motions take out by their way \[N\], beyond what the bound without steps takes: out and in over the borders of steps, one a tick, out before and
/// in behind them; over one border to and fro, and over more.
fn taken_n(wall: &mut Wall, near: &Near) -> f64 {
    let middle = ((0.5 * near.deep_mm) / STEP_MM).floor();
    let (little, tick_s, every) = (1e-6 * STEP_MM, near.tick_s(), wall.every());
    let needed = 1e-3 * near.needed_ns_per_m(0.0);
    let mut most = f64::MIN;
    for borders in [1_u32, 2, 4, 8] {
        let out = (0..borders).map(|n| (f64::from(n) - middle + 0.5) * STEP_MM - little);
        let back = (0..borders).rev().map(|n| (f64::from(n) - middle + 0.5) * STEP_MM + little);
        let places: Vec<f64> = out.chain(back).collect();
        let count = places.len();
        let (mut given, mut way) = (0.0, 0.0);
        wall.reset();
        for n in 0..4 * count {
            let place = |n: usize| places.get(n % count).copied().unwrap_or(0.0);
            let (x, go) = (place(n), place(n + 1) - place(n));
            for k in 0..every {
                let at = x + k as f64 / every as f64 * go;
                let force = wall.above(&near.spot, (at / STEP_MM).round() * STEP_MM);
                if n >= 2 * count {
                    given += force * go / every as f64;
                }
            }
            if n >= 2 * count {
                given -= needed * go * go / tick_s;
                way += go.abs();
            }
        }
        most = most.max(given / way);
    }
    most
}

/// How a device trembles around its rest.
#[derive(Clone, Copy, Debug, Default)]
struct Trembles {
    /// How far it goes from there at most \[mm\].
    far_mm: f64,
    /// Root mean square of the speed \[mm/s\].
    rms_mm_s: f64,
}

/// Lets a device fall into rest under a push, and looks at it after a time. The push is that of a depth of so many steps.
fn tremble(
    wall: &mut Wall,
    near: &Near,
    device: Device,
    steps: f64,
    (from_mm, settle_s, look_s): (f64, f64, f64),
) -> Trembles {
    wall.reset();
    let step_s = 1.0 / wall.tick_hz() / STEPS as f64;
    let mut servo = Loop::new(Handle::new(device, None, step_s), STEPS, 0, STEP_MM);
    let rest_mm = -steps * STEP_MM;
    servo.handle.put(rest_mm + from_mm, 0.0, 0.0);
    let (mut it, mut square) = (Trembles::default(), 0.0);
    let ticks = |s: f64| (s * wall.tick_hz()).ceil() as u64;
    let (settle, look) = (ticks(settle_s), ticks(look_s));
    for tick in 0..settle + look {
        servo.tick(
            |x| wall.above(&near.spot, x),
            rest_mm * near.law.stiffness_n_per_mm,
            |handle| {
                if tick >= settle {
                    it.far_mm = it.far_mm.max((handle.x_mm() - rest_mm).abs());
                    square += handle.v_mm_s().powi(2);
                }
            },
        );
    }
    it.rms_mm_s = (square / (look * STEPS as u64) as f64).sqrt();
    it
}

/// What a device is held to \[mm, mm/s\]: how far it goes, and its rms speed.
pub(super) fn bounds(near: &Near, device: Device) -> (f64, f64) {
    let law = near.law;
    let (k, most) = (1e3 * law.stiffness_n_per_mm, needed_n(near));
    let sampled = near.needed_ns_per_m(0.0) - law.damping_ns_per_m.abs();
    let z = (device.damping_ns_per_m + law.damping_ns_per_m - sampled) / (2.0 * (k * device.mass_kg).sqrt());
    let swings = if z < 1.0 { 1.0 / (0.5 * PI * z / (1.0 - z * z).sqrt()).tanh() } else { 1.0 };
    let far = (most + device.friction_n) / law.stiffness_n_per_mm * swings;
    let spare = device.damping_ns_per_m - near.needed_ns_per_m(0.0);
    (NEARLY * far, NEARLY * 1e3 * (most - device.friction_n).max(0.0) / spare)
}

/// A device that swings in the wall by so many radians a tick, with so many times the damping that the bound asks for.
fn device(near: &Near, radians: f64, times: f64, friction_n: f64) -> Device {
    let damping_ns_per_m = times * near.needed_ns_per_m(0.0);
    Device { mass_kg: near.mass_kg(radians), damping_ns_per_m, friction_n }
}

/// How slow a device without dry friction may be (rms) that rests at a depth of so many steps \[mm/s\].
fn least_mm_s(near: &Near, device: Device, steps: f64) -> f64 {
    let off_n = (steps - steps.round()).abs() * STEP_MM * near.law.stiffness_n_per_mm;
    let half = 0.5 * device.damping_ns_per_m * near.tick_s() / device.mass_kg;
    1e3 * off_n / device.damping_ns_per_m * (1.0 - half.tanh() / half).sqrt()
}

pub(super) fn below(wall: &mut Wall, near: &Near, subject: &Subject<'_>) -> Found {
    if !is_deep(near) {
        return Ok(format!("no deeper than {:.3} mm Hooke's law holds: no steps are seen", near.deep_mm));
    }
    let needed = needed_n(near);
    let taken = taken_n(wall, near);
    holds(taken <= needed * 1.001, || {
        format!(
            "a motion over the borders of steps takes out {:.3} mN; the bound is {:.3}",
            1e3 * taken,
            1e3 * needed
        )
    })?;
    if near.is_hooke() {
        holds(taken >= needed * 0.999, || {
            format!(
                "motions over the borders of steps take out {:.3} mN at most; {:.3} are to be had",
                1e3 * taken,
                1e3 * needed
            )
        })?;
    }
    let mut most = (0.0_f64, 0.0_f64, 0.0_f64);
    let times = [1.5, 4.0].into_iter().flat_map(|times| [0.14, 0.5].map(|radians| (times, radians)));
    for ((times, radians), part) in times.flat_map(|it| [0.0, 0.5].map(|part| (it, part))) {
        let device = device(near, radians, times, part * needed);
        let (far, fast) = bounds(near, device);
        // 20 times as long as its swings take to fall to 1/e.
        let settle_s = 40.0 * device.mass_kg / (device.damping_ns_per_m - near.needed_ns_per_m(0.0));
        let look_s = subject.by_effort(1.0, 4.0, 600.0);
        for rest in [8.0, 8.3, 8.5] {
            let it = tremble(wall, near, device, rest, (2.0 * STEP_MM, settle_s, look_s));
            let told = || {
                format!(
                    "{:.3} kg with {:.3} N s/m and {:.1} mN of dry friction",
                    device.mass_kg,
                    device.damping_ns_per_m,
                    1e3 * device.friction_n
                )
            };
            holds(it.far_mm <= far && it.rms_mm_s <= fast, || {
                format!(
                    "{} tremble by {:.4} mm and {:.2} mm/s; the bounds are {far:.4} and {fast:.2}",
                    told(),
                    it.far_mm,
                    it.rms_mm_s
                )
            })?;
            if part == 0.0 {
                let least = if near.is_hooke() { least_mm_s(near, device, rest) } else { 0.0 };
                holds(it.rms_mm_s >= least, || {
                    format!(
                        "{} lie still between two steps: {:.2e} mm/s; {least:.2e} are the least",
                        told(),
                        it.rms_mm_s
                    )
                })?;
                most = (most.0.max(it.far_mm), most.1.max(it.rms_mm_s), most.2.max(it.far_mm / far));
            }
        }
    }
    Ok(format!(
        "steps of {STEP_MM} mm take {:.1} mN of dry friction and a motion gets {:.4} of it; without any a device trembles by {:.4} mm ({:.2} of the bound) and {:.2} mm/s",
        1e3 * needed,
        taken / needed,
        most.0,
        most.2,
        most.1
    ))
}

pub(super) fn above(wall: &mut Wall, near: &Near, _subject: &Subject<'_>) -> Found {
    if !is_deep(near) {
        return Ok("no steps are seen".to_owned());
    }
    let needed = needed_n(near);
    let mut last = 0.0_f64;
    for radians in [0.14, 0.5] {
        for part in [1.2, 2.8] {
            let device = device(near, radians, 1.5, part * needed);
            let from_mm = 8.0 * STEP_MM;
            let swings = 1.0 + 0.25 * from_mm * near.law.stiffness_n_per_mm / (device.friction_n - needed);
            let still_s = swings * TAU / radians * near.tick_s();
            for rest in [10.0, 10.3, 10.5] {
                let it = tremble(wall, near, device, rest, (from_mm, still_s, 0.5));
                holds(it.rms_mm_s == 0.0, || {
                    format!(
                        "{:.3} kg with {:.1} mN of dry friction, {part} times what is needed, still moves after {still_s:.2} s: {:.2e} mm/s",
                        device.mass_kg,
                        1e3 * device.friction_n,
                        it.rms_mm_s
                    )
                })?;
                last = last.max(still_s);
            }
        }
    }
    Ok(format!(
        "with 1.2 and 2.8 times {:.1} mN of dry friction it lies still within {last:.2} s",
        1e3 * needed
    ))
}
