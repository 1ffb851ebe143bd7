//! `friction`: force against the motion along a surface.

mod dahl;
#[cfg(test)]
mod energy_tests;
pub mod law;
mod lugre;
#[cfg(test)]
mod stick_slip_tests;
mod viscous_coulomb;

use asperity_node::{
    Acts, Descriptor, Diagnostic, Direction, Effect, Fact, Form, Input, Node, Param, Prepared, Processor,
    Settings, Setup, ShapeSpec, State, Status, Tick, Unit,
};

pub use dahl::Dahl;
pub use lugre::{LuGre, LuGreSettings};
pub use viscous_coulomb::ViscousCoulomb;

use super::voices::{Voice, Voices};
use super::{each, let_go, made, put, slot, vector};

const SLOT: usize = 0;
const VELOCITY: usize = 1;
const FORCE: usize = 2;
const TANGENTS: usize = 3;

/// Tangents of a floor.
const FLAT: [[f64; 3]; 2] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

/// A force along the surface against the velocity there, by the law of the surface that is touched.
///
/// It is called in contact and once more to let go. When another law comes on, its bristles begin unbent.
/// Where tangents change, bristles stay as they stand in space.
pub struct Friction {
    laws: Voices<Law>,
    /// Tangents of the tick before, along which bristles are bent.
    tangents: [[f64; 3]; 2],
    dt_s: f64,
}

/// One of the laws.
#[derive(Clone, Copy)]
enum Law {
    ViscousCoulomb(ViscousCoulomb),
    Dahl(Dahl),
    LuGre(LuGre),
}

impl Law {
    fn read(settings: &Settings) -> Result<Self, Diagnostic> {
        let number = |name| settings.number(name);
        let law = match settings.form() {
            "viscous_coulomb" => ViscousCoulomb::new(number("coefficient"), number("viscosity_s_per_mm"))
                .map(Self::ViscousCoulomb),
            "dahl" => Dahl::new(number("coefficient"), number("bristle_stiffness_n_per_mm")).map(Self::Dahl),
            _ => LuGre::new(LuGreSettings {
                static_coefficient: number("static_coefficient"),
                kinetic_coefficient: number("kinetic_coefficient"),
                stribeck_speed_mm_s: number("stribeck_speed_mm_s"),
                bristle_stiffness_n_per_mm: number("bristle_stiffness_n_per_mm"),
                bristle_damping_ns_per_m: number("bristle_damping_ns_per_m"),
                viscosity_s_per_mm: number("viscosity_s_per_mm"),
            })
            .map(Self::LuGre),
        };
        made(settings, law)
    }

    /// The law near rest, along the surface.
    fn near_rest(self, settings: &Settings, normal_force_n: f64) -> asperity_node::Law {
        match self {
            Self::ViscousCoulomb(_) | Self::Dahl(_) if settings.number("coefficient") == 0.0 => {
                asperity_node::Law::default()
            }
            Self::ViscousCoulomb(law) => law.law(normal_force_n),
            Self::Dahl(law) => law.law(),
            Self::LuGre(law) => law.law(normal_force_n),
        }
    }

    fn step(&mut self, velocity_mm_s: [f64; 2], normal_force_n: f64, dt_s: f64) -> [f64; 2] {
        match self {
            Self::ViscousCoulomb(law) => law.force_n(velocity_mm_s, normal_force_n),
            Self::Dahl(law) => law.step(velocity_mm_s, normal_force_n, dt_s),
            Self::LuGre(law) => law.step(velocity_mm_s, normal_force_n, dt_s),
        }
    }
}

/// Forms of the laws in a scene, with their usual values.
fn effect() -> Effect {
    let usual = LuGreSettings::default();
    let coefficient = |name, usual| Param::number(name, usual, 0.0..=10.0, "friction over normal force");
    let bristle = |usual| {
        Param::number("bristle_stiffness_n_per_mm", usual, 0.0..=1000.0, "stiffness of what sticks")
            .unit("N/mm")
    };
    let viscosity = |usual| {
        Param::number("viscosity_s_per_mm", usual, 0.0..=10.0, "part of the normal force per speed")
            .unit("s/mm")
    };
    let viscous_coulomb =
        Form::new("viscous_coulomb", "viscous_coulomb(coefficient: 0.3, viscosity_s_per_mm: 0.004)")
            .field(coefficient("coefficient", 0.3))
            .field(viscosity(ViscousCoulomb::VISCOSITY_S_PER_MM));
    let dahl = Form::new("dahl", "dahl(coefficient: 0.3, bristle_stiffness_n_per_mm: 1)")
        .field(coefficient("coefficient", 0.3))
        .field(bristle(1.0));
    let lugre = Form::new(
        "lugre",
        "lugre(static_coefficient: 0.8, kinetic_coefficient: 0.5, stribeck_speed_mm_s: 30, \
         bristle_stiffness_n_per_mm: 1, bristle_damping_ns_per_m: 0.3, viscosity_s_per_mm: 0)",
    )
    .field(coefficient("static_coefficient", usual.static_coefficient))
    .field(coefficient("kinetic_coefficient", usual.kinetic_coefficient))
    .field(
        Param::number("stribeck_speed_mm_s", usual.stribeck_speed_mm_s, 0.0..=1000.0, "where it slips")
            .unit("mm/s"),
    )
    .field(bristle(usual.bristle_stiffness_n_per_mm))
    .field(
        Param::number(
            "bristle_damping_ns_per_m",
            usual.bristle_damping_ns_per_m,
            0.0..=1000.0,
            "damping of what sticks",
        )
        .unit("N s/m"),
    )
    .field(viscosity(usual.viscosity_s_per_mm));
    Effect::new("laws", Acts::Touching)
        .form(viscous_coulomb)
        .form(dahl)
        .form(lugre)
        .needs("velocity", "slide")
        .needs("force", "force")
        .needs("tangents", "tangents")
        .check(|settings| Law::read(settings).map(drop))
        .law(Direction::Surface, |settings, normal_force_n| {
            Law::read(settings)
                .map_or_else(|_| asperity_node::Law::default(), |law| law.near_rest(settings, normal_force_n))
        })
}

