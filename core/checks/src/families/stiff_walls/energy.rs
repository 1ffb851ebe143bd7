//! What a wall gives to a device and takes from it.
//!
//! A force F_k that is read at x_k and held over a tick gives `F_k (x_k+1 - x_k)`. A device's damping b takes least where the speed is constant from tick to
//! tick: `b sum (x_k+1 - x_k)^2 / T`. Such a motion is played here, so that what is found is what no device of this damping can take; a wall `F = -K x` gives
//!
//! ```text
//! -K x_k (x_k+1 - x_k) = U(x_k) - U(x_k+1) + K (x_k+1 - x_k)^2 / 2,    U = K x^2 / 2
//! ```
//!
//! so that over any closed way it is worth a damping of K T/2, and no more where it is left on the way, since U is convex. A damper B gives
//! `-B (x_k - x_k-1) (x_k+1 - x_k) / T`, at most `B sum (x_k+1 - x_k)^2 / T`. That is the bound K T/2 + B, for any way and any device, also for parts of both that are
//! cut off at 0 and at a greatest force.

use std::f64::consts::TAU;

use asperity_node::random;

use crate::case::{Not, holds};
use crate::handle::{Device, Handle, Loop};
use crate::wall::{Curve, Near, Wall};

/// Positions of a swing.
const POINTS: u32 = 64;

/// Goes through places outside the surface \[mm\], one a run of the wall, at constant speed between them, and again from the first on. Answers what the
/// wall gave on the second round \[mJ\] and what a damper of 1 N s/m would have taken \[mJ\].
fn round(wall: &mut Wall, near: &Near, places_mm: &[f64]) -> (f64, f64) {
    let (every, tick_s) = (wall.every(), near.tick_s());
    let (mut given, mut taken) = (0.0, 0.0);
    wall.reset();
    for n in 0..2 * places_mm.len() {
        let (Some(&x), Some(&to)) =
            (places_mm.get(n % places_mm.len()), places_mm.get((n + 1) % places_mm.len()))
        else {
            continue;
        };
        let part = (to - x) / every as f64;
        for k in 0..every {
            let force = wall.above(&near.spot, x + k as f64 * part);
            if n >= places_mm.len() {
                given += force * part;
            }
        }
        if n >= places_mm.len() {
            taken += 1e-3 * (to - x).powi(2) / tick_s;
        }
    }
    (given, taken)
}

/// How far a swing may go in the middle of where Hooke's law holds, and where that is \[mm\]: with what damping adds to the force it leaves neither end.
fn swing(near: &Near) -> (f64, f64) {
    let (middle, law) = (0.5 * near.deep_mm, near.law);
    let by_speed = 2e-3 * law.damping_ns_per_m.abs() / near.tick_s();
    let most = middle * law.stiffness_n_per_mm / (law.stiffness_n_per_mm + by_speed);
    (0.5 * most, -middle)
}

/// What a wall is worth as a damping that is missing \[N s/m\], at every frequency up to half the rate: measured, and by the closed form
/// `K T/2 sin((1/2 + n) w T) / sin(w T / 2) - B cos((1 + n) w T)`, for a delay of n ticks.
pub(super) struct Swings {
    /// The most that was measured.
    pub most_ns_per_m: f64,
    /// At this many Hz.
    pub at_hz: f64,
    /// The most that the closed form is off.
    pub off_ns_per_m: f64,
}

pub(super) fn swings(wall: &mut Wall, near: &Near) -> Swings {
    let (size, middle) = swing(near);
    let tick_s = near.tick_s();
    let late = near.sampling.delay_s / tick_s;
    let mut it = Swings { most_ns_per_m: f64::MIN, at_hz: 0.0, off_ns_per_m: 0.0 };
    for turns in 1..=POINTS / 2 {
        let angle = TAU * f64::from(turns) / f64::from(POINTS);
        let places: Vec<f64> = (0..POINTS).map(|k| middle + size * (angle * f64::from(k)).cos()).collect();
        let (given, taken) = round(wall, near, &places);
        let found = given / taken;
        let spring =
            0.5e3 * near.law.stiffness_n_per_mm * tick_s * ((0.5 + late) * angle).sin() / (0.5 * angle).sin();
        let want = spring - near.law.damping_ns_per_m * ((1.0 + late) * angle).cos();
        it.off_ns_per_m = it.off_ns_per_m.max((found - want).abs());
        if found > it.most_ns_per_m {
            (it.most_ns_per_m, it.at_hz) = (found, angle / TAU / tick_s);
        }
    }
    it
}

