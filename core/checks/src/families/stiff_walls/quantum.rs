//! A wall under a sensor that tells places in steps.
//!
//! An error e of the place, at most half a step, is an error of the force of `K e + B (e_k - e_k-1) / T`, at
//! most `P = K D/2 + B D/T`. It gives at most P per length of way, which the dry friction c of the device
//! takes where c > P. Below that the balance is
//!
//! ```text
//! dE/dt <= (P - c) |v| - (b - K T/2 - B) v^2
//! ```
//!
//! so that the rms speed is at most (P - c) / (b - K T/2 - B) over a time after which the energy is the same
//! again. The distance: a disturbance of at most F moves a mass in a spring by at most F times the integral
//! of the absolute impulse response, `coth(pi z / (2 sqrt(1 - z^2))) / K`, with the damping ratio z. Dry
//! friction is part of the disturbance.
//!
//! Without dry friction the device cannot lie still between two steps, where the force is that of one or the
//! other. Let f be the least difference from the push. A speed that follows `m dv/dt + b v = +-f` or more
//! over a tick has an rms of at least `f / b sqrt(1 - tanh(s/2) / (s/2))`, s = b T/m, from any start.

use std::f64::consts::{PI, TAU};

use asperity_scene::bound::Quantisation;

use crate::case::{Figures, Stop};
use crate::handle::{Device, Handle, Loop};
use crate::subject::Subject;
use crate::wall::{Near, Wall};

use super::{Round, round};

/// Step of a usual sensor \[mm\].
pub(super) const STEP_MM: f64 = 0.055;
/// Steps of the device between two ticks.
const STEPS: usize = 40;
/// Allowance for the difference between a spring and one in ticks.
const NEARLY: f64 = 1.1;

/// The dry friction that a wall needs of a device \[N\].
pub(super) fn needed_n(near: &Near) -> f64 {
    Quantisation::of(near.law, near.sampling, STEP_MM, 0.0).needed_n
}

/// Whether Hooke's law holds deep enough for steps to matter.
pub(super) fn is_deep(near: &Near) -> bool {
    near.deep_mm >= 20.0 * STEP_MM
}

/// Energy per way that motions take out beyond the bound without steps \[N\]. They go out and in over 1 to 8
/// borders of steps, one a tick: out just before them, in just behind them.
fn taken_n(wall: &mut Wall, near: &Near) -> f64 {
    let middle = ((0.5 * near.deep_mm) / STEP_MM).floor();
    let border = |n: u32| (f64::from(n) - middle + 0.5) * STEP_MM;
    let little = 1e-6 * STEP_MM;
    let mut most = f64::MIN;
    for borders in [1_u32, 2, 4, 8] {
        let out = (0..borders).map(|n| border(n) - little);
        let back = (0..borders).rev().map(|n| border(n) + little);
        let Round { given, taken, way } = round(wall, near, &out.chain(back).collect::<Vec<_>>(), STEP_MM);
        most = most.max((given - near.needed_ns_per_m(0.0) * taken) / way);
    }
    most
}

/// Motion after a device has settled.
pub(super) struct Moves {
    /// Least and greatest place \[mm\].
    pub span: (f64, f64),
    /// Root mean square of the speed \[mm/s\].
    pub rms_mm_s: f64,
}

/// Lets a device settle on a wall, and looks how it moves after that. `each` is called after every tick.
pub(super) fn settle(
    wall: &mut Wall,
    near: &Near,
    servo: &mut Loop,
    push_n: f64,
    (settle_s, look_s): (f64, f64),
    mut each: impl FnMut(&Handle),
) -> Moves {
    wall.reset();
    let [settle, look] = [settle_s, look_s].map(|s| (s * wall.tick_hz()).ceil() as u64);
    let (mut span, mut square, mut count) = ((f64::MAX, f64::MIN), 0.0, 0_u64);
    for tick in 0..settle + look {
        let look = |h: &Handle| {
            if tick >= settle {
                span = (span.0.min(h.x_mm()), span.1.max(h.x_mm()));
                (square, count) = (square + h.v_mm_s().powi(2), count + 1);
            }
        };
        servo.tick(|x| wall.above(&near.spot, x), -push_n, look);
        each(&servo.handle);
    }
    Moves { span, rms_mm_s: (square / count.max(1) as f64).sqrt() }
}

/// Lets a device settle under the wall's force at a depth of so many steps. Answers its largest distance from
/// rest \[mm\] and its rms speed \[mm/s\].
fn tremble(
    wall: &mut Wall,
    near: &Near,
    device: Device,
    steps: f64,
    (from_mm, settle_s, look_s): (f64, f64, f64),
) -> (f64, f64) {
    let step_s = 1.0 / wall.tick_hz() / STEPS as f64;
    let mut servo = Loop::new(Handle::new(device, None, step_s), STEPS, 0, STEP_MM);
    let rest_mm = -steps * STEP_MM;
    servo.handle.put(rest_mm + from_mm, 0.0, 0.0);
    let push_n = -rest_mm * near.law.stiffness_n_per_mm;
    let Moves { span, rms_mm_s } = settle(wall, near, &mut servo, push_n, (settle_s, look_s), |_| {});
    ((span.1 - rest_mm).max(rest_mm - span.0), rms_mm_s)
}

