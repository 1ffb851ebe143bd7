//! The force law that a device's servo evaluates at its own rate.
//!
//! With depth d = n . (p0 - p) in the plane, the force is n (k d - b v), where v is the velocity along n.
//! It is 0 out of contact, never against n, and never larger than the model or the device allows. The
//! velocity is a first difference behind a first-order low-pass ([`VELOCITY_HZ`]); both use the servo's
//! measured intervals. Around this:
//!
//! - A model that is older than [`MODEL_AGE`], invalid or not finite, or a position that is not finite: the
//!   force goes to 0 within [`LET_GO`]. When both are valid again, it comes back over [`TAKE_HOLD`], as after
//!   a start.
//! - A motion of the hand is answered at once, but at most at the slew limit. A change of the graph is not:
//!   the difference that a new model makes at the hand's position is carried on and decays with [`SETTLE`]
//!   (95 % in 9 ms). Where that lets the force grow, it grows no faster than the largest force in [`RISE`].
//!   So a plane that appears under the stylus pushes it out, and does not kick. With an unchanged model
//!   nothing is carried: the wall's own loop has no delay from this.
//! - Releasing is never slowed where the force would pull otherwise.
//!
//! The graph computes forces beside the plane (friction, drag, a magnet) once a tick. They are added,
//! smoothed with [`SETTLE`], in any direction. Invalid input takes them down as well. The sum is limited to
//! the largest force.

use std::time::Duration;

use asperity_live::ForceModel;

/// An older model is invalid.
pub const MODEL_AGE: Duration = Duration::from_millis(100);
/// Time from the largest force to 0 when the input is invalid.
pub const LET_GO: Duration = Duration::from_millis(20);
/// Time from 0 to the full force at a start.
pub const TAKE_HOLD: Duration = Duration::from_millis(500);
/// Time constant of the difference that a new model makes.
pub const SETTLE: Duration = Duration::from_millis(3);
/// Least time in which a new model lets the force grow from 0 to the largest.
pub const RISE: Duration = Duration::from_millis(50);
/// Corner frequency of the velocity's low-pass [Hz].
pub const VELOCITY_HZ: f64 = 100.0;
/// A longer time between two calls restarts the servo [s].
const STALL_S: f64 = 0.05;
/// Time from 0 to the largest force at the slew limit [s].
const SLEW_S: f64 = 0.004;

/// A valid model, with a normal of length 1 or 0.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Plane {
    point: [f64; 3],
    normal: [f64; 3],
    stiffness: f64,
    damping: f64,
    beside: [f64; 3],
    most: f64,
}

impl Plane {
    fn trusted(model: &ForceModel, now_ns: u64) -> Option<Self> {
        let numbers = [model.stiffness_n_per_mm, model.damping_ns_per_m, model.max_force_n];
        let sound = numbers.iter().all(|x| x.is_finite() && *x >= 0.0)
            && model.point.iter().chain(&model.normal).chain(&model.beside_n).all(|x| x.is_finite());
        let young = u128::from(now_ns.saturating_sub(model.time_ns)) <= MODEL_AGE.as_nanos();
        if !(model.valid && sound && young) {
            return None;
        }
        let length = size(model.normal);
        let normal = if length > 1e-9 { model.normal.map(|x| x / length) } else { [0.0; 3] };
        let [stiffness, damping, most] = numbers;
        Some(Self { point: model.point, normal, stiffness, damping, beside: model.beside_n, most })
    }

    /// Force on a hand: mm, mm/s, N.
    fn force(&self, position: [f64; 3], velocity: [f64; 3], most: f64) -> [f64; 3] {
        let depth = dot(self.normal, minus(self.point, position));
        if depth.is_nan() || depth <= 0.0 {
            return [0.0; 3];
        }
        let along = 1e-3 * dot(self.normal, velocity);
        let push = (self.stiffness * depth - self.damping * along).clamp(0.0, self.most.min(most));
        self.normal.map(|n| n * push)
    }
}

/// Evaluates the law by plain arithmetic: no allocation, no waiting.
#[derive(Clone, Debug)]
pub struct Servo {
    /// Largest force \[N\].
    force_n: f64,
    /// Fastest change of the force \[N/s\].
    slew_n_per_s: f64,
    plane: Plane,
    level: f64,
    last: Option<(u64, [f64; 3])>,
    velocity: [f64; 3],
    /// Difference of the force from the plane's, since the plane changed.
    carried: [f64; 3],
    wanted: [f64; 3],
    /// Force of the plane.
    force: [f64; 3],
    /// Smoothed force beside it.
    beside: [f64; 3],
}

impl Servo {
    /// A servo with a largest force \[N\], which is reached within 4 ms. A force that is not finite or below
    /// 0 counts as 0.
    pub fn new(force_n: f64) -> Self {
        let force_n = if force_n.is_finite() { force_n.max(0.0) } else { 0.0 };
        Self {
            force_n,
            slew_n_per_s: (force_n / SLEW_S).max(f64::MIN_POSITIVE),
            plane: Plane::default(),
            level: 0.0,
            last: None,
            velocity: [0.0; 3],
            carried: [0.0; 3],
            wanted: [0.0; 3],
            force: [0.0; 3],
            beside: [0.0; 3],
        }
    }

