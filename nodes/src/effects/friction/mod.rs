//! `friction`: force against the motion along a surface.

mod law;
#[cfg(test)]
mod stick_slip_tests;

use crate::prelude::*;

pub(super) use law::{BRISTLE_N_PER_MM, LuGreSettings, Rubbing, VISCOSITY_S_PER_MM};

use super::voices::Voices;
use super::{Renders, each, let_go, put, slot, vector};

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
    laws: Voices<Rubbing>,
    /// Tangents of the tick before, along which bristles are bent.
    tangents: [[f64; 3]; 2],
    dt_s: f64,
}

fn read(settings: &Settings) -> Result<Rubbing, Diagnostic> {
    let number = |name| settings.number(name);
    Ok(match settings.form() {
        "viscous_coulomb" => Rubbing::viscous_coulomb(number("coefficient"), number("viscosity_s_per_mm")),
        "dahl" => Rubbing::dahl(number("coefficient"), number("bristle_stiffness_n_per_mm")),
        _ => {
            let (most, kinetic) = (number("static_coefficient"), number("kinetic_coefficient"));
            if most < kinetic {
                let message = format!("a static coefficient of {most} is below the kinetic one of {kinetic}");
                return Err(settings.node_error(message));
            }
            Rubbing::lugre(LuGreSettings {
                static_coefficient: most,
                kinetic_coefficient: kinetic,
                stribeck_speed_mm_s: number("stribeck_speed_mm_s"),
                bristle_stiffness_n_per_mm: number("bristle_stiffness_n_per_mm"),
                bristle_damping_ns_per_m: number("bristle_damping_ns_per_m"),
                viscosity_s_per_mm: number("viscosity_s_per_mm"),
            })
        }
    })
}

/// Forms of the laws in a scene, with their usual values.
fn effect() -> Effect {
    let usual = LuGreSettings::default();
    let coefficient =
        |name, usual| number(name, usual, 0.0..=10.0, "").doc("friction force divided by normal force");
    let bristle = |usual| {
        number("bristle_stiffness_n_per_mm", usual, 1e-3..=1000.0, "N/mm")
            .doc("stiffness of the contact while it sticks")
    };
    let viscosity = |usual| {
        number("viscosity_s_per_mm", usual, 0.0..=10.0, "s/mm")
            .doc("viscous friction, as a fraction of the normal force per mm/s")
    };
    let viscous_coulomb =
        Form::new("viscous_coulomb", "viscous_coulomb(coefficient: 0.3, viscosity_s_per_mm: 0.0005)")
            .field(coefficient("coefficient", 0.3))
            .field(viscosity(VISCOSITY_S_PER_MM));
    let dahl = Form::new("dahl", "dahl(coefficient: 0.3, bristle_stiffness_n_per_mm: 1)")
        .field(coefficient("coefficient", 0.3))
        .field(bristle(BRISTLE_N_PER_MM));
    let lugre = Form::new(
        "lugre",
        "lugre(static_coefficient: 0.8, kinetic_coefficient: 0.5, stribeck_speed_mm_s: 30, \
         bristle_stiffness_n_per_mm: 1, bristle_damping_ns_per_m: 0.3, viscosity_s_per_mm: 0)",
    )
    .field(coefficient("static_coefficient", usual.static_coefficient))
    .field(coefficient("kinetic_coefficient", usual.kinetic_coefficient))
    .field(number("stribeck_speed_mm_s", usual.stribeck_speed_mm_s, 0.01..=1000.0, "mm/s"))
    .doc("Stribeck speed: speed of the transition from sticking to slipping")
    .field(bristle(usual.bristle_stiffness_n_per_mm))
    .field(number("bristle_damping_ns_per_m", usual.bristle_damping_ns_per_m, 0.0..=1000.0, "N s/m"))
    .doc("damping of the contact while it sticks")
    .field(viscosity(usual.viscosity_s_per_mm));
    Effect::new("laws", Acts::Touching)
        .form(dahl)
        .form(lugre)
        .form(viscous_coulomb)
        .needs("velocity", "slide")
        .needs("force", "force")
        .needs("tangents", "tangents")
        .check(|settings| read(settings).map(drop))
        .law(Direction::Surface, |settings, normal_force_n| {
            read(settings).map_or_else(|_| Law::default(), |law| law.law(normal_force_n))
        })
}

impl Node for Friction {
    fn descriptor() -> Descriptor {
        Descriptor::new("friction", "Renders friction: a force against the motion along the touched surface.")
            .input(slot("index into `laws`, from 0; below 0: no force").wakes())
            .input(control("velocity", 2, MM_S))
            .doc("unfiltered velocity along `tangents`; filtered velocity would make friction unstable")
            .input(control("force", 1, N).doc("normal force"))
            .input(
                control("tangents", 6, ONE)
                    .or(0.0)
                    .doc("two unit vectors along the surface; if unconnected, x and y"),
            )
            .output(super::force("friction force on the stylus, x, y, z"))
            .renders(effect())
            .timing("no latency; sleeps while nothing is touched")
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let laws = each(setup, read)?;
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
        state.require(self.tangents.as_flattened().iter().all(|x| x.is_finite()));
    }

    fn facts(&mut self) -> Vec<Fact> {
        vec![Fact::count("slots", self.laws.count() as u64)]
    }
}