/// Bounds of a device: distance \[mm\] and rms speed \[mm/s\].
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

/// A device that swings by so many radians a tick, with a multiple of the damping that it needs.
fn device(near: &Near, radians: f64, times: f64, friction_n: f64) -> Device {
    let damping_ns_per_m = times * near.needed_ns_per_m(0.0);
    Device { mass_kg: near.mass_kg(radians), damping_ns_per_m, friction_n }
}

/// Least rms speed of a device without dry friction that rests at a depth of so many steps \[mm/s\].
fn least_mm_s(near: &Near, device: Device, steps: f64) -> f64 {
    let off_n = (steps - steps.round()).abs() * STEP_MM * near.law.stiffness_n_per_mm;
    let half = 0.5 * device.damping_ns_per_m * near.tick_s() / device.mass_kg;
    1e3 * off_n / device.damping_ns_per_m * (1.0 - half.tanh() / half).sqrt()
}

pub(super) fn below(
    wall: &mut Wall,
    near: &Near,
    subject: &Subject<'_>,
    figures: &mut Figures,
) -> Result<(), Stop> {
    // Steps do not matter where Hooke's law ends earlier.
    if !is_deep(near) {
        return Ok(());
    }
    let (needed, taken) = (needed_n(near), taken_n(wall, near));
    let [got, all] = [taken, needed].map(|x| 1e3 * x);
    let within = taken <= needed * 1.001;
    ensure!(within, "a motion over the borders of steps takes out {got:.3} mN; the bound is {all:.3}");
    let reached = !near.is_hooke() || taken >= needed * 0.999;
    ensure!(reached, "motions over the borders of steps take out {got:.3} mN instead of {all:.3} mN");
    figures.note(all, "mN of dry friction taken by steps");
    let times = [1.5, 4.0].into_iter().flat_map(|times| [0.14, 0.5].map(|radians| (times, radians)));
    for ((times, radians), part) in times.flat_map(|it| [0.0, 0.5].map(|part| (it, part))) {
        let device = device(near, radians, times, part * needed);
        let (far, fast) = bounds(near, device);
        // 20 times the time in which its swings fall to 1/e.
        let settle_s = 40.0 * device.mass_kg / (device.damping_ns_per_m - near.needed_ns_per_m(0.0));
        let look_s = subject.by_effort(1.0, 4.0, 600.0);
        for rest in [8.0, 8.3, 8.5] {
            let (it, rms) = tremble(wall, near, device, rest, (2.0 * STEP_MM, settle_s, look_s));
            let Device { mass_kg, damping_ns_per_m, friction_n } = device;
            let dry = 1e3 * friction_n;
            let told =
                format!("{mass_kg:.3} kg with {damping_ns_per_m:.3} N s/m and {dry:.1} mN of dry friction");
            ensure!(
                it <= far && rms <= fast,
                "{told} tremble by {it:.4} mm and {rms:.2} mm/s; the bounds are {far:.4} and {fast:.2}"
            );
            let least = if part == 0.0 && near.is_hooke() { least_mm_s(near, device, rest) } else { 0.0 };
            ensure!(rms >= least, "{told} lie still between two steps: {rms:.2e} mm/s, not {least:.2e}");
            figures.note(it / far, "of the distance that it may tremble");
        }
    }
    Ok(())
}

pub(super) fn above(
    wall: &mut Wall,
    near: &Near,
    _: &Subject<'_>,
    figures: &mut Figures,
) -> Result<(), Stop> {
    if !is_deep(near) {
        return Ok(());
    }
    let needed = needed_n(near);
    for (radians, part) in [(0.14, 1.2), (0.14, 2.8), (0.5, 1.2), (0.5, 2.8)] {
        let device = device(near, radians, 1.5, part * needed);
        let from_mm = 8.0 * STEP_MM;
        let swings = 1.0 + 0.25 * from_mm * near.law.stiffness_n_per_mm / (device.friction_n - needed);
        let still_s = swings * TAU / radians * near.tick_s();
        for rest in [10.0, 10.3, 10.5] {
            let (_, rms) = tremble(wall, near, device, rest, (from_mm, still_s, 0.5));
            let (kg, dry) = (device.mass_kg, 1e3 * device.friction_n);
            ensure!(
                rms == 0.0,
                "{kg:.3} kg with {dry:.1} mN of dry friction, {part} times the needed one, still moves after \
                 {still_s:.2} s: {rms:.2e} mm/s"
            );
            figures.note(still_s, "s until it lies still");
        }
    }
    Ok(())
}
