//! `magnet`: a surface that snaps.

use asperity_node::{Descriptor, Diagnostic, Fact, Input, Node, Param, Setup, ShapeSpec, Status, Tick, Unit};
use asperity_scene::Pull;
use asperity_scene::effect;

use super::{at, let_go, pick, put, slot, texts, vector};

/// A force toward a surface from both of its sides, of the distance alone.
pub struct Magnet {
    magnets: Vec<effect::Magnet>,
    every: u32,
}

impl Node for Magnet {
    fn descriptor() -> Descriptor {
        Descriptor::new("magnet", "Pulls the stylus to a surface, from both sides, within a reach.")
            .input(slot("which of `magnets`, from 0; below 0 none pulls").wakes())
            .input(
                Input::new("distance", ShapeSpec::Control(1), Unit::MILLIMETRE)
                    .doc("from the surface, above 0 outside"),
            )
            .input(
                Input::new("normal", ShapeSpec::Control(3), Unit::NONE)
                    .or(0.0)
                    .doc("the surface's outward normal, of length 1; unconnected, z"),
            )
            .output(super::force("force on the stylus, x, y, z"))
            .param(Param::texts(
                "magnets",
                "Magnets, each a text as behind `magnet` in a scene: [\"(stiffness_n_per_mm: 0.2, max_force_n: 0.5, reach_mm: 4)\"].",
            ))
            .timing("no latency; not called while none pulls")
    }

    fn prepare(setup: &Setup<'_>) -> Result<Self, Diagnostic> {
        let magnets = texts::read(setup, "magnets", |value| {
            let pull = Pull::parse(value)?;
            at(value, effect::Magnet::new(pull.stiffness_n_per_mm, pull.max_force_n, pull.reach_mm))
        })?;
        Ok(Self { magnets, every: setup.every })
    }

    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let magnet = pick(tick.inputs.value(0), self.magnets.len()).and_then(|slot| self.magnets.get(slot));
        let Some(magnet) = magnet else { return let_go(tick, self.every) };
        // Along the outward normal: below 0 outside.
        let force = magnet.force_n(tick.inputs.value(1));
        let normal = if tick.inputs.connected(2) { vector(&tick.inputs, 2) } else { [0.0, 0.0, 1.0] };
        put(tick, normal.map(|n| force * n));
        Status::Continue
    }

    fn reset(&mut self) {}

    fn facts(&self) -> Vec<Fact> {
        vec![Fact::count("slots", self.magnets.len() as u64)]
    }
}
