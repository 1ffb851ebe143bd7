use asperity_numbers::Elementary as _;
use asperity_state::State;

use super::law::{BRISTLE, Bristle, MAX_COEFFICIENT, VISCOSITY, inputs};
use asperity_node::Law;

use crate::effects::bounds::{EffectError, dot};

/// Settings of LuGre friction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LuGreSettings {
    /// Coefficient of static friction, from the kinetic one to 10.
    pub static_coefficient: f64,
    /// Coefficient of kinetic friction, 0 to 10.
    pub kinetic_coefficient: f64,
    /// Speed at which static friction has fallen to kinetic friction but for 1/e, v_s \[mm/s\], 0.01 to 1000.
    pub stribeck_speed_mm_s: f64,
    /// Stiffness of the bristle, s0 \[N/mm\], 0.001 to 1000.
    pub bristle_stiffness_n_per_mm: f64,
    /// Damping of the bristle at rest, s1 \[N s/m\], 0 to 1000.
    pub bristle_damping_ns_per_m: f64,
    /// Viscous friction, as a part of the normal force for every mm/s \[s/mm\], 0 to 10.
    pub viscosity_s_per_mm: f64,
}

impl Default for LuGreSettings {
    /// Rubber on glass, to a stylus on a device of 1 N s/m at 1 kHz.
    fn default() -> Self {
        Self {
            static_coefficient: 0.8,
            kinetic_coefficient: 0.5,
            stribeck_speed_mm_s: 30.0,
            bristle_stiffness_n_per_mm: 1.0,
            bristle_damping_ns_per_m: 0.3,
            viscosity_s_per_mm: 0.0,
        }
    }
}

/// LuGre friction (C. Canudas de Wit, H. Olsson, K. J. Astrom, P. Lischinsky, "A new model for control of
/// systems with friction", IEEE Transactions on Automatic Control 40, 1995, pp. 419-425) on a plane: Dahl's
/// bristle, which bends less far the faster the surface passes,
///
/// ```text
/// z' = v - s0 |v| z / g(v),    g = F_n (mu_k + (mu_s - mu_k) e^(-(|v| / v_s)^2))
/// F  = -(s0 z + s1(v) z' + F_n c v)
/// ```
///
/// A stylus sticks up to `mu_s F_n` and slips at `mu_k F_n`. On a spring it sticks and slips by turns, under
/// two conditions. The bristle is stiff against the spring, and the mass is slow against `g / (s0 |v|)`, the
/// time in which the bristle gives way. So a soft bristle glides where a stiff one jerks. With the usual
/// settings, 0.2 kg on 300 N/m pulled at 30 mm/s jerk six times a second. At 500 Hz this is within 1 % of an
/// integration at 1 MHz; a bristle of 10 N/mm takes 1 kHz.
///
/// With a constant s1 the model is dissipative only where the viscous part is at least
/// `s1 (mu_s - mu_k) / mu_k` (N. Barabanov and R. Ortega, "Necessary and sufficient conditions for passivity
/// of the LuGre friction model", IEEE Transactions on Automatic Control 45, 2000, pp. 830-832). Otherwise a
/// bristle that is bent far when it begins to slip springs back and pushes. H. Olsson's remedy ("Control
/// systems with friction", Lund 1996) is a damping that falls with speed so that `s1(v) <= 4 g / |v|`. Here
///
/// ```text
/// s1(v) = s1 / (1 + s1 |v| / g)
/// ```
///
/// which is s1 at rest and never above `g / |v|`, whatever the parameters. Then the force of a whole tick is
/// dissipative as well (see the [module](super)). Without a normal force no part is left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LuGre {
    settings: LuGreSettings,
    bristle: Bristle,
}