impl Law {
    fn turn(&mut self, from: &[[f64; 3]; 2], to: &[[f64; 3]; 2]) {
        match self {
            Self::ViscousCoulomb(_) => {}
            Self::Dahl(law) => law.turn(from, to),
            Self::LuGre(law) => law.turn(from, to),
        }
    }
}

impl Voice for Law {
    fn reset(&mut self) {
        match self {
            Self::ViscousCoulomb(_) => {}
            Self::Dahl(law) => law.reset(),
            Self::LuGre(law) => law.reset(),
        }
    }

    fn state(&mut self, state: &mut State<'_>) {
        match self {
            // As much room as a bristle takes.
            Self::ViscousCoulomb(_) => _ = state.keep(&mut [0.0_f64; 2]),
            Self::Dahl(law) => law.state(state),
            Self::LuGre(law) => law.state(state),
        }
    }
}

impl Node for Friction {
    fn descriptor() -> Descriptor {
        Descriptor::new(
            "friction",
            "Force against the motion along a surface, by the law of the one that is touched.",
        )
        .input(slot("which of `laws`, from 0; below 0 nothing is touched").wakes())
        .input(
            Input::new("velocity", ShapeSpec::Control(2), Unit::MILLIMETRE_PER_SECOND).doc(
                "along the two tangents, as it is: behind a low-pass friction drives what it should brake",
            ),
        )
        .input(Input::new("force", ShapeSpec::Control(1), Unit::NEWTON).doc("normal force"))
        .input(Input::new("tangents", ShapeSpec::Control(6), Unit::NONE).or(0.0).doc(
            "two directions along the surface, of length 1: x, y, z of the first, then of the second; \
             unconnected, x and y",
        ))
        .output(super::force("force on the stylus, x, y, z"))
        .param(Param::texts(
            "laws",
            "Laws, each a text as behind `friction` in a scene, such as [\"dahl\", \
             \"viscous_coulomb(coefficient: 0.5)\"].",
        ))
        .effect(effect())
        .timing(
            "no latency: the force of a tick's velocity in that tick; not called while nothing is touched",
        )
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let laws = each(setup, Law::read)?;
        let dt_s = f64::from(setup.every) / f64::from(setup.tick_hz);
        Ok(Prepared::new(Self { laws: Voices::new(laws), tangents: FLAT, dt_s }))
    }
}

impl Processor for Friction {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        self.laws.turn(tick.inputs.value(SLOT));
        let Some(law) = self.laws.on().first_mut() else { return let_go(tick) };
        let mut tangents = FLAT;
        if tick.inputs.connected(TANGENTS) {
            tangents.as_flattened_mut().copy_from_slice(&vector::<6>(&tick.inputs, TANGENTS));
        }
        if tangents != self.tangents {
            law.turn(&self.tangents, &tangents);
            self.tangents = tangents;
        }
        let [u, v] = law.step(vector(&tick.inputs, VELOCITY), tick.inputs.value(FORCE), self.dt_s);
        put(tick, std::array::from_fn(|k| u * tangents[0][k] + v * tangents[1][k]));
        Status::Continue
    }

    fn reset(&mut self) {
        self.laws.reset();
        self.tangents = FLAT;
    }

    /// The law that is on, and the bend of its bristle.
    fn state(&mut self, state: &mut State<'_>) {
        self.laws.state(state);
        state.keep(&mut self.tangents);
        if state.restores() && !self.tangents.as_flattened().iter().all(|x| x.is_finite()) {
            self.tangents = FLAT;
            state.refuse();
        }
    }

    fn facts(&mut self) -> Vec<Fact> {
        vec![Fact::count("slots", self.laws.count() as u64)]
    }
}
