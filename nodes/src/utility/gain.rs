//! `gain`: a constant factor.

use asperity_node::{Config, Ports, Shape, UnitSpec};
use asperity_node::{
    Descriptor, Diagnostic, Input, Node, Output, Param, Setup, ShapeSpec, Status, Tick, Unit,
};

/// Multiplies a signal by a constant.
pub struct Gain {
    gain: f64,
    audio: bool,
}

impl Node for Gain {
    fn descriptor() -> Descriptor {
        Descriptor::new("gain", "Multiplies a signal, audio or control, by a constant.")
            .input(Input::new("in", ShapeSpec::Like('s'), Unit::NONE).unit_of('u').doc("what is multiplied"))
            .output(Output::new("out", ShapeSpec::Like('s'), Unit::NONE).unit_of('u').doc("the product"))
            .param(Param::number("gain", 1.0, -1e6..=1e6, "The factor."))
            .param(Param::text(
                "unit",
                "",
                "Unit of the output, where the factor changes it; empty keeps the input's.",
            ))
    }

    fn ports(config: &Config<'_>, mut ports: Ports) -> Result<Ports, Diagnostic> {
        let unit = config.params.text("unit");
        if !unit.is_empty() {
            ports.outputs[0].unit = UnitSpec::Is(Unit::from_symbol(unit));
        }
        Ok(ports)
    }

    fn prepare(setup: &Setup<'_>) -> Result<Self, Diagnostic> {
        let audio = match setup.input(0).map(|p| p.shape) {
            Some(Shape::Audio { .. }) => true,
            Some(Shape::Control { .. }) => false,
            _ => return Err(setup.params.node_error("`gain` multiplies audio or a control, not frames")),
        };
        Ok(Self { gain: setup.params.number("gain"), audio })
    }

    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        if self.audio {
            let gain = self.gain as f32;
            for (y, x) in tick.outputs.audio(0).iter_mut().zip(tick.inputs.audio(0)) {
                *y = gain * x;
            }
        } else {
            for (y, x) in tick.outputs.control(0).iter_mut().zip(tick.inputs.control(0)) {
                *y = self.gain * x;
            }
        }
        Status::Continue
    }

    fn reset(&mut self) {}
}