    /// Restarts from no force: the device was lost, or switched its motors off.
    pub fn restart(&mut self) {
        *self = Self { slew_n_per_s: self.slew_n_per_s, ..Self::new(self.force_n) };
    }

    /// The force \[N\] for a hand at `position` \[mm\] at `now_ns`, in the axes of the model.
    pub fn step(&mut self, now_ns: u64, position: [f64; 3], model: &ForceModel) -> [f64; 3] {
        let here = position.iter().all(|x| x.is_finite());
        let mut dt = self.last.map_or(0.0, |(then, _)| now_ns.saturating_sub(then) as f64 * 1e-9);
        if dt > STALL_S {
            self.restart();
            dt = 0.0;
        }
        let trusted = Plane::trusted(model, now_ns);
        self.turn_level(trusted.is_some() && here, dt);
        if here {
            self.measure(position, dt);
            if let Some(plane) = trusted {
                self.change(plane, position);
            }
            self.want(position, dt);
        }
        let there = self.last.map_or([0.0; 3], |(_, p)| p);
        self.last = Some((now_ns, if here { position } else { there }));
        self.command(dt);
        self.force()
    }

    /// The last force \[N\].
    pub fn force(&self) -> [f64; 3] {
        at_most(plus(self.force, self.beside.map(|x| x * self.level)), self.most())
    }

    fn most(&self) -> f64 {
        self.force_n.min(if self.plane == Plane::default() { f64::MAX } else { self.plane.most })
    }

    /// Last force along the plane's normal \[N\], at least 0: how hard the hand is held, which at rest is
    /// how hard it presses.
    pub fn normal_force(&self) -> f64 {
        dot(self.force, self.plane.normal).max(0.0)
    }

    fn turn_level(&mut self, up: bool, dt: f64) {
        let time = if up { TAKE_HOLD } else { LET_GO };
        let step = dt / time.as_secs_f64();
        self.level = if up { (self.level + step).min(1.0) } else { (self.level - step).max(0.0) };
        if self.level == 0.0 && !up {
            self.plane = Plane::default();
            self.carried = [0.0; 3];
            self.wanted = [0.0; 3];
            self.beside = [0.0; 3];
        }
    }

    fn measure(&mut self, position: [f64; 3], dt: f64) {
        let Some((_, before)) = self.last else { return };
        if dt <= 0.0 {
            return;
        }
        let weight = 1.0 - (-dt * std::f64::consts::TAU * VELOCITY_HZ).exp();
        for ((v, p), q) in self.velocity.iter_mut().zip(position).zip(before) {
            *v += weight * ((p - q) / dt - *v);
        }
    }

    fn change(&mut self, plane: Plane, position: [f64; 3]) {
        if plane != self.plane {
            let most = self.force_n;
            let (old, new) =
                (self.plane.force(position, self.velocity, most), plane.force(position, self.velocity, most));
            self.carried = plus(self.carried, minus(old, new));
            self.plane = plane;
        }
    }

    fn want(&mut self, position: [f64; 3], dt: f64) {
        let target = self.plane.force(position, self.velocity, self.force_n);
        let before = plus(target, self.carried);
        let decay = 1.0 - (-dt / SETTLE.as_secs_f64()).exp();
        let step = self.carried.map(|x| x * decay);
        // The size is convex in the share of the step, so this share grows it by no more than allowed.
        let growth = size(minus(before, step)) - size(before);
        let allowed = dt * self.force_n / RISE.as_secs_f64();
        let share = if growth > allowed { allowed / growth } else { 1.0 };
        let wanted = push_only(minus(before, step.map(|x| x * share)), self.plane.normal);
        self.carried = minus(wanted, target);
        self.wanted = wanted;
        self.beside = plus(self.beside, minus(self.plane.beside, self.beside).map(|x| x * decay));
    }

    fn command(&mut self, dt: f64) {
        let goal = self.wanted.map(|x| x * self.level);
        let change = at_most(minus(goal, self.force), self.slew_n_per_s * dt);
        self.force = push_only(at_most(plus(self.force, change), self.most()), self.plane.normal);
    }
}

/// Removes the part of a force that pulls into the plane.
fn push_only(force: [f64; 3], normal: [f64; 3]) -> [f64; 3] {
    let along = dot(force, normal).min(0.0);
    minus(force, normal.map(|n| n * along))
}

/// Scales a vector down to a size of at most `most`.
fn at_most(vector: [f64; 3], most: f64) -> [f64; 3] {
    let share = if size(vector) > most { most / size(vector) } else { 1.0 };
    vector.map(|x| x * share)
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn size(a: [f64; 3]) -> f64 {
    dot(a, a).sqrt()
}

fn plus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[cfg(test)]
mod tests;
