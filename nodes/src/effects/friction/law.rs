//! Friction along the surface: three laws, of the velocity along it and the normal force.
//!
//! | law | sticks | stick-slip | remembers |
//! |---|---|---|---|
//! | [`ViscousCoulomb`](super::ViscousCoulomb) | no | no | nothing |
//! | [`Dahl`](super::Dahl) | as a spring | no: static and kinetic friction are one | the bristle |
//! | [`LuGre`](super::LuGre) | as a spring | yes | the bristle |
//!
//! Velocities are plane vectors along the surface in mm/s, of the tick that has just passed. They are not
//! filtered: behind a low-pass, friction comes late and drives the motion that it should brake. Results are
//! forces on the stylus in N, against the motion. Call a law once a tick, also out of contact, where the
//! normal force is 0 and so is the result.
//!
//! # Energy
//!
//! All laws are dissipative for any velocities, normal forces and lengths of ticks. With F the force on the
//! stylus that a call returns and v the velocity that it was given, `sum -F v dt` is never below 0. (A bound
//! on the loop is another matter, since a force answers the tick before it: each law states its
//! [`Law`](asperity_node::Law) at rest.)
//!
//! The two bristles `z` \[mm\] store `s0 |z|^2 / 2`. Their stiffness `s0` does not depend on the normal
//! force. Their largest bend does: it is `mu F_n / s0`. When the normal force falls, a bristle that is bent
//! further is released to that bend at once, and the released energy is lost. A stiffness that grew with the
//! normal force would give energy that it never took: bend it under a light hand, press, let go. A bristle
//! that held is kept while the normal force trembles.
//!
//! The tangents change where the surface curves or another surface of the same law begins. Then `turn` keeps
//! the bristle as it stands in space, and releases the part that stands out of the new plane.
//!
//! For one tick of constant v and F_n the bristle obeys `z' = v - a z`, `a = s0 |v| / g`, a linear equation
//! that is solved exactly,
//!
//! ```text
//! z <- z e^(-a dt) + (g / s0) (v / |v|) (1 - e^(-a dt))
//! ```
//!
//! so no tick is too long. Along it `F v` rises, or falls to a limit that takes energy. A call returns the
//! force at the tick's end. So this force takes at least the energy that the exact one takes.
//!
//! A call takes 9 ns for viscous friction, 22 ns for Dahl's and 38 ns for LuGre's on a virtual AMD EPYC core
//! (a loop over one law alone).

use asperity_numbers::Elementary as _;
use asperity_state::State;

use crate::effects::bounds::{counted_positive, counted_vector, dot};

/// Largest coefficient of friction.
pub(super) const MAX_COEFFICIENT: f64 = 10.0;
/// Range of a bristle's stiffness \[N/mm\].
pub(super) const BRISTLE: (f64, f64) = (1e-3, 1000.0);
/// Range of the viscosity \[s/mm\].
pub(super) const VISCOSITY: (f64, f64) = (0.0, 10.0);

/// Bend along the surface, in mm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Bristle {
    pub(super) bent_mm: [f64; 2],
}

impl Bristle {
    /// Releases the bend beyond `most_mm`.
    pub(super) fn hold(&mut self, most_mm: f64) {
        let square = dot(self.bent_mm, self.bent_mm);
        // A bend that was cut to `most_mm` is not cut again because of rounding.
        if square > most_mm * most_mm * (1.0 + 1e-12) {
            let share = most_mm / square.sqrt();
            self.bent_mm = self.bent_mm.map(|z| share * z);
        }
    }

    /// Turns the bristle to new tangents, where the direction of the surface changes. The bristle stays as it
    /// stands in space; the part that stands out of the new tangents is released. It never gets longer,
    /// whatever the tangents are.
    pub(super) fn turn(&mut self, from: &[[f64; 3]; 2], to: &[[f64; 3]; 2]) {
        let [u, v] = self.bent_mm;
        let bent: [f64; 3] = std::array::from_fn(|k| u * from[0][k] + v * from[1][k]);
        let turned = to.map(|t| bent[0] * t[0] + bent[1] * t[1] + bent[2] * t[2]);
        let most_mm = dot(self.bent_mm, self.bent_mm).sqrt();
        *self = Self { bent_mm: counted_vector(turned) };
        self.hold(most_mm);
    }

    /// Passes a tick in which the surface moves at `velocity`, of size `speed`. The bend goes toward `end_mm`
    /// along it.
    pub(super) fn pass(&mut self, velocity: [f64; 2], speed: f64, end_mm: f64, dt_s: f64) {
        if speed <= 0.0 || end_mm <= 0.0 {
            return;
        }
        let way = speed * dt_s / end_mm;
        let (left, gone) = ((-way).exp_e(), -(-way).exp_less_1());
        for (z, v) in self.bent_mm.iter_mut().zip(velocity) {
            *z = *z * left + end_mm * (v / speed) * gone;
        }
    }

    pub(super) fn state(&mut self, state: &mut State<'_>) {
        state.keep(&mut self.bent_mm);
        if state.restores() && !self.bent_mm.iter().all(|z| z.abs() < 1e12) {
            *self = Self::default();
            state.refuse();
        }
    }
}

/// Velocity and its size, normal force and time, each finite and limited.
pub(super) fn inputs(velocity_mm_s: [f64; 2], normal_force_n: f64, dt_s: f64) -> ([f64; 2], f64, f64, f64) {
    let velocity = counted_vector(velocity_mm_s);
    (velocity, velocity[0].hypotenuse(velocity[1]), counted_positive(normal_force_n), counted_positive(dt_s))
}
