//! Friction along the surface: three laws, of the velocity along it and the normal force.
//!
//! | law | sticks | stick-slip | remembers |
//! |---|---|---|---|
//! | `viscous_coulomb` | no | no | nothing |
//! | `dahl` | as a spring | no: static and kinetic friction are one | the bristle |
//! | `lugre` | as a spring | yes | the bristle |
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
//! # Usual values
//!
//! Usual values are as stiff as Colgate's bound allows, `b > K (T/2 + t_d) + |B|`, on the shipped devices:
//!
//! - b = 2 N s/m, the damping that every shipped scene states;
//! - T = 2 ms: the graph computes friction once a tick, at 500 Hz unless it says otherwise;
//! - t_d = 0.5 ms, the exchange with an Inverse3; a Touch and a simulated device have none;
//! - F_n = 3.3 N, the largest normal force.
//!
//! So `1.5 ms K + |B|` has to stay below 2 N s/m.

use crate::prelude::*;
use asperity_numbers::Elementary as _;
use asperity_state::State;

use crate::effects::bounds::{counted_positive, counted_vector, dot};
use crate::effects::voices::Voice;

/// The usual slope of viscous friction \[s/mm\]: a twentieth of the normal force at 100 mm/s.
///
/// See [usual values](self#usual-values): the slope c has B = c F_n, so c has to be below 2 / 3300 s/mm.
pub(crate) const VISCOSITY_S_PER_MM: f64 = 0.0005;

/// The usual stiffness of a bristle \[N/mm\]: at 1 N and a coefficient of 0.3, it sticks for 0.3 mm.
///
/// See [usual values](self#usual-values): alone, it takes 1.5 N s/m of the 2.
pub(crate) const BRISTLE_N_PER_MM: f64 = 1.0;

/// Settings of LuGre friction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LuGreSettings {
    /// At least the kinetic one.
    pub static_coefficient: f64,
    pub kinetic_coefficient: f64,
    /// Speed at which static friction has fallen to kinetic friction but for 1/e, v_s.
    pub stribeck_speed_mm_s: f64,
    /// s0.
    pub bristle_stiffness_n_per_mm: f64,
    /// s1, at rest.
    pub bristle_damping_ns_per_m: f64,
    /// Viscous friction, as a part of the normal force for every mm/s.
    pub viscosity_s_per_mm: f64,
}

impl Default for LuGreSettings {
    /// Rubber on glass. Bristle and damping take 1.8 of the 2 N s/m of the [usual values](self#usual-values).
    fn default() -> Self {
        Self {
            static_coefficient: 0.8,
            kinetic_coefficient: 0.5,
            stribeck_speed_mm_s: 30.0,
            bristle_stiffness_n_per_mm: BRISTLE_N_PER_MM,
            bristle_damping_ns_per_m: 0.3,
            viscosity_s_per_mm: 0.0,
        }
    }
}

/// A law with its settings.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Model {
    ViscousCoulomb { coefficient: f64, viscosity_s_per_mm: f64 },
    Dahl { coefficient: f64, stiffness_n_per_mm: f64 },
    LuGre(LuGreSettings),
}

/// Friction by a law, and its bristle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rubbing {
    model: Model,
    /// Bend of the bristle along the surface. Viscous friction has none.
    bent_mm: [f64; 2],
}

impl Rubbing {
    fn of(model: Model) -> Self {
        Self { model, bent_mm: [0.0; 2] }
    }

    /// Friction that begins as drag: `F_n c |v|` up to `mu F_n`, against the velocity. It is continuous in
    /// velocity and normal force, remembers nothing and does not stick.
    pub(crate) fn viscous_coulomb(coefficient: f64, viscosity_s_per_mm: f64) -> Self {
        Self::of(Model::ViscousCoulomb { coefficient, viscosity_s_per_mm })
    }

    /// Dahl's friction (P. R. Dahl, "A solid friction model", 1968) on a plane: a bristle that bends as the
    /// surface passes, and gives way,
    ///
    /// ```text
    /// z' = v - s0 |v| z / F_c,    F = -s0 z,    F_c = mu F_n
    /// ```
    ///
    /// with v the vector of the velocity. In steady motion, F is F_c against it. Where the motion turns, the
    /// force follows within some F_c / s0 of distance. For small displacements it is a spring. It does not
    /// depend on speed.
    ///
    /// As in Dahl's model, motion to and fro under a steady pull creeps. So does a stylus at rest whose
    /// position is noisy.
    pub(crate) fn dahl(coefficient: f64, stiffness_n_per_mm: f64) -> Self {
        Self::of(Model::Dahl { coefficient, stiffness_n_per_mm })
    }

