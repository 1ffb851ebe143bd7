//! `audio_in`: a channel of the sound card, such as an accelerometer on a line input.

use crate::prelude::*;

/// Reads a channel of the device and scales it.
pub struct AudioIn {
    full_scale: f32,
}

impl Node for AudioIn {
    fn descriptor() -> Descriptor {
        Descriptor::new(
            "audio_in",
            "Reads one input channel of the sound card, such as an accelerometer on a line input.",
        )
        .role(Role::AudioInput)
        .input(Input::new("device", ShapeSpec::Audio(RateSpec::Graph), Unit::FULL_SCALE).host_fed())
        .doc("samples from the device; a wire here replaces them")
        .output(Output::new("out", ShapeSpec::Audio(RateSpec::Graph), Unit::METRE_PER_SECOND_SQUARED))
        .doc("recorded signal, in `unit`")
        .param(integer("channel", 1, 1..=1024).doc("Input channel of the device, counted from 1."))
        .param(number("full_scale", 1.0, 1e-9..=1e9, "").doc("Value of the device's full scale, in `unit`."))
        .param(choice("unit", &["m/s^2", "A", "V", "N", "FS"]).doc("Unit of the output."))
        .resumes(Resume::Continue)
    }

    fn ports(config: &Config<'_>, mut ports: Ports) -> Result<Ports, Diagnostic> {
        let unit = Unit::from_symbol(config.params.text("unit"));
        ports.outputs.iter_mut().for_each(|o| o.unit = UnitSpec::Is(unit.clone()));
        Ok(ports)
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        Ok(Prepared::new(Self { full_scale: setup.params.number("full_scale") as f32 }))
    }
}

impl Processor for AudioIn {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        for (y, x) in tick.outputs.audio(0).iter_mut().zip(tick.inputs.audio(0)) {
            *y = self.full_scale * x;
        }
        Status::Continue
    }
}
