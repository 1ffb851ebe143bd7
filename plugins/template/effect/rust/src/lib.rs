//! `my_effect`: an effect of surfaces to change. Ridges across a surface catch the stylus.

use std::f64::consts::TAU;

use asperity_sdk::{
    Acts, Descriptor, Diagnostic, Direction, Effect, Form, Input, Law, Node, Output, Param, Prepared,
    Processor, Setup, ShapeSpec, Status, Tick, Unit,
};

/// Ridges of every surface that has some: the force to leave one [N], and their spacing [mm].
pub struct MyEffectNode {
    ridges: Vec<(f64, f64)>,
}

impl Node for MyEffectNode {
    fn descriptor() -> Descriptor {
        // What a scene may write behind `my_effect`, and what it connects to this node.
        let form = Form::new("", "(force_n: 0.3, spacing_mm: 2)")
            .field(Param::number("force_n", 0.3, 0.0..=10.0, "force that leaves a ridge").unit("N"))
            .field(Param::number("spacing_mm", 2.0, 0.1..=100.0, "distance between ridges").unit("mm"));
        let effect = Effect::new("ridges", Acts::Touching)
            .form(form)
            .needs("place", "place")
            .needs("tangents", "tangents")
            // The steepest slope of the force tells a scene whether the device bears it.
            .law(Direction::Surface, |settings, _normal_force_n| Law {
                stiffness_n_per_mm: TAU * settings.number("force_n") / settings.number("spacing_mm"),
                damping_ns_per_m: 0.0,
            });
        Descriptor::new("my_effect", "Ridges across a surface that catch the stylus.")
            .input(
                Input::new("slot", ShapeSpec::Control(1), Unit::NONE)
                    .or(0.0)
                    .wakes()
                    .doc("index into `ridges`, from 0; below 0: no force"),
            )
            .input(
                Input::new("place", ShapeSpec::Control(3), Unit::MILLIMETRE)
                    .doc("stylus position along `tangents`, then height"),
            )
            .input(
                Input::new("tangents", ShapeSpec::Control(6), Unit::NONE)
                    .doc("two unit vectors along the surface"),
            )
            .output(Output::new("force", ShapeSpec::Control(3), Unit::NEWTON).doc("force on the stylus"))
            .param(Param::texts("ridges", "Ridges of each slot, written as after `my_effect` in a scene."))
            .effect(effect)
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let slots = setup.params.slots().iter().flatten();
        let ridges = slots.map(|settings| (settings.number("force_n"), settings.number("spacing_mm")));
        Ok(Prepared::new(Self { ridges: ridges.collect() }))
    }
}

impl Processor for MyEffectNode {
    // Real time: nothing here may allocate, lock, print or panic.
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let slot = tick.inputs.value(0);
        // What is not a number is not at least 0.
        let ridges = (slot >= 0.0).then(|| self.ridges.get(slot as usize)).flatten();
        let Some((force_n, spacing_mm)) = ridges else {
            tick.outputs.control(0).fill(0.0);
            return Status::Asleep;
        };
        let along = -force_n * (TAU * tick.inputs.value(1) / spacing_mm).sin();
        for (force, tangent) in tick.outputs.control(0).iter_mut().zip(tick.inputs.control(2)) {
            let part = along * tangent;
            *force = if part.is_finite() { part } else { 0.0 };
        }
        Status::Continue
    }

    fn reset(&mut self) {}
}

asperity_sdk::export!(MyEffectNode);