    /// LuGre friction (C. Canudas de Wit, H. Olsson, K. J. Astrom, P. Lischinsky, "A new model for control of
    /// systems with friction", IEEE Transactions on Automatic Control 40, 1995, pp. 419-425) on a plane:
    /// Dahl's bristle, which bends less far the faster the surface passes,
    ///
    /// ```text
    /// z' = v - s0 |v| z / g(v),    g = F_n (mu_k + (mu_s - mu_k) e^(-(|v| / v_s)^2))
    /// F  = -(s0 z + s1(v) z' + F_n c v)
    /// ```
    ///
    /// A stylus sticks up to `mu_s F_n` and slips at `mu_k F_n`. On a spring it alternately sticks and
    /// slips, under two conditions. The bristle is stiff against the spring, and the mass is slow against `g
    /// / (s0
    /// |v|)`, the time in which the bristle gives way. So a soft bristle glides where a stiff one jerks. With
    /// the usual settings, 0.2 kg on 300 N/m pulled at 30 mm/s jerk six times a second. At 500 Hz this is
    /// within 1 % of an integration at 1 MHz; a bristle of 10 N/mm takes 1 kHz.
    ///
    /// With a constant s1 the model is dissipative only where the viscous part is at least
    /// `s1 (mu_s - mu_k) / mu_k` (N. Barabanov and R. Ortega, "Necessary and sufficient conditions for
    /// passivity of the LuGre friction model", IEEE Transactions on Automatic Control 45, 2000, pp. 830-832).
    /// Otherwise a bristle that is bent far when it begins to slip springs back and pushes. H. Olsson's
    /// remedy ("Control systems with friction", Lund 1996) is a damping that falls with speed so that `s1(v)
    /// <= 4 g / |v|`. Here
    ///
    /// ```text
    /// s1(v) = s1 / (1 + s1 |v| / g)
    /// ```
    ///
    /// which is s1 at rest and never above `g / |v|`, whatever the parameters. Then the force of a whole tick
    /// is dissipative as well (see the [module](self)). Without a normal force no part is left.
    pub(crate) fn lugre(settings: LuGreSettings) -> Self {
        Self::of(Model::LuGre(settings))
    }

    /// The force on the stylus \[N\] after a tick of `dt_s` at this velocity. A velocity or a time that is
    /// not a number bends nothing.
    pub(crate) fn step(&mut self, velocity_mm_s: [f64; 2], normal_force_n: f64, dt_s: f64) -> [f64; 2] {
        let velocity = counted_vector(velocity_mm_s);
        let (normal, dt) = (counted_positive(normal_force_n), counted_positive(dt_s));
        let speed = velocity[0].hypotenuse(velocity[1]);
        match self.model {
            Model::ViscousCoulomb { coefficient, viscosity_s_per_mm } => {
                let (most, drag) = (coefficient * normal, viscosity_s_per_mm * normal);
                if drag * speed <= most {
                    velocity.map(|v| -drag * v)
                } else {
                    velocity.map(|v| -most * (v / speed))
                }
            }
            Model::Dahl { coefficient, stiffness_n_per_mm } => {
                let most_mm = coefficient * normal / stiffness_n_per_mm;
                self.hold(most_mm);
                self.pass(velocity, speed, most_mm, dt);
                self.bent_mm.map(|z| -stiffness_n_per_mm * z)
            }
            Model::LuGre(s) => self.slip(&s, velocity, speed, normal, dt),
        }
    }