impl LuGre {
    /// Friction at rest.
    ///
    /// # Errors
    /// A setting out of its range.
    pub fn new(settings: LuGreSettings) -> Result<Self, EffectError> {
        let s = &settings;
        let kinetic = EffectError::check(
            "a coefficient of kinetic friction",
            s.kinetic_coefficient,
            (0.0, MAX_COEFFICIENT),
            "",
        )?;
        let most = (kinetic, MAX_COEFFICIENT);
        EffectError::check("a coefficient of static friction", s.static_coefficient, most, "")?;
        EffectError::check("a Stribeck speed", s.stribeck_speed_mm_s, (0.01, 1000.0), "mm/s")?;
        EffectError::check("a bristle's stiffness", s.bristle_stiffness_n_per_mm, BRISTLE, "N/mm")?;
        EffectError::check("a bristle's damping", s.bristle_damping_ns_per_m, (0.0, 1000.0), "N s/m")?;
        EffectError::check("a viscosity", s.viscosity_s_per_mm, VISCOSITY, "s/mm")?;
        Ok(Self { settings, bristle: Bristle::default() })
    }

    /// The settings.
    pub fn settings(&self) -> &LuGreSettings {
        &self.settings
    }

    /// The force on the stylus \[N\] after a tick of `dt_s` at this velocity. A velocity or a time that is
    /// not a number bends nothing.
    pub fn step(&mut self, velocity_mm_s: [f64; 2], normal_force_n: f64, dt_s: f64) -> [f64; 2] {
        let (velocity, speed, normal, dt) = inputs(velocity_mm_s, normal_force_n, dt_s);
        let s = &self.settings;
        let stiffness = s.bristle_stiffness_n_per_mm;
        self.bristle.hold(s.static_coefficient * normal / stiffness);
        let gives_way = normal
            * (s.kinetic_coefficient
                + (s.static_coefficient - s.kinetic_coefficient)
                    * (-(speed / s.stribeck_speed_mm_s).powi(2)).exp_e());
        if gives_way <= 0.0 {
            // Nothing to bend it against: no normal force, or no friction at this speed.
            self.bristle.hold(if speed > 0.0 { 0.0 } else { f64::MAX });
            let drag = s.viscosity_s_per_mm * normal;
            return std::array::from_fn(|i| -stiffness * self.bristle.bent_mm[i] - drag * velocity[i]);
        }
        self.bristle.pass(velocity, speed, gives_way / stiffness, dt);
        let damping = 1e-3 * s.bristle_damping_ns_per_m;
        let damping = damping / (1.0 + damping * speed / gives_way);
        // s0 z + s1 z' + F_n c v, with z' = v - (s0 |v| / g) z
        let of_bend = stiffness * (1.0 - damping * speed / gives_way);
        let of_speed = damping + s.viscosity_s_per_mm * normal;
        std::array::from_fn(|i| -of_bend * self.bristle.bent_mm[i] - of_speed * velocity[i])
    }

    /// The law at rest under this normal force, along the surface: the bristle's stiffness and damping, and
    /// the viscous part.
    pub fn law(&self, normal_force_n: f64) -> Law {
        let (_, _, normal, _) = inputs([0.0; 2], normal_force_n, 0.0);
        if normal == 0.0 {
            return Law::default();
        }
        Law {
            stiffness_n_per_mm: self.settings.bristle_stiffness_n_per_mm,
            damping_ns_per_m: self.settings.bristle_damping_ns_per_m
                + 1e3 * self.settings.viscosity_s_per_mm * normal,
        }
    }

    /// Energy in the bristle \[mJ\].
    pub fn stored_mj(&self) -> f64 {
        0.5 * self.settings.bristle_stiffness_n_per_mm * dot(self.bristle.bent_mm, self.bristle.bent_mm)
    }

    /// Unbends the bristle.
    pub fn reset(&mut self) {
        self.bristle = Bristle::default();
    }

    /// Takes the bristle from one pair of tangents to another. Tangents are directions along the surface of
    /// length 1. It gives no energy.
    pub fn turn(&mut self, from: &[[f64; 3]; 2], to: &[[f64; 3]; 2]) {
        self.bristle.turn(from, to);
    }

    /// Bend of the bristle.
    pub fn state(&mut self, state: &mut State<'_>) {
        self.bristle.state(state);
    }
}
