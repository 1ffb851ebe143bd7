//! `viscosity`: drag in a volume.

use asperity_node::{Descriptor, Diagnostic, Fact, Input, Node, Param, Setup, ShapeSpec, Status, Tick, Unit};
use asperity_scene::Drag;
use asperity_scene::effect;

use super::{at, let_go, pick, put, slot, texts, vector};

/// A force against the velocity and in proportion to it, by the drag of the volume that the stylus is in.
pub struct Viscosity {
    drags: Vec<effect::Viscosity>,
    every: u32,
}

impl Node for Viscosity {
    fn descriptor() -> Descriptor {
        Descriptor::new(
            "viscosity",
            "Drag: a force against the velocity, by the volume that the stylus is in.",
        )
        .input(slot("which of `drags`, from 0; below 0 the stylus is in none").wakes())
        .input(
            Input::new("velocity", ShapeSpec::Control(3), Unit::MILLIMETRE_PER_SECOND)
                .doc("x, y, z, as it is: behind a low-pass drag drives what it should brake"),
        )
        .output(super::force("force on the stylus, x, y, z"))
        .param(Param::texts(
            "drags",
            "Drags, each a text as behind `viscosity` in a scene: [\"(viscosity_ns_per_m: 2, max_force_n: 1.5)\"].",
        ))
        .timing("no latency; not called while the stylus is in none")
    }

    fn prepare(setup: &Setup<'_>) -> Result<Self, Diagnostic> {
        let drags = texts::read(setup, "drags", |value| {
            let drag = Drag::parse(value)?;
            at(value, effect::Viscosity::new(drag.viscosity_ns_per_m, drag.max_force_n))
        })?;
        Ok(Self { drags, every: setup.every })
    }

    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let drag = pick(tick.inputs.value(0), self.drags.len()).and_then(|slot| self.drags.get(slot));
        let Some(drag) = drag else { return let_go(tick, self.every) };
        let force = drag.force_n(vector(&tick.inputs, 1));
        put(tick, force);
        Status::Continue
    }

    fn reset(&mut self) {}

    fn facts(&self) -> Vec<Fact> {
        vec![Fact::count("slots", self.drags.len() as u64)]
    }
}