    fn slip(&mut self, s: &LuGreSettings, velocity: [f64; 2], speed: f64, normal: f64, dt: f64) -> [f64; 2] {
        let stiffness = s.bristle_stiffness_n_per_mm;
        self.hold(s.static_coefficient * normal / stiffness);
        let gives_way = normal
            * (s.kinetic_coefficient
                + (s.static_coefficient - s.kinetic_coefficient)
                    * (-(speed / s.stribeck_speed_mm_s).powi(2)).exp_e());
        if gives_way <= 0.0 {
            // Nothing to bend it against: no normal force, or no friction at this speed.
            self.hold(if speed > 0.0 { 0.0 } else { f64::MAX });
            let drag = s.viscosity_s_per_mm * normal;
            return std::array::from_fn(|i| -stiffness * self.bent_mm[i] - drag * velocity[i]);
        }
        self.pass(velocity, speed, gives_way / stiffness, dt);
        let damping = 1e-3 * s.bristle_damping_ns_per_m;
        let damping = damping / (1.0 + damping * speed / gives_way);
        // s0 z + s1 z' + F_n c v, with z' = v - (s0 |v| / g) z
        let of_bend = stiffness * (1.0 - damping * speed / gives_way);
        let of_speed = damping + s.viscosity_s_per_mm * normal;
        std::array::from_fn(|i| -of_bend * self.bent_mm[i] - of_speed * velocity[i])
    }

    /// The law at rest under this normal force, along the surface: the bristle's stiffness and damping, and
    /// the viscous part. With the usual slope, viscous friction has 0.5 N s/m under a newton.
    pub(crate) fn law(&self, normal_force_n: f64) -> Law {
        let normal = counted_positive(normal_force_n);
        let (stiffness_n_per_mm, damping_ns_per_m) = match self.model {
            Model::ViscousCoulomb { coefficient, viscosity_s_per_mm } if coefficient > 0.0 => {
                (0.0, 1e3 * viscosity_s_per_mm * normal)
            }
            Model::Dahl { coefficient, stiffness_n_per_mm } if coefficient > 0.0 => (stiffness_n_per_mm, 0.0),
            Model::LuGre(s) if normal != 0.0 => (
                s.bristle_stiffness_n_per_mm,
                s.bristle_damping_ns_per_m + 1e3 * s.viscosity_s_per_mm * normal,
            ),
            _ => (0.0, 0.0),
        };
        Law { stiffness_n_per_mm, damping_ns_per_m }
    }

    /// Takes the bristle from one pair of tangents to another. Tangents are directions along the surface of
    /// length 1. The bristle stays as it stands in space; the part that stands out of the new tangents is
    /// released. It never gets longer, whatever the tangents are, so this gives no energy.
    pub(crate) fn turn(&mut self, from: &[[f64; 3]; 2], to: &[[f64; 3]; 2]) {
        if matches!(self.model, Model::ViscousCoulomb { .. }) {
            return;
        }
        let [u, v] = self.bent_mm;
        let bent: [f64; 3] = std::array::from_fn(|k| u * from[0][k] + v * from[1][k]);
        let turned = to.map(|t| bent[0] * t[0] + bent[1] * t[1] + bent[2] * t[2]);
        let most_mm = dot(self.bent_mm, self.bent_mm).sqrt();
        self.bent_mm = counted_vector(turned);
        self.hold(most_mm);
    }

    /// Releases the bend beyond `most_mm`.
    fn hold(&mut self, most_mm: f64) {
        let square = dot(self.bent_mm, self.bent_mm);
        // A bend that was cut to `most_mm` is not cut again because of rounding.
        if square > most_mm * most_mm * (1.0 + 1e-12) {
            let share = most_mm / square.sqrt();
            self.bent_mm = self.bent_mm.map(|z| share * z);
        }
    }

    /// Passes a tick in which the surface moves at `velocity`, of size `speed`. The bend goes toward `end_mm`
    /// along it.
    fn pass(&mut self, velocity: [f64; 2], speed: f64, end_mm: f64, dt_s: f64) {
        if speed <= 0.0 || end_mm <= 0.0 {
            return;
        }
        let way = speed * dt_s / end_mm;
        let (left, gone) = ((-way).exp_e(), -(-way).exp_less_1());
        for (z, v) in self.bent_mm.iter_mut().zip(velocity) {
            *z = *z * left + end_mm * (v / speed) * gone;
        }
    }
}

impl Voice for Rubbing {
    /// Unbends the bristle.
    fn reset(&mut self) {
        self.bent_mm = [0.0; 2];
    }

    /// Bend of the bristle.
    fn state(&mut self, state: &mut State<'_>) {
        state.keep(&mut self.bent_mm);
        state.require(self.bent_mm.iter().all(|z| z.abs() < 1e12));
    }
}

#[cfg(test)]
#[path = "law_tests.rs"]
mod tests;