/// The most that a wall is worth as a missing damping on ways that go in and out by chance, from outside and back there \[N s/m\].
pub(super) fn by_chance(wall: &mut Wall, near: &Near, ways: u64) -> f64 {
    let mut most = f64::MIN;
    for way in 0..ways {
        let random = |k: u64| random::uniform(0x5717_ff00 + way, k);
        // From small steps to such as go in and out at once.
        let step = near.deep_mm * 10.0_f64.powf(-2.0 * random(0));
        let mut x = near.deep_mm;
        let mut places = vec![x];
        for k in 1..200 {
            x = (x + step * (2.0 * random(k) - 1.0)).clamp(-0.8 * near.deep_mm, near.deep_mm);
            // A drift inwards and back.
            x -= 0.02 * near.deep_mm * (TAU * k as f64 / 200.0).sin();
            places.push(x);
        }
        let (given, taken) = round(wall, near, &places);
        most = most.max(given / taken);
    }
    most
}

/// A device on a wall.
pub(super) struct Fall<'a> {
    /// The wall.
    pub near: &'a Near,
    /// Its energy by place.
    pub curve: &'a Curve,
    /// The device.
    pub device: Device,
    /// A force into the wall beside its own \[N\].
    pub push_n: f64,
    /// How late forces come beside the graph's own delay, in parts of a tick.
    pub late: (usize, usize),
    /// Where it begins \[mm\], outside.
    pub from_mm: f64,
    /// How fast \[mm/s\], out.
    pub speed_mm_s: f64,
}

/// What became of it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fallen {
    /// Energy of device and wall at the beginning \[mJ\].
    pub first_mj: f64,
    /// The most there was in any tick.
    pub most_mj: f64,
    /// What it came back with: a tick after the wall it had left the first time let go of it \[mJ\].
    pub back_mj: f64,
    /// What it moved with in the last quarter at most \[mJ\].
    pub last_mj: f64,
    /// How often it came into the wall.
    pub contacts: u32,
}

/// Lets a device go for so many ticks.
///
/// # Errors
/// What is not finite.
pub(super) fn fall(wall: &mut Wall, it: &Fall<'_>, ticks: u64) -> Result<Fallen, Not> {
    wall.reset();
    let (late, of) = it.late;
    let steps = of.max(1) * if it.device.friction_n > 0.0 { 40 } else { 1 };
    let late = late * steps / of.max(1);
    let step_s = 1.0 / wall.tick_hz() / steps as f64;
    let mut servo = Loop::new(Handle::new(it.device, None, step_s), steps, late, 0.0);
    servo.handle.put(it.from_mm, it.speed_mm_s, 0.0);
    let energy = |h: &Handle| h.energy_mj() + it.push_n * h.x_mm() + it.curve.energy_mj(h.x_mm());
    let first_mj = energy(&servo.handle);
    let mut done = Fallen { first_mj, most_mj: f64::MIN, back_mj: 0.0, last_mj: 0.0, contacts: 0 };
    let (mut inside, mut left) = (false, None);
    let lets_go = it.late.0.div_ceil(of.max(1)) as u64 + wall.every();
    for tick in 0..ticks {
        servo.tick(|x| wall.above(&it.near.spot, x), -it.push_n, |_| {});
        let (now, moves) = (energy(&servo.handle), servo.handle.energy_mj());
        holds(now.is_finite(), || format!("the device is nowhere after {tick} ticks"))?;
        done.most_mj = done.most_mj.max(now);
        if 4 * tick >= 3 * ticks {
            done.last_mj = done.last_mj.max(moves);
        }
        let enters = servo.handle.x_mm() < 0.0;
        done.contacts += u32::from(enters && !inside);
        if inside && !enters {
            left.get_or_insert(tick);
        }
        if left.is_some_and(|left| tick == left + lets_go) {
            done.back_mj = moves;
        }
        inside = enters;
    }
    Ok(done)
}
